// SPDX-License-Identifier: GPL-3.0-or-later
//! The f32 test of a ray against a block of up to eight triangles at once.
//!
//! It is the test of Möller and Trumbore 1997 with an error bound on each of its quantities. It rejects a
//! triangle only if the bounds prove a miss, and marks those remaining triangles that the bounds prove to be
//! hit.

use crate::blocks::{LANES, SPAN};
use fearless_simd::{Simd, SimdBase, SimdFloat, SimdMask, f32x8};
use halfspace_geom::bound::{keep_max, keep_min};
use halfspace_ray::FrameRay;
use halfspace_ray::frame::{PRUNE, U};
use halfspace_ray::query::{Counters, Query};

// With |d| < 2 per component, |e| <= E, |o - v| <= S and all inputs of the test rounded once, the roundings of
// each quantity add up to less than (per component bounds, worst case of signs):
//   d x e2: 12 u E      s x e1: 8 u S E
//   det = e1 . (d x e2): 84 u E^2       u = s . (d x e2): 84 u S E
//   v = d . (s x e1): 84 u S E          t = e2 . (s x e1): 48 u S E^2
// A determinant smaller than its error may have the wrong sign, and then the signs of all quantities are wrong. In that
// case the true weights of a hit are at most as large as the determinant, because they add up to it. Adding three times
// the determinant's error to the bounds of weights, and as much multiplied by the distance to that of t, covers it.
/// Error bound of a determinant per `E^2`: derived above, 84 u with room for the bound's own roundings.
pub const DET_ERROR: f32 = 96.0 * U;
/// Half the error bound of a weight per `S E`: derived above. The double also covers tiles, where the vector of the
/// third weight is a sum and its error bound 196 u S E (`halfspace_group::tile::leaf`).
pub const UV_ERROR: f32 = 104.0 * U;
/// Error bound of `t` times the determinant per `S E^2`: derived above, 48 u with room.
pub const T_ERROR: f32 = 64.0 * U;

/// Absolute part of every bound, for products that lost bits below the normal numbers. It also appears in
/// factors of offsets, because those bits are multiplied by the offset too.
pub const UNDERFLOW: f32 = 1e-36;

/// Error bounds of the test of a block, for distances up to a reach.
#[derive(Clone, Copy)]
pub struct Errors {
    /// Error bound of a weight.
    pub uv: f32,
    /// Error bound of `t` minus the product of determinant and distance, for hits up to the reach.
    pub t: f32,
    /// Absolute part of both bounds: [`UNDERFLOW`], or NaN if some product may have overflowed.
    floor: f32,
}

/// Errors of a ray whose origin and direction, and the vertices that it meets, have errors of their own.
///
/// Let `s`, `d`, `e1` and `e2` be what the test reads, and `s'`, `d'`, `e1'` and `e2'` the true vectors: offsets and
/// edges differ by at most the blur `B` per component, directions by the drift `D`. No bound is needed for triangles
/// that are missed. For one that is hit at the distance `T`, `s' = w - T d'`, where `w` leads from the first vertex to
/// the point hit, so that `|w| <= E` if `E` includes the blur. Hence the errors do not grow with the offset, although
/// the products do:
///
/// - `u - u' = s' . ((d - d') x e2') + (s - s') . (d x e2) + s' . (d x (e2 - e2'))`. The first term is at most 6 D S E,
///   the second 2 B E |d| with `|d|` the sum of the direction's components. In the third `s' x d` is
///   `w x d + T (d - d') x d`, so it is at most 2 B E |d| + 2 B T D |d|, and `T <= 1.02 (S + E)`.
/// - The same holds for `v`, and for the third weight with twice the edges. The determinant has 4 B E |d| + 6 D E^2.
/// - `t - det T = (s + T d) . (e1 x e2)`, and `s + T d = w + (s - s') + T (d - d')`, where `w` is perpendicular to
///   `e1' x e2'`: at most 12 B E^2 + 6 B E^2 + 6 D T E^2. The sign of the determinant does not matter.
///
/// A weight, and the determinant's part for a wrong sign, have at most 12 B E |d| + 12 B D (S + E) |d| together.
struct Blurred {
    /// 6 D.
    drift: f32,
    /// `B |d| / 6`, with room for its rounding.
    turned: f32,
}

impl Blurred {
    /// Computes them for a ray.
    #[inline(always)]
    fn new(ray: &FrameRay) -> Self {
        Self {
            drift: 6.0 * ray.drift,
            turned: 0.17 * (ray.d[0].abs() + ray.d[1].abs() + ray.d[2].abs()) * ray.blur,
        }
    }
}

impl Errors {
    /// Computes the bounds for triangles with these coefficients and distances up to `reach`.
    #[inline(always)]
    pub fn new(edges: &Bounds, ray: &FrameRay, reach: f32) -> Self {
        let size = edges.size;
        // Bound the distance of hits: up to the reach, or behind the origin if the ray interval starts there. A vertex
        // of a triangle hit is at most the triangle's size farther away.
        let farthest = keep_max(-ray.t_min, reach);
        // Compute the bounds. The first branch is the second without blur and drift, in fewer operations, because these
        // cost as much as those on all triangles of the block.
        let (det, uv, t, floor) = if !ray.is_blurred() {
            // 0, or NaN if some product may have overflowed: NaN bounds reject nothing.
            let zero_or_nan = 0.0 * ((ray.span + size) * edges.overflow);
            let offset = keep_min(2.0 * farthest, ray.span) + zero_or_nan;
            let uv = offset * edges.uv[0] + edges.uv[1];
            let t = offset * edges.t[0] + edges.t[1];
            (edges.det, uv, t, zero_or_nan + UNDERFLOW)
        } else {
            // Offsets and edges have the blur as an error, directions the drift; [`Blurred`] derives the terms.
            let Blurred { drift, turned } = Blurred::new(ray);
            let size = size + ray.blur;
            let span = keep_min((2.0 + drift) * farthest + size, ray.span) + ray.blur;
            let floor = UNDERFLOW + 0.0 * (64.0 * span * size * keep_max(size, 1.0));
            let det = (DET_ERROR + drift) * size * size + UNDERFLOW;
            let t = (T_ERROR * span + 18.0 * ray.blur) * size * size + floor;
            let uv = 2.0 * ((UV_ERROR + drift) * size + UNDERFLOW) * span
                + 12.0 * turned * (6.0 * size + drift * (span + size))
                + 3.0 * det
                + floor;
            (det, uv, t, floor)
        };
        // Add the error for a determinant of the wrong sign, which is proportional to the distance of the hit.
        let t = t + 3.0 * det * farthest;
        Self { uv, t, floor }
    }
}

/// The triangles of one block that the ray may hit, with what later rejections need.
pub struct Candidates<S: Simd> {
    /// Mask of the candidates.
    lanes: u64,
    /// Absolute value of the determinant.
    det: f32x8<S>,
    /// Distance multiplied by `det`.
    t: f32x8<S>,
    /// Least of the three weights, multiplied by `det`.
    least: f32x8<S>,
    errors: Errors,
}

/// The triangles of a block that the ray provably hits, and bounds on their distances.
pub struct ProvenHits {
    /// Mask of their lanes.
    lanes: u64,
    /// Lower and upper bounds on their distances. With late verdicts the lower row holds, in the lanes of all
    /// candidates, bounds or estimates that order them.
    range: [[f32; LANES]; 2],
}

impl ProvenHits {
    /// No triangle.
    pub const NOTHING: Self = Self {
        lanes: 0,
        range: [[0.0; LANES]; 2],
    };

    /// Returns the bounds on the frame distance of the hit in a lane, or `None` if the hit is not proven.
    #[inline(always)]
    pub fn range(&self, lane: usize) -> Option<[f32; 2]> {
        let [low, high] = &self.range;
        (self.lanes >> lane & 1 == 1).then(|| [low[lane], high[lane]])
    }
}

/// The coefficients of the error bounds of triangles up to a size.
#[derive(Clone, Copy)]
pub struct Bounds {
    /// The largest edge component.
    size: f32,
    /// Overflow factor: if it overflows when multiplied by the distance to a vertex, some product of the test
    /// may have.
    overflow: f32,
    /// Error bound of a determinant.
    pub det: f32,
    /// Coefficients of the error bound of a weight: `uv[0] * x + uv[1]` if no vertex is farther from the origin than
    /// `x` plus `size`.
    uv: [f32; 2],
    /// Coefficients of the error bound of `t`, in the same form. What small edges lose by underflow, multiplied by a
    /// long offset, is less than the term for the determinant's sign.
    t: [f32; 2],
}

impl Bounds {
    /// Computes the coefficients, which are linear in the ray's offset, for edges with components up to `size`.
    #[inline(always)]
    pub fn new(size: f32) -> Self {
        let det = DET_ERROR * (size * size) + UNDERFLOW;
        let [uv, t] = [2.0 * UV_ERROR * size, T_ERROR * (size * size)];
        Self {
            size,
            overflow: 64.0 * size * keep_max(size, 1.0),
            det,
            uv: [uv + UNDERFLOW, uv * size + (3.0 * det + UNDERFLOW)],
            t: [t, t * size + UNDERFLOW],
        }
    }
}

/// The part of the test that does not depend on the ray: the triangles of a block, one per lane, and the
/// coefficients of their error bounds.
pub struct Edges<S: Simd> {
    /// The first vertex.
    corner: [f32x8<S>; 3],
    /// The edges from the first vertex to the second and to the third.
    sides: [[f32x8<S>; 3]; 2],
    /// Number of triangles.
    count: usize,
    /// The bounds of the largest triangle in the block.
    bounds: Bounds,
    /// The largest edge component of each triangle.
    sizes: f32x8<S>,
}

impl<S: Simd> Edges<S> {
    /// Computes the edges and bounds of a block of `n` triangles.
    #[inline(always)]
    pub fn new(simd: S, block: &[f32; SPAN], n: usize) -> Self {
        let row = |r: usize| f32x8::from_slice(simd, &block[1 + r * n..1 + r * n + LANES]);
        let v = [row(0), row(1), row(2)];
        let sides = [
            [row(3) - v[0], row(4) - v[1], row(5) - v[2]],
            [row(6) - v[0], row(7) - v[1], row(8) - v[2]],
        ];
        Self {
            corner: v,
            sides,
            count: n,
            bounds: Bounds::new(block[0]),
            sizes: largest(sides[0]).max(largest(sides[1])),
        }
    }

    /// Returns the number of triangles.
    #[inline(always)]
    pub fn count(&self) -> usize {
        self.count
    }

    /// Returns the ray's origin minus the first vertex.
    #[inline(always)]
    fn offset(&self, simd: S, ray: &FrameRay) -> [f32x8<S>; 3] {
        let splat = |x: f32| f32x8::splat(simd, x);
        [
            splat(ray.o[0]) - self.corner[0],
            splat(ray.o[1]) - self.corner[1],
            splat(ray.o[2]) - self.corner[2],
        ]
    }
}

/// Returns the largest absolute component of each of eight vectors.
#[inline(always)]
fn largest<S: Simd>(v: [f32x8<S>; 3]) -> f32x8<S> {
    v[0].abs().max(v[1].abs()).max(v[2].abs())
}

impl<S: Simd> Candidates<S> {
    /// Returns whether any candidate is left.
    #[inline(always)]
    pub fn any(&self) -> bool {
        self.lanes != 0
    }

    /// Rejects every triangle that the ray provably misses between its start and `reach`, by bounds for the
    /// block's largest triangle.
    #[inline(always)]
    pub fn new(simd: S, edges: &Edges<S>, ray: &FrameRay, reach: f32) -> Self {
        let splat = |x: f32| f32x8::splat(simd, x);
        // Broadcast the ray; `s` is the offset, `a` and `b` are the edges `e1` and `e2`.
        let (dx, dy, dz) = (splat(ray.d[0]), splat(ray.d[1]), splat(ray.d[2]));
        let [sx, sy, sz] = edges.offset(simd, ray);
        let [[ax, ay, az], [bx, by, bz]] = edges.sides;

        // p = d x e2, q = s x e1
        let px = dy.mul_sub(bz, dz * by);
        let py = dz.mul_sub(bx, dx * bz);
        let pz = dx.mul_sub(by, dy * bx);
        let qx = sy.mul_sub(az, sz * ay);
        let qy = sz.mul_sub(ax, sx * az);
        let qz = sx.mul_sub(ay, sy * ax);
        let det = ax.mul_add(px, ay.mul_add(py, az * pz));
        let u = sx.mul_add(px, sy.mul_add(py, sz * pz));
        let v = dx.mul_add(qx, dy.mul_add(qy, dz * qz));
        let t = bx.mul_add(qx, by.mul_add(qy, bz * qz));

        // Flip signs so that the determinant is positive.
        let sign = splat(1.0).copysign(det);
        let (det, u, v, t) = (det * sign, u * sign, v * sign, t * sign);
        let least = u.min(v).min(det - u - v);

        // Reject if a weight is provably negative or the distance provably exceeds the reach.
        let errors = Errors::new(&edges.bounds, ray, reach);
        let limit = det.mul_add(splat(reach), splat(errors.t));
        let rejected = least.simd_lt(splat(-errors.uv)) | t.simd_gt(limit);
        Self {
            lanes: !rejected.to_bitmask() & ((1 << edges.count) - 1),
            det,
            t,
            least,
            errors,
        }
    }

    /// Rejects more candidates: by bounds for each triangle's own size, hits behind the origin, and triangles
    /// coplanar with the ray. Returns which of the rest the ray provably hits, and the bounds on their
    /// distances.
    #[inline(always)]
    pub fn refine<Q: Query, C: Counters>(
        &mut self,
        simd: S,
        edges: &Edges<S>,
        ray: &FrameRay,
    ) -> ProvenHits {
        let splat = |x: f32| f32x8::splat(simd, x);
        let s = edges.offset(simd, ray);
        let floor = splat(self.errors.floor);
        // Recompute the bound of a weight with the size and the offset of each triangle; the terms are those of
        // [`Errors::new`].
        let (size, span) = (edges.sizes, largest(s));
        let uv_error = if !ray.is_blurred() {
            let sides = size * (size * splat(3.0 * DET_ERROR)) + floor;
            span.mul_add(size * splat(2.0 * UV_ERROR) + splat(UNDERFLOW), sides)
        } else {
            let Blurred { drift, turned } = Blurred::new(ray);
            let (size, span) = (size + splat(ray.blur), span + splat(ray.blur));
            let sides = size.mul_add(splat(6.0), (span + size) * splat(drift));
            let lost = span.mul_add(splat(2.0 * UNDERFLOW), floor);
            let blurred = sides.mul_add(splat(12.0 * turned), lost);
            size.mul_add(
                size * splat(3.0 * (DET_ERROR + drift)),
                size.mul_add(span * splat(2.0 * (UV_ERROR + drift)), blurred),
            )
        };
        // Reject hits behind the origin, unless the ray interval starts there.
        let behind = if ray.t_min >= -1e-30 {
            -self.errors.t
        } else {
            f32::NEG_INFINITY
        };
        let outside = self.least.simd_lt(-uv_error);
        let rejected = outside | self.t.simd_lt(splat(behind));
        self.lanes &= !rejected.to_bitmask();
        // Reject triangles in an axis-aligned plane that contains the ray, which the exact test would reject at greater
        // cost. A difference of floats is zero only if the coordinates are equal.
        if ray.still.contains(&0.0) {
            let [a, b] = edges.sides;
            let apart = |k: usize| {
                let offset = s[k].abs().max(a[k].abs()).max(b[k].abs());
                offset.max(splat(ray.still[k]))
            };
            let nearest = apart(0).min(apart(1)).min(apart(2));
            self.lanes &= !nearest.simd_eq(splat(0.0)).to_bitmask();
        }
        // Mark proven hits, if the query can use them.
        let mut proven = ProvenHits::NOTHING;
        if (C::LATE || C::QUICK && Q::ANY) && !ray.is_blurred() {
            let det_error = size * (size * splat(DET_ERROR)) + splat(UNDERFLOW);
            let sides = size * (size * splat(T_ERROR)) + splat(UNDERFLOW);
            let t_error = span.mul_add(sides, floor);
            // Prove that all three weights are positive and that the determinant is not near zero.
            let sure = self.least.simd_gt(uv_error) & self.det.simd_gt(det_error * splat(4.0));
            proven.lanes = sure.to_bitmask();
            let low = (self.t - t_error) / (self.det + det_error) * splat(2.0 - PRUNE);
            let high = (self.t + t_error) / (self.det - det_error) * splat(PRUNE);
            low.store_slice(&mut proven.range[0]);
            high.store_slice(&mut proven.range[1]);
        } else if C::LATE {
            // Store the estimates that order the candidates.
            (self.t / self.det).store_slice(&mut proven.range[0]);
        }
        proven
    }

    /// Removes a candidate and returns its lane: the nearest one by estimated distance, or any for any-hit queries.
    #[inline(always)]
    pub fn next<Q: Query, C: Counters>(&mut self, proven: &ProvenHits) -> Option<usize> {
        if self.lanes == 0 {
            return None;
        }
        let mut lane = self.lanes.trailing_zeros() as usize;
        let mut others = self.lanes & (self.lanes - 1);
        if !Q::ANY && others != 0 {
            let mut distances = proven.range[0];
            if !C::LATE {
                (self.t / self.det).store_slice(&mut distances);
            }
            // Search the other lanes for a smaller distance.
            while others != 0 {
                let other = others.trailing_zeros() as usize;
                if distances[other] < distances[lane] {
                    lane = other;
                }
                others &= others - 1;
            }
        }
        self.lanes &= !(1 << lane);
        Some(lane)
    }

    /// Drops the triangles that provably lie beyond `reach`.
    #[inline(always)]
    pub fn drop_beyond(&mut self, simd: S, reach: f32) {
        if self.lanes != 0 {
            let error = f32x8::splat(simd, self.errors.t);
            let limit = self.det.mul_add(f32x8::splat(simd, reach), error);
            self.lanes &= !self.t.simd_gt(limit).to_bitmask();
        }
    }
}

#[cfg(test)]
mod tests;
