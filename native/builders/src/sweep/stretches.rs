// SPDX-License-Identifier: GPL-3.0-or-later
//! Sweeps of dozens of triangles: only ends in stretches of the direction that may contain the cheapest plane
//! are counted.
//!
//! The lower bound is that of [`crate::sweep::bins`]: a plane inside a stretch has at least the triangles below it that
//! start below the stretch, at least those above it that end above the stretch, and parts with at least the
//! surface areas of the parts at the stretch's ends. Sixteen stretches are counted at once, without sorting.

use crate::sweep::{Batch, Scratch, count};
use fearless_simd::{Select, Simd, SimdBase, SimdMask, SimdSplit, f32x8, f32x16};

/// Tries all planes that may be the cheapest.
#[inline(always)]
pub fn search<S: Simd>(batch: &mut Batch<'_, S>, scratch: &mut Scratch) {
    let simd = batch.simd;
    let splat = |x: f32| f32x16::splat(simd, x);
    let (low, high) = hull(simd, scratch);
    let width = (high - low) / 16.0;
    if !(width > 0.0 && width < f32::INFINITY) {
        return count::all(batch, scratch);
    }
    // Divide the range into sixteen stretches of equal width.
    let mut edges = [f32::INFINITY; 17];
    let steps: [f32; 16] = std::array::from_fn(|i| i as f32);
    let starts = splat(low) + splat(width) * f32x16::from_slice(simd, &steps);
    starts.store_slice(&mut edges[..16]);

    // Count the triangles that start below each stretch, and those that end above it.
    let (zero, one) = (splat(0.0), splat(1.0));
    let (mut below, mut beyond) = (zero, zero);
    for (&min, &max) in scratch.min.iter().zip(&scratch.max) {
        below += splat(min).simd_lt(starts).select(one, zero);
        beyond += splat(max).simd_gt(starts).select(one, zero);
    }
    let above = beyond.slide::<1>(zero);
    let least = Least::new(batch, &edges, high, below, above);

    // Count the stretch with the lowest bound first, to tighten the limits for the others.
    let mut open = least.open(batch);
    if open & (open - u32::from(open > 0)) != 0 {
        let first = least.first();
        open &= !(1 << first);
        gather(simd, scratch, edges[first], edges[first + 1]);
        count::gathered(batch, scratch);
        open &= least.open(batch);
    }
    // Count each run of adjacent stretches that may still contain a better plane.
    while open != 0 {
        let first = open.trailing_zeros() as usize;
        let run = (open >> first).trailing_ones() as usize;
        open &= !(((1 << run) - 1) << first);
        gather(simd, scratch, edges[first], edges[first + run]);
        count::gathered(batch, scratch);
        open &= least.open(batch);
    }
}

/// Returns the lowest and the highest candidate height.
#[inline(always)]
fn hull<S: Simd>(simd: S, scratch: &Scratch) -> (f32, f32) {
    let mut low = f32x16::splat(simd, f32::INFINITY);
    let mut high = f32x16::splat(simd, f32::NEG_INFINITY);
    for list in [&scratch.min, &scratch.max, &scratch.extra] {
        // Sixteen heights at a time, then the rest.
        let mut chunks = list.chunks_exact(16);
        for chunk in &mut chunks {
            let at = f32x16::from_slice(simd, chunk);
            (low, high) = (low.min(at), high.max(at));
        }
        for &at in chunks.remainder() {
            let at = f32x16::splat(simd, at);
            (low, high) = (low.min(at), high.max(at));
        }
    }
    (low.reduce_min(), high.reduce_max())
}

/// Collects the candidate heights from `from` on and below `to` in `scratch.starts`.
#[inline(always)]
fn gather<S: Simd>(simd: S, scratch: &mut Scratch, from: f32, to: f32) {
    let Scratch {
        min,
        max,
        extra,
        starts: candidates,
        ..
    } = scratch;
    // Reserve room for all candidates and for the 16 lanes written last; their values do not matter.
    let most = min.len() + max.len() + extra.len() + 16;
    if candidates.len() < most {
        candidates.resize(most, 0.0);
    }
    let (from, to) = (f32x16::splat(simd, from), f32x16::splat(simd, to));
    let mut count = 0;
    for list in [&*min, max, extra] {
        for chunk in list.chunks(16) {
            // Fill an incomplete vector with NaN, which is in no stretch.
            let at = if chunk.len() == 16 {
                f32x16::from_slice(simd, chunk)
            } else {
                let mut last = [f32::NAN; 16];
                last[..chunk.len()].copy_from_slice(chunk);
                f32x16::from_slice(simd, &last)
            };
            let inside = at.simd_ge(from) & at.simd_lt(to);
            // Append the heights in the stretch without branches.
            at.compress(inside)
                .store_slice(&mut candidates[count..count + 16]);
            count += inside.to_bitmask().count_ones() as usize;
        }
    }
    candidates.truncate(count);
}

/// Lower bounds on the costs of sixteen stretches.
struct Least<S: Simd> {
    /// Cost of both children, in two halves of eight.
    inner: [f32x8<S>; 2],
    /// Factor for stretches in which a child may be empty.
    factor: [f32x8<S>; 2],
}

impl<S: Simd> Least<S> {
    /// Bounds the costs of stretches with these edges, the last of which ends at `high`, from the numbers of triangles
    /// below and above each.
    #[inline(always)]
    fn new(
        batch: &Batch<'_, S>,
        edges: &[f32; 17],
        high: f32,
        below: f32x16<S>,
        above: f32x16<S>,
    ) -> Self {
        let (simd, profile, costs) = (batch.simd, batch.profile, batch.pricing.costs);
        let splat = |x: f32| f32x8::splat(simd, x);
        // Margin for the rounding of heights and of edges.
        let extent = profile.high - profile.low;
        let room = splat(1e-5 * extent + f32::EPSILON * profile.low.abs().max(profile.high.abs()));
        let mut ends = *edges;
        ends[16] = high;
        let (below, above) = (below.split(), above.split());
        let (mut inner, mut factor) = ([splat(0.0); 2], [splat(1.0); 2]);
        // A loop, because a closure called twice would not be compiled for this instruction set.
        for (i, (below, above)) in [(below.0, above.0), (below.1, above.1)]
            .into_iter()
            .enumerate()
        {
            let low = f32x8::from_slice(simd, &ends[8 * i..8 * i + 8]);
            let high = f32x8::from_slice(simd, &ends[8 * i + 1..8 * i + 9]);
            // Shares at the stretch's ends bound those of all planes inside.
            let share_below = profile.shares_x8(simd, low - room).0;
            let share_above = profile.shares_x8(simd, high + room).1;
            inner[i] =
                share_below * costs.leaf_x8(simd, below) + share_above * costs.leaf_x8(simd, above);
            let empty = below.simd_eq(splat(0.0)) | above.simd_eq(splat(0.0));
            factor[i] = empty.select(splat(costs.empty), factor[i]);
        }
        Self { inner, factor }
    }

    /// Returns a mask of the stretches that may contain a plane better than the best so far.
    #[inline(always)]
    fn open(&self, batch: &Batch<'_, S>) -> u32 {
        let splat = |x: f32| f32x8::splat(batch.simd, x);
        let mut open = 0;
        for i in 0..2 {
            let step = batch.pricing.steps[i];
            if step == f32::INFINITY {
                continue;
            }
            let limit = batch.best[i].map_or(batch.pricing.limits[i], |b| b.cost);
            // A stretch is open if its bound is within the limit for either cost of a step.
            for half in 0..2 {
                let cost = (splat(step) + self.inner[half]) * self.factor[half];
                // Allow for the rounding of shares and costs.
                let within = (cost * splat(1.0 - 1e-4)).simd_le(splat(limit));
                open |= (within.to_bitmask() as u32) << (8 * half);
            }
        }
        open
    }

    /// Returns the stretch with the lowest bound.
    #[inline(always)]
    fn first(&self) -> usize {
        let [a, b] = self.inner;
        let least = f32x8::splat(a.simd, a.min(b).reduce_min());
        let bits = a.simd_eq(least).to_bitmask() | b.simd_eq(least).to_bitmask() << 8;
        // Costs are never NaN, so one equals the minimum; `min` only bounds the index.
        (bits.trailing_zeros() as usize).min(15)
    }
}
