// SPDX-License-Identifier: GPL-3.0-or-later
//! The interface of layouts whose bounds can be fitted to moved triangles: the links of the nodes stay, their boxes or
//! planes change (Wald, Boulos and Shirley 2007, Ray tracing deformable scenes using dynamic bounding volume
//! hierarchies, section 3.3).

use crate::nested::Nested;
use crate::tree::Tree;
use halfspace_geom::Aabb;
use halfspace_leaf::Leaf;
use std::fmt::Debug;

/// A child of a node; a layout whose leaves are nodes passes each leaf as the only child of its node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Below {
    /// The node with this index.
    Node(u32),
    /// A leaf.
    Leaf(Leaf),
}

/// The triangles below a node or in a leaf. Aligned, because copies of 28 bytes go through overlapping stores, which
/// stall the loads after them.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(16))]
pub struct Fitted {
    /// Their box, in the tree's frame; empty without triangles.
    pub bounds: Aabb,
    /// Their number.
    pub count: u32,
}

impl Fitted {
    /// No triangles.
    pub const NOTHING: Self = Self {
        bounds: Aabb::EMPTY,
        count: 0,
    };

    /// Returns the triangles of both.
    #[inline(always)]
    #[must_use]
    pub fn join(self, other: Self) -> Self {
        Self {
            bounds: self.bounds.union(&other.bounds),
            count: self.count + other.count,
        }
    }

    /// Returns the lower end of the box along an axis, or the largest float without triangles: no ray reaches it.
    #[inline(always)]
    pub fn low(&self, axis: usize) -> f32 {
        self.bounds.min[axis].min(f32::MAX)
    }

    /// Returns the upper end of the box along an axis, or the smallest float without triangles.
    #[inline(always)]
    pub fn high(&self, axis: usize) -> f32 {
        self.bounds.max[axis].max(f32::MIN)
    }
}

/// A node whose bounds can be fitted.
pub trait FitNode: Copy + Send + Sync {
    /// Calls `child` for each child, in the order of memory, writes the bounds that it returns and the numbers of
    /// triangles of leaves, and returns what lies below the node. Links and planes' axes stay as they are.
    fn fit(&mut self, child: impl FnMut(Below) -> Fitted) -> Fitted;
}

/// A layout of such nodes; children have higher indices than their parents.
pub trait FitTree: Nested + Tree + Debug + Sized {
    /// The nodes.
    type Node: FitNode;

    /// Returns the nodes; the root is the first.
    fn nodes(&self) -> &[Self::Node];

    /// Makes a tree of nodes with the same links as those of a sound tree.
    fn of_nodes(nodes: Vec<Self::Node>) -> Self;
}
