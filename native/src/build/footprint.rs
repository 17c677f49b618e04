// SPDX-License-Identifier: GPL-3.0-or-later
//! What trees take in memory while they are built, for the monitor's limit: a little more than they do, as
//! vectors that grow keep room ahead.

/// A triangle in a block of a leaf, with its part of the block's head (`traverse/blocks.rs`).
const REFERENCE: usize = 44;

/// What any structure needs per triangle before it has split anything: its box and number twice, and its
/// place in a leaf.
pub const TRIANGLE: usize = 2 * 28 + REFERENCE;

/// A leaf of `count` triangles, with its share of the inner nodes: in preorder, as items `T` and numbers, and laid
/// out, `node` bytes for each node, at the same time.
pub const fn leaf<T>(count: usize, node: usize) -> usize {
    4 * size_of::<T>() + 2 * node + count * (2 * size_of::<u32>() + REFERENCE)
}

/// A subtree of `count` references of type `T` that is built later, with its share of the inner nodes.
pub const fn later<T>(count: usize) -> usize {
    256 + count * size_of::<T>()
}

/// `count` nodes of a tree of boxes, as items `T` and laid out; its triangles are counted by [`TRIANGLE`].
pub const fn boxes<T>(count: usize) -> usize {
    count * (2 * size_of::<T>() + 40)
}

/// `count` references of type `T` that wait for being parted, and what they are parted into.
pub const fn waiting<T>(count: usize) -> usize {
    2 * count * size_of::<T>()
}
