// SPDX-License-Identifier: GPL-3.0-or-later
//! What every tree offers besides rays: its size, its cells, its invariants. Object safe, and never in a hot loop.

use crate::cells::Cells;
use crate::shape::Shape;
use halfspace_leaf::blocks::Blocks;
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;
use std::any::Any;
use std::fmt::Debug;

/// What a tree was built over, for the check of its invariants.
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
}

/// A tree in memory, whatever its layout.
pub trait Tree: Any + Debug + Send + Sync {
    /// Size of the nodes in bytes, without the leaves' triangles.
    fn bytes(&self) -> usize;

    /// The nodes as convex cells, for drawing and for following a ray; `None` for auxiliary data without cells.
    fn cells(&self) -> Option<&dyn Cells>;

    /// Visits every leaf: the position of its first block, and its number of triangles.
    fn leaves(&self, see: &mut dyn FnMut(u32, usize));

    /// Appends a sentence per broken invariant; none for a sound tree.
    fn validate(&self, body: &Body<'_>, broken: &mut Vec<String>);

    /// Whether the other tree has the same layout and equal nodes.
    fn same(&self, other: &dyn Tree) -> bool;
}

impl dyn Tree {
    /// The tree as its own type, if it is a `T`.
    pub fn downcast_ref<T: Tree>(&self) -> Option<&T> {
        (self as &dyn Any).downcast_ref()
    }
}

/// Whether `other` is a `T` equal to `tree`: what most layouts answer in [`Tree::same`].
pub fn same<T: Tree + PartialEq>(tree: &T, other: &dyn Tree) -> bool {
    other.downcast_ref::<T>() == Some(tree)
}
