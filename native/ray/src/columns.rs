// SPDX-License-Identifier: GPL-3.0-or-later
//! Eight rays converted to a frame at once, one per lane of f32 vectors, with the bits of [`Frame::ray`].

use crate::frame::{AXIS_PAD, Frame, OBLIQUE_PAD, PRUNE, U, last_places};
use crate::{FrameRay, Ray};
use fearless_simd::{Bytes, Select, Simd, SimdBase, SimdFloat, SimdMask, f32x4, f32x8, u32x8};
use halfspace_geom::bound::{keep_max_each, keep_min_each};

/// Rays that are converted together.
pub const TOGETHER: usize = 8;

/// Range of regular numbers: coordinates of origins lie below its end, largest components of directions inside
/// it. Derived: a product or a quotient of two such numbers stays between 1e-36 and 1e36, with room for a few
/// additions before it overflows.
pub const ORDINARY: std::ops::Range<f32> = 1e-18..1e18;

/// One number of each ray.
type Column = [f32; TOGETHER];

/// Eight rays in a frame: the fields of [`FrameRay`], a column each.
#[derive(Debug, Default)]
#[repr(align(64))]
pub struct Columns {
    o: [Column; 3],
    d: [Column; 3],
    inv: [Column; 3],
    slack: [Column; 3],
    pad: [Column; 3],
    still: [Column; 3],
    t_min: Column,
    t_max: Column,
    span: Column,
    oblique_pad: Column,
    last_place: Column,
    to_frame: Column,
    signs: [u32; TOGETHER],
    /// Mask of the rays that this conversion serves.
    regular: u64,
    /// Mask of the rays that may hit the scene's box.
    alive: u64,
}

impl Columns {
    /// Converts from one to eight rays. The frame must be unscaled.
    #[inline(always)]
    pub fn fill<S: Simd>(&mut self, simd: S, frame: &Frame, rays: &[Ray]) {
        let splat = |x: f32| f32x8::splat(simd, x);
        // Load one ray per lane; copies of the last one fill the lanes behind it.
        let last = rays.len().min(TOGETHER) - 1;
        let ray = |i: usize| &rays[i.min(last)];
        let low = transposed(simd, [ray(0), ray(1), ray(2), ray(3)]);
        let high = transposed(simd, [ray(4), ray(5), ray(6), ray(7)]);
        let all = |i: usize| simd.combine_f32x4(low[i], high[i]);
        let (d, t_min, t_max) = ([all(3), all(4), all(5)], all(6), all(7));
        let (origin, exact) = (frame.map().origin(), frame.map().exact());
        let o = [
            all(0) - splat(origin[0]),
            all(1) - splat(origin[1]),
            all(2) - splat(origin[2]),
        ];

        // Find the regular rays: finite, in the range where f32 products neither overflow nor vanish, with an exact
        // origin. The sum detects NaN, which a maximum may drop.
        let sums = (o[0] + o[1] + o[2]) + (d[0] + d[1] + d[2]);
        let longest = d[0].abs().max(d[1].abs()).max(d[2].abs());
        let far = o[0].abs().max(o[1].abs()).max(o[2].abs());
        let regular = o[0].abs().simd_le(splat(exact[0]))
            & o[1].abs().simd_le(splat(exact[1]))
            & o[2].abs().simd_le(splat(exact[2]))
            & sums.abs().simd_lt(splat(f32::INFINITY))
            & longest.simd_ge(splat(ORDINARY.start))
            & longest.simd_lt(splat(ORDINARY.end))
            & far.simd_lt(splat(ORDINARY.end))
            & t_min.simd_ge(splat(0.0))
            & t_min.simd_le(t_max);
        self.regular = regular.to_bitmask();

        // Divide directions by the power of two of their largest component.
        let exponent = u32x8::splat(simd, 0x7f80_0000);
        let unit: f32x8<S> = (longest.bitcast::<u32x8<S>>() & exponent).bitcast();
        let inverse = splat(1.0) / unit;

        // Compute the error bounds, and clip to the scene's box, in the order of operations of `Frame::complete`.
        let bounds = frame.bounds();
        let magnitude = splat(bounds.magnitude());
        let robust = splat(frame.robust());
        let last_place = last_places(simd, unit);
        let span = far + magnitude;
        let parallel = splat(U) / span;
        let (mut near, mut exit) = (splat(f32::NEG_INFINITY), splat(f32::INFINITY));
        let mut signs = u32x8::splat(simd, 0);
        for k in 0..3 {
            let (o, scene_d) = (o[k], d[k]);
            let d = scene_d * inverse;
            let still: f32x8<S> = scene_d.simd_eq(splat(0.0)).select(splat(0.0), splat(1.0));
            let pad = splat(AXIS_PAD) * (o.abs() + magnitude);
            let slowest = parallel * pad;
            let raised: f32x8<S> = (d.abs().simd_lt(slowest)).select(slowest.copysign(d), d);
            let inv = splat(1.0) / raised;
            let slack = pad * inv.abs();
            let low = (splat(bounds.min[k]) - o) * inv;
            let high = (splat(bounds.max[k]) - o) * inv;
            let back = splat(1.0).copysign(d).simd_lt(splat(0.0));
            near = keep_max_each(back.select(high, low) - slack, near);
            exit = keep_min_each(back.select(low, high) + slack, exit);
            signs |= (d.bitcast::<u32x8<S>>() >> 31) << k as u32;
            o.store_slice(&mut self.o[k]);
            d.store_slice(&mut self.d[k]);
            still.store_slice(&mut self.still[k]);
            inv.store_slice(&mut self.inv[k]);
            (robust * pad).store_slice(&mut self.pad[k]);
            (robust * slack).store_slice(&mut self.slack[k]);
        }

        // Intersect with the rays' own intervals.
        let start = keep_max_each(t_min * unit * splat(2.0 - PRUNE) - last_place, near);
        let end = keep_min_each(t_max * unit * splat(PRUNE) + last_place, exit);
        self.alive = !start.simd_gt(end).to_bitmask();
        start.store_slice(&mut self.t_min);
        end.store_slice(&mut self.t_max);
        span.store_slice(&mut self.span);
        (robust * (splat(OBLIQUE_PAD) * span)).store_slice(&mut self.oblique_pad);
        last_place.store_slice(&mut self.last_place);
        unit.store_slice(&mut self.to_frame);
        (signs * u32x8::splat(simd, 0x0101_0101)).store_slice(&mut self.signs);
    }

    /// Whether ray `i` was converted. Others need [`Frame::ray`]: they begin before their origin, have an origin that
    /// the frame rounds, or numbers outside [`ORDINARY`].
    #[inline(always)]
    pub fn is_regular(&self, i: usize) -> bool {
        self.regular >> i & 1 == 1
    }

    /// Returns ray `i`, if it is regular, as [`Frame::ray`] does.
    #[inline(always)]
    pub fn ray(&self, i: usize) -> Option<FrameRay<'static>> {
        if self.alive >> i & 1 == 0 {
            return None;
        }
        let i = i % TOGETHER;
        let at = |columns: &[Column; 3]| [columns[0][i], columns[1][i], columns[2][i]];
        let signs = self.signs[i];
        Some(FrameRay {
            o: at(&self.o),
            d: at(&self.d),
            inv: at(&self.inv),
            slack: at(&self.slack),
            pad: at(&self.pad),
            still: at(&self.still),
            negative: [signs & 1, signs >> 1 & 1, signs >> 2 & 1],
            signs,
            t_min: self.t_min[i],
            t_max: self.t_max[i],
            span: self.span[i],
            oblique_pad: self.oblique_pad[i],
            to_frame: f64::from(self.to_frame[i]),
            last_place: self.last_place[i],
            ..FrameRay::NOTHING
        })
    }
}

/// Transposes four rays: returns the origins, the directions and the limits of all, a vector per number.
#[inline(always)]
pub fn transposed<S: Simd>(simd: S, rays: [&Ray; 4]) -> [f32x4<S>; 8] {
    // Load the first four numbers of each ray, which are adjacent in memory, and the last four.
    let first = rays.map(
        #[inline(always)]
        |ray| f32x4::from_slice(simd, &[ray.o[0], ray.o[1], ray.o[2], ray.d[0]]),
    );
    let last = rays.map(
        #[inline(always)]
        |ray| f32x4::from_slice(simd, &[ray.d[1], ray.d[2], ray.t_min, ray.t_max]),
    );
    let [ox, oy, oz, dx] = matrix(simd, first);
    let [dy, dz, t_min, t_max] = matrix(simd, last);
    [ox, oy, oz, dx, dy, dz, t_min, t_max]
}

/// The transpose of a 4 by 4 matrix.
#[inline(always)]
fn matrix<S: Simd>(simd: S, [a, b, c, d]: [f32x4<S>; 4]) -> [f32x4<S>; 4] {
    let (even, odd) = (simd.zip_low_f32x4(a, c), simd.zip_low_f32x4(b, d));
    let (even_high, odd_high) = (simd.zip_high_f32x4(a, c), simd.zip_high_f32x4(b, d));
    [
        simd.zip_low_f32x4(even, odd),
        simd.zip_high_f32x4(even, odd),
        simd.zip_low_f32x4(even_high, odd_high),
        simd.zip_high_f32x4(even_high, odd_high),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch};
    use halfspace_geom::Aabb;
    use halfspace_strategies::point;
    use proptest::prelude::*;

    /// Returns a ray as text, in which floats differ if their bits do.
    fn text(ray: Option<FrameRay<'_>>) -> String {
        format!("{ray:?}")
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]
        #[test]
        fn regular_rays_have_the_bits_of_single_ones(
            bounds in prop::collection::vec([-40.0f32..40.0, -40.0f32..40.0, -40.0f32..40.0], 2..5),
            moved in prop_oneof![Just([0.0f32; 3]), point()],
            robust in any::<bool>(),
            rays in prop::collection::vec((point(), point(), 0.0f32..2.0, prop_oneof![Just(f32::INFINITY), 0.0f32..99.0]), 1..9),
            zero in any::<[bool; 8]>(),
        ) {
            let mut all = Aabb::EMPTY;
            for p in &bounds {
                all.grow(std::array::from_fn(|k| p[k] + moved[k]));
            }
            let frame = Frame::new(all).with_robust(robust);
            prop_assume!(frame.is_unscaled());
            let rays: Vec<_> = (rays.iter().zip(zero))
                .map(|(&(o, d, t_min, t_max), zero)| Ray {
                    o,
                    d: if zero { [d[0], -0.0, 0.0] } else { d },
                    t_min,
                    t_max,
                })
                .collect();
            let mut columns = Columns::default();
            dispatch!(Level::new(), simd => columns.fill(simd, &frame, &rays));
            for (i, ray) in rays.iter().enumerate() {
                if columns.is_regular(i) {
                    prop_assert_eq!(text(columns.ray(i)), text(frame.ray(ray)));
                }
            }
        }
    }

    #[test]
    fn unusual_rays_are_not_regular() {
        let all = Aabb {
            min: [1e4, -1.0, -1.0],
            max: [1e4 + 2.0, 1.0, 1.0],
        };
        let frame = Frame::new(all);
        let usual = Ray {
            o: [9e3, 0.25, 0.5],
            d: [1.0, 0.0, 0.5],
            t_min: 0.0,
            t_max: f32::INFINITY,
        };
        let unusual = [
            Ray {
                t_min: -1.0,
                ..usual
            },
            Ray {
                t_max: f32::NAN,
                ..usual
            },
            Ray {
                t_min: 2.0,
                t_max: 1.0,
                ..usual
            },
            Ray {
                d: [0.0; 3],
                ..usual
            },
            Ray {
                d: [1e-30, 0.0, 0.0],
                ..usual
            },
            Ray {
                d: [1.0, f32::INFINITY, 0.0],
                ..usual
            },
            Ray {
                o: [9e3, f32::NAN, 0.0],
                ..usual
            },
            Ray {
                o: [9e3, 1e19, 0.0],
                ..usual
            },
            // The frame rounds this origin.
            Ray {
                o: [0.1, 0.25, 0.5],
                ..usual
            },
        ];
        let mut columns = Columns::default();
        for ray in unusual {
            dispatch!(Level::new(), simd => columns.fill(simd, &frame, &[usual, ray]));
            assert!(columns.is_regular(0) && !columns.is_regular(1), "{ray:?}");
        }
    }
}
