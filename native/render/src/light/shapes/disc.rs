// SPDX-License-Identifier: GPL-3.0-or-later
//! Point and spot lights, with or without a radius.

use std::f32::consts::PI;

use crate::light::emission::Emission;
use crate::light::shapes::LightRay;
use crate::light::shapes::cone::Cone;
use crate::math::trig::sin_cos_turns;
use crate::math::vector::{Frame, Vec3, vec3};

/// A point or spot light: a disc that always faces the receiver, or a sphere.
#[derive(Debug, Clone, Copy)]
pub struct Disc {
    pub(super) centre: Vec3,
    /// Radius; 0 for a point.
    pub radius: f32,
    cone: Option<Cone>,
    /// Whether it is a sphere.
    sphere: bool,
}

impl Disc {
    /// A disc or sphere of this radius; `cone` makes it a spot light.
    pub fn new(centre: Vec3, radius: f32, cone: Option<Cone>, sphere: bool) -> Self {
        Self {
            centre,
            radius,
            cone,
            sphere: sphere && radius > 0.0,
        }
    }

    /// Samples a point of the disc, uniform by area, or of the sphere, uniform by solid angle.
    #[inline]
    pub fn sample(&self, from: Vec3, u: [f32; 2]) -> Option<LightRay> {
        if self.sphere {
            return self.sample_sphere(from, u);
        }
        let axis = self.centre - from;
        // A point without size has one direction; a disc is sampled around it.
        let mut to = axis;
        if self.radius > 0.0 {
            let frame = Frame::around(axis.normalized_or(vec3(0.0, 0.0, 1.0)));
            let r = self.radius * u[1].sqrt();
            let (sin, cos) = sin_cos_turns(u[0]);
            to += frame.x * (r * cos) + frame.y * (r * sin);
        }
        self.towards(axis, to)
    }

    /// Intersects a ray with the disc that faces the ray's origin, or with the sphere.
    #[inline]
    pub fn intersect(&self, from: Vec3, direction: Vec3, t_max: f32) -> Option<LightRay> {
        if self.sphere {
            return self.intersect_sphere(from, direction, t_max);
        }
        let axis = self.centre - from;
        // Intersect the disc's plane, then compare the distance from the centre.
        let normal = axis.normalized_or(Vec3::ZERO);
        let cos = direction.dot(normal);
        if cos <= 0.0 {
            return None;
        }
        let t = axis.dot(normal) / cos;
        let offset = direction * t - axis;
        if t > t_max || offset.length2() > self.radius * self.radius {
            return None;
        }
        self.towards(axis, direction * t)
    }

    /// The ray along `to` with attenuation and density. `axis`: from the receiver to the centre.
    #[inline]
    fn towards(&self, axis: Vec3, to: Vec3) -> Option<LightRay> {
        let d2 = to.length2();
        if !d2.is_normal() {
            return None;
        }
        let distance = d2.sqrt();
        let direction = to * (1.0 / distance);
        let attenuation = self.attenuation(direction);
        if attenuation <= 0.0 {
            return None;
        }
        // Without size the density is a delta: fold 1/d² into the factor.
        if self.radius <= 0.0 {
            return Some(LightRay {
                direction,
                distance,
                factor: attenuation / d2,
                pdf: 1.0,
            });
        }
        // Convert the density per area of the disc to solid angle.
        let cos = direction.dot(axis.normalized_or(direction));
        let pdf = d2 / (cos * PI * self.radius * self.radius);
        (cos > 0.0).then_some(LightRay {
            direction,
            distance,
            factor: attenuation,
            pdf,
        })
    }

    /// The attenuation of a spot for a ray in this direction: by the direction from the point that it meets.
    #[inline]
    pub(super) fn attenuation(&self, direction: Vec3) -> f32 {
        let cone = self.cone.as_ref();
        cone.map_or(1.0, |cone| cone.attenuation(-direction))
    }

    /// Whether it is a sphere.
    pub fn is_sphere(&self) -> bool {
        self.sphere
    }

    /// Returns the bound of the directions into which the light shines.
    pub fn emission(&self) -> Emission {
        self.cone.as_ref().map_or(Emission::ALL, Cone::emission)
    }

    /// Returns the centre.
    pub fn centre(&self) -> Vec3 {
        self.centre
    }

    /// Estimate of the irradiance per strength, see `Light::importance`.
    #[inline]
    pub fn importance(&self, point: Vec3, normal: Vec3) -> f32 {
        let axis = self.centre - point;
        if axis.dot(normal) + self.radius < 0.0 {
            return 0.0;
        }
        // Only a point has a single direction for the cone; inside the disc the distance counts as its radius.
        let d2 = axis.length2();
        if self.radius <= 0.0
            && let Some(cone) = &self.cone
        {
            return cone.attenuation(-axis) / d2.max(1e-12);
        }
        1.0 / d2.max(self.radius * self.radius).max(1e-12)
    }
}
