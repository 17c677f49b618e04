// SPDX-License-Identifier: GPL-3.0-or-later
//! A tracer without a tree: brute force.

use halfspace_ray::{Hit, Ray, RayCounters, Tracer};
use halfspace_scene::Triangles;

/// Tests every triangle against every ray, in f64, in ascending or descending order, so that tests of the renderer
/// do not depend on any structure.
pub struct BruteForce {
    pub triangles: Triangles,
    pub reversed: bool,
}

impl BruteForce {
    /// Intersects a ray with a triangle: Möller and Trumbore 1997.
    pub fn hit(&self, ray: &Ray, id: u32) -> Option<Hit> {
        let wide = |a: [f32; 3]| a.map(f64::from);
        let sub = |a: [f64; 3], b: [f64; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let cross = |a: [f64; 3], b: [f64; 3]| {
            [
                a[1] * b[2] - a[2] * b[1],
                a[2] * b[0] - a[0] * b[2],
                a[0] * b[1] - a[1] * b[0],
            ]
        };
        let [a, b, c] = self.triangles.corners(id).map(wide);
        let (o, d) = (wide(ray.o), wide(ray.d));
        let (e1, e2) = (sub(b, a), sub(c, a));
        let p = cross(d, e2);
        let det = dot(e1, p);
        if det == 0.0 {
            return None;
        }
        let s = sub(o, a);
        let u = dot(s, p) / det;
        let q = cross(s, e1);
        let v = dot(d, q) / det;
        let t = (dot(e2, q) / det) as f32;
        let inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0;
        (inside && t >= ray.t_min && t <= ray.t_max).then_some(Hit {
            t,
            triangle: id,
            u: u as f32,
            v: v as f32,
        })
    }
}

impl Tracer for BruteForce {
    fn triangles(&self) -> Option<&Triangles> {
        Some(&self.triangles)
    }

    fn count(&self) -> usize {
        self.triangles.len()
    }

    fn corners(&self, id: u32) -> [[f32; 3]; 3] {
        self.triangles.corners(id)
    }

    fn closest(&self, rays: &[Ray], hits: &mut [Hit], counters: Option<&mut [RayCounters]>) {
        let live = self.triangles.live();
        for (ray, best) in rays.iter().zip(hits) {
            *best = Hit::MISS;
            for k in 0..live.len() {
                let id = live[if self.reversed { live.len() - 1 - k } else { k }];
                if let Some(hit) = self.hit(ray, id)
                    && (hit.t, hit.triangle) < (best.t, best.triangle)
                {
                    *best = hit;
                }
            }
        }
        // Report fixed counts, which tests can predict.
        for c in counters.into_iter().flatten() {
            *c = RayCounters {
                steps_axis: 2,
                steps_oblique: 1,
                tests: 5,
                ..Default::default()
            };
        }
    }

    fn occluded(&self, rays: &[Ray], out: &mut [bool], _: Option<&mut [RayCounters]>) {
        for (ray, out) in rays.iter().zip(out) {
            *out = self
                .triangles
                .live()
                .iter()
                .any(|&id| self.hit(ray, id).is_some());
        }
    }
}
