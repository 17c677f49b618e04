// SPDX-License-Identifier: GPL-3.0-or-later
//! Rejects splits that are not worth the references they add.
//!
//! Triangles that overlap in one plane or along one line, or that meet in one point, are cut by every plane. The
//! surface area heuristic accepts such splits: each saves a ray one or two tests of thousands, so the references
//! grow with the square of the triangles. Once the triangles of a large node have been duplicated often on the
//! path to it, its splits must gain in proportion to the references they add.

use crate::space::{BUDGET, Builder, Choice, OpenNode, PlanePolicy, Stop};

/// Nodes of more triangles count as large. Smaller nodes reach hundreds of copies in ordinary scenes too, around
/// the hubs of wheels, without harm.
const LARGE: usize = 64;

/// Number of copies of each triangle up to which every split is accepted. Measured: large nodes of rooms, courts
/// and scans reach at most 13; those at the poles of a teapot, where triangles meet in one point, reach hundreds.
const COPIES: f32 = 16.0;

/// With this number of further copies, a split must reduce the cost of its leaf by at least the share by which it
/// increases the references.
const PATIENCE: f32 = 32.0;

impl<P: PlanePolicy> Builder<'_, P> {
    /// Returns whether a split that the cost model accepts is worth the references that it adds, for a node of `n`
    /// triangles with cost `leaf` as a leaf.
    pub fn is_worth(&self, choice: &Choice, leaf: f32, node: &OpenNode<P::Cell>, n: usize) -> bool {
        // f32 holds these counts exactly, except in nodes so large that their budget always suffices.
        let total = choice.best.counts[0] + choice.best.counts[1];
        let budget = node.budget as f32;
        if total > budget {
            return false;
        }
        // Number of references per triangle, if the whole tree were like the path to this node.
        let copies = n as f32 * BUDGET as f32 / budget;
        // Published builders have no such rule.
        if n <= LARGE || copies <= COPIES || self.params.stop != Stop::Cheapest {
            return true;
        }
        let more = total / n as f32 - 1.0;
        more <= 0.0 || PATIENCE * (1.0 - choice.best.cost / leaf) >= (copies - COPIES) * more
    }
}
