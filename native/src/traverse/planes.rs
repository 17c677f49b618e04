// SPDX-License-Identifier: GPL-3.0-or-later
//! Trees of split planes as walks go through them: in one piece, or in parts of which each is built by the
//! first ray that reaches it.

use super::blocks::Blocks;
use crate::build::lazy_tree::{LazyTree, Part};
use crate::build::plane_tree::{ENTRANCE, Node, PlaneTree};
use crate::scene::Triangles;

/// What a walk finds at a leaf.
pub enum Inside<'a, T> {
    /// Triangles, in these blocks.
    Triangles(&'a Blocks),
    /// The root of another part.
    Part(T),
}

/// A tree of split planes.
pub trait Planes: Copy + Sync {
    /// A node, and whatever it takes to find its children.
    type At: Copy;

    /// Whether leaves lie in other blocks than the tree's own.
    const PARTS: bool;

    /// The root.
    fn root(self) -> Self::At;

    /// What a node is.
    fn node(self, at: Self::At) -> Node;

    /// The node of that number in the same piece of the tree.
    fn sibling(self, at: Self::At, index: u32) -> Self::At;

    /// What is inside a leaf. `blocks` are those of a tree in one piece.
    fn inside<'a>(
        self,
        leaf: (Self::At, u32, usize),
        triangles: (&Triangles, &'a Blocks),
    ) -> Inside<'a, Self::At>
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
    fn inside<'a>(
        self,
        _: (u32, u32, usize),
        (_, blocks): (&Triangles, &'a Blocks),
    ) -> Inside<'a, u32>
    where
        Self: 'a,
    {
        Inside::Triangles(blocks)
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
        ((part, _), first, count): (Self::At, u32, usize),
        (scene, _): (&Triangles, &'a Blocks),
    ) -> Inside<'a, Self::At>
    where
        Self: 'a,
    {
        if count == ENTRANCE {
            let part = part.enter(first, scene);
            Inside::Part((part, part.tree.root()))
        } else {
            Inside::Triangles(&part.blocks)
        }
    }
}
