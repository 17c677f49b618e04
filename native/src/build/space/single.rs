// SPDX-License-Identifier: GPL-3.0-or-later
//! Single planes, each tried on its own: nothing is swept, so each is counted through a hierarchy of boxes.

use super::choice::{Found, Terms, keep_better};
use super::{Builder, PlanePolicy, TASK, Task};
use crate::build::cell::{Cell, Plane};
use crate::build::cost::Costs;
use crate::build::profile::Profile;
use crate::build::sweep::{Best, Pricing, Touching};
use rayon::prelude::*;

impl<P: PlanePolicy> Builder<'_, P> {
    /// The cheapest planes for both prices, those that were found or the task's single ones.
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
                // What is found then does not count.
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
                let at = plane.offset;
                let inside =
                    profile.low + profile.margin < at && at < profile.high - profile.margin;
                if !inside {
                    return found;
                }
                // The cheapest that counts could make it: all triangles in the part of less surface.
                let n = pieces.len() as f32;
                let [least_below, least_above] = profile.least_shares(at);
                let all = costs.leaf(n) * least_below.min(least_above);
                if pricing.hopeless(all, true) {
                    return found;
                }
                let counts = groups.count(pieces, plane).map(|n| n as f32);
                let [below, above, planar] = counts;
                // The parts together have at least the whole surface.
                let (fewer, more, other) = if below < above {
                    (below, above, least_above)
                } else {
                    (above, below, least_below)
                };
                let inner = costs.leaf(fewer) * (1.0 - other).max(0.0) + costs.leaf(more) * other;
                if pricing.hopeless(inner, fewer == 0.0) {
                    return found;
                }
                cell.divide(plane.direction, profile);
                cheaper(
                    found,
                    plane,
                    (profile.shares(at), [below, above, planar]),
                    &pricing,
                )
            })
        };
        if pieces.len() < TASK {
            return search(&task.planes, &mut task.profile);
        }
        // In parts of fixed size, so that the result does not depend on the number of threads.
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

/// A plane with its shares and counts, where it is cheaper than what was found.
fn cheaper(
    mut found: Found,
    plane: Plane,
    (shares, [below, above, planar]): ((f32, f32), [f32; 3]),
    pricing: &Pricing<'_>,
) -> Found {
    for (step, found) in pricing.steps.into_iter().zip(&mut found) {
        let costs = Costs {
            step,
            ..*pricing.costs
        };
        for (counts, touching) in [
            ((below + planar, above), Touching::PlanarBelow),
            ((below, above + planar), Touching::PlanarAbove),
        ] {
            let cost = costs.split(shares, counts);
            if cost < found.map_or(f32::INFINITY, |(_, best)| best.cost) {
                let new = Best {
                    cost,
                    at: plane.offset,
                    touching,
                    shares: shares.into(),
                    counts: counts.into(),
                };
                *found = Some((plane, new));
            }
        }
    }
    found
}
