// SPDX-License-Identifier: GPL-3.0-or-later
//! Sweeps of many triangles: the direction is divided into bins, and only bins that may hold the cheapest
//! plane are looked into.
//!
//! A plane inside a bin has at least the triangles below it that start in lower bins, and at least
//! those above it that end in higher bins; its parts have at least the surface that parts at the bin's
//! ends have. So each bin has a least price, and bins are opened in its order until the next is
//! dearer than the best plane so far. The answer is that of sorting everything; what is sorted is
//! usually a few hundredths of it.

use super::{Batch, Profile, Scratch, Ties, merge};
use fearless_simd::{Simd, SimdBase, f32x8};

/// Triangles per bin, about, and bins at most.
const PER_BIN: usize = 8;
const MOST: usize = 256;

/// Buffers, kept between sweeps.
#[derive(Debug, Default)]
pub struct Bins {
    table: Table,
    /// Heights by list as in the table, bin by bin.
    sorted: [Vec<f32>; 4],
    order: Vec<u32>,
}

/// What is known of the bins before one of them is opened.
#[derive(Debug, Default)]
struct Table {
    /// Starts, ends, planar triangles and further candidates: how many lie in lower bins.
    before: [Vec<u32>; 4],
    /// Least price of the children of each bin.
    least: Vec<f32>,
}

/// Which bin a height lies in. Never decreases with the height, so that heights of different bins
/// compare as their bins do.
#[derive(Clone, Copy)]
struct Ruler {
    low: f32,
    scale: f32,
    last: f32,
    /// How many bins there are.
    count: usize,
}

impl Ruler {
    /// Bins for so many triangles; `None` where the direction is too short for any.
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

    #[inline(always)]
    fn bin(self, at: f32) -> usize {
        let place = ((at - self.low) * self.scale - 0.5).max(0.0).min(self.last);
        // The nearest whole number is left in the low bits: no conversion that would have to look for overflow.
        const WHOLE: f32 = (1 << 23) as f32;
        (place + WHOLE).to_bits() as usize & 0x3ff
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
    /// Whether a triangle with these ends counts as lying in one plane.
    #[inline(always)]
    fn is_planar(self, min: f32, max: f32) -> bool {
        self.ties == Ties::Clean && min == max
    }
}

/// Tries all planes that may be the cheapest.
#[inline(always)]
pub fn search<S: Simd>(batch: &mut Batch<'_, S>, scratch: &mut Scratch) {
    let Some(ruler) = Ruler::new(batch.profile, scratch.min.len()) else {
        return super::sorted(batch, scratch);
    };
    let heights = Heights {
        min: &scratch.min,
        max: &scratch.max,
        extra: &scratch.extra,
        ties: batch.ties,
    };
    let Bins {
        table,
        sorted,
        order,
    } = &mut scratch.bins;
    table.count(heights, ruler);
    table.price(batch, ruler);

    // Open them, the most promising first.
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

    // Only now are the heights put in their bins.
    fill(sorted, &table.before, heights, ruler);
    for &bin in &*order {
        let bin = bin as usize;
        if !table.hopeless(batch, bin) {
            table.open(batch, sorted, bin);
        }
    }
}

impl Table {
    /// How many heights lie in each bin, then below each.
    #[inline(always)]
    fn count(&mut self, heights: Heights<'_>, ruler: Ruler) {
        for before in &mut self.before {
            before.clear();
            before.resize(ruler.count + 1, 0);
        }
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
        for before in &mut self.before {
            let mut sum = 0;
            for n in before.iter_mut() {
                sum += *n;
                *n = sum;
            }
        }
    }

    /// How many triangles there are.
    #[inline(always)]
    fn all(&self) -> u32 {
        let [starts, _, planar, _] = &self.before;
        starts[starts.len() - 1] + planar[planar.len() - 1]
    }

    /// Whether there is a candidate in a bin.
    #[inline(always)]
    fn filled(&self, bin: usize) -> bool {
        self.before.iter().any(|b| b[bin] < b[bin + 1])
    }

    /// The least price of each bin.
    #[inline(always)]
    fn price<S: Simd>(&mut self, batch: &Batch<'_, S>, ruler: Ruler) {
        let (simd, profile, costs) = (batch.simd, batch.profile, batch.pricing.costs);
        let (all, count) = (self.all(), ruler.count);
        let extent = profile.high - profile.low;
        let [starts, ends, planar, _] = &self.before;
        self.least.clear();
        for first in (0..count).step_by(8) {
            let (mut low, mut below, mut above) = ([0.0; 8], [0.0; 8], [0.0; 8]);
            for lane in 0..8 {
                let bin = first + lane;
                low[lane] = profile.low + extent * (bin as f32 / count as f32);
                below[lane] = (starts[bin] + planar[bin]) as f32;
                above[lane] = (all - ends[bin + 1] - planar[bin + 1]) as f32;
            }
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

    /// Whether no plane of a bin can be cheaper than the best so far.
    #[inline(always)]
    fn hopeless<S: Simd>(&self, batch: &Batch<'_, S>, bin: usize) -> bool {
        let pricing = batch.pricing;
        let [starts, ends, planar, _] = &self.before;
        let inner = self.least[bin];
        let (below, above) = (
            starts[bin] + planar[bin],
            self.all() - ends[bin + 1] - planar[bin + 1],
        );
        let factor = if below == 0 || above == 0 {
            pricing.costs.empty
        } else {
            1.0
        };
        (0..2).all(|i| {
            let limit = batch.best[i].map_or(pricing.limits[i], |b| b.cost);
            let cost = (pricing.steps[i] + inner) * factor;
            // All but the rounding of shares and prices.
            pricing.steps[i] == f32::INFINITY || cost * (1.0 - 1e-4) > limit
        })
    }

    /// Tries the planes of a bin.
    #[inline(always)]
    fn open<S: Simd>(&self, batch: &mut Batch<'_, S>, sorted: &mut [Vec<f32>; 4], bin: usize) {
        let [starts, ends, planar, further] = sorted;
        let part = |list: usize| {
            let before = &self.before[list];
            before[bin] as usize..before[bin + 1] as usize
        };
        let counted = |list: usize| self.before[list][bin];
        let below = counted(0) + counted(2);
        let above = self.all() - counted(1) - counted(2);
        merge(
            batch,
            [
                &mut starts[part(0)],
                &mut ends[part(1)],
                &mut planar[part(2)],
                &mut further[part(3)],
            ],
            (below, above),
        );
        batch.flush();
    }
}

/// Puts the heights in their bins, of which `before` says where they begin.
#[inline(always)]
fn fill(sorted: &mut [Vec<f32>; 4], before: &[Vec<u32>; 4], heights: Heights<'_>, ruler: Ruler) {
    let count = ruler.count;
    let mut next: [[u32; MOST]; 4] = [[0; MOST]; 4];
    for ((sorted, before), next) in sorted.iter_mut().zip(before).zip(&mut next) {
        sorted.clear();
        sorted.resize(before[count] as usize, 0.0);
        next[..count].copy_from_slice(&before[..count]);
    }
    let mut put = |list: usize, at: f32| {
        let place = &mut next[list][ruler.bin(at)];
        sorted[list][*place as usize] = at;
        *place += 1;
    };
    for (&min, &max) in heights.min.iter().zip(heights.max) {
        if heights.is_planar(min, max) {
            put(2, min);
        } else {
            put(0, min);
            put(1, max);
        }
    }
    for &at in heights.extra {
        put(3, at);
    }
}
