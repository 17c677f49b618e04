// SPDX-License-Identifier: GPL-3.0-or-later
//! The sweep: finds the cheapest plane along one direction among the ends of all triangles.
//!
//! Few triangles are counted directly, against sixteen candidates at a time ([`count`]). For more triangles, only
//! those stretches of the direction that may contain the cheapest plane are evaluated: by counting as well
//! ([`stretches`]), or, for many triangles, by sorting ([`bins`]), so that a build stays within O(n log n) (the
//! bound of Wald and Havran 2006, reached without event lists). All methods give the same plane, bit for bit.

mod bins;
mod count;
mod stretches;
#[cfg(test)]
mod tests;

use fearless_simd::{Select, Simd, SimdBase, SimdMask, dispatch, f32x8, f32x16};
use halfspace_base::simd;
use halfspace_geom::profile::Profile;
use halfspace_nodes::cost::Costs;

/// Up to this number of triangles all ends are counted.
const COUNT_LIMIT: usize = 8;

/// Up to this number of triangles the ends in promising stretches are counted.
const STRETCH_LIMIT: usize = 256;

/// Lists shorter than this are sorted by comparisons.
const RADIX_LIMIT: usize = 256;

/// Assignment of triangles that only touch the plane.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ties {
    /// Each goes to the side that it touches from; one that lies in the plane goes to the cheaper side (Wald and
    /// Havran 2006, section 4.1).
    Clean,
    /// As in pbrt's and Hoobergs's builders: starts sort before ends, so triangles that end at a plane where
    /// others start go to both sides.
    StartsFirst,
}

/// Sides of the triangles that touch a chosen plane.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Touching {
    /// Clean, planar triangles below.
    PlanarBelow,
    /// Clean, planar triangles above.
    PlanarAbove,
    /// Starts first, the plane is a start: all that touch it go above.
    AllAbove,
    /// Starts first, the plane is an end: all that touch it go below.
    AllBelow,
}

impl Touching {
    /// Returns whether a triangle with these ends goes below, and whether it goes above, a plane at `at`.
    #[inline(always)]
    pub fn sides(self, at: f32, min: f32, max: f32) -> (bool, bool) {
        match self {
            Self::PlanarBelow => (min < at || max <= at, max > at),
            Self::PlanarAbove => (min < at, max > at || min >= at),
            Self::AllAbove => (min < at, max >= at),
            Self::AllBelow => (min <= at, max > at),
        }
    }
}

/// Cost model of a sweep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pricing<'a> {
    /// Costs of the operations of a traversal.
    pub costs: &'a Costs,
    /// Cost of a step, and an alternative cost for which the cheapest plane is found as well; infinite if there is
    /// no alternative.
    pub steps: [f32; 2],
    /// Largest cost of interest with the first and with the second cost of a step.
    pub limits: [f32; 2],
    /// Weights the sides by their numbers of triangles instead of their surface areas: for nodes with too many
    /// triangles, which must be split at any cost.
    pub by_count: bool,
}

impl Pricing<'_> {
    /// Returns whether both costs exceed their limits if the children cost at least `inner`.
    #[inline(always)]
    pub fn hopeless(&self, inner: f32, empty: bool) -> bool {
        let factor = if empty { self.costs.empty } else { 1.0 };
        let exceeds = |i: usize| {
            let cost = (self.steps[i] + inner) * factor;
            // Allow for the rounding of one cost.
            cost * (1.0 - 1e-5) > self.limits[i] || self.steps[i] == f32::INFINITY
        };
        exceeds(0) && exceeds(1)
    }
}

/// The best plane of a sweep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Best {
    /// Expected cost of the split.
    pub cost: f32,
    /// Height of the plane along the direction.
    pub at: f32,
    /// Sides of the triangles that touch it.
    pub touching: Touching,
    /// Shares of the surface area below and above.
    pub shares: [f32; 2],
    /// Numbers of triangles below and above.
    pub counts: [f32; 2],
}

/// Buffers of a sweep, reused between nodes.
#[derive(Debug, Default)]
pub struct Scratch {
    /// Lower ends of the triangles along the direction.
    pub min: Vec<f32>,
    /// Upper ends of the triangles along the direction.
    pub max: Vec<f32>,
    /// Further candidate heights.
    pub extra: Vec<f32>,
    starts: Vec<f32>,
    ends: Vec<f32>,
    planar: Vec<f32>,
    bins: bins::Bins,
}

impl Scratch {
    /// Returns the lowest and the highest end.
    pub fn hull(&self) -> (f32, f32) {
        let low = self.min.iter().fold(f32::INFINITY, |a, &b| a.min(b));
        let high = self.max.iter().fold(f32::NEG_INFINITY, |a, &b| a.max(b));
        (low, high)
    }

    /// Adds candidates at distance `thickness` on both sides of each triangle that is parallel to the planes: no
    /// other plane can separate a wall from a cell whose face it lies in.
    pub fn add_slabs(&mut self, thickness: f32) {
        self.extra.clear();
        if thickness <= 0.0 {
            return;
        }
        dispatch!(simd::level(), simd => slabs(simd, &self.min, &self.max, thickness, &mut self.extra));
    }
}

/// Appends the heights of slabs. In most nodes few triangles are parallel to the planes.
#[inline(always)]
fn slabs<S: Simd>(simd: S, mins: &[f32], maxs: &[f32], thickness: f32, out: &mut Vec<f32>) {
    let half = f32x16::splat(simd, 0.5 * thickness);
    let (mut min, mut max) = ([0.0; 16], [f32::INFINITY; 16]);
    for (mins, maxs) in mins.chunks(16).zip(maxs.chunks(16)) {
        // Find triangles thinner than half the slab, sixteen at a time.
        let extent = if mins.len() == 16 {
            f32x16::from_slice(simd, maxs) - f32x16::from_slice(simd, mins)
        } else {
            min[..mins.len()].copy_from_slice(mins);
            max[..mins.len()].copy_from_slice(maxs);
            f32x16::from_slice(simd, &max) - f32x16::from_slice(simd, &min)
        };
        let mut flat = extent.simd_le(half).to_bitmask();
        // Add both planes of each slab.
        while flat != 0 {
            let i = flat.trailing_zeros() as usize;
            flat &= flat - 1;
            let (below, above) = (mins[i] - thickness, maxs[i] + thickness);
            // Consecutive triangles often lie in one plane.
            if out.last() != Some(&above) {
                out.extend([below, above]);
            }
        }
    }
}

/// Candidate planes of a sweep.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Candidates {
    /// All ends of triangles and of slabs.
    All,
    /// The two ends of all triangles, and slabs where those are flat: the planes that leave one part empty.
    Hull,
}

/// Returns the cheapest valid plane for each of the two costs of a step, the lowest of equally cheap ones; `None`
/// if no valid plane is within the limits.
///
/// Valid planes lie inside the cell, farther from its ends than the profile's margin. If the profile has walls and
/// ties are clean, its two end planes are also valid where they separate the triangles that lie in them from the
/// others.
pub fn sweep(
    scratch: &mut Scratch,
    profile: &Profile,
    pricing: &Pricing<'_>,
    ties: Ties,
    candidates: Candidates,
) -> [Option<Best>; 2] {
    dispatch!(simd::level(), simd => {
        let mut batch = Batch::new(simd, profile, pricing, ties);
        let n = scratch.min.len();
        // Choose the fastest method for the number of triangles; all give the same plane.
        if candidates == Candidates::Hull {
            count::hull(&mut batch, scratch);
        } else if n <= COUNT_LIMIT {
            count::all(&mut batch, scratch);
        } else if pricing.by_count {
            sorted(&mut batch, scratch);
        } else if n <= STRETCH_LIMIT {
            stretches::search(&mut batch, scratch);
        } else {
            bins::search(&mut batch, scratch);
        }
        batch.finish()
    })
}

/// Candidate planes queued for evaluation, eight at a time, and the best planes so far.
struct Batch<'a, S: Simd> {
    simd: S,
    profile: &'a Profile,
    pricing: &'a Pricing<'a>,
    ties: Ties,
    /// Heights of the queued candidates.
    at: [f32; 8],
    /// Counts of each candidate. With clean ties: triangles that extend below, that extend above, and that lie in
    /// the plane. With starts first: below and above if all that touch go above, then below and above if all that
    /// touch go below.
    counts: [[f32; 8]; 4],
    /// Number of queued candidates.
    queued: usize,
    best: [Option<Best>; 2],
}

impl<'a, S: Simd> Batch<'a, S> {
    /// Makes an empty batch.
    #[inline(always)]
    fn new(simd: S, profile: &'a Profile, pricing: &'a Pricing<'a>, ties: Ties) -> Self {
        Self {
            simd,
            profile,
            pricing,
            ties,
            at: [f32::NAN; 8],
            counts: [[0.0; 8]; 4],
            queued: 0,
            best: [None; 2],
        }
    }

    /// Adds one candidate; evaluates eight at a time.
    #[inline(always)]
    fn push(&mut self, at: f32, counts: [f32; 4]) {
        self.at[self.queued] = at;
        for (row, count) in self.counts.iter_mut().zip(counts) {
            row[self.queued] = count;
        }
        self.queued += 1;
        if self.queued == 8 {
            self.flush();
        }
    }

    /// Evaluates the queued candidates.
    #[inline(always)]
    fn flush(&mut self) {
        if self.queued > 0 {
            self.at[self.queued..].fill(f32::NAN);
            self.queued = 0;
            let at = f32x8::from_slice(self.simd, &self.at);
            // Written out: a closure passed to `map` would not be compiled for this instruction set.
            let row = |i: usize| f32x8::from_slice(self.simd, &self.counts[i]);
            let counts = [row(0), row(1), row(2), row(3)];
            self.price(at, counts);
        }
    }

    /// Evaluates the rest and returns the best planes.
    #[inline(always)]
    fn finish(mut self) -> [Option<Best>; 2] {
        self.flush();
        self.best
    }

    /// Evaluates eight candidates; NaN marks unused lanes.
    #[inline(always)]
    fn price(&mut self, at: f32x8<S>, [first, second, third, fourth]: [f32x8<S>; 4]) {
        let simd = self.simd;
        let splat = |x: f32| f32x8::splat(simd, x);
        let profile = self.profile;
        let zero = splat(0.0);
        // Determine which candidates are valid, and the counts of both ways to assign touching triangles.
        let inside = at.simd_gt(splat(profile.low + profile.margin))
            & at.simd_lt(splat(profile.high - profile.margin));
        let shares = profile.shares_x8(simd, at);
        let options = match self.ties {
            Ties::Clean => {
                let (mut low, mut high) = (inside, inside);
                if profile.walls {
                    // A wall of the cell is valid only if triangles lie in it and others do not.
                    low |= at.simd_eq(splat(profile.low)) & second.simd_gt(zero);
                    high |= at.simd_eq(splat(profile.high)) & first.simd_gt(zero);
                    low &= inside | third.simd_gt(zero);
                }
                [
                    (first + third, second, low, Touching::PlanarBelow),
                    (
                        first,
                        second + third,
                        high & third.simd_gt(zero),
                        Touching::PlanarAbove,
                    ),
                ]
            }
            Ties::StartsFirst => [
                (first, second, inside, Touching::AllAbove),
                (third, fourth, inside, Touching::AllBelow),
            ],
        };
        // Compute the costs of eight candidates, and extract the lanes that improve on the best plane.
        for (below, above, valid, touching) in options {
            let costs = self.pricing.costs;
            // Cost of both children, weighted by area or by number.
            let weights = if self.pricing.by_count {
                (below, above)
            } else {
                shares
            };
            let inner =
                weights.0 * costs.leaf_x8(simd, below) + weights.1 * costs.leaf_x8(simd, above);
            let empty = below.simd_eq(zero) | above.simd_eq(zero);
            for (i, best) in self.best.iter_mut().enumerate() {
                let step = self.pricing.steps[i];
                if step == f32::INFINITY {
                    continue;
                }
                let cost = splat(step) + inner;
                let cost = empty.select(cost * splat(costs.empty), cost);
                let limit = best.map_or(self.pricing.limits[i], |b| b.cost);
                let promising = valid & cost.simd_le(splat(limit));
                if !promising.any_true() {
                    continue;
                }
                // Compare lane by lane, with the lowest height first among equal costs.
                let mut lanes = promising.to_bitmask();
                while lanes != 0 {
                    let lane = lanes.trailing_zeros() as usize;
                    lanes &= lanes - 1;
                    let (cost, at) = (lane_of(cost, lane), lane_of(at, lane));
                    let better =
                        best.is_none_or(|b| cost < b.cost || (cost == b.cost && at < b.at));
                    if better && cost < f32::INFINITY {
                        *best = Some(Best {
                            cost,
                            at,
                            touching,
                            shares: [lane_of(shares.0, lane), lane_of(shares.1, lane)],
                            counts: [lane_of(below, lane), lane_of(above, lane)],
                        });
                    }
                }
            }
        }
    }
}

/// Returns one lane of a vector.
#[inline(always)]
fn lane_of<S: Simd>(lanes: f32x8<S>, lane: usize) -> f32 {
    let mut row = [0.0; 8];
    lanes.store_slice(&mut row);
    row[lane]
}

/// Sorts all ends and tries each.
#[inline(always)]
fn sorted<S: Simd>(batch: &mut Batch<'_, S>, scratch: &mut Scratch) {
    let Scratch {
        min,
        max,
        extra,
        starts,
        ends,
        planar,
        ..
    } = scratch;
    for list in [&mut *starts, ends, planar] {
        list.clear();
    }
    // Separate planar triangles, which clean ties treat specially.
    for (&min, &max) in min.iter().zip(&*max) {
        if batch.ties == Ties::Clean && min == max {
            planar.push(min);
        } else {
            starts.push(min);
            ends.push(max);
        }
    }
    // All triangles end above the lowest height.
    let all = u32::try_from(min.len()).expect("bounded by the scene");
    merge(batch, [starts, ends, planar, extra], 0, all);
}

/// Sorts and merges starts, ends, planar triangles and further candidates, and tries each height. `below` and
/// `above` are the numbers of triangles below and above all of these heights; `above` includes those that end or
/// lie here.
#[inline(always)]
fn merge<S: Simd>(
    batch: &mut Batch<'_, S>,
    lists: [&mut [f32]; 4],
    mut below: u32,
    mut above: u32,
) {
    let [starts, ends, planar, extra] = lists;
    // Sort each list.
    for list in [&mut *starts, ends, planar, extra] {
        if list.len() < RADIX_LIMIT {
            list.sort_unstable_by(f32::total_cmp);
        } else {
            radsort::sort(list);
        }
    }
    let (mut s, mut e, mut p, mut x) = (0, 0, 0, 0);
    let next = |list: &[f32], i: usize| list.get(i).copied().unwrap_or(f32::INFINITY);
    // Visit the heights of all lists in ascending order.
    loop {
        let at = next(starts, s)
            .min(next(ends, e))
            .min(next(planar, p))
            .min(next(extra, x));
        if at == f32::INFINITY {
            return;
        }
        // Count the entries of a list at this height.
        let run = |list: &[f32], i: &mut usize| {
            let first = *i;
            while next(list, *i) == at {
                *i += 1;
            }
            u32::try_from(*i - first).expect("bounded by the scene")
        };
        let (start, end, flat) = (run(starts, &mut s), run(ends, &mut e), run(planar, &mut p));
        run(extra, &mut x);
        // Counts at this height, as the batch expects them.
        let counts = match batch.ties {
            Ties::Clean => [below, above - end - flat, flat, 0],
            Ties::StartsFirst => [below, above, below + start, above - end],
        };
        batch.push(at, counts.map(|n| n as f32));
        // Move the triangles that end or lie here below the next height.
        below += start + flat;
        above -= end + flat;
    }
}
