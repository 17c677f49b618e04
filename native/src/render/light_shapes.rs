// SPDX-License-Identifier: GPL-3.0-or-later
//! The geometry of lights: sample a direction towards one, and find where a ray meets it.

use std::f32::consts::{PI, TAU};

use super::camera::matrix_column;
use super::trig::{asin, sin_cos_turns};
use super::vector::{Frame, Vec3, vec3};

/// A ray to a light.
#[derive(Debug, Clone, Copy)]
pub struct LightRay {
    /// Unit direction.
    pub direction: Vec3,
    /// Distance; infinite for a sun.
    pub distance: f32,
    /// What multiplies the light's strength: attenuation, and 1/d² for a point without size.
    pub factor: f32,
    /// Density per solid angle; 1 for lights without size.
    pub pdf: f32,
}

/// The cone of a spot light.
#[derive(Debug, Clone, Copy)]
pub struct Cone {
    /// Rows of the inverse of the light's matrix, which shapes the cone when scaled.
    inverse: [Vec3; 3],
    cos_half: f32,
    smooth: f32,
}

impl Cone {
    /// `size`: full angle; `blend`: share that fades. `None` for a singular matrix.
    pub fn new(to_world: &[[f64; 4]; 4], size: f32, blend: f32) -> Option<Self> {
        let [x, y, z] = [0, 1, 2].map(|k| matrix_column(to_world, k));
        let [x, y, z] = {
            let largest = [x, y, z].map(|v| v.map(f32::abs).max_component());
            let largest = largest[0].max(largest[1]).max(largest[2]);
            [x, y, z].map(|v| v * (1.0 / largest))
        };
        let determinant = x.dot(y.cross(z));
        if determinant == 0.0 || !determinant.is_finite() {
            return None;
        }
        let inverse = [y.cross(z), z.cross(x), x.cross(y)].map(|v| v * (1.0 / determinant));
        let cos_half = (0.5 * f64::from(size)).cos() as f32;
        let smooth = 1.0 / ((1.0 - cos_half) * blend.clamp(0.0, 1.0)).max(1e-7);
        Some(Self {
            inverse,
            cos_half,
            smooth,
        })
    }

    /// Cycles' falloff for light that leaves in this direction.
    #[inline]
    fn attenuation(&self, direction: Vec3) -> f32 {
        let local = vec3(
            self.inverse[0].dot(direction),
            self.inverse[1].dot(direction),
            self.inverse[2].dot(direction),
        );
        let cos = -local.z / local.length().max(1e-30);
        let x = ((cos - self.cos_half) * self.smooth).clamp(0.0, 1.0);
        x * x * (3.0 - 2.0 * x)
    }
}

/// A point or spot light: a disc that always faces the receiver.
#[derive(Debug, Clone, Copy)]
pub struct Disc {
    centre: Vec3,
    /// Soft size, 0 for a point.
    pub radius: f32,
    cone: Option<Cone>,
}

impl Disc {
    /// A disc of this radius; `cone` for a spot.
    pub fn new(centre: Vec3, radius: f32, cone: Option<Cone>) -> Self {
        Self {
            centre,
            radius,
            cone,
        }
    }

    /// A point of the disc, uniform over its area.
    #[inline]
    pub fn sample(&self, from: Vec3, u: [f32; 2]) -> Option<LightRay> {
        let axis = self.centre - from;
        let mut to = axis;
        if self.radius > 0.0 {
            let frame = Frame::around(axis.normalized_or(vec3(0.0, 0.0, 1.0)));
            let r = self.radius * u[1].sqrt();
            let (sin, cos) = sin_cos_turns(u[0]);
            to += frame.x * (r * cos) + frame.y * (r * sin);
        }
        self.towards(axis, to)
    }

    /// Where a ray meets the disc that faces its origin.
    #[inline]
    pub fn intersect(&self, from: Vec3, direction: Vec3, t_max: f32) -> Option<LightRay> {
        let axis = self.centre - from;
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

    #[inline]
    fn towards(&self, axis: Vec3, to: Vec3) -> Option<LightRay> {
        let d2 = to.length2();
        if !d2.is_normal() {
            return None;
        }
        let distance = d2.sqrt();
        let direction = to * (1.0 / distance);
        let attenuation = self
            .cone
            .as_ref()
            .map_or(1.0, |c| c.attenuation(-direction));
        if attenuation <= 0.0 {
            return None;
        }
        if self.radius <= 0.0 {
            return Some(LightRay {
                direction,
                distance,
                factor: attenuation / d2,
                pdf: 1.0,
            });
        }
        let cos = direction.dot(axis.normalized_or(direction));
        let pdf = d2 / (cos * PI * self.radius * self.radius);
        (cos > 0.0).then_some(LightRay {
            direction,
            distance,
            factor: attenuation,
            pdf,
        })
    }

    /// Its centre.
    pub fn centre(&self) -> Vec3 {
        self.centre
    }

    /// See `Light::importance`.
    #[inline]
    pub fn importance(&self, point: Vec3, normal: Vec3) -> f32 {
        let axis = self.centre - point;
        if axis.dot(normal) + self.radius < 0.0 {
            return 0.0;
        }
        let d2 = axis.length2();
        if self.radius <= 0.0
            && let Some(cone) = &self.cone
        {
            return cone.attenuation(-axis) / d2.max(1e-12);
        }
        1.0 / d2.max(self.radius * self.radius).max(1e-12)
    }
}

/// A distant light.
#[derive(Debug, Clone, Copy)]
pub struct Sun {
    frame: Frame,
    /// 1 - cos of half the angle, without cancellation.
    one_minus_cos: f32,
    sin2: f32,
}

impl Sun {
    /// `towards`: unit direction to the sun's centre; `angle`: full angle of its disc.
    pub fn new(towards: Vec3, angle: f32) -> Self {
        let half = 0.5 * f64::from(angle);
        let (sin, sin_half) = (half.sin() as f32, (0.5 * half).sin() as f32);
        let one_minus_cos = 2.0 * sin_half * sin_half;
        Self {
            frame: Frame::around(towards),
            one_minus_cos,
            sin2: sin * sin,
        }
    }

    /// Whether the disc is wide enough for a ray to meet it.
    pub fn has_size(&self) -> bool {
        self.one_minus_cos > 1e-12
    }

    /// Radiance of a sun of irradiance 1; the irradiance itself without a size.
    pub fn radiance_of_one(&self) -> f32 {
        if self.has_size() {
            1.0 / (PI * self.sin2)
        } else {
            1.0
        }
    }

    fn pdf(&self) -> f32 {
        1.0 / (TAU * self.one_minus_cos)
    }

    /// A direction uniform over the disc.
    #[inline]
    pub fn sample(&self, u: [f32; 2]) -> Option<LightRay> {
        let distance = f32::INFINITY;
        if !self.has_size() {
            return Some(LightRay {
                direction: self.frame.z,
                distance,
                factor: 1.0,
                pdf: 1.0,
            });
        }
        let m = u[1] * self.one_minus_cos;
        let r = (m * (2.0 - m)).max(0.0).sqrt();
        let (sin, cos) = sin_cos_turns(u[0]);
        let direction = self.frame.to_world(vec3(r * cos, r * sin, 1.0 - m));
        Some(LightRay {
            direction,
            distance,
            factor: 1.0,
            pdf: self.pdf(),
        })
    }

    /// Whether a ray that meets nothing else ends in the disc.
    #[inline]
    pub fn intersect(&self, direction: Vec3, t_max: f32) -> Option<LightRay> {
        // |d - z|² = 2 (1 - cos), which keeps its digits for narrow discs.
        let inside = (direction - self.frame.z).length2() <= 2.0 * self.one_minus_cos;
        (t_max == f32::INFINITY && inside && self.has_size()).then(|| LightRay {
            direction,
            distance: f32::INFINITY,
            factor: 1.0,
            pdf: self.pdf(),
        })
    }

    /// See `Light::importance`.
    #[inline]
    pub fn importance(&self, normal: Vec3) -> f32 {
        if self.frame.z.dot(normal) + self.sin2.sqrt().max(self.one_minus_cos) < 0.0 {
            0.0
        } else {
            1.0
        }
    }
}

/// A triangle that glows on both sides.
#[derive(Debug, Clone, Copy)]
pub struct Triangle {
    corners: [Vec3; 3],
    normal: Vec3,
    area: f32,
}

impl Triangle {
    /// `None` for a triangle without area.
    pub fn new(corners: [Vec3; 3]) -> Option<Self> {
        let [a, b, c] = corners;
        let cross = (b - a).cross(c - a);
        let area = 0.5 * cross.length();
        (area.is_normal()).then(|| Self {
            corners,
            normal: cross.normalized(),
            area,
        })
    }

    /// Its area.
    pub fn area(&self) -> f32 {
        self.area
    }

    /// A ball around it.
    pub fn ball(&self) -> (Vec3, f32) {
        let [a, b, c] = self.corners;
        let centre = (a + b + c) * (1.0 / 3.0);
        let far = |p: Vec3| (p - centre).length();
        (centre, far(a).max(far(b)).max(far(c)))
    }

    /// Weights of the second and third corner for a pair of random numbers, even over the area
    /// (Heitz 2019, "A Low-Distortion Map Between Triangle and Square").
    pub fn weights([u, v]: [f32; 2]) -> [f32; 2] {
        if v > u {
            let x = 0.5 * u;
            [x, v - x]
        } else {
            let y = 0.5 * v;
            [u - y, y]
        }
    }

    /// A direction to a point of it, even over the area.
    pub fn sample(&self, from: Vec3, u: [f32; 2]) -> Option<LightRay> {
        let [a, b, c] = self.corners;
        let [v, w] = Self::weights(u);
        let way = a * (1.0 - v - w) + b * v + c * w - from;
        let d2 = way.length2();
        let distance = d2.sqrt();
        let direction = way.normalized_or(Vec3::ZERO);
        let cosine = self.normal.dot(direction).abs();
        let pdf = d2 / (self.area * cosine).max(1e-30);
        (cosine > 1e-6 && d2.is_normal() && pdf.is_finite()).then_some(LightRay {
            direction,
            distance,
            factor: 1.0,
            pdf,
        })
    }
}

/// A flat one-sided emitter, rectangle or ellipse (or what a sheared matrix makes of them).
#[derive(Debug, Clone, Copy)]
pub struct Area {
    centre: Vec3,
    /// Half extents.
    u: Vec3,
    v: Vec3,
    unit_u: Vec3,
    unit_v: Vec3,
    half: [f32; 2],
    /// Side that shines.
    normal: Vec3,
    area: f32,
    round: bool,
    /// A right-angled rectangle, sampled by solid angle.
    rectangle: bool,
}

impl Area {
    /// `x`, `y`: full extents; `direction`: to the side that shines. `None` without area.
    pub fn new(centre: Vec3, x: Vec3, y: Vec3, direction: Vec3, round: bool) -> Option<Self> {
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
        })
    }

    /// Its area.
    pub fn area(&self) -> f32 {
        self.area
    }

    /// A point of the light: uniform over the solid angle of a rectangle, else over the area.
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

    /// Where a ray meets the shining side.
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
        let p = from + direction * t - self.centre;
        // Coordinates along the two extents, which need not be at right angles.
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
        let to = direction * t;
        let pdf = match self.rectangle.then(|| self.spherical(from)).flatten() {
            Some(rectangle) => 1.0 / rectangle.solid_angle,
            None => self.by_area(to)?,
        };
        self.towards(to, pdf)
    }

    #[inline]
    fn towards(&self, to: Vec3, pdf: f32) -> Option<LightRay> {
        let distance = to.length();
        let direction = to * (1.0 / distance);
        (distance > 0.0 && direction.dot(self.normal) < 0.0).then_some(LightRay {
            direction,
            distance,
            factor: 1.0,
            pdf,
        })
    }

    /// Density per solid angle of a point uniform over the area.
    #[inline]
    fn by_area(&self, to: Vec3) -> Option<f32> {
        let d2 = to.length2();
        let cos = -to.dot(self.normal) / d2.sqrt();
        (cos > 0.0 && d2.is_normal()).then(|| d2 / (cos * self.area))
    }

    /// A ball around it.
    pub fn ball(&self) -> (Vec3, f32) {
        (self.centre, (self.u.length2() + self.v.length2()).sqrt())
    }

    /// See `Light::importance`.
    #[inline]
    pub fn importance(&self, point: Vec3, normal: Vec3) -> f32 {
        let axis = self.centre - point;
        let cos = -axis.dot(self.normal);
        let reach = self.u.dot(normal).abs() + self.v.dot(normal).abs();
        if cos <= 0.0 || axis.dot(normal) + reach < 0.0 {
            return 0.0;
        }
        // Never zero on the shining side: a lower bound keeps grazing parts sampled.
        let d2 = axis.length2();
        (cos / d2.sqrt()).max(0.05) / d2.max(self.area)
    }

    #[inline]
    fn spherical(&self, from: Vec3) -> Option<SphericalRectangle> {
        SphericalRectangle::new(self, from)
    }
}

/// Ureña, Fajardo and King 2013, "An Area-Preserving Parametrization for Spherical Rectangles",
/// with arcsines instead of arccosines so that small rectangles keep their digits (as in Cycles).
struct SphericalRectangle {
    x: [f32; 2],
    y: [f32; 2],
    z: f32,
    sign: f32,
    b: [f32; 2],
    g: f32,
    solid_angle: f32,
}

impl SphericalRectangle {
    /// `None` when the solid angle is too small for f32; sample the area then.
    #[inline]
    fn new(area: &Area, from: Vec3) -> Option<Self> {
        let axis = area.centre - from;
        let z = area.normal.dot(axis).abs();
        // The plane's distance counts as negative in the paper.
        let z = -z;
        let (xc, yc) = (area.unit_u.dot(axis), area.unit_v.dot(axis));
        let x = [xc - area.half[0], xc + area.half[0]];
        let y = [yc - area.half[1], yc + area.half[1]];
        let n = [-y[0], x[1], y[1], -x[0]].map(|c| c / (c * c + z * z).sqrt());
        let g = [
            asin(-n[0] * n[1]),
            asin(-n[1] * n[2]),
            asin(-n[2] * n[3]),
            asin(-n[3] * n[0]),
        ];
        let solid_angle = -(g[0] + g[1] + g[2] + g[3]);
        let flat = n.iter().all(|c| c * c > 0.99999);
        if solid_angle.is_nan() || solid_angle < 1e-5 || flat {
            return None;
        }
        let sign = if area.normal.dot(axis) > 0.0 {
            -1.0
        } else {
            1.0
        };
        Some(Self {
            x,
            y,
            z,
            sign,
            b: [n[0], n[2]],
            g: g[2] + g[3],
            solid_angle,
        })
    }

    /// From the receiver to a point of the rectangle.
    #[inline]
    fn sample(&self, area: &Area, u: [f32; 2]) -> Vec3 {
        let au = u[0] * self.solid_angle + self.g;
        let (sin, cos) = sin_cos_turns((au * (1.0 / TAU)).rem_euclid(1.0));
        let fu = if sin == 0.0 {
            0.0
        } else {
            (cos * self.b[0] + self.b[1]) / sin
        };
        let cu = (1.0 / (fu * fu + self.b[0] * self.b[0]).sqrt())
            .copysign(fu)
            .clamp(-1.0, 1.0);
        let xu = -(cu * self.z) / (1.0 - cu * cu).max(1e-14).sqrt();
        let xu = xu.clamp(self.x[0], self.x[1]);
        let d2 = xu * xu + self.z * self.z;
        let h = self.y.map(|y| y / (d2 + y * y).sqrt());
        let hv = h[0] + u[1] * (h[1] - h[0]);
        let yv = if hv * hv < 1.0 - 1e-6 {
            hv * (d2 / (1.0 - hv * hv)).sqrt()
        } else {
            self.y[1]
        };
        area.unit_u * xu + area.unit_v * yv + area.normal * (self.z * self.sign)
    }
}
