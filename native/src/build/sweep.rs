// SPDX-License-Identifier: GPL-3.0-or-later
//! The sweep: the cheapest plane along one direction, tried at every end of every triangle.
//!
//! Few triangles are counted outright, eight candidates at a time; many are sorted first, by radix,
//! so that a build stays within O(n log n) (the bound of Wald and Havran 2006, reached without
//! keeping event lists). Both ways give the same plane, bit for bit.

use super::cell::Profile;
use super::cost::Costs;
use fearless_simd::{Level, Select, Simd, SimdBase, dispatch, f32x8};

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

/// The best plane of a sweep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Best {
    /// Expected cost of the split.
    pub cost: f32,
    /// Height of the plane along the direction.
    pub at: f32,
    /// What happens to triangles that touch it.
    pub touching: Touching,
}

/// Buffers of a sweep, kept between nodes.
#[derive(Debug, Default)]
pub struct Scratch {
    /// Lower ends of the triangles along the direction.
    pub min: Vec<f32>,
    /// Upper ends.
    pub max: Vec<f32>,
    starts: Vec<f32>,
    ends: Vec<f32>,
    planar: Vec<f32>,
}

/// Finds the cheapest valid plane; of equal ones the lowest. `None` when there is no valid plane.
///
/// Valid are planes strictly inside the cell and, with clean ties, its two end planes where they
/// part the triangles that lie in them from the others.
pub fn sweep(scratch: &mut Scratch, profile: &Profile, costs: &Costs, ties: Ties) -> Option<Best> {
    if scratch.min.len() <= COUNT_LIMIT {
        dispatch!(Level::new(), simd => count(simd, scratch, profile, costs, ties))
    } else {
        sorted(scratch, profile, costs, ties)
    }
}

/// The counts of one candidate plane.
#[derive(Clone, Copy)]
struct Counts {
    /// Triangles that reach below the plane.
    below: f32,
    /// Triangles that reach above it.
    above: f32,
    /// With clean ties: triangles in the plane. Otherwise unused.
    planar: f32,
    /// With starts first: below and above if all that touch go below.
    all_below: (f32, f32),
}

/// Prices one candidate plane and keeps it if it is the best so far.
#[inline(always)]
fn consider(
    best: &mut Option<Best>,
    at: f32,
    n: Counts,
    profile: &Profile,
    costs: &Costs,
    ties: Ties,
) {
    let shares = profile.shares(at);
    let inside = profile.low < at && at < profile.high;
    let mut keep = |counts: (f32, f32), touching: Touching| {
        let cost = costs.split(shares, counts);
        let better = best.is_none_or(|b| cost < b.cost || (cost == b.cost && at < b.at));
        if better {
            *best = Some(Best { cost, at, touching });
        }
    };
    match ties {
        Ties::Clean if inside => {
            keep((n.below + n.planar, n.above), Touching::PlanarBelow);
            if n.planar > 0.0 {
                keep((n.below, n.above + n.planar), Touching::PlanarAbove);
            }
        }
        // A wall of the cell: worth a plane only for the triangles that lie in it.
        Ties::Clean if n.planar > 0.0 => {
            if at == profile.low && n.above > 0.0 {
                keep((n.planar, n.above), Touching::PlanarBelow);
            } else if at == profile.high && n.below > 0.0 {
                keep((n.below, n.planar), Touching::PlanarAbove);
            }
        }
        Ties::StartsFirst if inside => {
            keep((n.below, n.above), Touching::AllAbove);
            keep(n.all_below, Touching::AllBelow);
        }
        _ => {}
    }
}

/// Counts all triangles against eight candidates at a time.
#[inline(always)]
fn count<S: Simd>(
    simd: S,
    scratch: &mut Scratch,
    profile: &Profile,
    costs: &Costs,
    ties: Ties,
) -> Option<Best> {
    let n = scratch.min.len();
    let mut candidates = [f32::NAN; 2 * COUNT_LIMIT];
    candidates[..n].copy_from_slice(&scratch.min);
    candidates[n..2 * n].copy_from_slice(&scratch.max);
    let (zero, one) = (f32x8::splat(simd, 0.0), f32x8::splat(simd, 1.0));
    let mut best = None;
    for first in (0..2 * n).step_by(8) {
        let at = f32x8::from_slice(simd, &candidates[first..first + 8]);
        let mut sums = [zero; 4];
        for (&min, &max) in scratch.min.iter().zip(&scratch.max) {
            let (min, max) = (f32x8::splat(simd, min), f32x8::splat(simd, max));
            let (below, above) = (min.simd_lt(at), max.simd_gt(at));
            sums[0] += below.select(one, zero);
            sums[1] += above.select(one, zero);
            match ties {
                Ties::Clean => sums[2] += (below | above).select(zero, one),
                Ties::StartsFirst => {
                    sums[2] += min.simd_le(at).select(one, zero);
                    sums[3] += max.simd_ge(at).select(one, zero);
                }
            }
        }
        let mut rows = [[0.0; 8]; 4];
        for (row, sum) in rows.iter_mut().zip(sums) {
            sum.store_slice(row);
        }
        for lane in 0..8.min(2 * n - first) {
            let [below, above, third, fourth] = rows.map(|row| row[lane]);
            let counts = match ties {
                Ties::Clean => Counts {
                    below,
                    above,
                    planar: third,
                    all_below: (0.0, 0.0),
                },
                Ties::StartsFirst => Counts {
                    below,
                    above: fourth,
                    planar: 0.0,
                    all_below: (third, above),
                },
            };
            consider(
                &mut best,
                candidates[first + lane],
                counts,
                profile,
                costs,
                ties,
            );
        }
    }
    best
}

/// Merges the sorted ends and keeps running counts.
fn sorted(scratch: &mut Scratch, profile: &Profile, costs: &Costs, ties: Ties) -> Option<Best> {
    let Scratch {
        min,
        max,
        starts,
        ends,
        planar,
    } = scratch;
    for list in [&mut *starts, ends, planar] {
        list.clear();
    }
    for (&min, &max) in min.iter().zip(&*max) {
        if ties == Ties::Clean && min == max {
            planar.push(min);
        } else {
            starts.push(min);
            ends.push(max);
        }
    }
    for list in [&mut *starts, ends, planar] {
        radsort::sort(list);
    }
    let mut best = None;
    let (mut s, mut e, mut p) = (0, 0, 0);
    let (mut below, mut above) = (
        0_u32,
        u32::try_from(min.len()).expect("bounded by the scene"),
    );
    let next = |list: &[f32], i: usize| list.get(i).copied().unwrap_or(f32::INFINITY);
    loop {
        let at = next(starts, s).min(next(ends, e)).min(next(planar, p));
        if at == f32::INFINITY {
            return best;
        }
        let run = |list: &[f32], i: &mut usize| {
            let first = *i;
            while next(list, *i) == at {
                *i += 1;
            }
            u32::try_from(*i - first).expect("bounded by the scene")
        };
        let (start, end, flat) = (run(starts, &mut s), run(ends, &mut e), run(planar, &mut p));
        let counts = match ties {
            Ties::Clean => Counts {
                below: below as f32,
                above: (above - end - flat) as f32,
                planar: flat as f32,
                all_below: (0.0, 0.0),
            },
            Ties::StartsFirst => Counts {
                below: below as f32,
                above: above as f32,
                planar: 0.0,
                all_below: ((below + start) as f32, (above - end) as f32),
            },
        };
        consider(&mut best, at, counts, profile, costs, ties);
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

    const UNIT: Profile = Profile {
        low: 0.0,
        high: 8.0,
        constant: 0.2,
        slope: 0.075,
    };

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
            let counted = sweep(&mut scratch(&ends), &UNIT, &costs, ties);
            prop_assert_eq!(counted, sorted(&mut scratch(&ends), &UNIT, &costs, ties));
            // The counts behind the cost are those of the classification.
            if let Some(best) = counted {
                let sides = ends.iter().map(|e| best.touching.sides(best.at, e.0, e.1));
                let (left, right) = sides.fold((0.0, 0.0), |(l, r), (a, b)| {
                    (l + f32::from(u8::from(a)), r + f32::from(u8::from(b)))
                });
                prop_assert_eq!(best.cost, costs.split(UNIT.shares(best.at), (left, right)));
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
        let best = sweep(
            &mut scratch(&flat_floor),
            &UNIT,
            &Costs::THESIS,
            Ties::Clean,
        )
        .unwrap();
        assert_eq!((best.at, best.touching), (0.0, Touching::PlanarBelow));
        let nothing_flat = [(0.0, 8.0), (0.0, 8.0)];
        assert_eq!(
            sweep(
                &mut scratch(&nothing_flat),
                &UNIT,
                &Costs::THESIS,
                Ties::Clean
            ),
            None
        );
    }
}
