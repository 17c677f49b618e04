// SPDX-License-Identifier: GPL-3.0-or-later
//! One triangle against eight rays of a common origin or direction: what depends on the shared half
//! and the triangle alone is worked out once, and each ray is left with three dot products.
//!
//! The test and its error bounds are those of [`super::candidates`], with the triple products turned
//! around so that what differs comes last; the bounds there hold for these orders as well. With the
//! direction last, the cross products of edges and offsets are off by 8 u E^2 and 8 u S E per
//! component, the dot products with |d| < 2 make that 48 and add 36, which is 84 u E^2 and
//! 84 u S E again. With the offset last, those of direction and edge are off by 12 u E, those of
//! edges by 8 u E^2; offset and dot product make that 84 u S E and 48 u S E^2 again.

use super::candidates::{DET_ERROR, T_ERROR, UNDERFLOW, UV_ERROR};
use fearless_simd::{Simd, SimdBase, SimdFloat, SimdMask, f32x8};

/// A triangle as seen from one origin.
pub struct Seen {
    det: [f32; 3],
    u: [f32; 3],
    v: [f32; 3],
    t: f32,
    errors: [f32; 2],
}

impl Seen {
    /// From corners and an origin in the same frame.
    #[inline(always)]
    pub fn new(o: [f32; 3], [a, b, c]: [[f32; 3]; 3]) -> Self {
        let (e1, e2, s) = (sub(b, a), sub(c, a), sub(o, a));
        let size = largest(e1).max(largest(e2));
        let span = largest(s);
        let q = cross(s, e1);
        Self {
            det: cross(e2, e1),
            u: cross(e2, s),
            v: q,
            t: e2[0] * q[0] + (e2[1] * q[1] + e2[2] * q[2]),
            errors: errors(span, size),
        }
    }

    /// The lanes whose rays may hit the triangle no farther away than `reach`.
    #[inline(always)]
    pub fn candidates<S: Simd>(&self, simd: S, d: [f32x8<S>; 3], reach: f32x8<S>) -> u64 {
        let splat = |x: f32| f32x8::splat(simd, x);
        let found = [
            dot(simd, self.det, d),
            dot(simd, self.u, d),
            dot(simd, self.v, d),
            splat(self.t),
        ];
        let [uv_error, doubt] = self.errors;
        within(simd, found, [splat(uv_error), splat(doubt)], reach)
    }
}

/// The lanes whose determinants, with their errors, do not exclude a hit within `reach`.
#[inline(always)]
fn within<S: Simd>(
    simd: S,
    [det, u, v, t]: [f32x8<S>; 4],
    [uv_error, doubt]: [f32x8<S>; 2],
    reach: f32x8<S>,
) -> u64 {
    let sign = f32x8::splat(simd, 1.0).copysign(det);
    let (det, u, v, t) = (det * sign, u * sign, v * sign, t * sign);
    let least = u.min(v).min(det - u - v);
    let rejected = least.simd_lt(-uv_error) | t.simd_gt(det.mul_add(reach, doubt));
    !rejected.to_bitmask() & 0xff
}

/// A triangle as seen along one direction.
pub struct Along {
    corner: [f32; 3],
    det: f32,
    u: [f32; 3],
    v: [f32; 3],
    t: [f32; 3],
    size: f32,
}

impl Along {
    /// From corners and a direction in the same frame.
    #[inline(always)]
    pub fn new(d: [f32; 3], [a, b, c]: [[f32; 3]; 3]) -> Self {
        let (e1, e2) = (sub(b, a), sub(c, a));
        let p = cross(d, e2);
        Self {
            corner: a,
            det: e1[0] * p[0] + (e1[1] * p[1] + e1[2] * p[2]),
            u: p,
            v: cross(e1, d),
            t: cross(e1, e2),
            size: largest(e1).max(largest(e2)),
        }
    }

    /// The lanes whose rays may hit the triangle no farther away than `reach`.
    #[inline(always)]
    pub fn candidates<S: Simd>(&self, simd: S, o: [f32x8<S>; 3], reach: f32x8<S>) -> u64 {
        let splat = |x: f32| f32x8::splat(simd, x);
        let s = [
            o[0] - splat(self.corner[0]),
            o[1] - splat(self.corner[1]),
            o[2] - splat(self.corner[2]),
        ];
        let found = [
            splat(self.det),
            dot(simd, self.u, s),
            dot(simd, self.v, s),
            dot(simd, self.t, s),
        ];
        within(simd, found, errors_of(simd, s, self.size), reach)
    }
}

/// A triangle for rays that share nothing; the test of [`super::candidates`], a lane per ray.
pub struct Free {
    corner: [f32; 3],
    e1: [f32; 3],
    e2: [f32; 3],
    size: f32,
}

impl Free {
    /// From corners in the rays' frame.
    #[inline(always)]
    pub fn new([a, b, c]: [[f32; 3]; 3]) -> Self {
        let (e1, e2) = (sub(b, a), sub(c, a));
        Self {
            corner: a,
            e1,
            e2,
            size: largest(e1).max(largest(e2)),
        }
    }

    /// The lanes whose rays may hit the triangle no farther away than `reach`.
    #[inline(always)]
    pub fn candidates<S: Simd>(
        &self,
        simd: S,
        o: [f32x8<S>; 3],
        d: [f32x8<S>; 3],
        reach: f32x8<S>,
    ) -> u64 {
        let splat = |x: f32| f32x8::splat(simd, x);
        let s = [
            o[0] - splat(self.corner[0]),
            o[1] - splat(self.corner[1]),
            o[2] - splat(self.corner[2]),
        ];
        let [ax, ay, az] = self.e1;
        let p = across(simd, d, self.e2);
        let q = across(simd, s, self.e1);
        let det = p[0].mul_add(splat(ax), p[1].mul_add(splat(ay), p[2] * splat(az)));
        let u = s[0].mul_add(p[0], s[1].mul_add(p[1], s[2] * p[2]));
        let v = d[0].mul_add(q[0], d[1].mul_add(q[1], d[2] * q[2]));
        let t = dot(simd, self.e2, q);
        within(simd, [det, u, v, t], errors_of(simd, s, self.size), reach)
    }
}

/// Bounds for a triangle of this size, of which a corner is so far from the origin along some axis: on the error of a weight,
/// and on how far `t` may lie beyond what the determinant makes of the distance of a hit.
///
/// A hit is no farther than the corner and the size, on whichever side of the origin: where the determinant's sign is
/// wrong, `t` may be as wrong as that. What products of small sides lose below the normal numbers is taken times the
/// offset.
#[inline(always)]
fn errors(span: f32, size: f32) -> [f32; 2] {
    let [by_span, constant] = lines(size);
    // Next to nothing, or NaN where some product may have overflowed: NaN bounds reject nothing.
    let overflow = (span * overflowing(size)) * 0.0;
    [0, 1].map(|i: usize| by_span[i] * span + constant[i] + overflow)
}

/// The same for eight offsets.
#[inline(always)]
fn errors_of<S: Simd>(simd: S, s: [f32x8<S>; 3], size: f32) -> [f32x8<S>; 2] {
    let splat = |x: f32| f32x8::splat(simd, x);
    let [by_span, constant] = lines(size);
    let span = s[0].abs().max(s[1].abs()).max(s[2].abs());
    let overflow = (span * splat(overflowing(size))) * splat(0.0);
    [
        span.mul_add(splat(by_span[0]), splat(constant[0]) + overflow),
        span.mul_add(splat(by_span[1]), splat(constant[1]) + overflow),
    ]
}

/// Both bounds, as what they are times the offset, and what is added to that.
#[inline(always)]
fn lines(size: f32) -> [[f32; 2]; 2] {
    let det = 3.0 * (DET_ERROR * size * size + UNDERFLOW);
    [
        [
            2.0 * UV_ERROR * size + UNDERFLOW,
            T_ERROR * size * size + det,
        ],
        [det + UNDERFLOW, det * size + UNDERFLOW],
    ]
}

/// Where this times an offset overflows, some product may have.
#[inline(always)]
fn overflowing(size: f32) -> f32 {
    64.0 * size * size.max(1.0)
}

/// `v x e` for eight vectors.
#[inline(always)]
fn across<S: Simd>(simd: S, v: [f32x8<S>; 3], e: [f32; 3]) -> [f32x8<S>; 3] {
    let [ex, ey, ez] = [
        f32x8::splat(simd, e[0]),
        f32x8::splat(simd, e[1]),
        f32x8::splat(simd, e[2]),
    ];
    [
        v[1].mul_sub(ez, v[2] * ey),
        v[2].mul_sub(ex, v[0] * ez),
        v[0].mul_sub(ey, v[1] * ex),
    ]
}

/// The plane of a triangle.
pub struct Plane {
    corner: [f32; 3],
    normal: [f32; 3],
    size: f32,
}

impl Plane {
    /// From corners.
    #[inline(always)]
    pub fn new([a, b, c]: [[f32; 3]; 3]) -> Self {
        let (e1, e2) = (sub(b, a), sub(c, a));
        Self {
            corner: a,
            normal: cross(e1, e2),
            size: largest(e1).max(largest(e2)),
        }
    }

    /// Which of eight points, each off by at most `pad` per axis, certainly lie above it, and which
    /// below. The height is the `t` of the triangle test, its error less than the bound there, and the normal's
    /// components are at most 2 E^2.
    #[inline(always)]
    pub fn sides<S: Simd>(&self, simd: S, p: [f32x8<S>; 3], pad: f32) -> [u64; 2] {
        let splat = |x: f32| f32x8::splat(simd, x);
        let s = [
            p[0] - splat(self.corner[0]),
            p[1] - splat(self.corner[1]),
            p[2] - splat(self.corner[2]),
        ];
        let height = dot(simd, self.normal, s);
        let [_, doubt] = errors_of(simd, s, self.size);
        let error = doubt + splat(8.0 * self.size * self.size * pad);
        let above = height.simd_gt(error).to_bitmask() & 0xff;
        let below = height.simd_lt(-error).to_bitmask() & 0xff;
        [above, below]
    }
}

#[inline(always)]
fn dot<S: Simd>(simd: S, n: [f32; 3], d: [f32x8<S>; 3]) -> f32x8<S> {
    let [x, y, z] = [
        f32x8::splat(simd, n[0]),
        f32x8::splat(simd, n[1]),
        f32x8::splat(simd, n[2]),
    ];
    d[0].mul_add(x, d[1].mul_add(y, d[2] * z))
}

#[inline(always)]
fn sub(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

#[inline(always)]
fn largest(a: [f32; 3]) -> f32 {
    a[0].abs().max(a[1].abs()).max(a[2].abs())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::strategies::{near_triangle, point, tiny_from_afar};
    use crate::geom::verdict::verdict;
    use crate::scene::Triangles;
    use crate::traverse::Ray;
    use crate::traverse::frame::Frame;
    use fearless_simd::{Level, dispatch};
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]
        #[test]
        fn no_hit_is_ever_rejected(
            corners in [point(), point(), point()], o in point(), s in 0.0f32..1.0, t in 0.0f32..1.0,
        ) {
            let scene = Triangles::new(corners.to_vec(), vec![[0, 1, 2]]).unwrap();
            prop_assume!(!scene.live().is_empty());
            let frame = Frame::new(scene.bounds());
            let target = near_triangle(corners, [s, t]);
            let d: [f32; 3] = std::array::from_fn(|k| target[k] - o[k]);
            prop_assume!(d.iter().all(|x| x.is_finite()));
            let ray = Ray { o, d, t_min: 0.0, t_max: f32::INFINITY };
            let hit = verdict(o, d, corners).is_some_and(|v| v.t >= 0.0 && v.t.is_finite());
            if let (true, Some(framed)) = (hit, frame.ray(&ray)) {
                let seen = Seen::new(framed.o, corners.map(|p| frame.point(p)));
                let mask = dispatch!(Level::new(), simd => {
                    let [x, y, z] = framed.d.map(|x| f32x8::splat(simd, x));
                    seen.candidates(simd, [x, y, z], f32x8::splat(simd, framed.t_max))
                });
                prop_assert_eq!(mask, 0xff);
                let along = Along::new(framed.d, corners.map(|p| frame.point(p)));
                let mask = dispatch!(Level::new(), simd => {
                    let [x, y, z] = framed.o.map(|x| f32x8::splat(simd, x));
                    along.candidates(simd, [x, y, z], f32x8::splat(simd, framed.t_max))
                });
                prop_assert_eq!(mask, 0xff, "along its direction");
                let free = Free::new(corners.map(|p| frame.point(p)));
                let plane = Plane::new(corners.map(|p| frame.point(p)));
                let (mask, sides) = dispatch!(Level::new(), simd => {
                    let splat = |v: [f32; 3]| [
                        f32x8::splat(simd, v[0]), f32x8::splat(simd, v[1]), f32x8::splat(simd, v[2]),
                    ];
                    let at = |t: f32| splat(std::array::from_fn(|k| framed.o[k] + t * framed.d[k]));
                    let reach = f32x8::splat(simd, framed.t_max);
                    let pad = framed.pad[0].max(framed.pad[1]).max(framed.pad[2]);
                    let ends = [framed.t_min, framed.t_max].map(|t| plane.sides(simd, at(t), pad));
                    let sides = ends[0][0] & ends[1][0] | ends[0][1] & ends[1][1];
                    (free.candidates(simd, splat(framed.o), splat(framed.d), reach), sides)
                });
                prop_assert_eq!(mask, 0xff, "alone");
                prop_assert_eq!(sides, 0, "beside its plane");
            }
        }

        #[test]
        fn no_tiny_triangle_is_rejected_from_afar((tiny, [o, d], [t_min, t_max]) in tiny_from_afar()) {
            let hit = verdict(o, d, tiny).map(|hit| hit.t).filter(|t| t_min <= *t && *t <= t_max);
            let Some(t) = hit else {
                return Ok(());
            };
            // In the frame the longest component of a direction lies in [1, 2).
            let unit = 2.0_f32.powi(d.map(f32::abs).into_iter().fold(0.0, f32::max).log2().floor() as i32);
            let (d, reach) = (d.map(|x| x / unit), t * unit + t.abs() * unit * 1e-6);
            let masks = dispatch!(Level::new(), simd => {
                let splat = |v: [f32; 3]| v.map(|x| f32x8::splat(simd, x));
                let (o8, d8) = (splat(o), splat(d));
                let reach = f32x8::splat(simd, reach);
                [
                    Seen::new(o, tiny).candidates(simd, d8, reach),
                    Along::new(d, tiny).candidates(simd, o8, reach),
                    Free::new(tiny).candidates(simd, o8, d8, reach),
                ]
            });
            prop_assert_eq!(masks, [0xff; 3]);
        }
    }
}
