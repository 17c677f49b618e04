// SPDX-License-Identifier: GPL-3.0-or-later
//! The interface of all trees except for traversals: size, cells, invariants. Object safe, and never in a hot loop.

use crate::cells::Cells;
use crate::shape::Shape;
use halfspace_base::Monitor;
use halfspace_leaf::blocks::Blocks;
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;
use std::any::Any;
use std::fmt::Debug;

/// A tree's scene, frame, leaves and statistics, for the check of its invariants.
#[derive(Debug, Clone, Copy)]
pub struct Body<'a> {
    /// The triangles.
    pub scene: &'a Triangles,
    /// The frame of the tree's coordinates.
    pub frame: &'a Frame,
    /// The triangles of its leaves.
    pub blocks: &'a Blocks,
    /// The statistics that the build reported.
    pub shape: &'a Shape,
    /// Cancels the check, whose result then means nothing.
    pub monitor: &'a Monitor,
}

/// A tree in memory, of any layout.
pub trait Tree: Any + Debug + Send + Sync {
    /// Returns the size of the nodes in bytes, without the leaves' triangles.
    fn bytes(&self) -> usize;

    /// Returns the nodes as convex cells, for drawing and for ray paths; `None` for auxiliary data without cells.
    fn cells(&self) -> Option<&dyn Cells>;

    /// Calls `see` for every leaf: the position of its first block, and its number of triangles.
    fn leaves(&self, see: &mut dyn FnMut(u32, usize));

    /// Appends a sentence per broken invariant; none for a sound tree.
    fn validate(&self, body: &Body<'_>, broken: &mut Vec<String>);

    /// Returns whether the other tree has the same layout and equal nodes.
    fn same(&self, other: &dyn Tree) -> bool;
}

impl dyn Tree {
    /// Returns the tree as its own type, if it is a `T`.
    pub fn downcast_ref<T: Tree>(&self) -> Option<&T> {
        (self as &dyn Any).downcast_ref()
    }
}

/// Returns whether `other` is a `T` equal to `tree`: [`Tree::same`] for most layouts.
pub fn same<T: Tree + PartialEq>(tree: &T, other: &dyn Tree) -> bool {
    other.downcast_ref::<T>() == Some(tree)
}
