// SPDX-License-Identifier: GPL-3.0-or-later
//! Parts that all kernels share: a kernel is one compiled way to answer a batch of rays over one tree.

pub mod batch;
pub mod blocker;
pub mod brute;
pub mod first_hit;
pub mod input;
pub mod kernel;
pub mod late;
pub mod row;
pub mod shadow_cache;
pub mod slabs;
pub mod stack;
pub mod verdicts;
