// SPDX-License-Identifier: GPL-3.0-or-later
//! Quantities of eight triangles of a leaf that do not depend on the ray, and their test against a whole fan.
//!
//! For rays of a common origin, triangles that the whole fan misses are rejected first, by their products with
//! the box of the directions. Centre and half extent add up to hardly more than 2 per component, so the errors
//! of both parts together are at most twice that for one direction (for the third weight that of
//! [`crate::tile::leaf`]): less than twice the bound of the single test.

use crate::packet::Packet;
use fearless_simd::{Simd, SimdBase, SimdFloat, SimdMask, f32x8};
use halfspace_leaf::blocks::{LANES as WIDE, SPAN};
use halfspace_leaf::candidates::{DET_ERROR, T_ERROR, UNDERFLOW, UV_ERROR};
use halfspace_leaf::eight::{Vector8, abs, corner_and_sides, cross, dot, largest, same, sub};

/// Eight triangles, one per lane.
pub struct Prepared {
    pub corner: [[f32; WIDE]; 3],
    pub e1: [[f32; WIDE]; 3],
    pub e2: [[f32; WIDE]; 3],
    pub normal: [[f32; WIDE]; 3],
    pub det_error: [f32; WIDE],
    /// Three times `det_error`: the error per unit of reach in the comparison of distances.
    pub doubt: [f32; WIDE],
    pub uv_error: [f32; WIDE],
    pub t_error: [f32; WIDE],
    /// Mask of the triangles that some ray may hit.
    pub kept: u64,
}

impl Prepared {
    const NOTHING: Self = Self {
        corner: [[0.0; WIDE]; 3],
        e1: [[0.0; WIDE]; 3],
        e2: [[0.0; WIDE]; 3],
        normal: [[0.0; WIDE]; 3],
        det_error: [0.0; WIDE],
        doubt: [0.0; WIDE],
        uv_error: [0.0; WIDE],
        t_error: [0.0; WIDE],
        kept: 0,
    };
}

/// Computes for `n` triangles of a block the quantities common to all rays: sides, normals, error bounds, and
/// the mask of triangles that the fan may hit.
#[inline(always)]
pub fn prepare<S: Simd>(
    simd: S,
    packet: &Packet,
    farthest: f32,
    block: &[f32; SPAN],
    n: usize,
) -> Prepared {
    let splat = |x: f32| f32x8::splat(simd, x);
    let [a, e1, e2] = corner_and_sides(simd, block, n);
    let normal = cross(e2, e1);
    let [low, high] = packet.origins;
    let (low, high) = (sub(same(simd, low), a), sub(same(simd, high), a));
    let size = largest(e1).max(largest(e2));
    let span = largest(low).max(largest(high));
    // A term of zero unless some product may have overflowed, then NaN: NaN bounds reject nothing.
    let product = splat(64.0) * span * size * size.max(splat(1.0));
    let floor = product.mul_add(splat(0.0), splat(UNDERFLOW));
    let det_error = size.mul_add(size * splat(DET_ERROR), splat(UNDERFLOW));
    let uv_error = size.mul_add(
        span * splat(2.0 * UV_ERROR),
        det_error.mul_add(splat(3.0), floor),
    );
    let t_error = (size * size).mul_add(span * splat(T_ERROR), floor);

    // Reject the triangles that the whole fan misses.
    let mut kept = (1 << n) - 1;
    if let Some(fan) = packet.fan {
        let sides = Sides { e1, e2, normal };
        let errors = Errors {
            det: det_error,
            uv: uv_error,
            t: t_error,
        };
        kept &= !missed(simd, low, fan, farthest, &sides, &errors);
        if kept == 0 {
            return Prepared::NOTHING;
        }
    }
    // Store the eight triangles as rows, to be read one lane at a time.
    let mut prepared = Prepared {
        kept,
        ..Prepared::NOTHING
    };
    for k in 0..3 {
        a[k].store_slice(&mut prepared.corner[k]);
        e1[k].store_slice(&mut prepared.e1[k]);
        e2[k].store_slice(&mut prepared.e2[k]);
        normal[k].store_slice(&mut prepared.normal[k]);
    }
    det_error.store_slice(&mut prepared.det_error);
    (det_error * splat(3.0)).store_slice(&mut prepared.doubt);
    uv_error.store_slice(&mut prepared.uv_error);
    t_error.store_slice(&mut prepared.t_error);
    prepared
}

/// Two sides of each of eight triangles, and their cross product.
struct Sides<S: Simd> {
    e1: Vector8<S>,
    e2: Vector8<S>,
    normal: Vector8<S>,
}

/// Error bounds of the f32 test of eight triangles.
struct Errors<S: Simd> {
    /// Error bound of the determinant.
    det: f32x8<S>,
    /// Error bound of the weights multiplied by the determinant.
    uv: f32x8<S>,
    /// Error bound of the distance multiplied by the determinant.
    t: f32x8<S>,
}

/// Mask of the triangles that all rays of a fan miss. The rays start at offset `s` from the first corners, have
/// directions in the box `(d, turn)` (centre, half extent) and end at `farthest`.
///
/// The dot product of a vector with any direction of the box differs from that with `d` by at most the dot product of
/// its absolute value with `turn`. If all rays see the triangle from one side, the sign of the determinant is known.
#[inline(always)]
fn missed<S: Simd>(
    simd: S,
    s: Vector8<S>,
    [d, turn]: [[f32; 3]; 2],
    farthest: f32,
    &Sides { e1, e2, normal }: &Sides<S>,
    errors: &Errors<S>,
) -> u64 {
    let two = f32x8::splat(simd, 2.0);
    let (d, turn) = (same(simd, d), same(simd, turn));
    // The range of the determinant over the box: `det` plus or minus `det_half`.
    let det = dot(normal, d);
    let det_half = dot(abs(normal), turn);
    let side = f32x8::splat(simd, 1.0).copysign(det);
    let det = det.abs();
    let one_sided = (det - det_half).simd_gt(errors.det * two);
    // Bound the largest value of each weight over the box; reject if one is negative for all rays.
    let (of_u, of_v) = (cross(e2, s), cross(s, e1));
    let of_w = sub(sub(normal, of_u), of_v);
    let u = dot(of_u, d).mul_add(side, dot(abs(of_u), turn));
    let v = dot(of_v, d).mul_add(side, dot(abs(of_v), turn));
    let w = dot(of_w, d).mul_add(side, dot(abs(of_w), turn));
    let outside = u.min(v).min(w).simd_lt(-(errors.uv * two));
    // Reject triangles beyond the farthest ray's end, or behind the common origin.
    let height = dot(normal, s) * -side;
    let room = errors.t * two;
    let far = f32x8::splat(simd, farthest);
    let doubt = far
        .abs()
        .mul_add(errors.det * f32x8::splat(simd, 3.0), room);
    let beyond = height.simd_gt((det + det_half).mul_add(far, doubt)) | height.simd_lt(-room);
    (one_sided & (outside | beyond)).to_bitmask()
}
