// SPDX-License-Identifier: GPL-3.0-or-later
//! The reference for all other code: the nearest hit by exact arithmetic alone, without f32 tests and their error
//! bounds, without f64, without a tree.

pub mod cases;
mod proximity;

pub use halfspace_base::simd::levels;
pub use proximity::{ExactNearest, exact_nearest, exact_overlap};

use halfspace_geom::exact::intersect;
use halfspace_ray::{Hit, Ray};
use halfspace_scene::Triangles;

/// An exact nearest hit, and whether it lies on a boundary.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExactAnswer {
    /// The nearest hit.
    pub hit: Hit,
    /// Whether the ray passes exactly through an edge or a vertex of the triangle it hits.
    pub on_boundary: bool,
}

/// Returns the nearest hit of one ray over all live triangles, decided in integers. The cost is O(n), for small
/// inputs.
///
/// A cheap necessary condition is checked first: a triangle whose vertices all lie behind the ray's origin along
/// some axis cannot be hit.
pub fn exact_closest(scene: &Triangles, ray: &Ray) -> ExactAnswer {
    let mut answer = ExactAnswer {
        hit: Hit::MISS,
        on_boundary: false,
    };
    if ray.t_min > ray.t_max {
        return answer;
    }
    for &id in scene.live() {
        let corners = scene.corners(id);
        // Skip triangles that certainly lie behind the ray.
        if beside(ray, corners) {
            continue;
        }
        let Some(exact) = intersect(ray.o, ray.d, corners) else {
            continue;
        };
        let t = exact.t + 0.0;
        // Keep the first of several triangles at one distance, which has the smallest number.
        if ray.t_min <= t && t <= ray.t_max && t.is_finite() && t < answer.hit.t {
            answer.hit = Hit {
                t,
                triangle: id,
                u: exact.weights[0],
                v: exact.weights[1],
            };
            answer.on_boundary = exact.zeros > 0;
        }
    }
    answer
}

/// Returns whether the triangle lies strictly behind a ray that starts at `t_min >= 0`, along some axis, and by so
/// much that `t` does not round to zero.
fn beside(ray: &Ray, corners: [[f32; 3]; 3]) -> bool {
    let smallest = f64::from(f32::from_bits(1));
    ray.t_min >= 0.0
        && (0..3).any(|k| {
            let (o, d) = (f64::from(ray.o[k]), f64::from(ray.d[k]));
            // Heights are exact in f64; the distance must exceed the smallest f32.
            let behind =
                |p: &[f32; 3], side: f64| side * (o - f64::from(p[k])) > d.abs() * smallest;
            (d >= 0.0 && corners.iter().all(|p| behind(p, 1.0)))
                || (d <= 0.0 && corners.iter().all(|p| behind(p, -1.0)))
        })
}
