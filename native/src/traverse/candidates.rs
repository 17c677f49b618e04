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

/// Absolute part of every bound, where products lost bits below the normal numbers, and of what a bound takes times an
/// offset: those bits are taken times it, too.
pub(super) const UNDERFLOW: f32 = 1e-36;

/// Bounds on the errors of the test of a block, and what follows from them for distances up to a reach.
#[derive(Clone, Copy)]
struct Errors {
    /// On a weight.
    uv: f32,
    /// On how far `t` lies beyond what the determinant makes of the reach, or of any shorter one.
    doubt: f32,
    /// Part of both: next to nothing, or NaN where some product may have overflowed.
    floor: f32,
}

impl Errors {
    /// For the triangles of a block.
    #[inline(always)]
    fn new<S: Simd>(edges: &Edges<S>, ray: &FrameRay, reach: f32) -> Self {
        let size = edges.size;
        // A corner of a triangle that is hit within reach, or behind the origin where the ray begins there, is
        // no farther than that, and its size.
        let farthest = keep_max(-ray.t_min, reach);
        // The first branch is the second one without blur and drift, in few operations: they take as long as those on
        // all triangles of the block. In streams what the block alone says is worked out once for all rays of a list.
        let (det, uv, t, floor) = if ray.place.is_none() {
            // 0, or NaN where some product may have overflowed: NaN bounds reject nothing.
            let zero_or_nan = 0.0 * ((ray.span + size) * edges.overflow);
            let lever = keep_min(2.0 * farthest, ray.span) + zero_or_nan;
            let uv = lever * edges.uv[0] + edges.uv[1];
            let t = lever * edges.t[0] + edges.t[1];
            (edges.det, uv, t, zero_or_nan + UNDERFLOW)
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
        // Where the determinant's sign is wrong, `t` is as wrong as the hit is far, and that may lie behind the origin.
        let doubt = t + 3.0 * det * farthest;
        Self { uv, doubt, floor }
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
}

/// The triangles of a block that the ray certainly hits.
pub(super) struct Surely {
    lanes: u64,
    /// Bounds on their distances, near and far. The near ones of all candidates tell which seems nearest.
    range: [[f32; LANES]; 2],
}

impl Surely {
    /// None yet.
    pub(super) const NOTHING: Self = Self {
        lanes: 0,
        range: [[0.0; LANES]; 2],
    };

    /// The distances between which the ray certainly hits the triangle of a lane.
    #[inline(always)]
    pub(super) fn range(&self, lane: usize) -> Option<[f32; 2]> {
        let [low, high] = &self.range;
        (self.lanes >> lane & 1 == 1).then(|| [low[lane], high[lane]])
    }
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
    /// Where this times the distance to a corner overflows, some product may have.
    overflow: f32,
    /// Bound on the error of a determinant.
    det: f32,
    /// Bound on the error of a weight: for offsets up to `x` from the size on it is `uv[0] * x + uv[1]`.
    uv: [f32; 2],
    /// The same of `t`. What small sides lose over long ways is less than what a determinant's sign may.
    t: [f32; 2],
    /// The largest component of the sides of each.
    sizes: f32x8<S>,
}

impl<S: Simd> Edges<S> {
    /// Of the block of `n` triangles.
    #[inline(always)]
    pub(super) fn new(simd: S, block: &[f32; SPAN], n: usize) -> Self {
        let row = |r: usize| f32x8::from_slice(simd, &block[1 + r * n..1 + r * n + LANES]);
        let v = [row(0), row(1), row(2)];
        let sides = [
            [row(3) - v[0], row(4) - v[1], row(5) - v[2]],
            [row(6) - v[0], row(7) - v[1], row(8) - v[2]],
        ];
        let size = block[0];
        let det = DET_ERROR * (size * size) + UNDERFLOW;
        let [uv, t] = [2.0 * UV_ERROR * size, T_ERROR * (size * size)];
        Self {
            corner: v,
            sides,
            count: n,
            size,
            overflow: 64.0 * size * keep_max(size, 1.0),
            det,
            uv: [uv + UNDERFLOW, uv * size + (3.0 * det + UNDERFLOW)],
            t: [t, t * size + UNDERFLOW],
            sizes: largest(sides[0]).max(largest(sides[1])),
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

/// The largest component of each.
#[inline(always)]
fn largest<S: Simd>(v: [f32x8<S>; 3]) -> f32x8<S> {
    v[0].abs().max(v[1].abs()).max(v[2].abs())
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

        let errors = Errors::new(edges, ray, reach);
        let limit = det.mul_add(splat(reach), splat(errors.doubt));
        let rejected = least.simd_lt(splat(-errors.uv)) | t.simd_gt(limit);
        Self {
            lanes: !rejected.to_bitmask() & ((1 << edges.count) - 1),
            det,
            t,
            least,
            errors,
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
    ) -> Surely {
        let splat = |x: f32| f32x8::splat(simd, x);
        let s = edges.offset(simd, ray);
        let floor = splat(self.errors.floor);
        let (size, span) = (edges.sizes, largest(s));
        let uv_error = if ray.place.is_none() {
            let sides = size * (size * splat(3.0 * DET_ERROR)) + floor;
            span.mul_add(size * splat(2.0 * UV_ERROR) + splat(UNDERFLOW), sides)
        } else {
            let (blur, drift) = (ray.blur, 6.0 * ray.drift);
            let (size, span) = (size + splat(blur), span + splat(blur));
            let blurred = (span + size * splat(4.0)).mul_add(splat(24.0 * blur), floor);
            size.mul_add(
                size * splat(3.0 * (DET_ERROR + drift)),
                size.mul_add(span * splat(2.0 * (UV_ERROR + drift)), blurred),
            )
        };
        let behind = if ray.t_min >= -1e-30 {
            -self.errors.doubt
        } else {
            f32::NEG_INFINITY
        };
        let outside = self.least.simd_lt(-uv_error);
        let rejected = outside | self.t.simd_lt(splat(behind));
        self.lanes &= !rejected.to_bitmask();
        // Rays inside an axis-parallel wall: the verdict would say at length what equality of
        // coordinates says at once, that they miss it. Differences of floats vanish only then.
        if ray.still.contains(&0.0) {
            let [a, b] = edges.sides;
            let apart = |k: usize| {
                let offset = s[k].abs().max(a[k].abs()).max(b[k].abs());
                offset.max(splat(ray.still[k]))
            };
            let nearest = apart(0).min(apart(1)).min(apart(2));
            self.lanes &= !nearest.simd_eq(splat(0.0)).to_bitmask();
        }
        let mut surely = Surely::NOTHING;
        if (C::LATE || C::QUICK && Q::ANY) && ray.place.is_none() {
            let det_error = size * (size * splat(DET_ERROR)) + splat(UNDERFLOW);
            let sides = size * (size * splat(T_ERROR)) + splat(UNDERFLOW);
            let t_error = span.mul_add(sides, floor);
            // All three weights certainly have one sign, and their sum is not near zero.
            let sure = self.least.simd_gt(uv_error) & self.det.simd_gt(det_error * splat(4.0));
            surely.lanes = sure.to_bitmask();
            let low = (self.t - t_error) / (self.det + det_error) * splat(2.0 - PRUNE);
            let high = (self.t + t_error) / (self.det - det_error) * splat(PRUNE);
            low.store_slice(&mut surely.range[0]);
            high.store_slice(&mut surely.range[1]);
        } else if C::LATE {
            // They tell at least which seems nearest.
            (self.t / self.det).store_slice(&mut surely.range[0]);
        }
        surely
    }

    /// Takes out the lane that seems nearest; any lane, when any hit will do.
    #[inline(always)]
    pub(super) fn next<Q: Query, C: Counters>(&mut self, surely: &Surely) -> Option<usize> {
        if self.lanes == 0 {
            return None;
        }
        let mut lane = self.lanes.trailing_zeros() as usize;
        let mut others = self.lanes & (self.lanes - 1);
        if !Q::ANY && others != 0 {
            let mut distances = surely.range[0];
            if !C::LATE {
                (self.t / self.det).store_slice(&mut distances);
            }
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
            let doubt = f32x8::splat(simd, self.errors.doubt);
            let limit = self.det.mul_add(f32x8::splat(simd, reach), doubt);
            self.lanes &= !self.t.simd_gt(limit).to_bitmask();
        }
    }
}

#[cfg(test)]
mod tests;
