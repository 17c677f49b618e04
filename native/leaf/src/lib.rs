// SPDX-License-Identifier: GPL-3.0-or-later
//! Triangles in leaves, and the conservative f32 tests that reject most of them.

pub mod block_boxes;
pub mod blocks;
pub mod candidates;
pub mod eight;
pub mod keep;
pub mod lanes;
pub mod leaf;
pub mod leaves;
pub mod members;
pub mod scalar;

pub use leaf::{Block, Job, Leaf};
