// SPDX-License-Identifier: GPL-3.0-or-later
//! Emissive triangles.

use crate::light::shapes::LightRay;
use crate::light::shapes::spherical_triangle::Spherical;
use crate::math::vector::Vec3;

/// Distance up to which a triangle is sampled by solid angle, in multiples of its radius (chosen: farther away, cosine
/// and distance vary little over it).
const NEAR: f32 = 3.0;

/// A triangle that emits on both sides.
#[derive(Debug, Clone, Copy)]
pub struct Triangle {
    corners: [Vec3; 3],
    normal: Vec3,
    area: f32,
}

impl Triangle {
    /// The triangle with these corners, or `None` if it has no area.
    pub fn new(corners: [Vec3; 3]) -> Option<Self> {
        let [a, b, c] = corners;
        // Half the cross product is the area.
        let cross = (b - a).cross(c - a);
        let area = 0.5 * cross.length();
        (area.is_normal()).then(|| Self {
            corners,
            normal: cross.normalized(),
            area,
        })
    }

    /// Returns the area.
    pub fn area(&self) -> f32 {
        self.area
    }

    /// Returns centre and radius of a bounding sphere.
    pub fn bounding_sphere(&self) -> (Vec3, f32) {
        let [a, b, c] = self.corners;
        // The centroid, and the farthest vertex from it.
        let centre = (a + b + c) * (1.0 / 3.0);
        let far = |p: Vec3| (p - centre).length();
        (centre, far(a).max(far(b)).max(far(c)))
    }

    /// Maps two random numbers to the weights of the second and third corner, uniform by area (Heitz 2019, "A
    /// Low-Distortion Map Between Triangle and Square").
    pub fn weights([u, v]: [f32; 2]) -> [f32; 2] {
        if v > u {
            let x = 0.5 * u;
            [x, v - x]
        } else {
            let y = 0.5 * v;
            [u - y, y]
        }
    }

    /// Samples a point, and returns the ray to it from the receiver at `from`, and the weights of the second and third
    /// corner; `None` if the receiver sees the triangle edge-on or the density overflows. Uniform by solid angle near
    /// the triangle, where the cosine and the distance vary most, else by area.
    pub fn sample(&self, from: Vec3, u: [f32; 2]) -> Option<(LightRay, [f32; 2])> {
        if let Some(seen) = self.seen(from) {
            let (direction, distance, weights) = seen.sample(u)?;
            let ray = LightRay {
                direction,
                distance,
                factor: 1.0,
                pdf: seen.density(),
            };
            return Some((ray, weights));
        }
        let [a, b, c] = self.corners;
        // Compute the vector to the point.
        let weights @ [v, w] = Self::weights(u);
        let to = a * (1.0 - v - w) + b * v + c * w - from;
        let d2 = to.length2();
        let distance = d2.sqrt();
        let direction = to.normalized_or(Vec3::ZERO);
        let cosine = self.normal.dot(direction).abs();
        // Convert the density per area to solid angle, and drop grazing directions whose density overflows.
        let pdf = d2 / (self.area * cosine).max(1e-30);
        let ray = LightRay {
            direction,
            distance,
            factor: 1.0,
            pdf,
        };
        (cosine > 1e-6 && d2.is_normal() && pdf.is_finite()).then_some((ray, weights))
    }

    /// Returns the density per solid angle with which [`Self::sample`] finds a point, at this distance and cosine from
    /// `from`.
    pub fn density(&self, from: Vec3, distance: f32, cosine: f32) -> f32 {
        match self.seen(from) {
            Some(seen) => seen.density(),
            None => distance * distance / (self.area * cosine).max(1e-30),
        }
    }

    /// Returns the triangle as seen from a point that is near and not almost in its plane.
    fn seen(&self, from: Vec3) -> Option<Spherical> {
        let (centre, radius) = self.bounding_sphere();
        let near = NEAR * radius;
        if (centre - from).length2() > near * near {
            return None;
        }
        Spherical::new(self.corners, from)
    }
}
