// SPDX-License-Identifier: GPL-3.0-or-later
//! What everything else must agree with: the nearest hit by exact arithmetic alone, without the f32
//! test and its bounds, without f64, without a tree.

pub mod cases;
mod levels;

pub use levels::levels;

use crate::geom::exact::intersect;
use crate::scene::Triangles;
use crate::traverse::{Hit, Ray};

/// An exact answer, and how close to a boundary it was.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExactAnswer {
    /// The nearest hit.
    pub hit: Hit,
    /// Whether the ray passes exactly through an edge or a corner of the triangle it hits.
    pub on_boundary: bool,
}

/// The nearest hit of one ray over all live triangles, decided in integers: O(n), for small inputs.
///
/// A cheap necessary condition comes first: a triangle whose corners all lie behind the ray's origin
/// along some axis cannot be hit.
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
        if beside(ray, corners) {
            continue;
        }
        let Some(exact) = intersect(ray.o, ray.d, corners) else {
            continue;
        };
        let t = exact.t + 0.0;
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

/// Whether the triangle lies strictly behind a ray that starts at `t_min >= 0`, along some axis, and
/// by so much that `t` does not round to zero.
fn beside(ray: &Ray, corners: [[f32; 3]; 3]) -> bool {
    let smallest = f64::from(f32::from_bits(1));
    ray.t_min >= 0.0
        && (0..3).any(|k| {
            let (o, d) = (f64::from(ray.o[k]), f64::from(ray.d[k]));
            let behind =
                |p: &[f32; 3], side: f64| side * (o - f64::from(p[k])) > d.abs() * smallest;
            (d >= 0.0 && corners.iter().all(|p| behind(p, 1.0)))
                || (d <= 0.0 && corners.iter().all(|p| behind(p, -1.0)))
        })
}
