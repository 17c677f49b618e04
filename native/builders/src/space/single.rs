// SPDX-License-Identifier: GPL-3.0-or-later
//! Single planes, each evaluated by itself: its triangles are counted through a hierarchy of boxes, without a
//! sweep.

use crate::space::choice::{Found, Terms, keep_better};
use crate::space::{Builder, PlanePolicy, TASK, Task};
use crate::sweep::{Best, Pricing, Touching};
use halfspace_geom::cell::{Cell, Plane};
use halfspace_geom::profile::Profile;
use halfspace_nodes::cost::Costs;
use rayon::prelude::*;

impl<P: PlanePolicy> Builder<'_, P> {
    /// Returns the cheapest planes for both costs of a step, of those in `found` and the task's single planes.
    pub fn singles(
        &self,
        task: &mut Task<P::Piece>,
        from: usize,
        cell: &P::Cell,
        terms: &Terms,
        found: Found,
    ) -> Found {
        if task.planes.is_empty() {
            return found;
        }
        let pieces = &task.pieces[from..];
        task.groups.fill(pieces, self.frame.bounds().magnitude());
        let groups = &task.groups;
        let search = |planes: &[Plane], profile: &mut Profile| {
            planes.iter().fold(found, |found, &plane| {
                // The result is discarded after a cancellation.
                if self.monitor.is_cancelled() {
                    return found;
                }
                let costs = &self.params.costs;
                let pricing = Pricing {
                    costs,
                    steps: terms.steps,
                    limits: terms.limits(&found),
                    by_count: false,
                };
                if !cell.extent(plane.direction, profile) {
                    return found;
                }
                // Planes outside the cell split nothing.
                let at = plane.offset;
                let inside =
                    profile.low + profile.margin < at && at < profile.high - profile.margin;
                if !inside {
                    return found;
                }
                // Reject by a lower bound: all triangles in the part with the smaller surface area.
                let n = pieces.len() as f32;
                let [least_below, least_above] = profile.least_shares(at);
                let all = costs.leaf(n) * least_below.min(least_above);
                if pricing.hopeless(all, true) {
                    return found;
                }
                // Count the pieces on both sides.
                let counts = groups.count(pieces, plane).map(|n| n as f32);
                let [below, above, planar] = counts;
                // Reject by a second bound: the parts together have at least the whole surface area.
                let (fewer, more, other) = if below < above {
                    (below, above, least_above)
                } else {
                    (above, below, least_below)
                };
                let inner = costs.leaf(fewer) * (1.0 - other).max(0.0) + costs.leaf(more) * other;
                if pricing.hopeless(inner, fewer == 0.0) {
                    return found;
                }
                // Compute the cost from the surface areas of both parts.
                cell.divide(plane.direction, profile);
                cheaper(
                    found,
                    plane,
                    profile.shares(at).into(),
                    [below, above, planar],
                    &pricing,
                )
            })
        };
        if pieces.len() < TASK {
            return search(&task.planes, &mut task.profile);
        }
        // Parts of fixed size make the result independent of the number of threads.
        let parts: Vec<_> = task
            .planes
            .par_chunks(TASK)
            .map(|part| search(part, &mut Profile::default()))
            .collect();
        let mut found = found;
        parts.iter().for_each(|new| keep_better(&mut found, new));
        found
    }
}

/// Returns `found` with this plane where it is cheaper.
fn cheaper(
    mut found: Found,
    plane: Plane,
    shares: [f32; 2],
    [below, above, planar]: [f32; 3],
    pricing: &Pricing<'_>,
) -> Found {
    for (step, found) in pricing.steps.into_iter().zip(&mut found) {
        let costs = Costs {
            step,
            ..*pricing.costs
        };
        // Try planar triangles on either side.
        for (counts, touching) in [
            ([below + planar, above], Touching::PlanarBelow),
            ([below, above + planar], Touching::PlanarAbove),
        ] {
            let cost = costs.split(shares, counts);
            // Keep the plane for this cost of a step if it is cheaper.
            if cost < found.map_or(f32::INFINITY, |(_, best)| best.cost) {
                let new = Best {
                    cost,
                    at: plane.offset,
                    touching,
                    shares,
                    counts,
                };
                *found = Some((plane, new));
            }
        }
    }
    found
}
