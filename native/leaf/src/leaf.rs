// SPDX-License-Identifier: GPL-3.0-or-later
//! What names a leaf, and what a test of its triangles needs.

use crate::blocks::Blocks;
use halfspace_scene::Triangles;

/// A leaf with triangles: the position of its first block and its number of triangles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Leaf {
    /// Word offset of the first block in [`Blocks`].
    pub first: u32,
    /// Number of triangles.
    pub count: usize,
}

/// The triangles that a kernel tests: those of the scene, and their copies in the leaves of one tree.
#[derive(Clone, Copy)]
pub struct Job<'a> {
    /// The triangles of the scene.
    pub scene: &'a Triangles,
    /// The blocks of the leaves.
    pub blocks: &'a Blocks,
}
