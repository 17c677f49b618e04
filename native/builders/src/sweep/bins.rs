// SPDX-License-Identifier: GPL-3.0-or-later
//! Sweeps of many triangles: the direction is divided into bins, and only the triangles of bins that may contain the
//! cheapest plane are sorted.
//!
//! Below a plane inside a bin are at least the triangles that start in lower bins, above it at least those that end in
//! higher bins. The part below has at least the surface area of the part below the bin, and the part above likewise.
//! This gives a lower bound on the costs of each bin. Bins are searched in ascending order of the bound until it
//! exceeds the best cost so far. The result equals that of sorting all triangles, but usually only a few hundredths are
//! sorted.

use crate::sweep::{Batch, Profile, Scratch, Ties, merge};
use fearless_simd::{Simd, SimdBase, f32x8};

/// Approximate number of triangles per bin (chosen).
const PER_BIN: usize = 8;

/// Largest number of bins (chosen).
const MOST: usize = 256;

/// Index of the list of lower ends of triangles.
const STARTS: usize = 0;

/// Index of the list of upper ends of triangles.
const ENDS: usize = 1;

/// Index of the list of triangles that lie in a plane.
const PLANAR: usize = 2;

/// Index of the list of further candidates.
const EXTRA: usize = 3;

/// Buffers, reused between sweeps.
#[derive(Debug, Default)]
pub struct Bins {
    table: Table,
    /// Heights of each list of the table, sorted by bin.
    sorted: [Vec<f32>; 4],
    /// Bins in the order in which they are searched.
    order: Vec<u32>,
}

/// Counts and lower bounds of the bins, computed before any is searched.
#[derive(Debug, Default)]
struct Table {
    /// For the lists [`STARTS`], [`ENDS`], [`PLANAR`] and [`EXTRA`], the number of entries in bins lower than each.
    before: [Vec<u32>; 4],
    /// Lower bound on the cost of the children, per bin.
    least: Vec<f32>,
}

/// Map from heights to bins. It is monotonic: heights in different bins compare as their bins do.
#[derive(Clone, Copy)]
struct Ruler {
    low: f32,
    scale: f32,
    last: f32,
    /// Number of bins.
    count: usize,
}

impl Ruler {
    /// Makes the map for this number of triangles; `None` if the cell's extent is too small.
    #[inline(always)]
    fn new(profile: &Profile, triangles: usize) -> Option<Self> {
        let count = (triangles / PER_BIN).clamp(8, MOST).next_multiple_of(8);
        let extent = profile.high - profile.low;
        let scale = count as f32 / extent;
        (extent > 0.0 && scale.is_finite()).then_some(Self {
            low: profile.low,
            scale,
            last: (count - 1) as f32,
            count,
        })
    }

    /// Returns the bin of a height.
    #[inline(always)]
    fn bin(self, at: f32) -> usize {
        let position = ((at - self.low) * self.scale - 0.5).max(0.0).min(self.last);
        // Adding 2^23 leaves the nearest integer in the low bits, without a conversion that checks for overflow.
        const WHOLE: f32 = (1 << 23) as f32;
        (position + WHOLE).to_bits() as usize & 0x3ff
    }
}

/// The heights of a sweep.
#[derive(Clone, Copy)]
struct Heights<'a> {
    min: &'a [f32],
    max: &'a [f32],
    extra: &'a [f32],
    ties: Ties,
}

impl Heights<'_> {
    /// Returns whether a triangle with these ends counts as lying in one plane.
    #[inline(always)]
    fn is_planar(self, min: f32, max: f32) -> bool {
        self.ties == Ties::Clean && min == max
    }
}

/// Tries all planes that may be the cheapest.
#[inline(always)]
pub fn search<S: Simd>(batch: &mut Batch<'_, S>, scratch: &mut Scratch) {
    let Some(ruler) = Ruler::new(batch.profile, scratch.min.len()) else {
        return crate::sweep::sorted(batch, scratch);
    };
    let heights = Heights {
        min: &scratch.min,
        max: &scratch.max,
        extra: &scratch.extra,
        ties: batch.ties,
    };
    // Bound the cost of each bin.
    let Bins {
        table,
        sorted,
        order,
    } = &mut scratch.bins;
    table.count(heights, ruler);
    table.price(batch, ruler);

    // Sort the bins by their lower bounds, without those that cannot improve on the best plane.
    order.clear();
    order.extend(
        (0..ruler.count)
            .filter(|&bin| table.filled(bin) && !table.hopeless(batch, bin))
            .map(|bin| bin as u32),
    );
    if order.is_empty() {
        return;
    }
    let least = &table.least;
    order.sort_unstable_by(|&a, &b| {
        least[a as usize]
            .total_cmp(&least[b as usize])
            .then(a.cmp(&b))
    });

    // Sort the heights into bins, and search the bins.
    fill(sorted, &table.before, heights, ruler);
    for &bin in &*order {
        let bin = bin as usize;
        if !table.hopeless(batch, bin) {
            table.search(batch, sorted, bin);
        }
    }
}

impl Table {
    /// Counts the heights in each bin, then accumulates them to the numbers below each bin.
    #[inline(always)]
    fn count(&mut self, heights: Heights<'_>, ruler: Ruler) {
        for before in &mut self.before {
            before.clear();
            before.resize(ruler.count + 1, 0);
        }
        // Count the heights of each list per bin.
        let [starts, ends, planar, further] = &mut self.before;
        for (&min, &max) in heights.min.iter().zip(heights.max) {
            if heights.is_planar(min, max) {
                planar[ruler.bin(min) + 1] += 1;
            } else {
                starts[ruler.bin(min) + 1] += 1;
                ends[ruler.bin(max) + 1] += 1;
            }
        }
        for &at in heights.extra {
            further[ruler.bin(at) + 1] += 1;
        }
        // Accumulate the numbers in lower bins.
        for before in &mut self.before {
            let mut sum = 0;
            for n in before.iter_mut() {
                sum += *n;
                *n = sum;
            }
        }
    }

    /// Returns the number of triangles.
    #[inline(always)]
    fn all(&self) -> u32 {
        let [starts, _, planar, _] = &self.before;
        starts[starts.len() - 1] + planar[planar.len() - 1]
    }

    /// Returns whether a bin contains a candidate.
    #[inline(always)]
    fn filled(&self, bin: usize) -> bool {
        self.before.iter().any(|b| b[bin] < b[bin + 1])
    }

    /// Computes the lower bound of each bin, eight bins at a time.
    #[inline(always)]
    fn price<S: Simd>(&mut self, batch: &Batch<'_, S>, ruler: Ruler) {
        let (simd, profile, costs) = (batch.simd, batch.profile, batch.pricing.costs);
        let (all, count) = (self.all(), ruler.count);
        let extent = profile.high - profile.low;
        let [starts, ends, planar, _] = &self.before;
        self.least.clear();
        for first in (0..count).step_by(8) {
            let (mut low, mut below, mut above) = ([0.0; 8], [0.0; 8], [0.0; 8]);
            // Compute the lower ends of eight bins, and the least numbers of triangles below and above their planes.
            for lane in 0..8 {
                let bin = first + lane;
                low[lane] = profile.low + extent * (bin as f32 / count as f32);
                below[lane] = (starts[bin] + planar[bin]) as f32;
                above[lane] = (all - ends[bin + 1] - planar[bin + 1]) as f32;
            }
            // Widen the bins by a margin for the rounding of shares.
            let room = f32x8::splat(simd, 1e-5 * extent);
            let low = f32x8::from_slice(simd, &low);
            let high = low + f32x8::splat(simd, extent / count as f32);
            let share_below = profile.shares_x8(simd, low - room).0;
            let share_above = profile.shares_x8(simd, high + room).1;
            let below = costs.leaf_x8(simd, f32x8::from_slice(simd, &below));
            let above = costs.leaf_x8(simd, f32x8::from_slice(simd, &above));
            let mut least = [0.0; 8];
            (share_below * below + share_above * above).store_slice(&mut least);
            self.least.extend(least);
        }
    }

    /// Returns whether no plane of a bin can be cheaper than the best so far.
    #[inline(always)]
    fn hopeless<S: Simd>(&self, batch: &Batch<'_, S>, bin: usize) -> bool {
        let pricing = batch.pricing;
        let [starts, ends, planar, _] = &self.before;
        let inner = self.least[bin];
        let (below, above) = (
            starts[bin] + planar[bin],
            self.all() - ends[bin + 1] - planar[bin + 1],
        );
        // The bonus for an empty child lowers the bound.
        let factor = if below == 0 || above == 0 {
            pricing.costs.empty
        } else {
            1.0
        };
        (0..2).all(|i| {
            let limit = batch.best[i].map_or(pricing.limits[i], |b| b.cost);
            let cost = (pricing.steps[i] + inner) * factor;
            // Allow for the rounding of shares and costs.
            pricing.steps[i] == f32::INFINITY || cost * (1.0 - 1e-4) > limit
        })
    }

    /// Tries the planes of a bin.
    #[inline(always)]
    fn search<S: Simd>(&self, batch: &mut Batch<'_, S>, sorted: &mut [Vec<f32>; 4], bin: usize) {
        let [starts, ends, planar, further] = sorted;
        let part = |list: usize| {
            let before = &self.before[list];
            before[bin] as usize..before[bin + 1] as usize
        };
        let counted = |list: usize| self.before[list][bin];
        // Count the triangles below and above the bin's lower end, then merge its range of each list.
        let below = counted(STARTS) + counted(PLANAR);
        let above = self.all() - counted(ENDS) - counted(PLANAR);
        merge(
            batch,
            [
                &mut starts[part(STARTS)],
                &mut ends[part(ENDS)],
                &mut planar[part(PLANAR)],
                &mut further[part(EXTRA)],
            ],
            below,
            above,
        );
        batch.flush();
    }
}

/// Sorts the heights into bins; `before` holds the offset of each bin in each list.
#[inline(always)]
fn fill(sorted: &mut [Vec<f32>; 4], before: &[Vec<u32>; 4], heights: Heights<'_>, ruler: Ruler) {
    let count = ruler.count;
    // Start with the first slot of each bin and list.
    let mut next: [[u32; MOST]; 4] = [[0; MOST]; 4];
    for ((sorted, before), next) in sorted.iter_mut().zip(before).zip(&mut next) {
        sorted.clear();
        sorted.resize(before[count] as usize, 0.0);
        next[..count].copy_from_slice(&before[..count]);
    }
    // Put each height into the next free slot of its bin.
    let mut put = |list: usize, at: f32| {
        let slot = &mut next[list][ruler.bin(at)];
        sorted[list][*slot as usize] = at;
        *slot += 1;
    };
    for (&min, &max) in heights.min.iter().zip(heights.max) {
        if heights.is_planar(min, max) {
            put(PLANAR, min);
        } else {
            put(STARTS, min);
            put(ENDS, max);
        }
    }
    for &at in heights.extra {
        put(EXTRA, at);
    }
}
