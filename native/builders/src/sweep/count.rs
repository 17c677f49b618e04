// SPDX-License-Identifier: GPL-3.0-or-later
//! Sweeps of few triangles: each triangle is compared with sixteen candidate planes at a time, without sorting.

use crate::sweep::{Batch, Scratch, Ties};
use fearless_simd::{Select, Simd, SimdBase, SimdSplit, f32x16};

/// Tries all ends of triangles and the further candidates.
#[inline(always)]
pub fn all<S: Simd>(batch: &mut Batch<'_, S>, scratch: &mut Scratch) {
    let Scratch {
        min,
        max,
        extra,
        starts: candidates,
        ..
    } = scratch;
    candidates.clear();
    candidates.extend(min.iter().chain(&*max).chain(&*extra));
    gathered(batch, scratch);
}

/// Tries the planes that leave one side empty: the lowest and the highest end, and further candidates beyond them.
#[inline(always)]
pub fn hull<S: Simd>(batch: &mut Batch<'_, S>, scratch: &mut Scratch) {
    let (low, high) = scratch.hull();
    let Scratch {
        extra,
        starts: candidates,
        ..
    } = scratch;
    candidates.clear();
    candidates.extend([low, high]);
    candidates.extend(extra.iter().filter(|&&at| at < low || at > high));
    gathered(batch, scratch);
}

/// Tries the heights in `scratch.starts`.
#[inline(always)]
pub fn gathered<S: Simd>(batch: &mut Batch<'_, S>, scratch: &mut Scratch) {
    let Scratch {
        min,
        max,
        starts: candidates,
        ..
    } = scratch;
    let (min, max) = (min.as_slice(), max.as_slice());
    let simd = batch.simd;
    // Fill the last vector with NaN, which no comparison accepts.
    candidates.resize(candidates.len().next_multiple_of(16), f32::NAN);
    let (zero, one) = (f32x16::splat(simd, 0.0), f32x16::splat(simd, 1.0));
    // Count planar triangles only if there are any.
    let flat = batch.ties == Ties::Clean && min.iter().zip(max).any(|(min, max)| min >= max);
    for chunk in candidates.chunks_exact(16) {
        let at = f32x16::from_slice(simd, chunk);
        // Compare each triangle with sixteen candidates. The sums are those that `Batch::price` expects: with clean
        // ties the triangles that extend below, extend above, and lie in the plane; otherwise those that start below,
        // end at or above, start at or below, and end above it.
        let mut sums = [zero; 4];
        for (&min, &max) in min.iter().zip(max) {
            let (min, max) = (f32x16::splat(simd, min), f32x16::splat(simd, max));
            sums[0] += min.simd_lt(at).select(one, zero);
            if batch.ties == Ties::Clean {
                sums[1] += max.simd_gt(at).select(one, zero);
                if flat {
                    sums[2] += (min.simd_lt(at) | max.simd_gt(at)).select(zero, one);
                }
            } else {
                sums[1] += max.simd_ge(at).select(one, zero);
                sums[2] += min.simd_le(at).select(one, zero);
                sums[3] += max.simd_gt(at).select(one, zero);
            }
        }
        // Price both halves. They are written out, because a closure passed to `map` would not be compiled for this
        // instruction set.
        let (low, high) = at.split();
        let [first, second, third, fourth] = sums;
        let (first, second) = (first.split(), second.split());
        let (third, fourth) = (third.split(), fourth.split());
        batch.price(low, [first.0, second.0, third.0, fourth.0]);
        if !chunk[8].is_nan() {
            batch.price(high, [first.1, second.1, third.1, fourth.1]);
        }
    }
}
