// SPDX-License-Identifier: GPL-3.0-or-later
//! What the loop is told besides the directions: prices, ties, and when to stop.

use crate::build::cost::Costs;
use crate::build::sweep::Ties;

/// When a node becomes a leaf.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stop {
    /// As soon as no split is cheaper than the leaf.
    Cheapest,
    /// As pbrt: the split that would be the so-manieth on its path dearer than its leaf is not made, and none four
    /// times as dear at fewer than 16 triangles (Pharr, Jakob and Humphreys, 3rd ed., section 4.4.2).
    Tolerant(u32),
}

/// What a step through a node with an oblique plane costs (Ize, Wald and Parker 2008, section 4.2).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ObliqueStep {
    /// As much for every node.
    Fixed(f32),
    /// `alpha` triangles per triangle of the node but one, and an axis step. Where nothing is then
    /// cheaper than the leaf, `fixed` is tried.
    Linear {
        /// Share of a triangle's price.
        alpha: f32,
        /// The price of the second attempt.
        fixed: f32,
        /// Whether the second attempt is made as Hoobergs's program makes it: where it succeeds, the
        /// plane of the first attempt is used.
        as_code: bool,
    },
}

/// What the loop is told besides the directions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Params {
    /// Prices.
    pub costs: Costs,
    /// Price of an oblique step.
    pub oblique: ObliqueStep,
    /// What happens to triangles that touch a plane.
    pub ties: Ties,
    /// Thickness of the slabs that are tried around triangles parallel to the planes, as a share of
    /// the scene's size; 0 for none.
    pub slab: f32,
    /// Nodes of at most this many triangles are leaves.
    pub leaf_size: usize,
    /// Larger nodes are parted whatever it costs, beyond `max_depth` if need be, as long as a plane
    /// parts them.
    pub leaf_most: usize,
    /// Nodes of `n` triangles are leaves where `n^2` times the scene's triangles times the cell's
    /// share of the surface is no more, up to a size: a cell that few rays visit is not worth a node.
    /// 0 for none.
    pub area_stop: f32,
    /// Leaves lie no deeper; at most [`MAX_DEPTH`](crate::build::plane_tree::MAX_DEPTH).
    pub max_depth: usize,
    /// The stopping rule.
    pub stop: Stop,
    /// Whether pieces are sorted along a curve, which the counts of single planes want.
    pub sorted: bool,
    /// Whether the search ends once a plane parts the node's triangles without cutting any.
    pub early: bool,
    /// Nodes whose first directions have a plane cheaper than this share of their leaf try no further ones.
    pub enough: f32,
}
