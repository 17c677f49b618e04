// SPDX-License-Identifier: GPL-3.0-or-later
//! The test of a block of up to eight triangles, all at once in f32.
//!
//! It is that of Möller and Trumbore 1997, with an error bound on each of its quantities. It rejects a
//! triangle only when the bound proves the miss; of what is left it tells which the ray certainly hits.

use super::blocks::{LANES, SPAN};
use super::bound::{keep_max, keep_min};
use super::frame::{FrameRay, PRUNE, U};
use super::query::{Counters, Query};
use fearless_simd::{Simd, SimdBase, SimdFloat, SimdMask, f32x8};

// With |d| < 2 per component, |e| <= E, |o - v| <= S and all inputs of the test rounded once, the
// roundings of each quantity add up to less than (per component bounds, worst case of signs):
//   d x e2: 12 u E      s x e1: 8 u S E
//   det = e1 . (d x e2): 84 u E^2       u = s . (d x e2): 84 u S E
//   v = d . (s x e1): 84 u S E          t = e2 . (s x e1): 48 u S E^2
// A determinant within its error may come out with the wrong sign, and then all signs are wrong.
// But then the true weights of a hit, which add up to it, are as small, and so is t times it. Three
// times the determinant's error on the other bounds covers that case.
pub(super) const DET_ERROR: f32 = 96.0 * U;
// Twice that is taken for all weights: of the third, where its vector is put together first, that covers 196 u S E
// (see [`super::tile_leaf`]).
pub(super) const UV_ERROR: f32 = 104.0 * U;
pub(super) const T_ERROR: f32 = 64.0 * U;

/// Absolute part of every bound, where products lost bits below the normal numbers.
pub(super) const UNDERFLOW: f32 = 1e-36;

/// Bounds on the errors of the test of a block, and what follows from them for distances up to a reach.
#[derive(Clone, Copy)]
struct Errors {
    det: f32,
    uv: f32,
    t: f32,
    /// On `t` less the reach times the determinant.
    doubt: f32,
    /// Part of each bound: next to nothing, or NaN where some product may have overflowed.
    floor: f32,
}

impl Errors {
    /// For triangles of this size.
    #[inline(always)]
    fn new(size: f32, ray: &FrameRay, reach: f32) -> Self {
        // A corner of a triangle that is hit within reach, or behind the origin where the ray begins there, is
        // no farther than that, and its size.
        let farthest = keep_max(-ray.t_min, reach);
        // The first branch is the second one without blur and drift, at half its operations.
        let (det, uv, t, floor) = if ray.place.is_none() {
            // From the size and the reach as few operations as can be: what follows waits for both.
            let lever = (keep_min(2.0 * farthest, ray.span) + size) * size;
            let largest = (ray.span + size) * size;
            // Next to nothing, or NaN where some product may have overflowed: NaN bounds reject nothing.
            let floor = UNDERFLOW + 0.0 * (64.0 * largest * keep_max(size, 1.0));
            let det = DET_ERROR * (size * size) + UNDERFLOW;
            let uv = 2.0 * UV_ERROR * lever + (3.0 * det + floor);
            (det, uv, T_ERROR * (lever * size) + floor, floor)
        } else {
            // In an instance's space offsets and edges may be off by the blur; what the rows of a determinant
            // are off by adds up, times six for its products and times the size of the other rows.
            let (blur, drift) = (ray.blur, 6.0 * ray.drift);
            let size = size + blur;
            let span = keep_min((2.0 + drift) * farthest + size, ray.span) + blur;
            let floor = UNDERFLOW + 0.0 * (64.0 * span * size * keep_max(size, 1.0));
            let det = ((DET_ERROR + drift) * size + 24.0 * blur) * size + UNDERFLOW;
            let t = (T_ERROR * span * size + 6.0 * blur * (size + 2.0 * span)) * size + floor;
            let uv = 2.0 * ((UV_ERROR + drift) * span * size + 12.0 * blur * (span + size))
                + 3.0 * det
                + floor;
            (det, uv, t, floor)
        };
        let doubt = t + 3.0 * reach.abs() * det;
        Self {
            det,
            uv,
            t,
            doubt,
            floor,
        }
    }
}

/// The triangles of one block that the ray may hit.
pub(super) struct Candidates<S: Simd> {
    lanes: u64,
    det: f32x8<S>,
    t: f32x8<S>,
    /// The least of the three weights.
    least: f32x8<S>,
    errors: Errors,
    /// Those that the ray certainly hits.
    sure: u64,
    /// Bounds on the distances of those, near and far.
    range: [[f32; LANES]; 2],
}

/// The triangles of a block, a lane each: what all rays have in common.
pub(super) struct Edges<S: Simd> {
    /// A corner.
    corner: [f32x8<S>; 3],
    /// The others less that one.
    sides: [[f32x8<S>; 3]; 2],
    /// How many there are.
    count: usize,
    /// The largest component of a side.
    size: f32,
}

impl<S: Simd> Edges<S> {
    /// Of the block of `n` triangles.
    #[inline(always)]
    pub(super) fn new(simd: S, block: &[f32; SPAN], n: usize) -> Self {
        let row = |r: usize| f32x8::from_slice(simd, &block[1 + r * n..1 + r * n + LANES]);
        let v = [row(0), row(1), row(2)];
        Self {
            corner: v,
            sides: [
                [row(3) - v[0], row(4) - v[1], row(5) - v[2]],
                [row(6) - v[0], row(7) - v[1], row(8) - v[2]],
            ],
            count: n,
            size: block[0],
        }
    }

    /// The ray's origin less the corner.
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

impl<S: Simd> Candidates<S> {
    /// Whether there are any.
    #[inline(always)]
    pub(super) fn any(&self) -> bool {
        self.lanes != 0
    }

    /// Rejects every triangle that the ray certainly misses between its start and `reach`, by bounds for
    /// the block's largest.
    #[inline(always)]
    pub(super) fn new(simd: S, edges: &Edges<S>, ray: &FrameRay, reach: f32) -> Self {
        let splat = |x: f32| f32x8::splat(simd, x);
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

        // Turn everything so that the determinant is positive.
        let sign = splat(1.0).copysign(det);
        let (det, u, v, t) = (det * sign, u * sign, v * sign, t * sign);
        let least = u.min(v).min(det - u - v);

        let errors = Errors::new(edges.size, ray, reach);
        let limit = det.mul_add(splat(reach), splat(errors.doubt));
        let rejected = least.simd_lt(splat(-errors.uv)) | t.simd_gt(limit);
        Self {
            lanes: !rejected.to_bitmask() & ((1 << edges.count) - 1),
            det,
            t,
            least,
            errors,
            sure: 0,
            range: [[0.0; LANES]; 2],
        }
    }

    /// Rejects more of them: each triangle by bounds for its own size, what lies behind the origin, and what
    /// lies in one plane with the ray. Of what remains, tells which the ray certainly hits, and where.
    #[inline(always)]
    pub(super) fn refine<Q: Query, C: Counters>(
        &mut self,
        simd: S,
        edges: &Edges<S>,
        ray: &FrameRay,
    ) {
        let splat = |x: f32| f32x8::splat(simd, x);
        let s = edges.offset(simd, ray);
        let [a, b] = edges.sides;
        let (blur, drift) = (ray.blur, 6.0 * ray.drift);
        let largest = |v: [f32x8<S>; 3]| v[0].abs().max(v[1].abs()).max(v[2].abs());
        let size = largest(a).max(largest(b)) + splat(blur);
        let span = largest(s) + splat(blur);
        let blurred =
            (span + size * splat(4.0)).mul_add(splat(24.0 * blur), splat(self.errors.floor));
        let uv_error = size.mul_add(
            size * splat(3.0 * (DET_ERROR + drift)),
            size.mul_add(span * splat(2.0 * (UV_ERROR + drift)), blurred),
        );
        let behind = if ray.t_min >= -1e-30 {
            -self.errors.doubt
        } else {
            f32::NEG_INFINITY
        };
        // Rays inside an axis-parallel wall: the verdict would say at length what equality of
        // coordinates says at once, that they miss it. Differences of floats vanish only then.
        let apart = |k: usize| {
            let offset = s[k].abs().max(a[k].abs()).max(b[k].abs());
            offset.max(splat(ray.still[k]))
        };
        let nearest = apart(0).min(apart(1)).min(apart(2));
        let in_wall = nearest.simd_eq(splat(0.0));
        let outside = self.least.simd_lt(-uv_error);
        let rejected = outside | self.t.simd_lt(splat(behind)) | in_wall;
        self.lanes &= !rejected.to_bitmask();
        if (C::LATE || C::QUICK && Q::ANY) && ray.place.is_none() {
            let floor = splat(self.errors.floor);
            let det_error = size.mul_add(size * splat(DET_ERROR), splat(UNDERFLOW));
            let t_error = (span * splat(T_ERROR)).mul_add(size * size, floor);
            // All three weights certainly have one sign, and their sum is not near zero.
            let sure = self.least.simd_gt(uv_error) & self.det.simd_gt(det_error * splat(4.0));
            self.sure = sure.to_bitmask();
            let low = (self.t - t_error) / (self.det + det_error) * splat(2.0 - PRUNE);
            let high = (self.t + t_error) / (self.det - det_error) * splat(PRUNE);
            low.store_slice(&mut self.range[0]);
            high.store_slice(&mut self.range[1]);
        }
    }

    /// The distances between which the ray certainly hits the triangle of a lane.
    #[inline(always)]
    pub(super) fn sure(&self, lane: usize) -> Option<[f32; 2]> {
        let [low, high] = &self.range;
        (self.sure >> lane & 1 == 1).then(|| [low[lane], high[lane]])
    }

    /// Takes out the lane that seems nearest; any lane, when any hit will do.
    #[inline(always)]
    pub(super) fn next<Q: Query>(&mut self) -> Option<usize> {
        if self.lanes == 0 {
            return None;
        }
        let mut lane = self.lanes.trailing_zeros() as usize;
        let mut others = self.lanes & (self.lanes - 1);
        if !Q::ANY && others != 0 {
            let mut distances = [0.0; LANES];
            (self.t / self.det).store_slice(&mut distances);
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

    /// Drops the triangles that lie certainly beyond `reach`.
    #[inline(always)]
    pub(super) fn drop_beyond(&mut self, simd: S, reach: f32) {
        if self.lanes != 0 {
            let doubt = f32x8::splat(simd, self.errors.t + 3.0 * reach.abs() * self.errors.det);
            let limit = self.det.mul_add(f32x8::splat(simd, reach), doubt);
            self.lanes &= !self.t.simd_gt(limit).to_bitmask();
        }
    }
}

#[cfg(test)]
mod tests;
