// SPDX-License-Identifier: GPL-3.0-or-later
//! Area lights.

use std::f32::consts::PI;

use crate::light::shapes::LightRay;
use crate::light::shapes::spherical_rectangle::SphericalRectangle;
use crate::light::shapes::spread::Spread;
use crate::math::trig::sin_cos_turns;
use crate::math::vector::Vec3;

/// A flat one-sided emitter: a rectangle or an ellipse, or its image under a sheared matrix.
#[derive(Debug, Clone, Copy)]
pub struct Area {
    pub(super) centre: Vec3,
    /// Half extents, as vectors.
    u: Vec3,
    v: Vec3,
    /// Unit vectors along the extents, and half lengths.
    pub(super) unit_u: Vec3,
    pub(super) unit_v: Vec3,
    pub(super) half: [f32; 2],
    /// Unit normal on the emitting side.
    pub(super) normal: Vec3,
    area: f32,
    round: bool,
    /// Whether it is a right-angled rectangle, which is sampled by solid angle.
    rectangle: bool,
    spread: Spread,
}

impl Area {
    /// An emitter with full extents `x` and `y` that shines towards `direction`; `None` if it has no area.
    pub fn new(centre: Vec3, x: Vec3, y: Vec3, direction: Vec3, round: bool) -> Option<Self> {
        // The area of the parallelogram; its normal turned to the emitting side.
        let cross = x.cross(y);
        let product = cross.length();
        if !product.is_normal() {
            return None;
        }
        let normal = cross * (1.0 / product);
        let normal = if normal.dot(direction) < 0.0 {
            -normal
        } else {
            normal
        };
        let area = if round { 0.25 * PI * product } else { product };
        // Only right-angled rectangles can be sampled by solid angle.
        let (lx, ly) = (x.length(), y.length());
        let rectangle = !round && x.dot(y).abs() < 1e-4 * lx * ly;
        Some(Self {
            centre,
            u: x * 0.5,
            v: y * 0.5,
            unit_u: x * (1.0 / lx),
            unit_v: y * (1.0 / ly),
            half: [0.5 * lx, 0.5 * ly],
            normal,
            area,
            round,
            rectangle,
            spread: Spread::new(PI),
        })
    }

    /// The light with a cone of this full angle, to which it narrows what each of its points emits.
    #[must_use]
    pub fn with_spread(self, angle: f32) -> Self {
        let spread = Spread::new(angle);
        Self { spread, ..self }
    }

    /// Returns the area.
    pub fn area(&self) -> f32 {
        self.area
    }

    /// Samples a point of the light as seen from `from`: uniform by solid angle for a rectangle, otherwise by area.
    #[inline]
    pub fn sample(&self, from: Vec3, u: [f32; 2]) -> Option<LightRay> {
        if (from - self.centre).dot(self.normal) <= 0.0 {
            return None;
        }
        if self.rectangle
            && let Some(rectangle) = self.spherical(from)
        {
            let to = rectangle.sample(self, u);
            return self.towards(to, 1.0 / rectangle.solid_angle);
        }
        // Uniform point of the unit disk or the square.
        let [a, b] = if self.round {
            let (sin, cos) = sin_cos_turns(u[0]);
            let r = u[1].sqrt();
            [r * cos, r * sin]
        } else {
            [2.0 * u[0] - 1.0, 2.0 * u[1] - 1.0]
        };
        let to = self.centre + self.u * a + self.v * b - from;
        self.towards(to, self.by_area(to)?)
    }

    /// Intersects a ray with the emitting side.
    #[inline]
    pub fn intersect(&self, from: Vec3, direction: Vec3, t_max: f32) -> Option<LightRay> {
        let cos = -direction.dot(self.normal);
        if cos <= 0.0 {
            return None;
        }
        let t = (from - self.centre).dot(self.normal) / cos;
        if t <= 0.0 || t > t_max {
            return None;
        }
        // Intersect the plane first, then test the outline.
        let p = from + direction * t - self.centre;
        // Solve for the coordinates along the two extents, which need not be perpendicular.
        let (uu, uv, vv) = (self.u.length2(), self.u.dot(self.v), self.v.length2());
        let (pu, pv) = (p.dot(self.u), p.dot(self.v));
        let scale = 1.0 / (uu * vv - uv * uv);
        let (a, b) = ((pu * vv - pv * uv) * scale, (pv * uu - pu * uv) * scale);
        let inside = if self.round {
            a * a + b * b <= 1.0
        } else {
            a.abs() <= 1.0 && b.abs() <= 1.0
        };
        if !inside {
            return None;
        }
        // Return the density with which `sample` finds this point.
        let to = direction * t;
        let pdf = match self.rectangle.then(|| self.spherical(from)).flatten() {
            Some(rectangle) => 1.0 / rectangle.solid_angle,
            None => self.by_area(to)?,
        };
        self.towards(to, pdf)
    }

    /// The ray along `to`, if it arrives at the emitting side.
    #[inline]
    fn towards(&self, to: Vec3, pdf: f32) -> Option<LightRay> {
        let distance = to.length();
        let direction = to * (1.0 / distance);
        let cos = -direction.dot(self.normal);
        (distance > 0.0 && cos > 0.0).then(|| LightRay {
            direction,
            distance,
            factor: self.spread.factor(cos),
            pdf,
        })
    }

    /// Density per solid angle of a point that is uniform by area.
    #[inline]
    fn by_area(&self, to: Vec3) -> Option<f32> {
        let d2 = to.length2();
        let cos = -to.dot(self.normal) / d2.sqrt();
        (cos > 0.0 && d2.is_normal()).then(|| d2 / (cos * self.area))
    }

    /// Returns centre and radius of a bounding sphere.
    pub fn bounding_sphere(&self) -> (Vec3, f32) {
        let (u, v) = (self.u, self.v);
        let radius2 = if self.round {
            // Bounds |u cos a + v sin a| by the Cauchy–Schwarz inequality.
            u.length2() + v.length2()
        } else {
            // The diagonals differ if the matrix shears.
            (u + v).length2().max((u - v).length2())
        };
        (self.centre, radius2.sqrt())
    }

    /// Estimate of the irradiance per strength, see `Light::importance`.
    #[inline]
    pub fn importance(&self, point: Vec3, normal: Vec3) -> f32 {
        // No light on the back, or if the whole light lies below the receiver's horizon.
        let axis = self.centre - point;
        let cos = -axis.dot(self.normal);
        let reach = self.u.dot(normal).abs() + self.v.dot(normal).abs();
        if cos <= 0.0 || axis.dot(normal) + reach < 0.0 {
            return 0.0;
        }
        // The lower bound keeps the cosine positive on the emitting side, because parts of the light may be less
        // grazing than its centre.
        let d2 = axis.length2();
        (cos / d2.sqrt()).max(0.05) / d2.max(self.area)
    }

    /// The rectangle as seen from a point, if its solid angle can be sampled.
    #[inline]
    fn spherical(&self, from: Vec3) -> Option<SphericalRectangle> {
        SphericalRectangle::new(self, from)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vector::vec3;

    #[test]
    fn the_bounding_sphere_contains_sheared_lights() {
        let (u, v) = (vec3(1.0, 0.0, 0.0), vec3(0.9, 0.1, 0.0));
        let down = vec3(0.0, 0.0, -1.0);
        for round in [false, true] {
            let area = Area::new(Vec3::ZERO, u, v, down, round).expect("it has an area");
            let (centre, radius) = area.bounding_sphere();
            for k in 0..16_u8 {
                let (sin, cos) = (f32::from(k) * std::f32::consts::FRAC_PI_8).sin_cos();
                // The outline of a square or of an ellipse.
                let scale = if round {
                    1.0
                } else {
                    1.0 / sin.abs().max(cos.abs())
                };
                let point = area.u * (scale * cos) + area.v * (scale * sin);
                let far = (point - centre).length();
                assert!(
                    far <= radius * 1.00001,
                    "{far} outside {radius}, round: {round}"
                );
            }
        }
    }
}
