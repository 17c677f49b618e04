// SPDX-License-Identifier: GPL-3.0-or-later
//! Area lights.

use std::f32::consts::PI;

use crate::light::emission::Emission;
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
    /// Whether its extents are perpendicular; rectangles are then sampled by solid angle.
    straight: bool,
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
        let straight = x.dot(y).abs() < 1e-4 * lx * ly;
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
            straight,
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

    /// Samples a point of the light, or of the part of it that shines on `from`: uniform by solid angle for a
    /// rectangle, otherwise by area.
    #[inline]
    pub fn sample(&self, from: Vec3, u: [f32; 2]) -> Option<LightRay> {
        if (from - self.centre).dot(self.normal) <= 0.0 {
            return None;
        }
        if self.spread.is_full() {
            return self.sample_all(from, u);
        }
        // The rectangle around a part of an ellipse has points outside of the ellipse.
        let found = self.part_towards(from)?.sample_all(from, u)?;
        let point = from + found.direction * found.distance - self.centre;
        (!self.round || self.covers(point)).then_some(found)
    }

    /// Samples a point of the whole light.
    #[inline]
    fn sample_all(&self, from: Vec3, u: [f32; 2]) -> Option<LightRay> {
        if let Some(rectangle) = self.spherical(from) {
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
        if !self.covers(from + direction * t - self.centre) {
            return None;
        }
        // Return the density with which `sample` finds this point.
        let to = direction * t;
        let pdf = if self.spread.is_full() {
            self.density(from, to)?
        } else {
            self.part_towards(from)?.density(from, to)?
        };
        self.towards(to, pdf)
    }

    /// Whether a point of the plane, relative to the centre, is inside of the outline.
    #[inline]
    fn covers(&self, p: Vec3) -> bool {
        // Solve for the coordinates along the two extents, which need not be perpendicular.
        let (uu, uv, vv) = (self.u.length2(), self.u.dot(self.v), self.v.length2());
        let (pu, pv) = (p.dot(self.u), p.dot(self.v));
        let scale = 1.0 / (uu * vv - uv * uv);
        let (a, b) = ((pu * vv - pv * uv) * scale, (pv * uu - pu * uv) * scale);
        if self.round {
            a * a + b * b <= 1.0
        } else {
            a.abs() <= 1.0 && b.abs() <= 1.0
        }
    }

    /// Density per solid angle with which [`Self::sample_all`] finds the end of `to`.
    #[inline]
    fn density(&self, from: Vec3, to: Vec3) -> Option<f32> {
        match self.spherical(from) {
            Some(rectangle) => Some(1.0 / rectangle.solid_angle),
            None => self.by_area(to),
        }
    }

    /// The light cut to a square around the circle whose points shine on `from`; all of it if that is smaller.
    fn part_towards(&self, from: Vec3) -> Option<Self> {
        if !self.straight {
            return Some(*self);
        }
        let back = from - self.centre;
        let reach = self.spread.reach(back.dot(self.normal));
        let cut = |axis: Vec3, half: f32| {
            let middle = axis.dot(back);
            let (low, high) = ((middle - reach).max(-half), (middle + reach).min(half));
            (low < high).then_some((axis * (0.5 * (low + high)), 0.5 * (high - low)))
        };
        // A square that covers more than an ellipse gains nothing.
        let (along_u, a) = cut(self.unit_u, self.half[0])?;
        let (along_v, b) = cut(self.unit_v, self.half[1])?;
        let area = 4.0 * a * b;
        if area >= self.area {
            return Some(*self);
        }
        area.is_normal().then_some(Self {
            centre: self.centre + along_u + along_v,
            u: self.unit_u * a,
            v: self.unit_v * b,
            half: [a, b],
            area,
            round: false,
            ..*self
        })
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

    /// Returns the unit normal on the emitting side.
    pub fn normal(&self) -> Vec3 {
        self.normal
    }

    /// Returns the position of a point along both extents, 0..1.
    pub fn parametric(&self, point: Vec3) -> [f32; 2] {
        let p = point - self.centre;
        [(self.unit_u, self.half[0]), (self.unit_v, self.half[1])]
            .map(|(axis, half)| 0.5 + (0.5 * p.dot(axis) / half).clamp(-0.5, 0.5))
    }

    /// Returns the point at a position along both extents, 0..1.
    pub fn point(&self, [u, v]: [f32; 2]) -> Vec3 {
        self.centre + self.u * (2.0 * u - 1.0) + self.v * (2.0 * v - 1.0)
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

    /// Returns the bound of the directions into which the light shines.
    pub fn emission(&self) -> Emission {
        Emission::around(self.normal, self.spread.half_angle())
    }

    /// The light as seen from a point, if it is a rectangle whose solid angle can be sampled.
    #[inline]
    fn spherical(&self, from: Vec3) -> Option<SphericalRectangle> {
        (self.straight && !self.round)
            .then(|| SphericalRectangle::new(self, from))
            .flatten()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vector::vec3;

    /// The integral over the light of what `from` receives by direction, in small pieces of the area.
    fn received(light: &Area, from: Vec3) -> f64 {
        let steps = 400_u16;
        let place = |k: u16| (f32::from(k) + 0.5) / f32::from(steps) * 2.0 - 1.0;
        let piece = light.u.cross(light.v).length() * 4.0 / f32::from(steps).powi(2);
        let mut sum = 0.0;
        for (i, j) in (0..steps).flat_map(|i| (0..steps).map(move |j| (i, j))) {
            let point = light.u * place(i) + light.v * place(j);
            let to = light.centre + point - from;
            if light.covers(point)
                && let Some(ray) = light.towards(to, 1.0)
            {
                let cos = -ray.direction.dot(light.normal);
                sum += f64::from(ray.factor * cos * piece / to.length2());
            }
        }
        sum
    }

    #[test]
    fn samples_cover_what_lights_with_a_spread_emit() {
        let (x, y) = (vec3(0.8, 0.0, 0.0), vec3(0.0, 0.5, 0.0));
        let down = vec3(0.0, 0.0, -1.0);
        let from = [
            vec3(0.1, 0.05, -1.0),
            vec3(0.4, 0.1, -1.5),
            vec3(-0.6, 0.1, -2.0),
        ];
        for (round, degrees) in [false, true]
            .into_iter()
            .flat_map(|r| [10.0, 40.0, 120.0].map(|d| (r, d)))
        {
            let whole = Area::new(Vec3::ZERO, x, y, down, round).unwrap();
            let light = whole.with_spread(f32::to_radians(degrees));
            for from in from {
                // Compare the density of each sample with that of the ray that meets it.
                let mut sum = 0.0;
                for k in 0..10_000_u16 {
                    let u = [k / 100, k % 100].map(|c| (f32::from(c) + 0.5) / 100.0);
                    let Some(ray) = light.sample(from, u) else {
                        continue;
                    };
                    sum += f64::from(ray.factor / ray.pdf) / 10_000.0;
                    if let Some(hit) = light.intersect(from, ray.direction, f32::INFINITY) {
                        assert!((hit.pdf - ray.pdf).abs() <= 1e-3 * ray.pdf);
                    }
                }
                let expected = received(&light, from);
                assert!(
                    (sum - expected).abs() <= 0.02 * expected + 1e-9,
                    "{degrees} {round} {from:?}: {sum} {expected}"
                );
            }
        }
    }

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
