// SPDX-License-Identifier: GPL-3.0-or-later
//! The f32 test of one triangle against eight rays with a common origin or a common direction. The terms that depend
//! only on it and on the triangle are computed once, which leaves three dot products per ray.
//!
//! The test and its error bounds are those of [`crate::candidates`], with the triple products cyclically permuted so
//! that the factor that differs between rays comes last. The bounds hold for these orders too. With the direction last,
//! the cross products of edges and offsets have errors of 8 u E^2 and 8 u S E per component; the dot product with |d| <
//! 2 multiplies them by 6 and adds 36, which is 84 u E^2 and 84 u S E again. With the offset last, the cross products
//! of direction and edge have errors of 12 u E, those of edges 8 u E^2; the dot product with the offset makes these 84
//! u S E and 48 u S E^2 again.

use crate::candidates::{DET_ERROR, T_ERROR, UNDERFLOW, UV_ERROR};
use fearless_simd::{Simd, SimdBase, SimdFloat, SimdMask, f32x8};

/// The part of the triangle test that depends on one origin: the vectors whose dot products with a direction
/// are the determinant and the weights, and the distance times the determinant.
pub struct Seen {
    det: [f32; 3],
    u: [f32; 3],
    v: [f32; 3],
    t: f32,
    /// Error bounds; see [`errors`].
    errors: [f32; 2],
}

impl Seen {
    /// Computes the products of an origin and of a triangle's vertices, in the same frame.
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

    /// Returns the mask of the rays, given by their directions, that may hit the triangle within `reach`.
    #[inline(always)]
    pub fn candidates<S: Simd>(&self, simd: S, d: [f32x8<S>; 3], reach: f32x8<S>) -> u64 {
        let splat = |x: f32| f32x8::splat(simd, x);
        let found = [
            dot(simd, self.det, d),
            dot(simd, self.u, d),
            dot(simd, self.v, d),
            splat(self.t),
        ];
        let [uv_error, t_error] = self.errors;
        within(simd, found, [splat(uv_error), splat(t_error)], reach)
    }
}

/// Returns the mask of the lanes in which determinant, weights and distance, with their error bounds, do not exclude a
/// hit within `reach`.
#[inline(always)]
fn within<S: Simd>(
    simd: S,
    [det, u, v, t]: [f32x8<S>; 4],
    [uv_error, t_error]: [f32x8<S>; 2],
    reach: f32x8<S>,
) -> u64 {
    // Flip signs so that the determinant is positive, then reject as in [`crate::candidates`].
    let sign = f32x8::splat(simd, 1.0).copysign(det);
    let (det, u, v, t) = (det * sign, u * sign, v * sign, t * sign);
    let least = u.min(v).min(det - u - v);
    let rejected = least.simd_lt(-uv_error) | t.simd_gt(det.mul_add(reach, t_error));
    !rejected.to_bitmask() & 0xff
}

/// The part of the triangle test that depends on one direction: the determinant, and the vectors whose dot
/// products with an offset are the weights and the distance, each times the determinant.
pub struct Along {
    corner: [f32; 3],
    det: f32,
    u: [f32; 3],
    v: [f32; 3],
    t: [f32; 3],
    /// Largest edge component.
    size: f32,
}

impl Along {
    /// Computes the products of a direction and of a triangle's vertices, in the same frame.
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

    /// Returns the mask of the rays, given by their origins, that may hit the triangle within `reach`.
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

/// A triangle for rays without a common origin or direction: the test of [`crate::candidates`], one ray per lane.
pub struct Free {
    corner: [f32; 3],
    e1: [f32; 3],
    e2: [f32; 3],
    /// Largest edge component.
    size: f32,
}

impl Free {
    /// Computes the edges of a triangle from its vertices in the rays' frame.
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

    /// Returns the mask of the rays that may hit the triangle within `reach`.
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
        // Compute the determinant, the weights and the distance, as in [`crate::candidates`].
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

/// Returns the error bound of a weight, and that of `t` minus the product of determinant and distance, for a triangle
/// with largest edge component `size` whose first vertex is at most `span` from the origin per axis.
///
/// A hit is at most `span + size` away, on either side of the origin, and if the determinant has the wrong sign, the
/// error of `t` is proportional to that distance. [`UNDERFLOW`] is also in the factors of the offset, because an
/// offset multiplies what products of small edges lose by underflow.
#[inline(always)]
fn errors(span: f32, size: f32) -> [f32; 2] {
    let [by_span, constant] = coefficients(size);
    // 0, or NaN if some product may have overflowed: NaN bounds reject nothing.
    let overflow = (span * overflow_factor(size)) * 0.0;
    [0, 1].map(|i: usize| by_span[i] * span + constant[i] + overflow)
}

/// Returns [`errors`] for the offsets `s` of eight rays from the first vertex.
#[inline(always)]
fn errors_of<S: Simd>(simd: S, s: [f32x8<S>; 3], size: f32) -> [f32x8<S>; 2] {
    let splat = |x: f32| f32x8::splat(simd, x);
    let [by_span, constant] = coefficients(size);
    let span = s[0].abs().max(s[1].abs()).max(s[2].abs());
    let overflow = (span * splat(overflow_factor(size))) * splat(0.0);
    [
        span.mul_add(splat(by_span[0]), splat(constant[0]) + overflow),
        span.mul_add(splat(by_span[1]), splat(constant[1]) + overflow),
    ]
}

/// Returns the coefficients of both error bounds, which are linear in the offset: the factors, then the constants.
#[inline(always)]
fn coefficients(size: f32) -> [[f32; 2]; 2] {
    let det = 3.0 * (DET_ERROR * size * size + UNDERFLOW);
    [
        [
            2.0 * UV_ERROR * size + UNDERFLOW,
            T_ERROR * size * size + det,
        ],
        [det + UNDERFLOW, det * size + UNDERFLOW],
    ]
}

/// Returns the overflow factor: if its product with an offset overflows, some product of the test may have overflowed.
#[inline(always)]
fn overflow_factor(size: f32) -> f32 {
    64.0 * size * size.max(1.0)
}

/// Returns the cross products `v x e` of eight vectors and one.
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

/// The plane of a triangle, for classifying points with error bounds.
pub struct Plane {
    corner: [f32; 3],
    /// The cross product of two edges, not normalized.
    normal: [f32; 3],
    /// Largest edge component.
    size: f32,
}

impl Plane {
    /// Computes the plane through a triangle's vertices.
    #[inline(always)]
    pub fn new([a, b, c]: [[f32; 3]; 3]) -> Self {
        let (e1, e2) = (sub(b, a), sub(c, a));
        Self {
            corner: a,
            normal: cross(e1, e2),
            size: largest(e1).max(largest(e2)),
        }
    }

    /// Returns the masks of those of eight points, each with an error of at most `pad` per axis, that provably lie
    /// above the plane, and below it. The height is the `t` of the triangle test and has less than its error; the
    /// normal's components are at most 2 E^2, which multiplies `pad`.
    #[inline(always)]
    pub fn sides<S: Simd>(&self, simd: S, p: [f32x8<S>; 3], pad: f32) -> [u64; 2] {
        let splat = |x: f32| f32x8::splat(simd, x);
        let s = [
            p[0] - splat(self.corner[0]),
            p[1] - splat(self.corner[1]),
            p[2] - splat(self.corner[2]),
        ];
        let height = dot(simd, self.normal, s);
        let [_, t_error] = errors_of(simd, s, self.size);
        let error = t_error + splat(8.0 * self.size * self.size * pad);
        let above = height.simd_gt(error).to_bitmask() & 0xff;
        let below = height.simd_lt(-error).to_bitmask() & 0xff;
        [above, below]
    }
}

/// Returns the dot products `n . d` of one vector and eight.
#[inline(always)]
fn dot<S: Simd>(simd: S, n: [f32; 3], d: [f32x8<S>; 3]) -> f32x8<S> {
    let [x, y, z] = [
        f32x8::splat(simd, n[0]),
        f32x8::splat(simd, n[1]),
        f32x8::splat(simd, n[2]),
    ];
    d[0].mul_add(x, d[1].mul_add(y, d[2] * z))
}

/// Returns `a - b`.
#[inline(always)]
fn sub(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// Returns the cross product `a x b`.
#[inline(always)]
fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// Returns the largest absolute component.
#[inline(always)]
fn largest(a: [f32; 3]) -> f32 {
    a[0].abs().max(a[1].abs()).max(a[2].abs())
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch};
    use halfspace_geom::verdict::verdict;
    use halfspace_ray::Ray;
    use halfspace_ray::frame::Frame;
    use halfspace_scene::Triangles;
    use halfspace_strategies::{near_triangle, point, tiny_from_afar};
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
                prop_assert_eq!(sides, 0, "next to its plane");
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
