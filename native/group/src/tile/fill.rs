// SPDX-License-Identifier: GPL-3.0-or-later
//! Filling a tile: rays are scaled into the frame and clipped to the scene's box, and their common bounds are
//! computed.

use crate::tile::{
    LANES, Numbers, Pace, Pyramid, Row, Tile, bits, bitwise_equal, load, row_and_lane, splat,
};
use fearless_simd::{Select, Simd, SimdBase, SimdMask, f32x16, mask32x16};
use halfspace_ray::columns::ORDINARY;
use halfspace_ray::frame::{Frame, PRUNE, last_place};
use halfspace_ray::{Hit, Interval, Ray};

impl<const R: usize> Tile<R> {
    /// Loads at least one ray and at most `16 R`, and resets all other state. Compiled once for all trees.
    #[inline(never)]
    pub fn fill<S: Simd>(&mut self, simd: S, frame: &Frame, rays: &[Ray]) {
        simd.vectorize(
            #[inline(always)]
            || self.load_rays(simd, frame, rays),
        );
    }

    /// Sets origin, in the frame, and scale for directions whose largest component is about `longest`.
    #[inline(always)]
    fn set_origin(&mut self, o: [f32; 3], longest: f32) {
        let unit = f32::from_bits(longest.to_bits() & 0x7f80_0000);
        self.o = o;
        self.to_frame = unit;
        self.last_place = last_place(f64::from(unit));
    }

    /// Removes all rays. State without a meaning for an empty tile is left as it is.
    #[inline(always)]
    fn clear(&mut self) {
        self.active = [0; R];
        self.rest = [0; R];
        self.reach = [[f32::NEG_INFINITY; LANES]; R];
        self.row_reach = [f32::NEG_INFINITY; R];
        self.far = f32::NEG_INFINITY;
        self.id = [[Hit::NONE; LANES]; R];
        self.deferred.clear();
        self.blur = [0.0; 2];
        self.inside = Interval::new(0.0, f32::NEG_INFINITY);
        self.pyramid = None;
        self.known = 0;
    }

    /// Loads rays: rows of a full tile as vectors, others ray by ray. Rays with the first one's origin become
    /// active.
    #[inline(always)]
    fn load_rays<S: Simd>(&mut self, simd: S, frame: &Frame, rays: &[Ray]) {
        let first = &rays[0];
        self.clear();
        self.set_origin(frame.point(first.o), largest(first.d));
        if rays.len() == R * LANES {
            for row in 0..R {
                let own = Numbers::of_row(simd, rays, row);
                let same = bitwise_equal(own.o[0], splat(simd, first.o[0]))
                    & bitwise_equal(own.o[1], splat(simd, first.o[1]))
                    & bitwise_equal(own.o[2], splat(simd, first.o[2]));
                self.active[row] = same;
                self.rest[row] = u16::MAX;
                for k in 0..3 {
                    own.d[k].store_slice(&mut self.d[row][k]);
                }
                own.t_min.store_slice(&mut self.t_min[row]);
                own.t_max.store_slice(&mut self.t[row]);
            }
        } else {
            for (i, ray) in rays.iter().enumerate() {
                let (row, lane) = row_and_lane(i);
                let same = (0..3).all(|k| ray.o[k].to_bits() == first.o[k].to_bits());
                self.active[row] |= u16::from(same) << lane;
                self.rest[row] |= 1 << lane;
                for k in 0..3 {
                    self.d[row][k][lane] = ray.d[k];
                }
                self.t_min[row][lane] = ray.t_min;
                self.t[row][lane] = ray.t_max;
            }
        }
        let exact = frame.map().is_exact(self.o);
        if exact && self.is_ordinary(frame) && self.is_half_active(rays.len()) {
            self.set_up(simd, frame);
        } else {
            self.active = [0; R];
        }
    }

    /// A tile of rays from a common origin in the frame to points, which they reach at distance 1. `longest`: largest
    /// component of the directions `d`; `there`: masks of the rays that exist; `active`: masks of those that take
    /// part.
    #[inline(always)]
    pub fn to_points(
        o: [f32; 3],
        longest: f32,
        d: [[Row; 3]; R],
        active: [u16; R],
        there: [u16; R],
    ) -> Self {
        let mut tile = Self::none();
        tile.set_origin(o, longest);
        tile.d = d;
        tile.active = active;
        tile.rest = there;
        tile.t = [[1.0 + 1e-6; LANES]; R];
        tile
    }

    /// Scales a tile of [`Self::to_points`] into the frame; returns the largest difference of its directions relative
    /// to the longest. `None` if they differ too much or are irregular.
    #[inline(always)]
    pub fn scale_into<S: Simd>(&mut self, simd: S, frame: &Frame) -> Option<f32> {
        if !self.is_ordinary(frame) {
            return None;
        }
        self.set_up(simd, frame);
        let pyramid = self.pyramid.as_ref()?;
        // Measure the largest extent of the pyramid's base.
        let mut spread = 0.0_f32;
        for k in 0..3 {
            let at = |i: usize| pyramid.corners[i][k];
            let low = at(0).min(at(1)).min(at(2)).min(at(3));
            let high = at(0).max(at(1)).max(at(2)).max(at(3));
            spread = spread.max(high - low);
        }
        Some(spread)
    }

    /// Whether origin and scale are in the range where nothing overflows.
    #[inline(always)]
    fn is_ordinary(&self, frame: &Frame) -> bool {
        frame.is_unscaled()
            && self.o.iter().all(|x| x.abs() < ORDINARY.end)
            && ORDINARY.contains(&self.to_frame)
    }

    /// Scales the active rays into the frame, clips them to the scene's box and computes the pyramid.
    #[inline(always)]
    fn set_up<S: Simd>(&mut self, simd: S, frame: &Frame) {
        (self.pad, self.oblique_pad) = frame.pads(self.o);
        let blur = self.blur[0];
        // A height changes by at most the blur times the sum of the normal's components, which is 1.74.
        for pad in &mut self.pad {
            *pad += 1.01 * blur;
        }
        self.oblique_pad += 2.0 * blur;
        // Scale the directions, and leave irregular rays in `rest`.
        let ranges = self.scale(simd, self.to_frame);
        for row in 0..R {
            self.rest[row] &= !self.active[row];
        }
        if let Some(ranges) = ranges {
            self.clip(simd, frame, ranges);
            self.pyramid = Pyramid::new(simd, self, ranges);
        }
    }

    /// Scales directions into the frame and deactivates irregular rays. Returns the range of each direction
    /// component over the others, `None` if there are none.
    #[inline(always)]
    fn scale<S: Simd>(&mut self, simd: S, unit: f32) -> Option<[(f32, f32); 3]> {
        let mut low = [splat(simd, f32::INFINITY); 3];
        let mut high = [splat(simd, f32::NEG_INFINITY); 3];
        let inverse = splat(simd, 1.0 / unit);
        for row in 0..R {
            if self.active[row] == 0 {
                continue;
            }
            let [x, y, z] = &self.d[row];
            let d = [load(simd, x), load(simd, y), load(simd, z)];
            let longest = d[0].abs().max(d[1].abs()).max(d[2].abs());
            // Infinity or NaN multiplied by zero is NaN.
            let finite =
                (d[0] * splat(simd, 0.0) + d[1] * splat(simd, 0.0) + d[2] * splat(simd, 0.0))
                    .simd_eq(splat(simd, 0.0));
            let t_min = load(simd, &self.t_min[row]);
            let t_max = load(simd, &self.t[row]);
            // Keep rays of similar direction length and with a valid interval ahead of the origin.
            let fine = finite
                & longest.simd_ge(splat(simd, 0.5 * unit))
                & longest.simd_lt(splat(simd, 2.0 * unit))
                & t_min.simd_ge(splat(simd, 0.0))
                & t_max.simd_ge(t_min);
            self.active[row] &= bits(fine);
            let fine = mask32x16::from_bitmask(simd, u64::from(self.active[row]));
            // Scale the directions and reduce their range.
            for k in 0..3 {
                let d = d[k] * inverse;
                d.store_slice(&mut self.d[row][k]);
                let below: f32x16<S> = fine.select(d, splat(simd, f32::INFINITY));
                let above: f32x16<S> = fine.select(d, splat(simd, f32::NEG_INFINITY));
                low[k] = low[k].min(below);
                high[k] = high[k].max(above);
            }
        }
        let ranges = [
            (low[0].reduce_min(), high[0].reduce_max()),
            (low[1].reduce_min(), high[1].reduce_max()),
            (low[2].reduce_min(), high[2].reduce_max()),
        ];
        (ranges[0].0 <= ranges[0].1).then_some(ranges)
    }

    /// Clips the rays to the scene's box and computes their paces.
    #[inline(always)]
    fn clip<S: Simd>(&mut self, simd: S, frame: &Frame, ranges: [(f32, f32); 3]) {
        let bounds = frame.bounds();
        let (mut enter, mut leave) = (0.0_f32, f32::INFINITY);
        // Bound the interval inside each slab by the fastest and the slowest ray.
        for (k, (low, high)) in ranges.into_iter().enumerate() {
            let pace = |slow: f32, fast: f32| Pace {
                least: if fast > 0.0 { 1.0 / fast } else { f32::MAX },
                most: if slow > 0.0 {
                    1.0 / slow
                } else {
                    f32::INFINITY
                },
            };
            self.pace[k] = [pace(-high, -low), pace(low, high)];
            self.up[k] = low + high > 0.0;
            let [down, up] = self.pace[k];
            let (floor, ceiling) = (bounds.min[k] - self.o[k], bounds.max[k] - self.o[k]);
            let pad = self.pad[k];
            enter = enter
                .max((floor - pad).max(0.0) * up.least)
                .max((-ceiling - pad).max(0.0) * down.least);
            // Rays that do not all move to the same side may stay in the slab without end.
            leave = leave.min(if low > 0.0 {
                (ceiling + pad).max(0.0) * up.most
            } else if high < 0.0 {
                (pad - floor).max(0.0) * down.most
            } else {
                f32::INFINITY
            });
        }
        // Cut each ray's reach at that interval.
        let mut soonest = splat(simd, f32::INFINITY);
        for row in 0..R {
            let active = mask32x16::from_bitmask(simd, u64::from(self.active[row]));
            let t_max = load(simd, &self.t[row]);
            let reach = (t_max * splat(simd, self.to_frame * PRUNE) + splat(simd, self.last_place))
                .min(splat(simd, leave));
            let reach: f32x16<S> = active.select(reach, splat(simd, f32::NEG_INFINITY));
            reach.store_slice(&mut self.reach[row]);
            self.row_reach[row] = reach.reduce_max();
            self.far = self.far.max(self.row_reach[row]);
            let t_min = load(simd, &self.t_min[row]);
            let t_min: f32x16<S> = active.select(t_min, splat(simd, f32::INFINITY));
            soonest = soonest.min(t_min);
        }
        let soonest = soonest.reduce_min() * (self.to_frame * (2.0 - PRUNE)) - self.last_place;
        self.inside = Interval::new(enter.max(soonest), leave.min(self.far));
    }
}

#[inline(always)]
fn largest(a: [f32; 3]) -> f32 {
    a[0].abs().max(a[1].abs()).max(a[2].abs())
}
