// SPDX-License-Identifier: GPL-3.0-or-later
//! The sweep: the cheapest plane along one direction, tried at every end of every triangle.
//!
//! Few triangles are counted outright, sixteen candidates at a time ([`count`]). Of more, only those
//! stretches of the direction are looked into that may hold the cheapest plane: they are counted as well
//! ([`stretches`]), or, of many triangles, sorted ([`bins`]), so that a build stays within O(n log n) (the
//! bound of Wald and Havran 2006, reached without keeping event lists). All ways give the same plane, bit
//! for bit.

mod bins;
mod count;
mod stretches;
#[cfg(test)]
mod tests;

use super::cost::Costs;
use super::profile::Profile;
use fearless_simd::{Level, Select, Simd, SimdBase, SimdMask, dispatch, f32x8, f32x16};

/// Of up to this many triangles all ends are counted.
const COUNT_LIMIT: usize = 8;

/// Of up to this many, those in stretches that have a chance.
const STRETCH_LIMIT: usize = 256;

/// Shorter lists are sorted by comparisons.
const RADIX_LIMIT: usize = 256;

/// Which side a triangle goes to when it only touches the plane.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ties {
    /// To the side that it touches from; one that lies in the plane goes to the cheaper side
    /// (Wald and Havran 2006, section 4.1).
    Clean,
    /// As pbrt's and Hoobergs's builders have it: starts sort before ends, so triangles that end
    /// at the plane where others start land on both sides.
    StartsFirst,
}

/// Which triangles that touch the plane go where.
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
    /// Whether a triangle with these ends goes below, and whether it goes above, a plane at `at`.
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

/// What a plane costs besides the triangles that its children test.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pricing<'a> {
    /// Prices.
    pub costs: &'a Costs,
    /// The price of a step, and a second one for which the cheapest plane is found as well; infinite
    /// where there is no second.
    pub steps: [f32; 2],
    /// Planes that cost more at the first price, and at the second, are of no interest.
    pub limits: [f32; 2],
    /// Weigh the two sides by their triangles instead of by their surface: for nodes that hold too
    /// many and must be parted whatever it costs.
    pub by_count: bool,
}

impl Pricing<'_> {
    /// Whether both prices are beyond their limits where the children cost `inner` at least.
    #[inline(always)]
    pub fn hopeless(&self, inner: f32, empty: bool) -> bool {
        let factor = if empty { self.costs.empty } else { 1.0 };
        let dear = |i: usize| {
            let cost = (self.steps[i] + inner) * factor;
            // All but the rounding of one price.
            cost * (1.0 - 1e-5) > self.limits[i] || self.steps[i] == f32::INFINITY
        };
        dear(0) && dear(1)
    }
}

/// The best plane of a sweep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Best {
    /// Expected cost of the split.
    pub cost: f32,
    /// Height of the plane along the direction.
    pub at: f32,
    /// What happens to triangles that touch it.
    pub touching: Touching,
    /// Shares of the surface below and above.
    pub shares: [f32; 2],
    /// Triangles below and above.
    pub counts: [f32; 2],
}

/// Buffers of a sweep, kept between nodes.
#[derive(Debug, Default)]
pub struct Scratch {
    /// Lower ends of the triangles along the direction.
    pub min: Vec<f32>,
    /// Upper ends.
    pub max: Vec<f32>,
    /// Further heights to try.
    pub extra: Vec<f32>,
    starts: Vec<f32>,
    ends: Vec<f32>,
    planar: Vec<f32>,
    bins: bins::Bins,
}

impl Scratch {
    /// The lowest and the highest end.
    pub fn hull(&self) -> (f32, f32) {
        let low = self.min.iter().fold(f32::INFINITY, |a, &b| a.min(b));
        let high = self.max.iter().fold(f32::NEG_INFINITY, |a, &b| a.max(b));
        (low, high)
    }

    /// Adds the planes of a slab around each triangle that is parallel to them, `thickness` away: no
    /// other plane can part a wall from a cell whose face it lies in.
    pub fn add_slabs(&mut self, thickness: f32) {
        self.extra.clear();
        if thickness <= 0.0 {
            return;
        }
        dispatch!(Level::new(), simd => slabs(simd, (&self.min, &self.max), thickness, &mut self.extra));
    }
}

/// The heights of slabs. Few triangles are parallel to the planes in most nodes.
#[inline(always)]
fn slabs<S: Simd>(simd: S, (mins, maxs): (&[f32], &[f32]), thickness: f32, out: &mut Vec<f32>) {
    let half = f32x16::splat(simd, 0.5 * thickness);
    let (mut min, mut max) = ([0.0; 16], [f32::INFINITY; 16]);
    for (mins, maxs) in mins.chunks(16).zip(maxs.chunks(16)) {
        let extent = if mins.len() == 16 {
            f32x16::from_slice(simd, maxs) - f32x16::from_slice(simd, mins)
        } else {
            min[..mins.len()].copy_from_slice(mins);
            max[..mins.len()].copy_from_slice(maxs);
            f32x16::from_slice(simd, &max) - f32x16::from_slice(simd, &min)
        };
        let mut flat = extent.simd_le(half).to_bitmask();
        while flat != 0 {
            let i = flat.trailing_zeros() as usize;
            flat &= flat - 1;
            let (below, above) = (mins[i] - thickness, maxs[i] + thickness);
            // Neighbours often lie in one plane.
            if out.last() != Some(&above) {
                out.extend([below, above]);
            }
        }
    }
}

/// Which planes a sweep tries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Candidates {
    /// All ends of triangles and of slabs.
    All,
    /// The hull's two ends, and planes this far from them where it is flat: those that leave one part
    /// empty.
    Hull,
}

/// Finds the cheapest valid plane for each of the two prices of a step; of equal ones the lowest.
/// `None` when there is no valid plane within the limits.
///
/// Valid are planes inside the cell, away from its ends by the profile's margin, and, where the
/// profile has walls and ties are clean, its two end planes where they part the triangles that lie
/// in them from the others.
pub fn sweep(
    scratch: &mut Scratch,
    profile: &Profile,
    pricing: &Pricing<'_>,
    ties: Ties,
    candidates: Candidates,
) -> [Option<Best>; 2] {
    dispatch!(Level::new(), simd => {
        let mut batch = Batch::new(simd, profile, pricing, ties);
        let n = scratch.min.len();
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

/// Candidate planes that wait to be priced, and the best of those that were.
struct Batch<'a, S: Simd> {
    simd: S,
    profile: &'a Profile,
    pricing: &'a Pricing<'a>,
    ties: Ties,
    at: [f32; 8],
    /// Counts of each candidate. Clean ties: triangles that reach below, that reach above, and that
    /// lie in the plane. Starts first: below and above if all that touch go above, then the same if
    /// all that touch go below.
    counts: [[f32; 8]; 4],
    waiting: usize,
    best: [Option<Best>; 2],
}

impl<'a, S: Simd> Batch<'a, S> {
    #[inline(always)]
    fn new(simd: S, profile: &'a Profile, pricing: &'a Pricing<'a>, ties: Ties) -> Self {
        Self {
            simd,
            profile,
            pricing,
            ties,
            at: [f32::NAN; 8],
            counts: [[0.0; 8]; 4],
            waiting: 0,
            best: [None; 2],
        }
    }

    /// Adds one candidate.
    #[inline(always)]
    fn push(&mut self, at: f32, counts: [f32; 4]) {
        self.at[self.waiting] = at;
        for (row, count) in self.counts.iter_mut().zip(counts) {
            row[self.waiting] = count;
        }
        self.waiting += 1;
        if self.waiting == 8 {
            self.flush();
        }
    }

    /// Prices what waits.
    #[inline(always)]
    fn flush(&mut self) {
        if self.waiting > 0 {
            self.at[self.waiting..].fill(f32::NAN);
            self.waiting = 0;
            let at = f32x8::from_slice(self.simd, &self.at);
            // Written out: a closure given to `map` would not be compiled for this instruction set.
            let row = |i: usize| f32x8::from_slice(self.simd, &self.counts[i]);
            let counts = [row(0), row(1), row(2), row(3)];
            self.price(at, counts);
        }
    }

    #[inline(always)]
    fn finish(mut self) -> [Option<Best>; 2] {
        self.flush();
        self.best
    }

    /// Prices eight candidates; heights that are not numbers are none.
    #[inline(always)]
    fn price(&mut self, at: f32x8<S>, [first, second, third, fourth]: [f32x8<S>; 4]) {
        let simd = self.simd;
        let splat = |x: f32| f32x8::splat(simd, x);
        let profile = self.profile;
        let zero = splat(0.0);
        let inside = at.simd_gt(splat(profile.low + profile.margin))
            & at.simd_lt(splat(profile.high - profile.margin));
        let shares = profile.shares_x8(simd, at);
        let options = match self.ties {
            Ties::Clean => {
                let (mut low, mut high) = (inside, inside);
                if profile.walls {
                    // A wall of the cell: worth a plane only for the triangles that lie in it.
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
        for (below, above, valid, touching) in options {
            let costs = self.pricing.costs;
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

/// One lane of a vector.
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
    for (&min, &max) in min.iter().zip(&*max) {
        if batch.ties == Ties::Clean && min == max {
            planar.push(min);
        } else {
            starts.push(min);
            ends.push(max);
        }
    }
    let all = u32::try_from(min.len()).expect("bounded by the scene");
    merge(batch, [starts, ends, planar, extra], (0, all));
}

/// Sorts and merges starts, ends, planar triangles and further candidates, and tries each height. What
/// lies below and above all of them is counted in `below` and `above`; `above` includes the
/// triangles that end or lie here.
#[inline(always)]
fn merge<S: Simd>(
    batch: &mut Batch<'_, S>,
    lists: [&mut [f32]; 4],
    (mut below, mut above): (u32, u32),
) {
    let [starts, ends, planar, extra] = lists;
    for list in [&mut *starts, ends, planar, extra] {
        if list.len() < RADIX_LIMIT {
            list.sort_unstable_by(f32::total_cmp);
        } else {
            radsort::sort(list);
        }
    }
    let (mut s, mut e, mut p, mut x) = (0, 0, 0, 0);
    let next = |list: &[f32], i: usize| list.get(i).copied().unwrap_or(f32::INFINITY);
    loop {
        let at = next(starts, s)
            .min(next(ends, e))
            .min(next(planar, p))
            .min(next(extra, x));
        if at == f32::INFINITY {
            return;
        }
        let run = |list: &[f32], i: &mut usize| {
            let first = *i;
            while next(list, *i) == at {
                *i += 1;
            }
            u32::try_from(*i - first).expect("bounded by the scene")
        };
        let (start, end, flat) = (run(starts, &mut s), run(ends, &mut e), run(planar, &mut p));
        run(extra, &mut x);
        let counts = match batch.ties {
            Ties::Clean => [below, above - end - flat, flat, 0],
            Ties::StartsFirst => [below, above, below + start, above - end],
        };
        batch.push(at, counts.map(|n| n as f32));
        below += start + flat;
        above -= end + flat;
    }
}
