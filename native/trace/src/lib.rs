// SPDX-License-Identifier: GPL-3.0-or-later
//! Traversal kernels: each is one compiled way to answer a batch of rays over one tree.

pub mod batch;
pub mod beam;
mod blocker;
pub mod first_hit;
pub mod flight;
pub mod input;
pub mod kernel;
pub mod packet;
pub mod shadow_cache;
pub mod single;
pub mod slabs;
pub mod stack;
pub mod stream;
pub mod tile;
mod visits;
