// SPDX-License-Identifier: GPL-3.0-or-later
//! The layouts of object trees, and which walk belongs to each.

use super::batch::Batch;
use super::box_tree::{self, BoxTree};
use super::nested::Nested;
use super::query::Query;
use super::ray::{Hit, RayCounters};
use super::slab_tree::{self, SlabTree};

/// An object tree, laid out for one way of walking.
#[derive(Debug, Clone, PartialEq)]
pub enum Objects {
    /// Boxes, two to a node.
    Boxes2(BoxTree<2>),
    /// Boxes, four to a node.
    Boxes4(BoxTree<4>),
    /// Boxes, eight to a node.
    Boxes8(BoxTree<8>),
    /// Two planes to a node.
    Slabs(SlabTree),
}

impl Objects {
    /// The tree as validation, statistics and drawing see it.
    pub fn nested(&self) -> &dyn Nested {
        match self {
            Self::Boxes2(tree) => tree,
            Self::Boxes4(tree) => tree,
            Self::Boxes8(tree) => tree,
            Self::Slabs(tree) => tree,
        }
    }

    /// Walks a batch of rays.
    pub fn walk<Q: Query>(
        &self,
        job: &Batch<'_>,
        write: impl FnMut(usize, Hit),
        counters: Option<&mut [RayCounters]>,
    ) {
        match self {
            Self::Boxes2(tree) => job.walk::<_, Q>(&box_tree::Walk(tree), write, counters),
            Self::Boxes4(tree) => job.walk::<_, Q>(&box_tree::Walk(tree), write, counters),
            Self::Boxes8(tree) => job.walk::<_, Q>(&box_tree::Walk(tree), write, counters),
            Self::Slabs(tree) => job.walk::<_, Q>(&slab_tree::Walk(tree), write, counters),
        }
    }
}
