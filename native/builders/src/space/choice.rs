// SPDX-License-Identifier: GPL-3.0-or-later
//! Chooses the split of a node: the cheapest of all planes, if it is cheap enough.

use crate::piece::Piece;
use crate::space::{
    Builder, Choice, ObliqueStep, OpenNode, PlanePolicy, Round, Stop, Task, even_split_pays,
    one_child_only,
};
use crate::sweep::{Best, Candidates, Pricing, Scratch, Ties, sweep};
use halfspace_geom::cell::{Cell, Direction, Plane};
use halfspace_geom::profile::Profile;
use halfspace_nodes::cost::Costs;
use rayon::prelude::*;

/// Nodes of at least this number of references sweep their directions in parallel.
const PARALLEL_SWEEP: usize = 1 << 16;

/// Best planes for both costs of an oblique step.
pub type Found = [Option<(Plane, Best)>; 2];

/// Buffers of a sweep, reused between sweeps.
struct Buffers<'a> {
    scratch: &'a mut Scratch,
    profile: &'a mut Profile,
}

/// A search for the cheapest planes of a node.
struct Search<'c, C> {
    cell: &'c C,
    /// Index of the node's first piece in its task.
    from: usize,
    /// Index of the first direction to sweep.
    first: usize,
    /// Whether only planes that leave one part empty are tried.
    hull: bool,
}

/// A node as a sweep reads it.
struct Swept<'a, P, C> {
    pieces: &'a [P],
    cell: &'a C,
    /// As in [`Search`].
    hull: bool,
}

/// Keeps the cheaper plane of each pair, the first of equal ones.
pub fn keep_better(found: &mut Found, new: &Found) {
    for (old, new) in found.iter_mut().zip(new) {
        if let Some((_, best)) = new
            && old.as_ref().is_none_or(|(_, old)| best.cost < old.cost)
        {
            *old = *new;
        }
    }
}

/// Costs with which the planes of a node are compared.
#[derive(Debug, Clone, Copy)]
pub struct Terms {
    /// Costs of an oblique step: the usual one, and an alternative for nodes where no plane at the usual cost is
    /// cheaper than the leaf.
    pub steps: [f32; 2],
    /// Cost of the node as a leaf.
    pub leaf: f32,
    /// Whether only planes cheaper than the leaf are of use.
    strict: bool,
    /// Whether only planes that leave one part empty can be cheaper than the leaf.
    pub hull: bool,
}

impl Terms {
    /// Returns the largest useful costs of planes for both costs of a step, given those found so far.
    pub fn limits(&self, found: &Found) -> [f32; 2] {
        let most = if self.strict {
            self.leaf
        } else {
            f32::INFINITY
        };
        let cost = |i: usize| found[i].map_or(f32::INFINITY, |(_, best): (Plane, Best)| best.cost);
        let first = cost(0).min(most);
        // A plane cheaper than the leaf at the first cost makes the second one unnecessary.
        let second = if cost(0) < self.leaf {
            f32::NEG_INFINITY
        } else {
            cost(1).min(most)
        };
        [first, second]
    }
}

impl<P: PlanePolicy> Builder<'_, P> {
    /// Returns the costs with which the planes of a node of `n` triangles are compared.
    fn terms(&self, n: usize) -> Terms {
        let costs = &self.params.costs;
        let n = n as f32;
        // With the linear cost, oblique planes are cheap only at nodes of few triangles.
        let steps = match self.params.oblique {
            ObliqueStep::Fixed(step) => [step, f32::INFINITY],
            ObliqueStep::Linear { alpha, fixed, .. } => {
                [alpha * costs.triangle * (n - 1.0) + costs.step, fixed]
            }
        };
        let as_code = matches!(
            self.params.oblique,
            ObliqueStep::Linear { as_code: true, .. }
        );
        let strict = self.params.stop == Stop::Cheapest && !as_code;
        Terms {
            steps,
            leaf: costs.leaf(n),
            strict,
            // Both parts together have at least the whole surface area, and each costs a whole block.
            hull: strict && n <= costs.block,
        }
    }

    /// Returns the cheapest split if the cost model accepts it; `None` for a leaf.
    pub fn affordable(
        &self,
        task: &mut Task<P::Piece>,
        from: usize,
        node: &OpenNode<P::Cell>,
        round: Round,
    ) -> Option<Choice> {
        let params = self.params;
        let (cell, bad) = (node.cell.as_ref()?, node.bad);
        let n = task.pieces.len() - from;
        let terms = self.terms(n);
        let leaf = terms.leaf;
        let costs = &params.costs;
        // Only planes cheaper than those found so far are of interest.
        let pricing = |direction, found: &Found| Pricing {
            costs,
            steps: match direction {
                Direction::Axis(_) => [costs.step, f32::INFINITY],
                Direction::Oblique(_) => terms.steps,
            },
            limits: terms.limits(found),
            by_count: false,
        };
        // Sweep the first directions, and further ones if these find nothing cheap enough.
        let mut found = [None; 2];
        let mut search = Search {
            cell,
            from,
            first: 0,
            hull: terms.hull,
        };
        let ended = self.sweep_all(task, &search, pricing, &mut found);
        if round == Round::First && !ended {
            // Triangles that fill one block are only separated from empty space, which oblique planes do best.
            let enough = found[0].is_some_and(|(_, best)| best.cost < params.enough * leaf);
            if enough && !terms.hull {
                task.out.first_only += 1;
            } else {
                search.first = task.directions.len();
                self.policy.further(
                    &node.view(&task.pieces[from..], self.monitor),
                    &mut task.directions,
                );
                self.sweep_all(task, &search, pricing, &mut found);
            }
        }
        // Choose between the planes for the two costs of an oblique step.
        let [first, second] = self.singles(task, from, cell, &terms, found);
        let as_code = matches!(params.oblique, ObliqueStep::Linear { as_code: true, .. });
        let second = second.filter(|(_, best)| best.cost < leaf);
        let (plane, best, cost) = match (first, second) {
            (Some((plane, best)), Some((_, second))) if best.cost >= leaf && as_code => {
                (plane, best, second.cost)
            }
            (first, Some((plane, best))) if first.is_none_or(|(_, b)| b.cost >= leaf) => {
                (plane, best, best.cost)
            }
            (first, _) => {
                let (plane, best) = first?;
                (plane, best, best.cost)
            }
        };
        // Apply the stopping rule.
        let bad = match params.stop {
            Stop::Cheapest if cost >= leaf => return None,
            Stop::Cheapest => 0,
            // pbrt's rule counts bad splits on the path.
            Stop::Tolerant(limit) => {
                let bad = bad + u32::from(cost > leaf);
                if (cost > 4.0 * leaf && n < 16) || bad >= limit {
                    return None;
                }
                bad
            }
            Stop::Even(beta) => {
                let beta = beta.unwrap_or_else(|| one_child_only(best.shares));
                let step = match (plane.direction, params.oblique) {
                    (Direction::Axis(_), _) => costs.step,
                    (_, ObliqueStep::Fixed(step) | ObliqueStep::Linear { fixed: step, .. }) => step,
                };
                let divides = best.counts[0].min(best.counts[1]) < n as f32;
                if !divides || !even_split_pays(n as f32, beta, step, costs.triangle) {
                    return None;
                }
                0
            }
        };
        Some(Choice { plane, best, bad })
    }

    /// Returns the split with the most even numbers of triangles, for a node too large for a leaf; `None` if no
    /// plane splits it usefully.
    pub fn forced(
        &self,
        task: &mut Task<P::Piece>,
        from: usize,
        node: &OpenNode<P::Cell>,
    ) -> Option<Choice> {
        let cell = node.cell.as_ref()?;
        let costs = Costs {
            step: 0.0,
            leaf: 0.0,
            // A child without triangles separates nothing.
            empty: f32::INFINITY,
            ..self.params.costs
        };
        let pricing = Pricing {
            costs: &costs,
            steps: [0.0, f32::INFINITY],
            limits: [f32::INFINITY; 2],
            by_count: true,
        };
        let n = (task.pieces.len() - from) as f32;
        // Sweep with costs that only count triangles.
        let attempt = |task: &mut Task<P::Piece>| {
            let mut found = [None; 2];
            let search = Search {
                cell,
                from,
                first: 0,
                hull: false,
            };
            self.sweep_all(task, &search, |_, _| pricing, &mut found);
            found[0].filter(|(_, Best { counts, .. })| {
                // Triangles that cross each other would be split without end.
                counts[0].max(counts[1]) <= 0.95 * n && counts[0] + counts[1] <= 1.7 * n
            })
        };
        // Try the policy's last resort if no direction splits the node.
        let found = attempt(task).or_else(|| {
            task.directions.clear();
            self.policy.last_resort(
                &node.view(&task.pieces[from..], self.monitor),
                &mut task.directions,
            );
            attempt(task)
        });
        let (plane, best) = found?;
        let total = best.counts[0] + best.counts[1];
        (total <= node.budget as f32).then_some(Choice {
            plane,
            best,
            bad: 0,
        })
    }

    /// Finds the cheapest planes of the task's directions from `search.first` on, where cheaper than those in `found`.
    /// `pricing` receives the planes found before. Returns whether the search may end here.
    fn sweep_all<'p>(
        &self,
        task: &mut Task<P::Piece>,
        search: &Search<'_, P::Cell>,
        pricing: impl Fn(Direction, &Found) -> Pricing<'p> + Sync,
        found: &mut Found,
    ) -> bool {
        let Task {
            pieces,
            scratch,
            profile,
            directions,
            ..
        } = task;
        let directions = &directions[search.first..];
        let pieces = &pieces[search.from..];
        let n = pieces.len();
        // Sweep one direction with the given buffers.
        let attempt = |direction: Direction, found: &mut Found, buffers: Buffers<'_>| {
            let node = Swept {
                pieces,
                cell: search.cell,
                hull: search.hull,
            };
            self.sweep_one(node, direction, &pricing, found, buffers);
        };
        // Sweep the directions of a large node in parallel, each with its own buffers; keep the first of equally cheap
        // planes.
        if n >= PARALLEL_SWEEP {
            let attempts: Vec<_> = directions
                .par_iter()
                .map(|&d| {
                    let mut found = [None; 2];
                    let buffers = Buffers {
                        scratch: &mut Scratch::default(),
                        profile: &mut Profile::default(),
                    };
                    attempt(d, &mut found, buffers);
                    found
                })
                .collect();
            attempts.iter().for_each(|new| keep_better(found, new));
            return false;
        }
        // Sweep the directions in order, each with the limits set by those before.
        for &direction in directions {
            let buffers = Buffers {
                scratch: &mut *scratch,
                profile: &mut *profile,
            };
            attempt(direction, found, buffers);
            // A plane that cuts no triangle and leaves both sides filled may end the search.
            let separates = |best: &Option<(Plane, Best)>| {
                best.is_some_and(|(_, b)| {
                    b.counts[0] + b.counts[1] <= n as f32 && b.counts[0] > 0.0 && b.counts[1] > 0.0
                })
            };
            if self.params.early && separates(&found[0]) {
                return true;
            }
        }
        false
    }

    /// Finds the cheapest planes of one direction, where cheaper than those in `found`.
    fn sweep_one<'p>(
        &self,
        Swept { pieces, cell, hull }: Swept<'_, P::Piece, P::Cell>,
        direction: Direction,
        pricing: &impl Fn(Direction, &Found) -> Pricing<'p>,
        found: &mut Found,
        Buffers { scratch, profile }: Buffers<'_>,
    ) {
        if !cell.extent(direction, profile) {
            return;
        }
        let pricing = pricing(direction, found);
        let slab = self.params.slab * self.frame.bounds().magnitude();
        // Project the pieces, and add the slabs of parallel triangles.
        P::Piece::project(pieces, direction, scratch);
        scratch.add_slabs(slab);
        // Skip the division of the surface if no hull plane can be cheap enough.
        let candidates = if hull {
            let leaf = pricing.costs.leaf(pieces.len() as f32);
            if hull_is_hopeless(scratch, profile, slab, &pricing, leaf) {
                return;
            }
            Candidates::Hull
        } else {
            Candidates::All
        };
        cell.divide(direction, profile);
        profile.margin *= self.margin(pricing.by_count);
        // Keep the planes that improve on those found.
        let best = sweep(scratch, profile, &pricing, self.params.ties, candidates);
        for (old, best) in found.iter_mut().zip(best) {
            if let Some(best) = best
                && old.as_ref().is_none_or(|(_, old)| best.cost < old.cost)
            {
                let offset = best.at;
                *old = Some((Plane { direction, offset }, best));
            }
        }
    }

    /// Returns the factor on the usual margin between planes and the ends of their cell.
    fn margin(&self, by_count: bool) -> f32 {
        if self.params.ties == Ties::StartsFirst {
            // The published builders keep no margin. Two planes with almost the normal of a wall separate it from
            // both sides by a cell thinner than rounding: the published traversals then miss it, ours do not.
            0.0
        } else if by_count {
            // A node that must be split is split however thin the parts.
            1.0 / 1024.0
        } else {
            1.0
        }
    }
}

/// Returns whether no plane on either side of all triangles can be cheap enough; `leaf` is their cost as a leaf.
fn hull_is_hopeless(
    scratch: &Scratch,
    profile: &Profile,
    slab: f32,
    pricing: &Pricing<'_>,
    leaf: f32,
) -> bool {
    let (low, high) = scratch.hull();
    let hopeless = |kept: f32| pricing.hopeless(kept * leaf, true);
    hopeless(profile.least_shares(low - slab)[1]) && hopeless(profile.least_shares(high + slab)[0])
}
