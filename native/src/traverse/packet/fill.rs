// SPDX-License-Identifier: GPL-3.0-or-later
//! How rays get into a packet: brought into the frame and to the scene's box, all at once.

use super::super::bound::{keep_max_each, keep_min_each};
use super::super::frame::{AXIS_PAD, Frame, OBLIQUE_PAD, PRUNE, U, last_places};
use super::super::ray::{Hit, Ray};
use super::super::tile::{self, Held, ORDINARY};
use super::{MOST, Packet, Sixteen, live, store};
use crate::geom::vec3::map;
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, f32x16};

/// The middle of a box of directions, and half its extent with what rounding may add.
#[inline(always)]
fn middle(low: [f32; 3], high: [f32; 3]) -> [[f32; 3]; 2] {
    let (mut middle, mut half) = ([0.0; 3], [0.0; 3]);
    for k in 0..3 {
        middle[k] = 0.5 * (low[k] + high[k]);
        half[k] = 0.5 * (high[k] - low[k]) + 8.0 * U;
    }
    [middle, half]
}

impl Packet {
    /// Takes the rays at the packet's places, and forgets all others. `known` are the best hits that they have
    /// already, if there are any; rays end there. Returns those that enter the scene. One function for all trees.
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

    #[inline(always)]
    fn filled<S: Simd>(
        &mut self,
        simd: S,
        frame: &Frame,
        rays: &[Ray],
        known: Option<&[Hit; MOST]>,
    ) -> u64 {
        self.blocked = 0;
        self.held = Held::none();
        let mut there = self.take(rays);
        if !frame.is_scene() {
            self.odd |= there;
            there = 0;
        }
        if let Some(known) = known {
            for (i, hit) in known.iter().enumerate().take(self.count) {
                if hit.is_hit() {
                    self.know(i, *hit);
                }
            }
        }
        self.odd | self.cut(simd, frame) & there
    }

    /// Takes what is ordinary of the rays, a lane each; returns those lanes.
    #[inline(always)]
    fn take(&mut self, rays: &[Ray]) -> u64 {
        let nowhere = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        let ((mut least, mut most), (mut slowest, mut quickest)) = (nowhere, nowhere);
        let mut there = 0;
        self.odd = 0;
        for i in 0..self.count.min(MOST) {
            let ray = &rays[self.places[i]];
            let size = |v: [f32; 3]| v[0].abs().max(v[1].abs()).max(v[2].abs());
            // A maximum forgets what is not a number, a sum does not.
            let sums = (ray.o[0] + ray.o[1] + ray.o[2]) + (ray.d[0] + ray.d[1] + ray.d[2]);
            let longest = size(ray.d);
            let ordinary = sums.abs() < f32::INFINITY
                && ORDINARY.contains(&longest)
                && size(ray.o) < ORDINARY.end
                && 0.0 <= ray.t_min
                && ray.t_min <= ray.t_max;
            if !ordinary {
                self.odd |= 1 << i;
                self.id[i] = Hit::NONE;
                continue;
            }
            there |= 1 << i;
            let unit = f32::from_bits(longest.to_bits() & 0x7f80_0000);
            let inverse = 1.0 / unit;
            for k in 0..3 {
                self.o[k][i] = ray.o[k];
                self.d[k][i] = ray.d[k] * inverse;
                least[k] = least[k].min(ray.o[k]);
                most[k] = most[k].max(ray.o[k]);
                slowest[k] = slowest[k].min(self.d[k][i]);
                quickest[k] = quickest[k].max(self.d[k][i]);
            }
            let [x, y, z] = map(ray.d, |d| d.to_bits() >> 31);
            self.signs[i] = 0x0101_0101 * (x | y << 1 | z << 2);
            self.to_frame[i] = unit;
            self.t_min[i] = ray.t_min;
            self.t[i] = ray.t_max;
            self.id[i] = Hit::NONE;
        }
        self.origins = [least, most];
        self.fan = (least == most).then(|| middle(slowest, quickest));
        there
    }

    /// Cuts the rays to the scene's box, as [`Frame::ray`] does; returns those that meet it.
    #[inline(always)]
    fn cut<S: Simd>(&mut self, simd: S, frame: &Frame) -> u64 {
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
            // What is not a number bounds nothing.
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
