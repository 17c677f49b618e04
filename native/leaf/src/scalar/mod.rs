// SPDX-License-Identifier: GPL-3.0-or-later
//! Leaf tests of one triangle at a time, the cost that kd-trees and BSP trees were priced for before vector units: the
//! test of Möller and Trumbore 1997 with the error bounds of [`crate::candidates`], or as published that of pbrt-v3.
//!
//! The bounded test rejects as soon as one bound proves a miss: after the first weight, after the second, after the
//! distance. What is left gets the exact verdict, so the answer is that of all other tests. The published test decides
//! in f32 (Woop, Benthin and Wald 2013; Pharr, Jakob and Humphreys 2016, section 3.6).

use crate::candidates::{Bounds, Errors};
use crate::{Job, Leaf};
use halfspace_geom::bound::keep_min;
use halfspace_geom::vec3::{map, widen};
use halfspace_ray::frame::{PRUNE, U};
use halfspace_ray::query::{Best, Counters, LeafTest, Query};
use halfspace_ray::{BoundedRay, FrameRay, Hit, RayRef};

/// A triangle in the frame, and its number.
#[derive(Clone, Copy)]
struct Triangle {
    id: u32,
    corners: [[f32; 3]; 3],
}

impl Job<'_> {
    /// Intersects a ray with the triangles of a leaf one after another, and returns whether the traversal may end. With
    /// `EITHER` the leaf may be stored as indices. A ray with a mailbox skips the triangles that it holds; the others are
    /// tested for hits behind the leaf too, because other leaves skip them.
    #[inline(always)]
    pub(crate) fn one_by_one<Q: Query, C: Counters, const EITHER: bool>(
        self,
        leaf: Leaf,
        ray: RayRef<'_>,
        leave: f32,
        best: &mut Best,
        counters: &mut C,
    ) -> bool {
        debug_assert!(
            EITHER || !self.blocks.has_indices(),
            "indices are not expected"
        );
        let leave = if C::MAILBOX { f32::INFINITY } else { leave };
        for index in 0..leaf.count {
            let (id, corners) = self.blocks.triangle(self.scene, leaf, index);
            if C::MAILBOX && counters.is_known(id) {
                continue;
            }
            let triangle = Triangle { id, corners };
            counters.tests(1);
            let ends = if Q::LEAF == LeafTest::Published {
                triangle.meet_published::<Q, C>(ray, best, counters)
            } else {
                self.meet::<Q, C>(triangle, ray, leave, best, counters)
            };
            if ends {
                return true;
            }
        }
        false
    }

    /// Tests one triangle within error bounds, and applies the exact verdict if they do not decide.
    #[inline(always)]
    fn meet<Q: Query, C: Counters>(
        self,
        triangle: Triangle,
        ray: RayRef<'_>,
        leave: f32,
        best: &mut Best,
        counters: &mut C,
    ) -> bool {
        let reach = keep_min(leave, best.reach);
        let Some(range) = triangle.candidate::<C>(ray.frame, reach, Q::ANY) else {
            return false;
        };
        let Triangle { id, corners } = triangle;
        // An any-hit ray needs no verdict on a hit that f32 proves.
        if let Some(range) = range {
            let certain = ray.frame.certain(ray.ray);
            let ray = BoundedRay { ray, certain };
            let corners = || self.blocks.scene_corners(self.scene, id, corners);
            if let Some(ends) = best.defer::<Q>(ray, id, range, corners) {
                return ends;
            }
        }
        let corners = || self.blocks.scene_corners(self.scene, id, corners);
        best.offer::<Q, C>(ray, id, corners, counters)
    }
}

impl Triangle {
    /// Returns `None` if the ray provably misses the triangle between its start and `reach`; else bounds on the distance
    /// if the hit is proven and the query `any` can use that.
    #[inline(always)]
    fn candidate<C: Counters>(
        &self,
        ray: &FrameRay,
        reach: f32,
        any: bool,
    ) -> Option<Option<[f32; 2]>> {
        let [a, b, c] = self.corners;
        let (e1, e2, s) = (sub(b, a), sub(c, a), sub(ray.o, a));
        let bounds = Bounds::new(largest(e1).max(largest(e2)));
        let errors = Errors::new(&bounds, ray, reach);
        // Reject by the first weight and the determinant, whose sign makes all terms positive.
        let p = cross(ray.d, e2);
        let det = dot(e1, p);
        let sign = 1.0_f32.copysign(det);
        let (det, u) = (det * sign, dot(s, p) * sign);
        let rest = det - u;
        if u < -errors.uv || rest < -errors.uv {
            return None;
        }
        // Reject by the other weights.
        let q = cross(s, e1);
        let v = dot(ray.d, q) * sign;
        let w = rest - v;
        if v < -errors.uv || w < -errors.uv {
            return None;
        }
        // Reject by the distance: beyond the reach, or behind the origin unless the ray interval starts there.
        let t = dot(e2, q) * sign;
        let behind = ray.t_min >= -1e-30 && t < -errors.t;
        if behind || t > det * reach + errors.t {
            return None;
        }
        // Prove the hit where all weights are certainly positive and the determinant is far from zero.
        let proven = C::QUICK
            && any
            && !ray.is_blurred()
            && u > errors.uv
            && v > errors.uv
            && w > errors.uv
            && det > 4.0 * bounds.det;
        Some(proven.then(|| {
            let low = (t - errors.t) / (det + bounds.det) * (2.0 - PRUNE);
            [low, (t + errors.t) / (det - bounds.det) * PRUNE]
        }))
    }

    /// Tests the triangle as published and keeps the hit if it is the nearest so far; returns whether the traversal may
    /// end.
    #[inline(always)]
    fn meet_published<Q: Query, C: Counters>(
        &self,
        ray: RayRef<'_>,
        best: &mut Best,
        counters: &mut C,
    ) -> bool {
        let frame = ray.frame;
        let Some([t, u, v]) = self.published(frame, best.reach) else {
            return false;
        };
        #[expect(clippy::cast_possible_truncation, reason = "distances are f32")]
        let t = ((f64::from(t) + frame.shift) * frame.to_scene()) as f32;
        let triangle = frame.first + self.id;
        best.keep::<Q, C>(ray, Hit { t, triangle, u, v }, counters)
    }

    /// Returns distance and weights of a hit in front of the origin and within `reach`, by the watertight test without
    /// an exact verdict, but with its bound on the rounding of the distance.
    #[inline(always)]
    fn published(&self, ray: &FrameRay, reach: f32) -> Option<[f32; 3]> {
        // Shear the triangle so that the ray is the third axis, which is that of its largest component.
        let d = ray.d.map(f32::abs);
        let kz = if d[0] > d[1] {
            if d[0] > d[2] { 0 } else { 2 }
        } else if d[1] > d[2] {
            1
        } else {
            2
        };
        let [kx, ky] = [(kz + 1) % 3, (kz + 2) % 3];
        let shear = [
            -ray.d[kx] / ray.d[kz],
            -ray.d[ky] / ray.d[kz],
            1.0 / ray.d[kz],
        ];
        let [p, q, r] = map(self.corners, |corner| {
            let s = sub(corner, ray.o);
            let z = s[kz];
            [s[kx] + shear[0] * z, s[ky] + shear[1] * z, z]
        });
        // The weights are the areas that the edges span with the origin; an area of 0 is computed again in f64.
        let area = |a: [f32; 3], b: [f32; 3]| a[0] * b[1] - a[1] * b[0];
        let mut e = [area(q, r), area(r, p), area(p, q)];
        if e.contains(&0.0) {
            let [p, q, r] = [p, q, r].map(widen);
            let area = |a: [f64; 3], b: [f64; 3]| a[0] * b[1] - a[1] * b[0];
            #[expect(clippy::cast_possible_truncation, reason = "as published")]
            let again = [area(q, r), area(r, p), area(p, q)].map(|x| x as f32);
            e = again;
        }
        if e.iter().any(|x| *x < 0.0) && e.iter().any(|x| *x > 0.0) {
            return None;
        }
        let det = e[0] + e[1] + e[2];
        if det == 0.0 {
            return None;
        }
        // Compare the distance, times the determinant, with the interval before the division.
        let z = [p[2] * shear[2], q[2] * shear[2], r[2] * shear[2]];
        let scaled = e[0] * z[0] + e[1] * z[1] + e[2] * z[2];
        let sign = 1.0_f32.copysign(det);
        if scaled * sign <= 0.0 || scaled * sign > reach * (det * sign) {
            return None;
        }
        let inverse = 1.0 / det;
        let t = scaled * inverse;
        (t > distance_error([p, q, r], z, e, inverse)).then(|| [t, e[1] * inverse, e[2] * inverse])
    }
}

/// The published bound on the rounding of the distance: a hit not beyond it may lie behind the origin.
#[inline(always)]
fn distance_error(corners: [[f32; 3]; 3], z: [f32; 3], e: [f32; 3], inverse: f32) -> f32 {
    let most = |v: [f32; 3]| largest(v);
    let along = most(z);
    let x = most(map(corners, |p| p[0]));
    let y = most(map(corners, |p| p[1]));
    // Add up the errors of the sheared coordinates, of the areas and of their products with the distances.
    let (x_error, y_error) = (gamma(5.0) * (x + along), gamma(5.0) * (y + along));
    let z_error = gamma(3.0) * along;
    let e_error = 2.0 * (gamma(2.0) * x * y + y_error * x + x_error * y);
    let area = most(e);
    3.0 * (gamma(3.0) * area * along + e_error * along + z_error * area) * inverse.abs()
}

/// Bound on the relative error of `n` roundings.
#[inline(always)]
fn gamma(n: f32) -> f32 {
    n * U / (1.0 - n * U)
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

/// Returns the dot product.
#[inline(always)]
fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Returns the largest absolute component.
#[inline(always)]
fn largest(a: [f32; 3]) -> f32 {
    a[0].abs().max(a[1].abs()).max(a[2].abs())
}

#[cfg(test)]
mod tests;
