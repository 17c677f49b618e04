// SPDX-License-Identifier: GPL-3.0-or-later
//! Filling a packet: rays are scaled into the frame and clipped to the scene's box, 16 lanes at once.

use crate::packet::{MOST, Packet, Sixteen, live, store};
use crate::tile::{self, Deferred, Numbers};
use fearless_simd::{
    Bytes, Select, Simd, SimdBase, SimdFloat, SimdMask, f32x16, mask32x16, u32x16,
};
use halfspace_geom::bound::{keep_max_each, keep_min_each};
use halfspace_ray::columns::ORDINARY;
use halfspace_ray::frame::{AXIS_PAD, Frame, OBLIQUE_PAD, PRUNE, ToFrame, U, last_places};
use halfspace_ray::{Hit, Ray};

/// Centre and half extent of a box of directions. The half extent includes 8 u for the rounding of both:
/// components are below 2, so each of the three operations is off by at most 2 u.
#[inline(always)]
fn middle(low: [f32; 3], high: [f32; 3]) -> [[f32; 3]; 2] {
    let (mut middle, mut half) = ([0.0; 3], [0.0; 3]);
    for k in 0..3 {
        middle[k] = 0.5 * (low[k] + high[k]);
        half[k] = 0.5 * (high[k] - low[k]) + 8.0 * U;
    }
    [middle, half]
}

/// Minimum and maximum of a row over the lanes of the mask.
#[inline(always)]
pub fn ends<S: Simd>(simd: S, lanes: mask32x16<S>, row: f32x16<S>) -> (f32, f32) {
    let none = f32x16::splat(simd, f32::INFINITY);
    let below: f32x16<S> = lanes.select(row, none);
    let above: f32x16<S> = lanes.select(row, -none);
    (below.reduce_min(), above.reduce_max())
}

impl Packet {
    /// Loads the rays at [`Packet::places`] and resets all other state. Returns the mask of rays that meet the
    /// scene's box and of irregular ones. `known`, if given, are hits found before; each ray ends at its own.
    /// Compiled once for all trees.
    #[inline(never)]
    pub fn fill<S: Simd>(
        &mut self,
        simd: S,
        frame: &Frame,
        rays: &[Ray],
        known: Option<&[Hit; MOST]>,
    ) -> u64 {
        simd.vectorize(
            #[inline(always)]
            || self.filled(simd, frame, rays, known),
        )
    }

    /// [`Self::fill`] in the instruction set of the caller.
    #[inline(always)]
    fn filled<S: Simd>(
        &mut self,
        simd: S,
        frame: &Frame,
        rays: &[Ray],
        known: Option<&[Hit; MOST]>,
    ) -> u64 {
        self.blocked = 0;
        self.deferred = Deferred::none();
        self.projections.known = 0;
        let mut there = self.load_rays(simd, frame.map(), rays);
        // In a scaled frame all rays are traced one by one.
        if !frame.is_unscaled() {
            self.odd |= there;
            there = 0;
        }
        if let Some(known) = known {
            for (i, hit) in known.iter().enumerate().take(self.count) {
                if hit.is_hit() {
                    self.set_hit(i, *hit);
                }
            }
        }
        self.odd | self.clip(simd, frame) & there
    }

    /// Loads the regular rays, one per lane, in an unscaled frame, and returns their mask. The other lanes get a ray
    /// that meets nothing.
    #[inline(always)]
    fn load_rays<S: Simd>(&mut self, simd: S, to_frame: &ToFrame, rays: &[Ray]) -> u64 {
        let splat = |x: f32| f32x16::splat(simd, x);
        let count = self.count.min(MOST);
        let filled = (1_u64 << count) - 1;
        let mut places = [self.places[0]; MOST];
        places[..count].copy_from_slice(&self.places[..count]);
        let mut own = Numbers::at(simd, rays, &places);
        let exact = own.translate(simd, to_frame);
        let Numbers { o, d, t_min, t_max } = own;

        // Find the regular rays: finite, with direction and origin in the range where f32 products neither
        // overflow nor vanish, and with an exact origin. The sum detects NaN, which a maximum may drop.
        let sums = (o[0] + o[1] + o[2]) + (d[0] + d[1] + d[2]);
        let longest = d[0].abs().max(d[1].abs()).max(d[2].abs());
        let ordinary = exact
            & sums.abs().simd_lt(splat(f32::INFINITY))
            & longest.simd_ge(splat(ORDINARY.start))
            & longest.simd_lt(splat(ORDINARY.end))
            & (o[0].abs().max(o[1].abs()).max(o[2].abs())).simd_lt(splat(ORDINARY.end))
            & t_min.simd_ge(splat(0.0))
            & t_min.simd_le(t_max);
        let there = ordinary.to_bitmask() & filled;
        self.odd = filled & !there;
        let lanes = mask32x16::from_bitmask(simd, there);

        // Divide each direction by the power of two of its largest component, and reduce the boxes of origins
        // and directions.
        let exponent = u32x16::splat(simd, 0x7f80_0000);
        let unit: f32x16<S> = (longest.bitcast::<u32x16<S>>() & exponent).bitcast();
        let unit: f32x16<S> = lanes.select(unit, splat(1.0));
        let inverse = splat(1.0) / unit;
        let (mut least, mut most) = ([0.0; 3], [0.0; 3]);
        let (mut slowest, mut quickest) = ([0.0; 3], [0.0; 3]);
        let mut signs = u32x16::splat(simd, 0);
        for k in 0..3 {
            let o: f32x16<S> = lanes.select(o[k], splat(0.0));
            let d: f32x16<S> = lanes.select(d[k] * inverse, splat(1.0));
            store::<S, Sixteen>(o, &mut self.o[k]);
            store::<S, Sixteen>(d, &mut self.d[k]);
            (least[k], most[k]) = ends(simd, lanes, o);
            (slowest[k], quickest[k]) = ends(simd, lanes, d);
            signs |= (d.bitcast::<u32x16<S>>() >> 31) << k as u32;
        }
        (signs * u32x16::splat(simd, 0x0101_0101)).store_slice(&mut self.signs);
        store::<S, Sixteen>(unit, &mut self.to_frame);
        let t_min: f32x16<S> = lanes.select(t_min, splat(0.0));
        let t_max: f32x16<S> = lanes.select(t_max, splat(f32::NEG_INFINITY));
        store::<S, Sixteen>(t_min, &mut self.t_min);
        store::<S, Sixteen>(t_max, &mut self.t);
        self.id = [Hit::NONE; MOST];
        self.origins = [least, most];
        self.fan = (least == most).then(|| middle(slowest, quickest));
        there
    }

    /// Clips the rays to the scene's box, as [`Frame::ray`] does, and returns the mask of those that meet it.
    #[inline(always)]
    fn clip<S: Simd>(&mut self, simd: S, frame: &Frame) -> u64 {
        let splat = |x: f32| f32x16::splat(simd, x);
        let bounds = frame.bounds();
        let magnitude = splat(bounds.magnitude());
        let robust = splat(frame.robust());
        let to_frame = tile::load(simd, &self.to_frame);
        let last_place = last_places(simd, to_frame);
        let far = tile::load(simd, &self.o[0])
            .abs()
            .max(tile::load(simd, &self.o[1]).abs())
            .max(tile::load(simd, &self.o[2]).abs());
        let span = far + magnitude;
        let parallel = splat(U) / span;
        let t_min = tile::load(simd, &self.t_min) * to_frame;
        let t_max = tile::load(simd, &self.t) * to_frame;
        let mut near = t_min * splat(2.0 - PRUNE) - last_place;
        let mut exit = t_max * splat(PRUNE) + last_place;
        // Intersect with each slab. A component that moves the ray across the scene by less than u times the
        // error bound is raised to that limit, which keeps its reciprocal finite.
        for k in 0..3 {
            let o = tile::load(simd, &self.o[k]);
            let d = tile::load(simd, &self.d[k]);
            let pad = (o.abs() + magnitude) * splat(AXIS_PAD);
            let slowest = parallel * pad;
            let d = d.abs().simd_lt(slowest).select(slowest.copysign(d), d);
            let inv = splat(1.0) / d;
            let slack = pad * inv.abs();
            let low = (splat(bounds.min[k]) - o) * inv;
            let high = (splat(bounds.max[k]) - o) * inv;
            let back = splat(1.0).copysign(d).simd_lt(splat(0.0));
            // Ignore bounds that are NaN.
            near = keep_max_each(back.select(high, low) - slack, near);
            exit = keep_min_each(back.select(low, high) + slack, exit);
            store::<S, Sixteen>(inv, &mut self.inv[k]);
            store::<S, Sixteen>(slack * robust, &mut self.slack[k]);
        }
        store::<S, Sixteen>(span, &mut self.span);
        store::<S, Sixteen>(span * splat(OBLIQUE_PAD) * robust, &mut self.oblique_pad);
        store::<S, Sixteen>(last_place, &mut self.last_place);
        store::<S, Sixteen>(near, &mut self.start);
        store::<S, Sixteen>(exit, &mut self.reach);
        live::<S, Sixteen>(near, exit)
    }
}
