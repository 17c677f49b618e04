// SPDX-License-Identifier: GPL-3.0-or-later
//! Memory that trees take while they are built, in bytes, for the monitor's limit. The estimates are slightly
//! high, because growing vectors reserve room in advance.

/// Bytes of a triangle in a block of a leaf, with its part of the block's header (`leaf/src/blocks.rs`).
const REFERENCE: usize = 44;

/// Bytes that any structure needs per triangle before its first split: the triangle's box and number twice, and
/// its slot in a leaf.
pub const TRIANGLE: usize = 2 * 28 + REFERENCE;

/// Returns the bytes of a leaf of `count` triangles and its share of the inner nodes. The preorder, with items `T` and
/// triangle numbers, exists at the same time as the final layout, with `node` bytes per node.
pub const fn leaf<T>(count: usize, node: usize) -> usize {
    4 * size_of::<T>() + 2 * node + count * (2 * size_of::<u32>() + REFERENCE)
}

/// Returns the bytes of a subtree of `count` references of type `T` that is built later, with its share of the inner
/// nodes.
pub const fn later<T>(count: usize) -> usize {
    256 + count * size_of::<T>()
}

/// Returns the bytes of `count` nodes of a box tree, as items `T` and in the final layout; [`TRIANGLE`] counts its
/// triangles.
pub const fn boxes<T>(count: usize) -> usize {
    count * (2 * size_of::<T>() + 40)
}

/// Returns the bytes of `count` references of type `T` of a node that is not split yet, and of their copies in the
/// children.
pub const fn unsplit<T>(count: usize) -> usize {
    2 * count * size_of::<T>()
}
