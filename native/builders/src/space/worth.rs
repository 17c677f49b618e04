// SPDX-License-Identifier: GPL-3.0-or-later
//! Rejects splits that are not worth the references they add.
//!
//! Triangles that overlap in one plane or along one line, or that meet in one point, are cut by every plane. The
//! surface area heuristic accepts such splits, each of which saves a ray one or two tests of thousands, so the number
//! of references grows with the square of the number of triangles. Once the triangles of a large node have been
//! duplicated often on the path to it, a split must therefore reduce the cost in proportion to the references it adds.

use crate::space::{BUDGET, Builder, Choice, OpenNode, PlanePolicy, Stop};

/// Nodes of more triangles count as large (chosen). Smaller nodes reach hundreds of copies in ordinary scenes too, such
/// as around the hubs of wheels, but add few references.
const LARGE: usize = 64;

/// Number of copies of each triangle up to which every split is accepted. Measured: large nodes of rooms, courts
/// and scans reach at most 13; those at the poles of a teapot, where triangles meet in one point, reach hundreds.
const COPIES: f32 = 16.0;

/// Number of triangles of a node, multiplied by [`COPIES`] of them, beyond which published builders make no split that adds
/// references (chosen); all others they make as published. In ordinary scenes large nodes have few copies, and nodes of
/// many copies few triangles; in a fan of `n` triangles the product is `n / 13` everywhere, and 10^5 triangles reached 482
/// copies of each.
const PUBLISHED: f32 = 2048.0;

/// Number of copies beyond [`COPIES`] at which a split must reduce the cost of the node, relative to a leaf, by the
/// same fraction by which it increases the references (chosen).
const PATIENCE: f32 = 32.0;

impl<P: PlanePolicy> Builder<'_, P> {
    /// Returns whether a split that the cost model accepts is worth the references that it adds, for a node of `n`
    /// triangles with cost `leaf` as a leaf.
    pub fn is_worth(&self, choice: &Choice, leaf: f32, node: &OpenNode<P::Cell>, n: usize) -> bool {
        // Reject splits that exceed the budget. f32 holds these counts exactly, except in nodes so large that their
        // budget always suffices.
        let total = choice.best.counts[0] + choice.best.counts[1];
        let budget = node.budget as f32;
        if total > budget {
            return false;
        }
        // Estimate the references per triangle of a whole tree that is like the path to this node.
        let copies = n as f32 * BUDGET as f32 / budget;
        // Accept the split of a small or rarely duplicated node, and one that adds no references.
        let more = total / n as f32 - 1.0;
        if n <= LARGE || copies <= COPIES || more <= 0.0 {
            return true;
        }
        if self.params.stop != Stop::Cheapest {
            return n as f32 * copies <= PUBLISHED;
        }
        // Compare the reduction of the cost with the increase of the references.
        PATIENCE * (1.0 - choice.best.cost / leaf) >= (copies - COPIES) * more
    }
}
