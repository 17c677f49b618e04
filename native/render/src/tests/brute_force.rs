// SPDX-License-Identifier: GPL-3.0-or-later
//! A tracer without a tree: brute force.

use halfspace_geom::verdict::verdict_within;
use halfspace_ray::{Hit, Ray, RayCounters, Tracer};
use halfspace_scene::Triangles;

/// Tests every triangle against every ray, exactly, in ascending or descending order, so that tests of the renderer
/// do not depend on any structure.
pub struct BruteForce {
    pub triangles: Triangles,
    pub reversed: bool,
}

impl BruteForce {
    /// Intersects a ray with a triangle.
    pub fn hit(&self, ray: &Ray, id: u32) -> Option<Hit> {
        let span = [ray.t_min, ray.t_max];
        let found = verdict_within(ray.o, ray.d, self.triangles.corners(id), span)?;
        ray.reaches(found.t).then_some(Hit {
            t: found.t,
            triangle: id,
            u: found.u,
            v: found.v,
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
