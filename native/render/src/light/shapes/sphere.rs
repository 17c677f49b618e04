// SPDX-License-Identifier: GPL-3.0-or-later
//! Point and spot lights as spheres: Blender's lights without soft falloff.

use std::f32::consts::TAU;

use crate::light::shapes::LightRay;
use crate::light::shapes::disc::Disc;
use crate::math::trig::sin_cos_turns;
use crate::math::vector::{Frame, Vec3, vec3};

impl Disc {
    /// Samples a direction towards the sphere, uniform by solid angle; from inside in all directions.
    pub(super) fn sample_sphere(&self, from: Vec3, u: [f32; 2]) -> Option<LightRay> {
        let axis = self.centre - from;
        // The cap of directions has the height 1 - cos of its half angle.
        let height = self.cap(axis);
        let z = 1.0 - u[0] * height;
        let (sin, cos) = sin_cos_turns(u[1]);
        let r = (u[0] * height * (2.0 - u[0] * height)).max(0.0).sqrt();
        let frame = Frame::around(axis.normalized_or(vec3(0.0, 0.0, 1.0)));
        let direction = frame
            .to_world(vec3(r * cos, r * sin, z))
            .normalized_or(axis);
        // At the rim, rounding may lead past the sphere: the nearest point counts then.
        let distance = self
            .distance_along(axis, direction)
            .unwrap_or_else(|| axis.dot(direction));
        self.ray(direction, distance, height)
    }

    /// Intersects a ray with the sphere, from inside with its far side.
    pub(super) fn intersect_sphere(
        &self,
        from: Vec3,
        direction: Vec3,
        t_max: f32,
    ) -> Option<LightRay> {
        let axis = self.centre - from;
        let distance = self.distance_along(axis, direction)?;
        if distance > t_max {
            return None;
        }
        self.ray(direction, distance, self.cap(axis))
    }

    /// One minus the cosine of the half angle of the sphere as seen from the start of `axis`; 2 from inside.
    fn cap(&self, axis: Vec3) -> f32 {
        let (d2, r2) = (axis.length2(), self.radius * self.radius);
        if d2 <= r2 {
            return 2.0;
        }
        // 1 - sqrt(1 - s) without cancellation.
        let s = r2 / d2;
        s / (1.0 + (1.0 - s).sqrt())
    }

    /// Distance to the first point of the sphere ahead. `axis`: from the start to the centre.
    fn distance_along(&self, axis: Vec3, direction: Vec3) -> Option<f32> {
        let middle = axis.dot(direction);
        let aside = axis - direction * middle;
        let half2 = self.radius * self.radius - aside.length2();
        if half2 < 0.0 {
            return None;
        }
        let half = half2.sqrt();
        [middle - half, middle + half]
            .into_iter()
            .find(|&t| t > 0.0)
    }

    /// The ray to a point of the sphere, with its density over a cap of this height.
    fn ray(&self, direction: Vec3, distance: f32, height: f32) -> Option<LightRay> {
        let attenuation = self.attenuation(direction);
        let pdf = 1.0 / (TAU * height);
        (attenuation > 0.0 && distance > 0.0 && pdf.is_finite()).then_some(LightRay {
            direction,
            distance,
            factor: attenuation,
            pdf,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ball() -> Disc {
        Disc::new(vec3(1.0, 2.0, 3.0), 0.5, None, true)
    }

    #[test]
    fn samples_are_what_rays_in_their_directions_meet() {
        let from = vec3(-1.0, 1.0, 0.5);
        for i in 0..64_u16 {
            let u = [
                (f32::from(i % 8) + 0.5) / 8.0,
                (f32::from(i / 8) + 0.5) / 8.0,
            ];
            let sample = ball().sample(from, u).unwrap();
            let hit = ball().intersect(from, sample.direction, 1e9).unwrap();
            assert!((sample.distance - hit.distance).abs() < 1e-4);
            assert!((sample.pdf - hit.pdf).abs() < 1e-4 * hit.pdf);
            let point = from + sample.direction * sample.distance;
            assert!(((point - vec3(1.0, 2.0, 3.0)).length() - 0.5).abs() < 1e-4);
        }
    }

    #[test]
    fn the_density_covers_the_solid_angle() {
        // At distance d, the solid angle is 2 pi (1 - sqrt(1 - r^2 / d^2)).
        let ray = ball().sample(vec3(1.0, 2.0, 4.0), [0.3, 0.6]).unwrap();
        let solid = TAU * (1.0 - (1.0_f32 - 0.25).sqrt());
        assert!((1.0 / ray.pdf - solid).abs() < 1e-5);
        let inside = ball().sample(vec3(1.0, 2.0, 3.1), [0.3, 0.6]).unwrap();
        assert!((1.0 / inside.pdf - 2.0 * TAU).abs() < 1e-4);
        assert!(
            ball()
                .intersect(vec3(1.0, 2.0, 3.1), vec3(0.0, 0.0, 1.0), 9.0)
                .is_some()
        );
    }

    #[test]
    fn rays_past_the_sphere_or_ending_before_it_miss() {
        let (from, up) = (vec3(1.0, 2.0, 0.0), vec3(0.0, 0.0, 1.0));
        assert!(ball().intersect(from, up, 9.0).is_some());
        assert!(ball().intersect(from, up, 2.0).is_none());
        assert!(ball().intersect(from, -up, 9.0).is_none());
        assert!(ball().intersect(vec3(1.6, 2.0, 0.0), up, 9.0).is_none());
    }
}
