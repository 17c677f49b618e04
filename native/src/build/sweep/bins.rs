// SPDX-License-Identifier: GPL-3.0-or-later
//! Sweeps of many triangles: the direction is divided into bins, and only bins that may hold the cheapest
//! plane are looked into.
//!
//! A plane inside a bin has at least the triangles below it that start in lower bins, and at least
//! those above it that end in higher bins; its parts have at least the surface that parts at the bin's
//! ends have. So each bin has a least price, and bins are opened in its order until the next is
//! dearer than the best plane so far. The answer is that of sorting everything; what is sorted is
//! usually a few hundredths of it.

use super::{Batch, Scratch, Ties, merge};
use fearless_simd::{Simd, SimdBase, f32x8};

/// Triangles per bin, about, and bins at most.
const PER_BIN: usize = 8;
const MOST: usize = 256;

/// Buffers, kept between sweeps.
#[derive(Debug, Default)]
pub struct Bins {
    /// Starts, ends, planar triangles and further candidates: how many lie in lower bins.
    before: [Vec<u32>; 4],
    /// Their heights, bin by bin.
    sorted: [Vec<f32>; 4],
    /// Least price of the children of each bin.
    least: Vec<f32>,
    order: Vec<u32>,
}

/// Which bin a height lies in. Never decreases with the height, so that heights of different bins
/// compare as their bins do.
#[derive(Clone, Copy)]
struct Ruler {
    low: f32,
    scale: f32,
    last: f32,
}

impl Ruler {
    #[inline(always)]
    fn bin(self, at: f32) -> usize {
        let place = ((at - self.low) * self.scale - 0.5).max(0.0).min(self.last);
        // The nearest whole number is left in the low bits: no conversion that would have to look for overflow.
        const WHOLE: f32 = (1 << 23) as f32;
        (place + WHOLE).to_bits() as usize & 0x3ff
    }
}

/// Tries all planes that may be the cheapest.
#[inline(always)]
pub fn search<S: Simd>(batch: &mut Batch<'_, S>, scratch: &mut Scratch) {
    let (simd, profile, pricing) = (batch.simd, batch.profile, batch.pricing);
    let count = (scratch.min.len() / PER_BIN)
        .clamp(8, MOST)
        .next_multiple_of(8);
    let extent = profile.high - profile.low;
    let scale = count as f32 / extent;
    if !(extent > 0.0 && scale.is_finite()) {
        return super::sorted(batch, scratch);
    }
    let ruler = Ruler {
        low: profile.low,
        scale,
        last: (count - 1) as f32,
    };
    let Scratch {
        min,
        max,
        extra,
        bins,
        ..
    } = scratch;
    let is_planar = |min: f32, max: f32| batch.ties == Ties::Clean && min == max;

    // How many lie in each bin, then below each.
    for before in &mut bins.before {
        before.clear();
        before.resize(count + 1, 0);
    }
    let [starts, ends, planar, further] = &mut bins.before;
    for (&min, &max) in min.iter().zip(&*max) {
        if is_planar(min, max) {
            planar[ruler.bin(min) + 1] += 1;
        } else {
            starts[ruler.bin(min) + 1] += 1;
            ends[ruler.bin(max) + 1] += 1;
        }
    }
    for &at in &*extra {
        further[ruler.bin(at) + 1] += 1;
    }
    for before in &mut bins.before {
        let mut sum = 0;
        for n in before.iter_mut() {
            sum += *n;
            *n = sum;
        }
    }

    // The least price of each bin.
    let [starts, ends, planar, _] = &bins.before;
    let all = starts[count] + planar[count];
    bins.least.clear();
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
        let below = pricing.costs.leaf_x8(simd, f32x8::from_slice(simd, &below));
        let above = pricing.costs.leaf_x8(simd, f32x8::from_slice(simd, &above));
        let mut least = [0.0; 8];
        (share_below * below + share_above * above).store_slice(&mut least);
        bins.least.extend(least);
    }

    // Open them, the most promising first.
    let hopeless = |batch: &Batch<'_, S>, bin: usize| {
        let inner = bins.least[bin];
        let (below, above) = (
            starts[bin] + planar[bin],
            all - ends[bin + 1] - planar[bin + 1],
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
    };
    let filled = |bin: usize| bins.before.iter().any(|b| b[bin] < b[bin + 1]);
    bins.order.clear();
    bins.order.extend(
        (0..count)
            .filter(|&bin| filled(bin) && !hopeless(batch, bin))
            .map(|bin| bin as u32),
    );
    if bins.order.is_empty() {
        return;
    }
    let least = &bins.least;
    bins.order.sort_unstable_by(|&a, &b| {
        least[a as usize]
            .total_cmp(&least[b as usize])
            .then(a.cmp(&b))
    });

    // Only now are the heights put in their bins.
    let mut next: [[u32; MOST]; 4] = [[0; MOST]; 4];
    for ((sorted, before), next) in bins.sorted.iter_mut().zip(&bins.before).zip(&mut next) {
        sorted.clear();
        sorted.resize(before[count] as usize, 0.0);
        next[..count].copy_from_slice(&before[..count]);
    }
    let mut put = |list: usize, at: f32| {
        let place = &mut next[list][ruler.bin(at)];
        bins.sorted[list][*place as usize] = at;
        *place += 1;
    };
    for (&min, &max) in min.iter().zip(&*max) {
        if is_planar(min, max) {
            put(2, min);
        } else {
            put(0, min);
            put(1, max);
        }
    }
    for &at in &*extra {
        put(3, at);
    }
    for &bin in &bins.order {
        let bin = bin as usize;
        if hopeless(batch, bin) {
            continue;
        }
        let [starts, ends, planar, further] = &mut bins.sorted;
        let part = |list: usize| {
            let before = &bins.before[list];
            before[bin] as usize..before[bin + 1] as usize
        };
        let counted = |list: usize| bins.before[list][bin];
        let below = counted(0) + counted(2);
        let above = all - counted(1) - counted(2);
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
