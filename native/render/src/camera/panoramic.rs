// SPDX-License-Identifier: GPL-3.0-or-later
//! Rays of panoramic cameras, sharp or through a lens.

use crate::camera::panorama::Panorama;
use crate::camera::{Camera, EMPTY};
use crate::math::vector::Vec3;
use halfspace_ray::Ray;

impl Camera {
    /// The ray of a panorama, sharp or through the lens; an empty one where the projection has no direction.
    pub(super) fn panoramic_ray(
        &self,
        panorama: &Panorama,
        x: f32,
        y: f32,
        lens: impl FnOnce() -> [f32; 2],
    ) -> Ray {
        // The window spans the picture in multiples of its sides.
        let film = self.corner + self.right * x + self.up * y - self.forward;
        let [right, up] = self.axes;
        let direction = panorama.direction(film.dot(right), film.dot(up));
        let d = direction.map(|d| right * d.x + up * d.y - self.forward * d.z);
        let [t_min, t_max] = self.clip;
        let ray = Ray {
            o: self.origin.array(),
            d: d.unwrap_or(self.forward).array(),
            t_min,
            t_max: if d.is_some() { t_max } else { EMPTY },
        };
        match &self.lens {
            Some(it) if d.is_some() => self.focused(ray, panorama, it.focus, it.sample(lens())),
            _ => ray,
        }
    }

    /// The ray of a panorama through a lens across it, to the point of the sharp ray at the distance in focus. As in
    /// Cycles, the lens turns with the direction: its first axis leans to the view, that of a mirror ball to the right.
    fn focused(&self, ray: Ray, panorama: &Panorama, focus: f32, [first, second]: [f32; 2]) -> Ray {
        let (o, d) = (Vec3::from(ray.o), Vec3::from(ray.d));
        let mirrored = matches!(panorama, Panorama::MirrorBall);
        let (axis, side) = if mirrored {
            (self.axes[0], -1.0)
        } else {
            (self.forward, 1.0)
        };
        let across = axis - d * axis.dot(d);
        // Take any axis across a ray along `axis`.
        let across = if across.length() > 1e-6 {
            across.normalized()
        } else {
            self.axes[1]
        };
        let from = across * first + d.cross(across) * (side * second);
        Ray {
            o: (o + from).array(),
            d: (d * focus - from).normalized().array(),
            ..ray
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::lens::LensParams;
    use crate::camera::{CameraParams, Projection};

    fn none() -> [f32; 2] {
        panic!("a sharp camera needs no random numbers")
    }

    #[test]
    fn panoramic_rays_through_a_lens_meet_at_the_distance_in_focus() {
        let ball = Panorama::MirrorBall;
        let fisheye = Panorama::Equidistant { fov: 3.0 };
        for (panorama, [x, y]) in [
            (fisheye, [2.0, 7.0]),
            (fisheye, [5.0, 5.0]),
            (ball, [3.0, 4.0]),
        ] {
            let params = CameraParams {
                projection: Projection::Panoramic(panorama),
                window: [0.0, 1.0, 0.0, 1.0],
                lens: LensParams {
                    radius: 0.5,
                    focus: 4.0,
                    ..Default::default()
                },
                ..Default::default()
            };
            let sharp = CameraParams {
                lens: LensParams::default(),
                ..params.clone()
            };
            let seen = Camera::new(&sharp, 10, 10).unwrap().ray(x, y, none);
            let focus = Vec3::from(seen.o) + Vec3::from(seen.d) * 4.0;
            let camera = Camera::new(&params, 10, 10).unwrap();
            let mut starts = Vec::new();
            for lens in [[0.1, 0.9], [0.8, 0.3], [0.4, 0.2]] {
                let ray = camera.ray(x, y, || lens);
                let (o, d) = (Vec3::from(ray.o), Vec3::from(ray.d));
                assert!((d.length() - 1.0).abs() < 1e-6);
                assert!((focus - o).cross(d).length() < 1e-5, "all rays meet");
                let from = o - Vec3::from(seen.o);
                assert!(
                    from.dot(Vec3::from(seen.d)).abs() < 1e-5,
                    "the lens lies across the ray"
                );
                assert!(from.length() > 0.05 && from.length() < 0.5 + 1e-6);
                starts.push(o);
            }
            assert!((starts[0] - starts[1]).length() > 0.1);
        }
        let outside = Camera::new(
            &CameraParams {
                projection: Projection::Panoramic(fisheye),
                window: [0.0, 1.0, 0.0, 1.0],
                lens: LensParams {
                    radius: 0.5,
                    ..Default::default()
                },
                ..Default::default()
            },
            10,
            10,
        );
        assert_eq!(outside.unwrap().ray(0.0, 0.0, none).t_max, EMPTY);
    }
}
