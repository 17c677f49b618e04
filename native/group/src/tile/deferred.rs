// SPDX-License-Identifier: GPL-3.0-or-later
//! Deferred hits, at most one per ray: hits that f32 has proven, kept until they are known to be the nearest.
//! Exact distances of hits behind others are then never computed, and those of many rays are computed together
//! at the cost of one.

use crate::tile::{LANES, Limits, Quotient, Row, StoredTriangle, Tile, bits, load, splat};
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask, f32x16, mask32x16, u32x16};
use halfspace_ray::Hit;
use halfspace_ray::frame::{PRUNE, U};

/// The deferred hits of `R` rows of rays.
pub struct Deferred<const R: usize> {
    /// Masks of the rays that have one.
    pub lanes: [u16; R],
    /// Numbers of the triangles; [`Hit::NONE`] for rays without a deferred hit.
    pub id: [[u32; LANES]; R],
    /// Position of the triangle's first word in the blocks.
    from: [[u32; LANES]; R],
    /// Distance between its words.
    stride: [[u32; LANES]; R],
    /// Lower bound on the hit's distance in the frame; infinite for rays without one.
    early: [Row; R],
}

impl<const R: usize> Deferred<R> {
    /// No deferred hits.
    #[inline(always)]
    pub fn none() -> Self {
        Self {
            lanes: [0; R],
            id: [[Hit::NONE; LANES]; R],
            from: [[0; LANES]; R],
            stride: [[1; LANES]; R],
            early: [[f32::INFINITY; LANES]; R],
        }
    }

    /// Removes all deferred hits.
    #[inline(always)]
    pub fn clear(&mut self) {
        // Positions of words have no meaning for rays without a hit and may stay.
        self.lanes = [0; R];
        self.id = [[Hit::NONE; LANES]; R];
        self.early = [[f32::INFINITY; LANES]; R];
    }

    /// The triangle of a ray's deferred hit.
    #[inline(always)]
    pub fn triangle(&self, row: usize, lane: usize) -> StoredTriangle {
        StoredTriangle {
            id: self.id[row][lane],
            at: self.from[row][lane] as usize,
            stride: self.stride[row][lane] as usize,
        }
    }

    /// Defers the hits of some rays of a row with a triangle, as far as each certainly lies inside the limits and
    /// is nearer than the ray's deferred hit. Returns the mask of those rays, and upper bounds on their
    /// distances in the frame.
    #[inline(always)]
    pub fn take<S: Simd>(
        &mut self,
        simd: S,
        row: usize,
        lanes: u16,
        distance: &Quotient<S>,
        limits: &Limits<S>,
        triangle: StoredTriangle,
    ) -> (u16, f32x16<S>) {
        let &Quotient {
            t,
            t_error,
            det,
            det_error,
        } = distance;
        let &Limits {
            soonest,
            latest,
            last_place,
        } = limits;
        let inverse = splat(simd, 1.0) / det;
        let distance = t * inverse;
        // Bound the distance. If the denominator exceeds its error 1024 times, as checked below, the quotient is off by
        // at most the sum of both relative errors and 2^-9 of that sum. The roundings of the quotient and of both ends
        // come on top, and the error bound of subnormal distances, so that intervals that do not meet stay apart in the
        // scene.
        let error = distance.mul_add(det_error, t_error) * inverse * splat(simd, 1.01)
            + distance * splat(simd, 16.0 * U)
            + last_place;
        let (early, late) = (distance - error, distance + error);
        let known = load(simd, &self.early[row]);
        let taken = lanes
            & bits(det.simd_gt(det_error * splat(simd, 1024.0)))
            & bits(late.simd_lt(known.min(latest)) & early.simd_gt(soonest));
        if taken == 0 {
            return (0, late);
        }
        let lanes = mask32x16::from_bitmask(simd, u64::from(taken));
        let early: f32x16<S> = lanes.select(early, known);
        early.store_slice(&mut self.early[row]);
        #[expect(
            clippy::cast_possible_truncation,
            reason = "leaf data is bounded by the budget"
        )]
        let words = [triangle.id, triangle.at as u32, triangle.stride as u32];
        for (row, new) in [
            (&mut self.id[row], words[0]),
            (&mut self.from[row], words[1]),
            (&mut self.stride[row], words[2]),
        ] {
            let known = u32x16::from_slice(simd, row);
            let kept: u32x16<S> = lanes.select(u32x16::splat(simd, new), known);
            kept.store_slice(row);
        }
        self.lanes[row] |= taken;
        (taken, late)
    }
}

impl<const R: usize> Tile<R> {
    /// Mask of the rays of a row whose deferred or best hit is this triangle.
    #[inline(always)]
    pub fn has_hit<S: Simd>(&self, simd: S, row: usize, id: u32) -> u16 {
        let id = u32x16::splat(simd, id);
        let best = u32x16::from_slice(simd, &self.id[row]);
        let deferred = u32x16::from_slice(simd, &self.deferred.id[row]);
        bits(best.simd_eq(id) | deferred.simd_eq(id))
    }

    /// Defers the hits of some rays of a row with a triangle, as far as each is certainly inside the ray's
    /// limits and nearer than the ray's deferred hit; returns the mask of those rays.
    #[inline(always)]
    pub fn defer<S: Simd>(
        &mut self,
        simd: S,
        row: usize,
        lanes: u16,
        distance: &Quotient<S>,
        triangle: StoredTriangle,
    ) -> u16 {
        if lanes == 0 {
            return 0;
        }
        let last_place = splat(simd, self.last_place);
        let limits = Limits {
            soonest: load(simd, &self.t_min[row])
                .mul_add(splat(simd, self.to_frame * PRUNE), last_place),
            latest: load(simd, &self.t[row]) * splat(simd, self.to_frame * (2.0 - PRUNE)),
            last_place,
        };
        let (taken, late) = (self.deferred).take(simd, row, lanes, distance, &limits, triangle);
        if taken != 0 {
            let lanes = mask32x16::from_bitmask(simd, u64::from(taken));
            let reach = late.mul_add(splat(simd, PRUNE), last_place);
            let known = load(simd, &self.reach[row]);
            let reach: f32x16<S> = lanes.select(reach.min(known), known);
            reach.store_slice(&mut self.reach[row]);
        }
        taken
    }
}
