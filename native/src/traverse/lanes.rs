// SPDX-License-Identifier: GPL-3.0-or-later
//! One triangle against eight rays of a common origin: what depends on the origin and the triangle
//! alone is worked out once, and each ray is left with three dot products.
//!
//! The test and its error bounds are those of [`super::blocks`], with the triple products turned
//! around so that the direction comes last; the bounds there hold for this order as well: the
//! cross products of edges and offsets are off by 8 u E^2 and 8 u S E per component, the dot
//! products with |d| < 2 make that 48 and add 36, which is 84 u E^2 and 84 u S E again.

use super::blocks::{DET_ERROR, T_ERROR, UNDERFLOW, UV_ERROR};
use fearless_simd::{Simd, SimdBase, SimdFloat, SimdMask, f32x8};

/// A triangle as seen from one origin.
pub struct Seen {
    det: [f32; 3],
    u: [f32; 3],
    v: [f32; 3],
    t: f32,
    det_error: f32,
    uv_error: f32,
    t_error: f32,
}

impl Seen {
    /// From corners and an origin in the same frame.
    #[inline(always)]
    pub fn new(o: [f32; 3], [a, b, c]: [[f32; 3]; 3]) -> Self {
        let (e1, e2, s) = (sub(b, a), sub(c, a), sub(o, a));
        let size = largest(e1).max(largest(e2));
        let span = largest(s);
        // Zero, or NaN where some product may have overflowed: NaN bounds reject nothing.
        let floor = UNDERFLOW + 0.0 * (64.0 * span * size * size.max(1.0));
        let det_error = DET_ERROR * size * size + UNDERFLOW;
        let q = cross(s, e1);
        Self {
            det: cross(e2, e1),
            u: cross(e2, s),
            v: q,
            t: e2[0] * q[0] + (e2[1] * q[1] + e2[2] * q[2]),
            det_error,
            uv_error: 2.0 * UV_ERROR * span * size + 3.0 * det_error + floor,
            t_error: T_ERROR * span * size * size + floor,
        }
    }

    /// The lanes whose rays may hit the triangle no farther away than `reach`.
    #[inline(always)]
    pub fn candidates<S: Simd>(&self, simd: S, d: [f32x8<S>; 3], reach: f32x8<S>) -> u64 {
        let splat = |x: f32| f32x8::splat(simd, x);
        let (det, u, v) = (
            dot(simd, self.det, d),
            dot(simd, self.u, d),
            dot(simd, self.v, d),
        );
        let sign = splat(1.0).copysign(det);
        let (det, u, v, t) = (det * sign, u * sign, v * sign, splat(self.t) * sign);
        let least = u.min(v).min(det - u - v);
        let doubt = reach
            .abs()
            .mul_add(splat(3.0 * self.det_error), splat(self.t_error));
        let rejected = least.simd_lt(splat(-self.uv_error)) | t.simd_gt(det.mul_add(reach, doubt));
        !rejected.to_bitmask() & 0xff
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
