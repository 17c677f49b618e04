// SPDX-License-Identifier: GPL-3.0-or-later
//! Slab tests of axis-aligned boxes against one ray (Kay and Kajiya 1986), with error bounds.

use fearless_simd::{Simd, SimdFloat, SimdMask};
use halfspace_geom::Aabb;
use halfspace_geom::bound::{keep_max, keep_max_each, keep_min, keep_min_each};
use halfspace_ray::{FrameRay, Interval};

/// The slab test coefficients of a ray: it crosses the plane `x_k = p` no sooner than `p * inv + near` and no
/// later than `p * inv + far`.
#[derive(Debug, Clone, Copy)]
pub struct Slabs {
    /// Reciprocal direction; 0 on an axis that bounds nothing.
    pub inv: [f32; 3],
    /// Added for planes of entry: `-o * inv` less the error bound.
    pub near: [f32; 3],
    /// Added for planes of exit: `-o * inv` plus the error bound.
    pub far: [f32; 3],
    /// Row of a node's bounds with the planes of entry, per axis; the planes of exit are three rows away.
    entry: [usize; 3],
}

impl Slabs {
    /// Computes the coefficients of a ray.
    #[inline(always)]
    pub fn new(ray: &FrameRay) -> Self {
        let mut slabs = Self {
            inv: ray.inv,
            near: [0.0; 3],
            far: [0.0; 3],
            entry: [0; 3],
        };
        for k in 0..3 {
            // Fold the origin and the error bound into the added terms.
            let shift = ray.o[k] * ray.inv[k];
            // If a product with some coordinate may overflow, this axis bounds nothing.
            if (ray.span * ray.inv[k]).is_finite() && (ray.slack[k] + shift.abs()).is_finite() {
                slabs.near[k] = -shift - ray.slack[k];
                slabs.far[k] = -shift + ray.slack[k];
            } else {
                slabs.inv[k] = 0.0;
                slabs.near[k] = f32::NEG_INFINITY;
                slabs.far[k] = f32::INFINITY;
            }
            slabs.entry[k] = if ray.negative[k] == 1 { 3 + k } else { k };
        }
        slabs
    }

    /// Whether the ray enters through the lower (0) or the upper (1) plane of a slab across `axis`.
    #[inline(always)]
    pub fn entry_row(&self, axis: usize) -> usize {
        usize::from(self.entry[axis] >= 3)
    }

    /// The entry distance of a box that the ray may hit within an interval, or `None` if it provably misses it.
    #[inline(always)]
    pub fn meet(&self, bounds: &Aabb, within: Interval) -> Option<f32> {
        let Interval {
            mut enter,
            mut leave,
        } = within;
        for k in 0..3 {
            let (near, far) = if self.entry[k] < 3 {
                (bounds.min[k], bounds.max[k])
            } else {
                (bounds.max[k], bounds.min[k])
            };
            enter = keep_max(near * self.inv[k] + self.near[k], enter);
            leave = keep_min(far * self.inv[k] + self.far[k], leave);
        }
        (enter <= leave).then_some(enter)
    }

    /// The entry and exit distances of the boxes in the lanes of `V`, clipped to an interval. The ray misses a box
    /// whose exit lies before its entry.
    #[inline(always)]
    pub fn meet_all<S: Simd, V: SimdFloat<S, Element = f32>, const W: usize>(
        &self,
        simd: S,
        bounds: &[[f32; W]; 6],
        within: Interval,
    ) -> (V, V) {
        let splat = |x: f32| V::splat(simd, x);
        // Intersect the slabs of the three axes.
        let mut enter = splat(within.enter);
        let mut leave = splat(within.leave);
        for k in 0..3 {
            let row = self.entry[k];
            let near = V::from_slice(simd, &bounds[row]);
            let far = V::from_slice(simd, &bounds[(row + 3) % 6]);
            let inv = splat(self.inv[k]);
            enter = keep_max_each(near.mul_add(inv, splat(self.near[k])), enter);
            leave = keep_min_each(far.mul_add(inv, splat(self.far[k])), leave);
        }
        (enter, leave)
    }

    /// Stores the entry distances of the boxes in the lanes of `V`; returns the mask of those the ray may hit within an
    /// interval.
    #[inline(always)]
    pub fn test<S: Simd, V: SimdFloat<S, Element = f32>, const W: usize>(
        &self,
        simd: S,
        bounds: &[[f32; W]; 6],
        within: Interval,
        enters: &mut [f32; W],
    ) -> u64 {
        let (enter, leave): (V, V) = self.meet_all(simd, bounds, within);
        enter.store_slice(enters);
        enter.simd_le(leave).to_bitmask()
    }

    /// [`Self::test`] in scalar code, for nodes of fewer children than the shortest vector has lanes.
    #[inline(always)]
    pub fn test_few<const W: usize>(
        &self,
        bounds: &[[f32; W]; 6],
        within: Interval,
        enters: &mut [f32; W],
    ) -> u64 {
        *enters = [within.enter; W];
        let mut leaves = [within.leave; W];
        for k in 0..3 {
            let (near, far) = (&bounds[self.entry[k]], &bounds[(self.entry[k] + 3) % 6]);
            for lane in 0..W {
                let enter = near[lane] * self.inv[k] + self.near[k];
                let leave = far[lane] * self.inv[k] + self.far[k];
                enters[lane] = keep_max(enter, enters[lane]);
                leaves[lane] = keep_min(leave, leaves[lane]);
            }
        }
        (0..W).fold(0, |mask, lane| {
            mask | u64::from(enters[lane] <= leaves[lane]) << lane
        })
    }
}
