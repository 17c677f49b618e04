// SPDX-License-Identifier: GPL-3.0-or-later
//! The exact verdict for sixteen rays at a time, each with a triangle of its own, in f64 as far as f64 is certain. It
//! repeats the arithmetic of [`halfspace_geom::verdict`] operation by operation, with error bounds at least as large.

use crate::row::{self, LANES, Row, load, splat};
use fearless_simd::{Simd, SimdBase, SimdMask, f32x16, f64x8, mask64x8};
use halfspace_geom::verdict::{DETERMINANT_ERROR, FromOrigin, WEIGHT_SLACK};

/// Half of a row, the number of f64 lanes.
pub const HALF: usize = 8;

/// Eight vectors of f64, by axis.
pub type Vector<S> = [f64x8<S>; 3];

/// Computes the hits of sixteen rays as [`halfspace_geom::verdict`] does, each with a triangle that it certainly hits. Returns the
/// mask of those of which f64 determines all numbers to the last bit, and their `t` and the weights of the second and
/// third vertices.
#[inline(always)]
pub fn apart<S: Simd>(
    simd: S,
    o: &[Row; 3],
    d: &[Row; 3],
    to_scene: &[f64; LANES],
    corners: &[[Row; 3]; 3],
) -> (u16, [Row; 3]) {
    let (o, d) = (wide(simd, o), wide(simd, d));
    let [a, b, c] = corners;
    let (a, b, c) = (wide(simd, a), wide(simd, b), wide(simd, c));
    let (below, above) = to_scene.split_at(HALF);
    let low = Triangles8::from_origins(simd, o[0], [a[0], b[0], c[0]]);
    let low = half(simd, &low, d[0], f64x8::from_slice(simd, below));
    let high = Triangles8::from_origins(simd, o[1], [a[1], b[1], c[1]]);
    let high = half(simd, &high, d[1], f64x8::from_slice(simd, above));
    // The hit is certain if both bounds on its distance round to the same f32.
    let early = simd.narrow_f64x8(low.early, high.early);
    let late = simd.narrow_f64x8(low.late, high.late);
    let hit = (low.hit & low.well) | (high.hit & high.well) << HALF;
    let (certain, [u, v]) = shares(simd, &low, &high);
    let mut out = [[0.0; LANES]; 3];
    // Adding zero turns -0.0 into 0.0.
    (early + splat(simd, 0.0)).store_slice(&mut out[0]);
    u.store_slice(&mut out[1]);
    v.store_slice(&mut out[2]);
    (hit & certain & row::bits(early.simd_eq(late)), out)
}

/// Returns the weights of the second and third vertices of sixteen hits, and the mask of the rays of which both ends of
/// the error intervals of both round to the same f32.
#[inline(always)]
pub fn shares<S: Simd>(simd: S, low: &Half<S>, high: &Half<S>) -> (u16, [f32x16<S>; 2]) {
    let u = simd.narrow_f64x8(low.u - low.slack, high.u - high.slack);
    let v = simd.narrow_f64x8(low.v - low.slack, high.v - high.slack);
    let u_end = simd.narrow_f64x8(low.u + low.slack, high.u + high.slack);
    let v_end = simd.narrow_f64x8(low.v + low.slack, high.v + high.slack);
    (row::bits(u.simd_eq(u_end) & v.simd_eq(v_end)), [u, v])
}

/// The quantities of the verdict on eight triangles, each seen from an origin, for directions with components
/// below 2.
#[derive(Clone, Copy)]
pub struct Triangles8<S: Simd> {
    /// Vectors whose products with the direction are the weights of the vertices.
    pub normals: [Vector<S>; 3],
    /// Vector whose product with the direction is the sum of the weights.
    pub normal: Vector<S>,
    /// Distance multiplied by that sum.
    pub distance: f64x8<S>,
    /// Error bound of a weight.
    pub weight_error: f64x8<S>,
    /// Error bound of the sum.
    pub sum_error: f64x8<S>,
    /// Error bound of the distance multiplied by the sum.
    pub distance_error: f64x8<S>,
}

impl<S: Simd> Triangles8<S> {
    /// The quantities for eight origins and the vertices of eight triangles.
    #[inline(always)]
    pub fn from_origins(simd: S, o: Vector<S>, [a, b, c]: [Vector<S>; 3]) -> Self {
        let [of_a, of_b, of_c] = [sub(c, b), sub(a, c), sub(b, a)];
        let [a, b, c] = [sub(a, o), sub(b, o), sub(c, o)];
        let normal = cross(of_b, of_c);
        let (first, size) = (largest(a), largest(of_b).max(largest(of_c)));
        let error = all(simd, DETERMINANT_ERROR);
        let (twice, four) = (all(simd, 2.0), all(simd, 4.0));
        Self {
            normals: [cross(b, of_a), cross(c, of_b), cross(a, of_c)],
            normal,
            distance: dot(a, normal),
            weight_error: error * (four * ((first + size) * size)),
            sum_error: error * (twice * (size * size)),
            distance_error: error * (first * (size * size)),
        }
    }
}

/// The two halves of rows, as f64.
#[inline(always)]
pub fn wide<S: Simd>(simd: S, rows: &[Row; 3]) -> [Vector<S>; 2] {
    let [x, y, z] = rows;
    let (x, y, z) = (
        simd.widen_f32x16(load(simd, x)),
        simd.widen_f32x16(load(simd, y)),
        simd.widen_f32x16(load(simd, z)),
    );
    [[x.0, y.0, z.0], [x.1, y.1, z.1]]
}

/// A vector of equal numbers.
#[inline(always)]
pub fn all<S: Simd>(simd: S, x: f64) -> f64x8<S> {
    f64x8::splat(simd, x)
}

/// The same vector in all lanes.
#[inline(always)]
pub fn vectors<S: Simd>(simd: S, v: [f64; 3]) -> Vector<S> {
    [all(simd, v[0]), all(simd, v[1]), all(simd, v[2])]
}

#[inline(always)]
fn sub<S: Simd>(a: Vector<S>, b: Vector<S>) -> Vector<S> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn largest<S: Simd>(v: Vector<S>) -> f64x8<S> {
    v[0].abs().max(v[1].abs()).max(v[2].abs())
}

#[inline(always)]
fn dot<S: Simd>(a: Vector<S>, b: Vector<S>) -> f64x8<S> {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn cross<S: Simd>(a: Vector<S>, b: Vector<S>) -> Vector<S> {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// The verdict of f64 on eight rays.
pub struct Half<S: Simd> {
    /// Mask of the rays that certainly miss.
    pub miss: u16,
    /// Mask of the rays whose lines certainly hit.
    pub hit: u16,
    /// Mask of the rays whose distance certainly lies between `early` and `late`.
    pub well: u16,
    /// Lower bound on the distance in the scene.
    pub early: f64x8<S>,
    /// Upper bound on it.
    pub late: f64x8<S>,
    /// Weight of the second vertex.
    pub u: f64x8<S>,
    /// Weight of the third vertex.
    pub v: f64x8<S>,
    /// Error bound of `u` and of `v`.
    pub slack: f64x8<S>,
}

/// Computes the verdict on eight rays.
#[inline(always)]
pub fn half<S: Simd>(
    simd: S,
    triangle: &Triangles8<S>,
    d: Vector<S>,
    to_scene: f64x8<S>,
) -> Half<S> {
    let [a, b, c] = triangle.normals;
    let w = [dot(d, a), dot(d, b), dot(d, c)];
    // Decide by the signs of the weights, up to their error bound.
    let (most, least) = (w[0].max(w[1]).max(w[2]), w[0].min(w[1]).min(w[2]));
    let (above, below) = (triangle.weight_error, -triangle.weight_error);
    let miss = most.simd_gt(above) & least.simd_lt(below);
    let hit = least.simd_gt(above) | most.simd_lt(below);
    // Bound the distance if the determinant is well conditioned.
    let sum = dot(d, triangle.normal);
    let epsilon = all(simd, 2.0 * f64::EPSILON);
    let sum_error = triangle.sum_error;
    let both = sum_error + triangle.weight_error;
    let well = (sum.abs()).simd_gt(both * all(simd, FromOrigin::WELL_CONDITIONED));
    let inverse = all(simd, 1.0) / sum;
    let t = triangle.distance * inverse;
    let error = triangle.distance_error + t.abs() * sum_error;
    let slack = error * inverse.abs() * all(simd, 1.0 + 2e-6) + t.abs() * epsilon;
    Half {
        miss: bits(miss),
        hit: bits(hit),
        well: bits(well),
        early: (t - slack) * to_scene,
        late: (t + slack) * to_scene,
        u: w[1] * inverse,
        v: w[2] * inverse,
        slack: both * inverse.abs() * all(simd, WEIGHT_SLACK),
    }
}

#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "eight lanes")]
fn bits<S: Simd>(mask: mask64x8<S>) -> u16 {
    mask.to_bitmask() as u16 & 0xff
}
