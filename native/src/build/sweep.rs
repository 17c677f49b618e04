// SPDX-License-Identifier: GPL-3.0-or-later
//! The sweep: the cheapest plane along one direction, tried at every end of every triangle.
//!
//! Few triangles are counted outright, eight candidates at a time; many are sorted first, by radix,
//! so that a build stays within O(n log n) (the bound of Wald and Havran 2006, reached without
//! keeping event lists). Both ways give the same plane, bit for bit.

use super::cost::Costs;
use super::profile::Profile;
use fearless_simd::{Level, Select, Simd, SimdBase, SimdMask, dispatch, f32x8};

/// Up to this many triangles are counted without sorting.
const COUNT_LIMIT: usize = 32;

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
    /// Weigh the two sides by their triangles instead of by their surface: for nodes that hold too
    /// many and must be parted whatever it costs.
    pub by_count: bool,
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
}

impl Scratch {
    /// Adds the planes of a slab around each triangle that is parallel to them, `thickness` away: no
    /// other plane can part a wall from a cell whose face it lies in.
    pub fn add_slabs(&mut self, thickness: f32) {
        self.extra.clear();
        if thickness <= 0.0 {
            return;
        }
        for (&min, &max) in self.min.iter().zip(&self.max) {
            if max - min <= 0.5 * thickness {
                let (below, above) = (min - thickness, max + thickness);
                // Neighbours often lie in one plane.
                if self.extra.last() != Some(&above) {
                    self.extra.extend([below, above]);
                }
            }
        }
    }
}

/// Finds the cheapest valid plane for each of the two prices of a step; of equal ones the lowest.
/// `None` when there is no valid plane.
///
/// Valid are planes inside the cell, away from its ends by the profile's margin, and, where the
/// profile has walls and ties are clean, its two end planes where they part the triangles that lie
/// in them from the others.
pub fn sweep(
    scratch: &mut Scratch,
    profile: &Profile,
    pricing: &Pricing<'_>,
    ties: Ties,
) -> [Option<Best>; 2] {
    dispatch!(Level::new(), simd => {
        let mut batch = Batch::new(simd, profile, pricing, ties);
        if scratch.min.len() <= COUNT_LIMIT {
            count(&mut batch, scratch);
        } else {
            sorted(&mut batch, scratch);
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
            self.price();
        }
    }

    #[inline(always)]
    fn finish(mut self) -> [Option<Best>; 2] {
        if self.waiting > 0 {
            self.price();
        }
        self.best
    }

    /// Prices the candidates that wait.
    #[inline(always)]
    fn price(&mut self) {
        let simd = self.simd;
        let splat = |x: f32| f32x8::splat(simd, x);
        let profile = self.profile;
        self.at[self.waiting..].fill(f32::NAN);
        self.waiting = 0;
        let at = f32x8::from_slice(simd, &self.at);
        let [first, second, third, fourth] = self.counts.map(|row| f32x8::from_slice(simd, &row));
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
            for (step, best) in self.pricing.steps.into_iter().zip(&mut self.best) {
                if step == f32::INFINITY {
                    continue;
                }
                let cost = splat(step) + inner;
                let cost = empty.select(cost * splat(costs.empty), cost);
                let limit = best.map_or(f32::INFINITY, |b| b.cost);
                let promising = valid & cost.simd_le(splat(limit));
                if !promising.any_true() {
                    continue;
                }
                let mut rows = [[0.0; 8]; 5];
                for (row, lanes) in rows.iter_mut().zip([
                    promising.select(cost, splat(f32::NAN)),
                    below,
                    above,
                    shares.0,
                    shares.1,
                ]) {
                    lanes.store_slice(row);
                }
                for (lane, &at) in self.at.iter().enumerate() {
                    let [cost, below, above, left, right] = rows.map(|row| row[lane]);
                    let better =
                        best.is_none_or(|b| cost < b.cost || (cost == b.cost && at < b.at));
                    if better && cost < f32::INFINITY {
                        *best = Some(Best {
                            cost,
                            at,
                            touching,
                            shares: [left, right],
                            counts: [below, above],
                        });
                    }
                }
            }
        }
    }
}

/// Counts all triangles against eight candidates at a time.
#[inline(always)]
fn count<S: Simd>(batch: &mut Batch<'_, S>, scratch: &mut Scratch) {
    let simd = batch.simd;
    let Scratch {
        min,
        max,
        extra,
        starts: candidates,
        ..
    } = scratch;
    candidates.clear();
    candidates.extend(min.iter().chain(&*max).chain(&*extra));
    let n = candidates.len();
    candidates.resize(n.next_multiple_of(8), f32::NAN);
    let (zero, one) = (f32x8::splat(simd, 0.0), f32x8::splat(simd, 1.0));
    for chunk in candidates.chunks_exact(8) {
        let at = f32x8::from_slice(simd, chunk);
        let mut sums = [zero; 4];
        for (&min, &max) in min.iter().zip(&*max) {
            let (min, max) = (f32x8::splat(simd, min), f32x8::splat(simd, max));
            let (below, above) = (min.simd_lt(at), max.simd_gt(at));
            match batch.ties {
                Ties::Clean => {
                    sums[0] += below.select(one, zero);
                    sums[1] += above.select(one, zero);
                    sums[2] += (below | above).select(zero, one);
                }
                Ties::StartsFirst => {
                    sums[0] += below.select(one, zero);
                    sums[1] += max.simd_ge(at).select(one, zero);
                    sums[2] += min.simd_le(at).select(one, zero);
                    sums[3] += above.select(one, zero);
                }
            }
        }
        batch.at.copy_from_slice(chunk);
        for (row, sum) in batch.counts.iter_mut().zip(sums) {
            sum.store_slice(row);
        }
        batch.waiting = 8;
        batch.price();
    }
}

/// Merges the sorted ends and keeps running counts.
#[inline(always)]
fn sorted<S: Simd>(batch: &mut Batch<'_, S>, scratch: &mut Scratch) {
    let Scratch {
        min,
        max,
        extra,
        starts,
        ends,
        planar,
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
    for list in [&mut *starts, ends, planar, extra] {
        radsort::sort(list);
    }
    let (mut s, mut e, mut p, mut x) = (0, 0, 0, 0);
    let (mut below, mut above) = (
        0_u32,
        u32::try_from(min.len()).expect("bounded by the scene"),
    );
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn scratch(ends: &[(f32, f32)]) -> Scratch {
        Scratch {
            min: ends.iter().map(|e| e.0).collect(),
            max: ends.iter().map(|e| e.1).collect(),
            ..Scratch::default()
        }
    }

    fn unit() -> Profile {
        let mut profile = Profile::default();
        profile.linear((0.0, 8.0), 0.2, 0.075);
        profile
    }

    fn pricing(costs: &Costs) -> Pricing<'_> {
        Pricing {
            costs,
            steps: [costs.step, f32::INFINITY],
            by_count: false,
        }
    }

    proptest! {
        #[test]
        fn counting_and_sorting_find_the_same_plane(
            ends in prop::collection::vec((0u8..9, 0u8..4), 1..COUNT_LIMIT + 1),
            clean in any::<bool>(),
            thesis in any::<bool>(),
        ) {
            let ends: Vec<_> = ends
                .into_iter()
                .map(|(a, n)| (f32::from(a.min(8)), f32::from((a + n).min(8))))
                .collect();
            let ties = if clean { Ties::Clean } else { Ties::StartsFirst };
            let costs = if thesis { Costs::THESIS } else { Costs::BLOCKS };
            let profile = unit();
            let pricing = pricing(&costs);
            let counted = sweep(&mut scratch(&ends), &profile, &pricing, ties);
            let merged = dispatch!(Level::new(), simd => {
                let mut batch = Batch::new(simd, &profile, &pricing, ties);
                sorted(&mut batch, &mut scratch(&ends));
                batch.finish()
            });
            prop_assert_eq!(counted, merged);
            // The counts behind the cost are those of the classification.
            if let Some(best) = counted[0] {
                let sides = ends.iter().map(|e| best.touching.sides(best.at, e.0, e.1));
                let (left, right) = sides.fold((0.0, 0.0), |(l, r), (a, b)| {
                    (l + f32::from(u8::from(a)), r + f32::from(u8::from(b)))
                });
                prop_assert_eq!(best.cost, costs.split(profile.shares(best.at), (left, right)));
                prop_assert!(ends.iter().all(|e| {
                    let (below, above) = best.touching.sides(best.at, e.0, e.1);
                    below || above
                }), "a triangle was lost");
            }
        }
    }

    #[test]
    fn walls_part_planar_triangles_only() {
        let flat_floor = [(0.0, 0.0), (0.0, 8.0), (0.0, 8.0)];
        let profile = unit();
        let pricing = pricing(&Costs::THESIS);
        let sweep =
            |ends: &[(f32, f32)]| sweep(&mut scratch(ends), &profile, &pricing, Ties::Clean)[0];
        let best = sweep(&flat_floor).unwrap();
        assert_eq!((best.at, best.touching), (0.0, Touching::PlanarBelow));
        let nothing_flat = [(0.0, 8.0), (0.0, 8.0)];
        assert_eq!(sweep(&nothing_flat), None);
    }
}
