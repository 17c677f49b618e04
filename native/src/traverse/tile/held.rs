// SPDX-License-Identifier: GPL-3.0-or-later
//! Hits of which f32 is certain, one a ray, held back until it is known that they are the nearest: exact
//! distances of hits behind others need not be worked out, and those of many rays take as long together as
//! that of one.

use super::super::frame::{PRUNE, U};
use super::super::ray::Hit;
use super::{LANES, Row, Tile, bits, load, splat};
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask, f32x16, mask32x16, u32x16};

/// The hits held back by the rays of `R` rows.
pub struct Held<const R: usize> {
    /// Which rays hold one.
    pub lanes: [u16; R],
    /// The triangles, of rays without one [`Hit::NONE`].
    pub id: [[u32; LANES]; R],
    /// Where their words begin.
    from: [[u32; LANES]; R],
    /// How far apart they are.
    stride: [[u32; LANES]; R],
    /// No such hit is nearer than this, in the frame; infinite for rays without one.
    early: [Row; R],
}

impl<const R: usize> Held<R> {
    /// None at all.
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

    /// Lets go of all.
    #[inline(always)]
    pub fn clear(&mut self) {
        // Where words begin is of no meaning for rays without a hit.
        self.lanes = [0; R];
        self.id = [[Hit::NONE; LANES]; R];
        self.early = [[f32::INFINITY; LANES]; R];
    }

    /// Where the words of the triangle begin whose hit a ray holds back, and how far apart they are.
    #[inline(always)]
    pub fn words(&self, row: usize, lane: usize) -> (usize, usize) {
        (
            self.from[row][lane] as usize,
            self.stride[row][lane] as usize,
        )
    }

    /// Takes the hits of these rays of a row with a triangle, as far as they certainly lie between the rays' first two
    /// `limits` and are nearer than what else is held; the third is the last place of a distance. Returns those
    /// rays, and distances in the frame that are no smaller than theirs.
    #[inline(always)]
    pub fn take<S: Simd>(
        &mut self,
        simd: S,
        (row, lanes): (usize, u16),
        [t, t_error, det, det_error]: [f32x16<S>; 4],
        [soonest, latest, last_place]: [f32x16<S>; 3],
        (id, from, stride): (u32, usize, usize),
    ) -> (u16, f32x16<S>) {
        let inverse = splat(simd, 1.0) / det;
        let distance = t * inverse;
        // With a denominator so much larger than its error the quotient is off by at most the sum of both
        // errors in parts, and 2^-9 of it; its roundings, and those of the ends, come on top. So do
        // the last places of two distances in the scene: those of ends that do not meet differ.
        let error = distance.mul_add(det_error, t_error) * inverse * splat(simd, 1.01)
            + distance * splat(simd, 16.0 * U)
            + last_place;
        let (early, late) = (distance - error, distance + error);
        let held = load(simd, &self.early[row]);
        let taken = lanes
            & bits(det.simd_gt(det_error * splat(simd, 1024.0)))
            & bits(late.simd_lt(held.min(latest)) & early.simd_gt(soonest));
        if taken == 0 {
            return (0, late);
        }
        let lanes = mask32x16::from_bitmask(simd, u64::from(taken));
        let early: f32x16<S> = lanes.select(early, held);
        early.store_slice(&mut self.early[row]);
        #[expect(
            clippy::cast_possible_truncation,
            reason = "leaf data is bounded by the budget"
        )]
        let words = [id, from as u32, stride as u32];
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
    /// The rays of a row that hold back a hit with this triangle, or have one as their best.
    #[inline(always)]
    pub fn met<S: Simd>(&self, simd: S, row: usize, id: u32) -> u16 {
        let id = u32x16::splat(simd, id);
        let best = u32x16::from_slice(simd, &self.id[row]);
        let held = u32x16::from_slice(simd, &self.held.id[row]);
        bits(best.simd_eq(id) | held.simd_eq(id))
    }

    /// Holds back the hits of these rays of a row with a triangle, as far as they are certainly inside the
    /// rays' limits and nearer than what else is held back; returns those rays. `quotient`: the distance in the
    /// frame as numerator and denominator, each with a bound on its error. `words`: the triangle's number, and where
    /// its words are.
    #[inline(always)]
    pub fn hold<S: Simd>(
        &mut self,
        simd: S,
        (row, lanes): (usize, u16),
        quotient: [f32x16<S>; 4],
        words: (u32, usize, usize),
    ) -> u16 {
        if lanes == 0 {
            return 0;
        }
        let last_place = splat(simd, self.last_place);
        let soonest =
            load(simd, &self.t_min[row]).mul_add(splat(simd, self.to_frame * PRUNE), last_place);
        let latest = load(simd, &self.t[row]) * splat(simd, self.to_frame * (2.0 - PRUNE));
        let limits = [soonest, latest, last_place];
        let (taken, late) = self.held.take(simd, (row, lanes), quotient, limits, words);
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
