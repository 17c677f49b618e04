// SPDX-License-Identifier: GPL-3.0-or-later
//! Quantities of eight triangles of a leaf relative to the common origin of a tile, with their error bounds, and
//! the test against the pyramid that contains the rays. [`crate::tile::leaf`] derives the bounds.

use crate::tile::Tile;
use fearless_simd::{Simd, SimdBase, SimdFloat, SimdMask, f32x8};
use halfspace_leaf::blocks::{LANES as WIDE, SPAN};
use halfspace_leaf::candidates::{DET_ERROR, T_ERROR, UNDERFLOW, UV_ERROR};
use halfspace_leaf::eight::{Vector8, corner_and_sides, cross, dot, largest, same, sub};

/// A dot product at the corners of the pyramid, one triangle per lane: at the first corner, and its differences
/// along the two sides that begin there.
#[derive(Clone, Copy)]
pub struct Corners {
    pub first: [f32; WIDE],
    pub sides: [[f32; WIDE]; 2],
}

/// Eight triangles relative to the origin of a tile, one per lane.
pub struct Prepared {
    /// Vectors whose dot product with a direction is the determinant.
    pub det: [[f32; WIDE]; 3],
    /// Vectors whose dot products with a direction are the weights of the three vertices.
    pub weights: [[[f32; WIDE]; 3]; 3],
    /// Numerators of the distances, positive, and the error bounds of the single test.
    pub t: [f32; WIDE],
    pub det_error: [f32; WIDE],
    pub uv_error: [f32; WIDE],
    pub t_error: [f32; WIDE],
    /// Error bounds for products over a row's part of the pyramid.
    pub det_row_error: [f32; WIDE],
    pub uv_row_error: [f32; WIDE],
    /// The weights and the determinant at the corners of the pyramid.
    pub at: [Corners; 4],
    /// Mask of the triangles that some ray of the tile may hit.
    pub kept: u64,
    /// Mask of the triangles for which the origin's side is uncertain.
    pub edgewise: u64,
}

impl Prepared {
    const NOTHING: Self = Self {
        det: [[0.0; WIDE]; 3],
        weights: [[[0.0; WIDE]; 3]; 3],
        t: [0.0; WIDE],
        det_error: [0.0; WIDE],
        uv_error: [0.0; WIDE],
        t_error: [0.0; WIDE],
        det_row_error: [0.0; WIDE],
        uv_row_error: [0.0; WIDE],
        at: [Corners {
            first: [0.0; WIDE],
            sides: [[0.0; WIDE]; 2],
        }; 4],
        kept: 0,
        edgewise: 0,
    };
}

/// Factor between the error bound of the single test and that for rows; derived in [`crate::tile::leaf`].
const ROW_ERROR: f32 = 8.0;

/// Error bounds of eight triangles.
struct Errors<S: Simd> {
    /// Error of determinants.
    det: f32x8<S>,
    /// Error of weights, times the determinant.
    uv: f32x8<S>,
    /// Error of distances, times the determinant.
    t: f32x8<S>,
    /// Error of determinants over a row's part of the pyramid.
    det_row: f32x8<S>,
    /// Error of weights over a row's part of the pyramid.
    uv_row: f32x8<S>,
}

impl<S: Simd> Errors<S> {
    /// The bounds for triangles with sides up to `size` at offsets up to `span` from the origin of a tile with
    /// this blur.
    #[inline(always)]
    fn new(simd: S, size: f32x8<S>, span: f32x8<S>, [blur, turn]: [f32; 2]) -> Self {
        // A term of zero unless some product may have overflowed, then NaN: NaN bounds reject nothing.
        let product = splat8(simd, 64.0) * span * size * size.max(splat8(simd, 1.0));
        let floor = product.mul_add(splat8(simd, 0.0), splat8(simd, UNDERFLOW));
        // The part of the bounds due to the blur, which does not grow when products are combined.
        let det_blur = size * size * splat8(simd, 7.0 * turn);
        let uv_blur = size * span.mul_add(splat8(simd, 14.0 * turn), splat8(simd, 30.0 * blur))
            + det_blur * splat8(simd, 3.0);
        // The bounds of the single test, with the terms of the blur.
        let det = size.mul_add(
            size * splat8(simd, 7.0f32.mul_add(turn, DET_ERROR)),
            splat8(simd, UNDERFLOW),
        );
        let uv = size.mul_add(
            span.mul_add(
                splat8(simd, 14.0f32.mul_add(turn, 2.0 * UV_ERROR)),
                splat8(simd, 30.0 * blur),
            ),
            det.mul_add(splat8(simd, 3.0), floor),
        );
        let t = (size * size).mul_add(
            span.mul_add(splat8(simd, T_ERROR), splat8(simd, 7.0 * blur)),
            floor,
        );
        let rows = splat8(simd, ROW_ERROR);
        Self {
            det,
            uv,
            t,
            det_row: det_blur + (det - det_blur) * rows,
            uv_row: uv_blur + (uv - uv_blur) * rows,
        }
    }
}

/// Vectors and numerators of eight triangles, oriented so that the determinant of a hit is positive.
struct Oriented<S: Simd> {
    /// Vectors whose dot products with a direction are the weights.
    weights: [Vector8<S>; 3],
    /// Vectors whose dot products with a direction are the determinants.
    det: Vector8<S>,
    /// Numerators of the distances.
    t: f32x8<S>,
}

impl<S: Simd> Oriented<S> {
    /// The quantities of triangles with sides `e1` and `e2`, for an origin at offset `s` from their first vertices.
    #[inline(always)]
    fn new(simd: S, s: Vector8<S>, e1: Vector8<S>, e2: Vector8<S>) -> Self {
        let (det, u, v) = (cross(e2, e1), cross(e2, s), cross(s, e1));
        let t = dot(e2, v);
        let side = splat8(simd, 1.0).copysign(t);
        let det = [det[0] * side, det[1] * side, det[2] * side];
        let u = [u[0] * side, u[1] * side, u[2] * side];
        let v = [v[0] * side, v[1] * side, v[2] * side];
        Self {
            weights: [u, v, sub(sub(det, u), v)],
            det,
            t: t * side,
        }
    }
}

#[inline(always)]
fn splat8<S: Simd>(simd: S, x: f32) -> f32x8<S> {
    f32x8::splat(simd, x)
}

/// Tests `n` triangles of a block against the pyramid, up to the distance `leave`, and prepares them for the tests of
/// rows and rays.
#[inline(always)]
pub fn prepare<S: Simd, const R: usize>(
    simd: S,
    tile: &Tile<R>,
    leave: f32,
    block: &[f32; SPAN],
    n: usize,
) -> Prepared {
    let [a, e1, e2] = corner_and_sides(simd, block, n);
    let s = sub(same(simd, tile.o), a);
    let size = largest(e1).max(largest(e2));
    let errors = Errors::new(simd, size, largest(s), tile.blur);
    let oriented = Oriented::new(simd, s, e1, e2);
    let edgewise = !oriented.t.simd_gt(errors.t).to_bitmask();
    let mut prepared = Prepared {
        kept: (1_u64 << n) - 1,
        edgewise,
        ..Prepared::NOTHING
    };
    let outside = missed_by_pyramid(simd, tile, leave, &oriented, &errors, &mut prepared.at);
    prepared.kept &= !(outside & !edgewise);
    // Store the eight triangles as rows, to be read one lane at a time.
    if prepared.kept != 0 {
        for k in 0..3 {
            oriented.det[k].store_slice(&mut prepared.det[k]);
            for (of, rows) in oriented.weights.iter().zip(&mut prepared.weights) {
                of[k].store_slice(&mut rows[k]);
            }
        }
        oriented.t.store_slice(&mut prepared.t);
        errors.det.store_slice(&mut prepared.det_error);
        errors.uv.store_slice(&mut prepared.uv_error);
        errors.det_row.store_slice(&mut prepared.det_row_error);
        errors.uv_row.store_slice(&mut prepared.uv_row_error);
        errors.t.store_slice(&mut prepared.t_error);
    }
    prepared
}

/// Mask of the triangles with a weight that is negative at all corners of the pyramid, or that lie beyond the
/// farthest ray. Writes the products at the corners to `at`.
#[inline(always)]
fn missed_by_pyramid<S: Simd, const R: usize>(
    simd: S,
    tile: &Tile<R>,
    leave: f32,
    oriented: &Oriented<S>,
    errors: &Errors<S>,
    at: &mut [Corners; 4],
) -> u64 {
    let Some(pyramid) = &tile.pyramid else {
        return 0;
    };
    let below = -errors.uv;
    let [u, v, w] = oriented.weights;
    let mut outside = 0;
    for (i, of) in [u, v, w, oriented.det].into_iter().enumerate() {
        let [a, b, c, d] = &pyramid.corners;
        let a = dot(of, same(simd, *a));
        let b = dot(of, same(simd, *b));
        let c = dot(of, same(simd, *c));
        let d = dot(of, same(simd, *d));
        let most = a.max(b).max(c.max(d));
        if i < 3 {
            outside |= most.simd_lt(below).to_bitmask();
        } else {
            let far = splat8(simd, tile.stretched(pyramid, leave));
            let doubt = far.abs() * errors.det_row + errors.t;
            outside |= oriented.t.simd_gt(most.mul_add(far, doubt)).to_bitmask();
        }
        a.store_slice(&mut at[i].first);
        (b - a).store_slice(&mut at[i].sides[0]);
        (c - a).store_slice(&mut at[i].sides[1]);
    }
    outside
}
