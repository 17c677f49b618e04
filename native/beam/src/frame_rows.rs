// SPDX-License-Identifier: GPL-3.0-or-later
//! The rays of a beam in the frame of the scene: the results of [`Frame::ray`] in rows for up to 64 rays,
//! computed eight at a time with the same operations as for one.

use crate::bundle::{LANES, RAYS, Row, Rows, all, load};
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask, f32x8};
use halfspace_geom::bound::keep_min;
use halfspace_geom::vec3::map;
use halfspace_leaf::Job;
use halfspace_ray::frame::{AXIS_PAD, Frame, U};
use halfspace_ray::query::{Best, Closest, Counters};
use halfspace_ray::{Ray, RayRef, RaySlice};

/// A triangle that the f32 test does not reject.
#[derive(Clone, Copy)]
pub struct Candidate {
    /// Its number.
    pub id: u32,
    /// Its vertices in the frame.
    pub corners: [[f32; 3]; 3],
}

/// Up to 64 rays in the frame, one row per quantity.
pub struct FrameRows {
    /// Origins and directions.
    pub rays: Rows,
    /// Reciprocal directions.
    pub inv: [Row; 3],
    /// Distance at which each ray enters the scene's box, or begins inside it.
    pub enter: Row,
    /// Distance at which each ray leaves the box, or ends inside it.
    pub reach: Row,
    /// Mask of the rays that may hit the scene.
    pub live: u64,
    /// Mask of the rays whose origin the frame rounds: bounds for common origins do not hold for them.
    pub blurred: u64,
    /// Mask of the rays whose direction has its sign bit set, per axis.
    pub negative: [u64; 3],
}

impl FrameRows {
    /// Storage without rays.
    pub fn blank() -> Self {
        Self {
            rays: Rows::blank(),
            inv: [[0.0; RAYS]; 3],
            enter: [0.0; RAYS],
            reach: [0.0; RAYS],
            live: 0,
            blurred: 0,
            negative: [0; 3],
        }
    }

    /// Replaces all rays by up to 64 new ones.
    #[inline(always)]
    pub fn fill<S: Simd>(&mut self, simd: S, frame: &Frame, rays: &[Ray]) {
        let (mut plain, mut odd) = (0_u64, 0_u64);
        // Scale the directions of ordinary rays; the others (`odd`) take the slow path below.
        for (i, ray) in rays.iter().enumerate() {
            match frame.unit_of(ray) {
                Some(unit) => {
                    let inverse = 1.0 / unit;
                    let o = frame.point(ray.o);
                    for (k, o) in o.into_iter().enumerate() {
                        self.rays.o[k][i] = o;
                        self.rays.d[k][i] = ray.d[k] * inverse;
                    }
                    let ends = frame.interval(ray, unit);
                    self.enter[i] = ends[0];
                    self.reach[i] = ends[1];
                    plain |= u64::from(ray.t_min <= ray.t_max) << i;
                }
                None => odd |= 1 << i,
            }
        }
        self.live = 0;
        self.blurred = 0;
        self.negative = [0; 3];
        // Clip all rays, eight at a time. Rows of odd rays hold old values and are overwritten below.
        for row in (0..rays.len()).step_by(LANES) {
            self.cut(simd, frame, row);
        }
        self.live &= plain;
        // Convert the odd rays one by one.
        while odd != 0 {
            let i = odd.trailing_zeros() as usize;
            odd &= odd - 1;
            self.negative = map(self.negative, |bits| bits & !(1 << i));
            // Leave rays that miss the scene inactive.
            let Some(ray) = frame.ray(&rays[i]) else {
                continue;
            };
            for k in 0..3 {
                self.rays.o[k][i] = ray.o[k];
                self.rays.d[k][i] = ray.d[k];
                self.inv[k][i] = ray.inv[k];
                self.negative[k] |= u64::from(ray.negative[k]) << i;
            }
            self.enter[i] = ray.t_min;
            self.reach[i] = ray.t_max;
            self.live |= 1 << i;
            self.blurred |= u64::from(ray.is_blurred()) << i;
        }
    }

    /// Decides by the exact test whether ray `i` of the tile hits a candidate, and cuts the ray's reach at its best hit.
    #[inline(always)]
    pub fn offer<C: Counters>(
        &mut self,
        i: usize,
        RaySlice { frame, rays }: RaySlice<'_>,
        job: Job<'_>,
        Candidate { id, corners }: Candidate,
        best: &mut Best,
        counters: &mut C,
    ) {
        // The exact test takes the caller's ray; only the scale of its distances in the frame is needed.
        let ray = RayRef {
            ray: &rays[i],
            frame: &frame.limits_of(&rays[i]),
        };
        best.offer::<Closest, C>(
            ray,
            id,
            #[inline(always)]
            || job.blocks.scene_corners(job.scene, id, corners),
            counters,
        );
        self.reach[i] = keep_min(best.reach, self.reach[i]);
    }

    /// Clips the eight rays from index `row` on to the scene's box; the operations are those of [`Frame::ray`].
    #[inline(always)]
    fn cut<S: Simd>(&mut self, simd: S, frame: &Frame, row: usize) {
        let splat = |x: f32| f32x8::splat(simd, x);
        let (o, d) = (all(simd, &self.rays.o, row), all(simd, &self.rays.d, row));
        let bounds = frame.bounds();
        let magnitude = splat(bounds.magnitude());
        // Replace slow components as [`Frame::ray`] does.
        let far = o[0].abs().max(o[1].abs()).max(o[2].abs());
        let parallel = splat(U) / (far + magnitude);
        let mut near = load(simd, &self.enter, row);
        let mut exit = load(simd, &self.reach, row);
        for k in 0..3 {
            let pad = (o[k].abs() + magnitude) * splat(AXIS_PAD);
            let slowest = parallel * pad;
            let dk = d[k]
                .abs()
                .simd_lt(slowest)
                .select(slowest.copysign(d[k]), d[k]);
            let inv = splat(1.0) / dk;
            let slack = pad * inv.abs();
            // Clip to the slab of this axis, moved outwards.
            let low = (splat(bounds.min[k]) - o[k]) * inv;
            let high = (splat(bounds.max[k]) - o[k]) * inv;
            let back = splat(1.0).copysign(d[k]).simd_lt(splat(0.0));
            let enter = back.select(high, low) - slack;
            let leave = back.select(low, high) + slack;
            // Ignore a distance that is NaN.
            near = enter.simd_gt(near).select(enter, near);
            exit = leave.simd_lt(exit).select(leave, exit);
            self.negative[k] |= (back.to_bitmask() & 0xff) << row;
            inv.store_slice(&mut self.inv[k][row..row + LANES]);
        }
        near.store_slice(&mut self.enter[row..row + LANES]);
        exit.store_slice(&mut self.reach[row..row + LANES]);
        self.live |= (near.simd_le(exit).to_bitmask() & 0xff) << row;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch};
    use halfspace_geom::Aabb;
    use proptest::prelude::*;

    fn number() -> impl Strategy<Value = f32> {
        prop_oneof![
            (-4i8..4).prop_map(f32::from),
            -1.0f32..1.0,
            -1e-20f32..1e-20,
            any::<f32>(),
        ]
    }

    fn ray() -> impl Strategy<Value = Ray> {
        let point = || [number(), number(), number()];
        (point(), point(), number(), number()).prop_map(|(o, d, t_min, t_max)| Ray {
            o,
            d,
            t_min,
            t_max,
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(5_000))]
        #[test]
        fn rows_are_what_single_rays_are(
            rays in prop::collection::vec(ray(), 1..=RAYS), size in prop_oneof![0.5f32..4.0, 1e-20f32..1e-12],
        ) {
            let frame = Frame::new(Aabb { min: [-size; 3], max: [size; 3] });
            let mut rows = FrameRows::blank();
            dispatch!(Level::new(), simd => rows.fill(simd, &frame, &rays));
            for (i, ray) in rays.iter().enumerate() {
                let Some(one) = frame.ray(ray) else {
                    prop_assert!(rows.live >> i & 1 == 0, "{ray:?}");
                    continue;
                };
                prop_assert!(rows.live >> i & 1 == 1, "{ray:?}");
                let row = |row: &Row| row[i].to_bits();
                for k in 0..3 {
                    prop_assert_eq!(row(&rows.rays.o[k]), one.o[k].to_bits());
                    prop_assert_eq!(row(&rows.rays.d[k]), one.d[k].to_bits());
                    prop_assert_eq!(row(&rows.inv[k]), one.inv[k].to_bits());
                    prop_assert_eq!((rows.negative[k] >> i & 1) as u32, one.negative[k]);
                }
                prop_assert_eq!(row(&rows.enter), one.t_min.to_bits());
                prop_assert_eq!(row(&rows.reach), one.t_max.to_bits());
            }
        }
    }
}
