// SPDX-License-Identifier: GPL-3.0-or-later
//! The layouts of object trees, and which walk belongs to each.

use super::batch::WithWalk;
use super::box_tree::{self, BoxTree};
use super::dop_tree::{self, DopTree};
use super::nested::{self, Nested};
use super::slab_boxes;
use super::slab_node::{Double, Single};
use super::slab_tree::{self, SlabTree};
use super::slab_wide::{self, WideSlabs};
use super::slant_tree::{self, SlantTree};
use crate::build::shape::Shape;
use crate::geom::Aabb;

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
    Slabs(SlabTree<Double>),
    /// One plane to a node.
    Single(SlabTree<Single>),
    /// Two planes to a node, walked as boxes.
    SlabBoxes(SlabTree<Double>),
    /// Two planes to a node, oblique ones too.
    Slanted(SlantTree),
    /// Two intervals to a node.
    Slabs2(WideSlabs<2>),
    /// Four intervals to a node.
    Slabs4(WideSlabs<4>),
    /// Eight intervals to a node.
    Slabs8(WideSlabs<8>),
    /// Boxes, any number to a node.
    Dops3(DopTree<3>),
    /// Seven slabs around each node.
    Dops7(DopTree<7>),
    /// Thirteen slabs around each node.
    Dops13(DopTree<13>),
}

impl Objects {
    /// The tree as validation, statistics and drawing see it.
    pub fn nested(&self) -> &dyn Nested {
        match self {
            Self::Boxes2(tree) => tree,
            Self::Boxes4(tree) => tree,
            Self::Boxes8(tree) => tree,
            Self::Slabs(tree) | Self::SlabBoxes(tree) => tree,
            Self::Single(tree) => tree,
            Self::Slanted(tree) => tree,
            Self::Slabs2(tree) => tree,
            Self::Slabs4(tree) => tree,
            Self::Slabs8(tree) => tree,
            Self::Dops3(tree) => tree,
            Self::Dops7(tree) => tree,
            Self::Dops13(tree) => tree,
        }
    }

    /// Its shape, over a scene of these bounds.
    pub fn shape(&self, bounds: Aabb) -> Shape {
        match self {
            // The quickest to build are measured as quickly.
            Self::Slabs(tree) | Self::SlabBoxes(tree) => nested::shape(tree, bounds),
            Self::Single(tree) => nested::shape(tree, bounds),
            _ => nested::shape(self.nested(), bounds),
        }
    }

    /// Hands the way of walking to `then`. `bounds` is the scene's box.
    pub fn with_walk<F: WithWalk>(&self, bounds: Aabb, then: F) -> F::Output {
        match self {
            Self::Boxes2(tree) => then.with(&box_tree::Walk(tree)),
            Self::Boxes4(tree) => then.with(&box_tree::Walk(tree)),
            Self::Boxes8(tree) => then.with(&box_tree::Walk(tree)),
            Self::Slabs(tree) => then.with(&slab_tree::Walk(tree)),
            Self::Single(tree) => then.with(&slab_tree::Walk(tree)),
            Self::SlabBoxes(tree) => then.with(&slab_boxes::Walk(tree, bounds)),
            Self::Slanted(tree) => then.with(&slant_tree::Walk(tree)),
            Self::Slabs2(tree) => then.with(&slab_wide::Walk(tree)),
            Self::Slabs4(tree) => then.with(&slab_wide::Walk(tree)),
            Self::Slabs8(tree) => then.with(&slab_wide::Walk(tree)),
            Self::Dops3(tree) => then.with(&dop_tree::Walk(tree)),
            Self::Dops7(tree) => then.with(&dop_tree::Walk(tree)),
            Self::Dops13(tree) => then.with(&dop_tree::Walk(tree)),
        }
    }
}
