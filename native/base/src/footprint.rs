// SPDX-License-Identifier: GPL-3.0-or-later
//! Estimates, in bytes, of the memory that trees need while they are built, for the monitor's limit. They are slightly
//! high, because they count the memory that growing vectors reserve in advance.

/// Bytes of a triangle in a block of a leaf, with its part of the block's header (`leaf/src/blocks.rs`).
const REFERENCE: usize = 44;

/// Bytes that any structure needs per triangle before its first split: the triangle's box and number twice, and
/// its slot in a leaf.
pub const TRIANGLE: usize = 2 * 28 + REFERENCE;

/// Returns the bytes of a leaf of `count` triangles and of one inner node, because a binary tree has about as many
/// inner nodes as leaves. Its preorder, a vector of items `T` and one of triangle numbers, exists at the same time as
/// the final layout, with `node` bytes per node; both vectors may have reserved twice their length.
pub const fn leaf<T>(count: usize, node: usize) -> usize {
    4 * size_of::<T>() + 2 * node + count * (2 * size_of::<u32>() + REFERENCE)
}

/// Returns the bytes of a subtree of `count` references of type `T` that is built later: the references, and at most
/// 256 for its other state and the inner node above it.
pub const fn later<T>(count: usize) -> usize {
    256 + count * size_of::<T>()
}

/// Returns the bytes of `count` nodes of a box tree, without its triangles, which [`TRIANGLE`] counts: items `T` in a
/// vector that may have reserved twice its length, and 40 per node for the final layout.
pub const fn boxes<T>(count: usize) -> usize {
    count * (2 * size_of::<T>() + 40)
}

/// Returns the bytes of `count` references of type `T` of a node that is not split yet, and of their copies in the
/// children.
pub const fn unsplit<T>(count: usize) -> usize {
    2 * count * size_of::<T>()
}
