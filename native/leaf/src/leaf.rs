// SPDX-License-Identifier: GPL-3.0-or-later
//! Leaves, their blocks, and the arrays that a test of their triangles reads.

use crate::blocks::{Blocks, SPAN};
use halfspace_scene::Triangles;

/// A leaf: the position of its first block and its number of triangles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Leaf {
    /// Word offset of the first block in [`Blocks`].
    pub first: u32,
    /// Number of triangles.
    pub count: usize,
}

/// The triangles that a kernel tests: the scene's, and their copies in the leaves of one tree.
#[derive(Clone, Copy)]
pub struct Job<'a> {
    /// The triangles of the scene.
    pub scene: &'a Triangles,
    /// The blocks of the leaves.
    pub blocks: &'a Blocks,
}

/// A block of a leaf under test.
#[derive(Clone, Copy)]
pub struct Block<'a> {
    /// The scene, and the leaves that the block belongs to.
    pub job: Job<'a>,
    /// The words of the block, and the words that loads may read past it.
    pub words: &'a [f32; SPAN],
    /// Number of triangles.
    pub count: usize,
}
