// SPDX-License-Identifier: GPL-3.0-or-later
//! Parameters of the build loop other than directions: costs, ties, and stopping rules.

use crate::sweep::Ties;
use halfspace_nodes::cost::Costs;

/// Rule by which a node becomes a leaf.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stop {
    /// If no split is cheaper than the leaf.
    Cheapest,
    /// With argument `n`, as in pbrt: the split that would be the `n`-th on its path to cost more than its leaf is
    /// not made, nor one that costs four times as much with fewer than 16 triangles (Pharr, Jakob and Humphreys,
    /// 3rd ed., section 4.4.2).
    Tolerant(u32),
}

/// Cost of a step through a node with an oblique plane (Ize, Wald and Parker 2008, section 4.2).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ObliqueStep {
    /// The same cost for every node.
    Fixed(f32),
    /// `alpha` triangle tests per triangle of the node minus one, plus an axis-aligned step. If nothing is then
    /// cheaper than the leaf, `fixed` is tried.
    Linear {
        /// Share of the cost of a triangle test.
        alpha: f32,
        /// Cost of a step in the second attempt.
        fixed: f32,
        /// Whether the second attempt follows Hoobergs's program: where it succeeds, the plane of the first
        /// attempt is used.
        as_code: bool,
    },
}

/// Parameters of the build loop other than directions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Params {
    /// Costs of the operations of a traversal.
    pub costs: Costs,
    /// Cost of an oblique step.
    pub oblique: ObliqueStep,
    /// Assignment of triangles that touch a plane.
    pub ties: Ties,
    /// Thickness of the slabs that are tried around triangles parallel to the planes, per unit of the scene's
    /// largest coordinate; 0 for none.
    pub slab: f32,
    /// Nodes of at most this number of triangles are leaves.
    pub leaf_size: usize,
    /// Nodes of more triangles are split at any cost, beyond `max_depth` if necessary, as long as a plane splits
    /// them.
    pub leaf_most: usize,
    /// Nodes of at most 16 triangles become leaves where the squared number of triangles, multiplied by the number
    /// of triangles in the scene and by the cell's share of the root's surface area, is at most this: a cell that
    /// few rays visit is not worth a node. 0 for none.
    pub area_stop: f32,
    /// Largest depth of a leaf; at most [`MAX_DEPTH`](halfspace_nodes::plane_tree::MAX_DEPTH).
    pub max_depth: usize,
    /// The stopping rule.
    pub stop: Stop,
    /// Whether pieces are sorted along a curve, which speeds up the counts of single planes.
    pub sorted: bool,
    /// Whether the search ends once a plane separates the node's triangles without cutting any.
    pub early: bool,
    /// Nodes whose first directions have a plane cheaper than this share of their leaf try no further directions.
    pub enough: f32,
}
