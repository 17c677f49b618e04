// SPDX-License-Identifier: GPL-3.0-or-later
//! Access to plane trees for their traversals: to trees in one piece, and to trees whose parts the first ray that
//! reaches them builds.

pub mod axis_tree;
pub mod lazy_tree;
pub mod plane_tree;
pub mod preorder;
pub mod projected_tree;
pub mod ropes;
pub mod views;
pub mod wide_tree;

use crate::lazy_tree::{LazyTree, Part};
use crate::plane_tree::{ENTRANCE, Node, PlaneTree};
use crate::projected_tree::{CODES, Projected, ProjectedTree};
use halfspace_leaf::blocks::Blocks;
use halfspace_leaf::{Job, Leaf};

/// Contents of a leaf.
pub enum Inside<'a, T> {
    /// Triangles, stored in these blocks.
    Triangles(&'a Blocks),
    /// The root of another part.
    Part(T),
}

/// A tree of split planes.
pub trait Planes: Copy + Sync {
    /// A reference to a node, with the part of the tree it belongs to.
    type At: Copy;

    /// Whether the blocks of a leaf depend on its part of the tree.
    const PARTS: bool;

    /// Returns the root.
    fn root(self) -> Self::At;

    /// Returns the decoded node.
    fn node(self, at: Self::At) -> Node;

    /// Returns a reference to the node number `index` in the same part of the tree as `at`.
    fn sibling(self, at: Self::At, index: u32) -> Self::At;

    /// Returns the number of the direction of the oblique node at `at`; `None` in trees that number none, and where it has
    /// no number.
    #[inline(always)]
    fn direction(self, _: Self::At) -> Option<usize> {
        None
    }

    /// Returns the contents of the leaf `leaf` at `at`. `job` holds the blocks of a tree in one piece; parts have their
    /// own.
    fn inside<'a>(self, at: Self::At, leaf: Leaf, job: Job<'a>) -> Inside<'a, Self::At>
    where
        Self: 'a;
}

impl Planes for &PlaneTree {
    type At = u32;
    const PARTS: bool = false;

    #[inline(always)]
    fn root(self) -> u32 {
        PlaneTree::root(self)
    }

    #[inline(always)]
    fn node(self, at: u32) -> Node {
        PlaneTree::node(self, at)
    }

    #[inline(always)]
    fn sibling(self, _: u32, index: u32) -> u32 {
        index
    }

    #[inline(always)]
    fn inside<'a>(self, _: u32, _: Leaf, job: Job<'a>) -> Inside<'a, u32>
    where
        Self: 'a,
    {
        Inside::Triangles(job.blocks)
    }
}

impl Planes for &ProjectedTree {
    type At = u32;
    const PARTS: bool = false;

    #[inline(always)]
    fn root(self) -> u32 {
        ProjectedTree::root(self)
    }

    #[inline(always)]
    fn node(self, at: u32) -> Node {
        self.as_plane_node(at)
    }

    #[inline(always)]
    fn sibling(self, _: u32, index: u32) -> u32 {
        index
    }

    #[inline(always)]
    fn direction(self, at: u32) -> Option<usize> {
        match ProjectedTree::node(self, at) {
            Projected::Along { direction, .. } => Some(direction % CODES),
            _ => None,
        }
    }

    #[inline(always)]
    fn inside<'a>(self, _: u32, _: Leaf, job: Job<'a>) -> Inside<'a, u32>
    where
        Self: 'a,
    {
        Inside::Triangles(job.blocks)
    }
}

impl<'t> Planes for &'t LazyTree {
    type At = (&'t Part, u32);
    const PARTS: bool = true;

    #[inline(always)]
    fn root(self) -> Self::At {
        (self.top(), self.top().tree.root())
    }

    #[inline(always)]
    fn node(self, (part, index): Self::At) -> Node {
        part.tree.node(index)
    }

    #[inline(always)]
    fn sibling(self, (part, _): Self::At, index: u32) -> Self::At {
        (part, index)
    }

    #[inline(always)]
    fn inside<'a>(
        self,
        (part, _): Self::At,
        Leaf { first, count }: Leaf,
        job: Job<'a>,
    ) -> Inside<'a, Self::At>
    where
        Self: 'a,
    {
        if count == ENTRANCE {
            let part = part.enter(first, job.scene);
            Inside::Part((part, part.tree.root()))
        } else {
            Inside::Triangles(&part.blocks)
        }
    }
}
