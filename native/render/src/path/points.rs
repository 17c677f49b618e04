// SPDX-License-Identifier: GPL-3.0-or-later
//! Points of surfaces in place of camera rays: for pictures that are baked, whose pixels lie on the triangles of a mesh.

use crate::camera::Camera;
use crate::check::{Error, Result};
use crate::math::vector::Vec3;
use crate::scene::RenderScene;
use crate::scene::surface::Surface;
use halfspace_ray::{Hit, Ray};

/// Number of the triangle of a pixel without one.
pub const NO_TRIANGLE: u32 = u32::MAX;

/// Least cosine between the shading normal and the direction to the camera from which a point is seen: points on the
/// other side still get usable reflections. As in Cycles.
const LEAST_COSINE: f32 = 0.2;

/// Share of the way from the viewer to the point after which the ray begins, so that it is in the media there.
const NEAR: f32 = 0.999;

/// From where the points are seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Seen {
    /// From above: along the shading normal.
    Above,
    /// From the camera.
    Camera,
    /// Not at all: the background is seen from the world's origin, which has this position, in their direction.
    Background([f32; 3]),
}

/// Where a pixel lies on its triangle: barycentric weights of the second and the third corner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// The weights at the pixel's centre.
    pub at: [f32; 2],
    /// Their changes from pixel to pixel, to the right.
    pub right: [f32; 2],
    /// The same upwards.
    pub up: [f32; 2],
}

/// The points of all pixels, row by row from the bottom.
#[derive(Debug, Clone)]
pub struct Points {
    /// The triangle of each pixel, or [`NO_TRIANGLE`].
    pub triangles: Vec<u32>,
    /// The place of each pixel on it.
    pub places: Vec<SurfacePoint>,
    /// From where they are seen.
    pub seen: Seen,
}

impl Points {
    /// Checks the points, and removes those on triangles that no ray hits.
    ///
    /// # Errors
    /// [`Error::Shape`] or [`Error::NonFinite`] if there are not as many as pixels, a triangle does not exist, or a
    /// weight is not finite; [`Error::Spec`] if the scene keeps instances.
    pub fn prepared(mut self, pixels: usize, scene: &RenderScene) -> Result<Self> {
        let count = scene.tracer.count();
        let Some(triangles) = scene.tracer.triangles() else {
            return Err(Error::Spec(
                "points: expected a scene without instances".into(),
            ));
        };
        if self.triangles.len() != pixels || self.places.len() != pixels {
            return Err(Error::Shape(format!(
                "points: expected {pixels}, one for each pixel, got {} triangles and {} places",
                self.triangles.len(),
                self.places.len()
            )));
        }
        let mut live = vec![false; count];
        for &triangle in triangles.live() {
            live[triangle as usize] = true;
        }
        for (triangle, place) in self.triangles.iter_mut().zip(&self.places) {
            if *triangle == NO_TRIANGLE {
                continue;
            }
            let Some(&live) = live.get(*triangle as usize) else {
                return Err(Error::Shape(format!(
                    "points['triangle']: {triangle} is out of range for {count}"
                )));
            };
            let SurfacePoint { at, right, up } = place;
            if ![at, right, up].into_iter().flatten().all(|x| x.is_finite()) {
                return Err(Error::NonFinite("points['place']".into()));
            }
            if !live {
                *triangle = NO_TRIANGLE;
            }
        }
        Ok(self)
    }

    /// Returns the ray to the point of a pixel, which lies at distance 1, and its hit; `None` without a triangle.
    /// `random`: moves the point within the pixel, in [0, 1).
    pub fn ray(
        &self,
        pixel: usize,
        random: [f32; 2],
        scene: &RenderScene,
        camera: &Camera,
    ) -> Option<(Ray, Hit)> {
        let triangle = self.triangles[pixel];
        if triangle == NO_TRIANGLE {
            return None;
        }
        let [u, v] = self.places[pixel].moved(random);
        let hit = Hit {
            t: 1.0,
            triangle,
            u,
            v,
        };
        let [a, b, c] = scene.tracer.corners(triangle).map(Vec3::from);
        let geometric = (b - a).cross(c - a).normalized();
        let surface = Surface::of(scene, &hit, -geometric, None);
        let to_viewer = match self.seen {
            Seen::Above => surface.shading,
            Seen::Camera => visible_direction(camera, &surface),
            Seen::Background(origin) => {
                let d = (surface.point - Vec3::from(origin)).normalized_or(geometric);
                return Some((ray(Vec3::from(origin), d), Hit::MISS));
            }
        };
        Some((ray(surface.point + to_viewer, -to_viewer), hit))
    }
}

/// Returns the ray from a viewer at distance 1 in the direction `d`.
fn ray(o: Vec3, d: Vec3) -> Ray {
    Ray {
        o: o.array(),
        d: d.array(),
        t_min: NEAR,
        t_max: f32::INFINITY,
    }
}

/// Returns the direction towards the camera, bent towards the normal where the surface faces away.
fn visible_direction(camera: &Camera, surface: &Surface<'_>) -> Vec3 {
    let normal = surface.shading;
    let view = camera.view();
    let backward = -view.axes[2];
    let mut direction = if view.perspective {
        (view.origin - surface.point).normalized_or(backward)
    } else {
        backward
    };
    let cosine = direction.dot(normal);
    if cosine < LEAST_COSINE {
        direction = (direction + normal * (LEAST_COSINE - cosine)).normalized_or(normal);
    }
    if cosine < 0.0 {
        direction = (direction * (1.0 + cosine) - normal * cosine).normalized_or(normal);
    }
    // The ray stays in front of the triangle itself.
    let below = 1e-5 - direction.dot(surface.geometric);
    if below > 0.0 {
        direction = (direction + surface.geometric * below).normalized_or(normal);
    }
    direction
}

impl SurfacePoint {
    /// Returns the weights at a random point of the pixel that lies on the triangle: the point is moved half as far
    /// until it does.
    fn moved(&self, random: [f32; 2]) -> [f32; 2] {
        let [mut x, mut y] = random.map(|r| r - 0.5);
        for _ in 0..10 {
            let [u, v] = [0, 1].map(|k| self.at[k] + x * self.right[k] + y * self.up[k]);
            if u >= 0.0 && v >= 0.0 && u + v <= 1.0 {
                return [u, v];
            }
            (x, y) = (0.5 * x, 0.5 * y);
        }
        // Centres may lie on an edge, and beyond it by rounding.
        let [u, v] = self.at.map(|w| w.clamp(0.0, 1.0));
        let scale = 1.0 / (u + v).max(1.0);
        [u * scale, v * scale]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_stay_on_their_triangle() {
        let place = SurfacePoint {
            at: [0.9, 0.05],
            right: [0.5, 0.0],
            up: [0.0, 0.5],
        };
        for i in 0..64_u8 {
            let [u, v] = place.moved([f32::from(i % 8) / 8.0, f32::from(i / 8) / 8.0]);
            assert!(u >= 0.0 && v >= 0.0 && u + v <= 1.0, "{u} {v}");
        }
        assert_eq!(place.moved([0.5; 2]), place.at);
        let beyond = SurfacePoint {
            at: [1.5, -0.5],
            right: [0.0; 2],
            up: [0.0; 2],
        };
        assert_eq!(beyond.moved([0.5; 2]), [1.0, 0.0]);
    }
}
