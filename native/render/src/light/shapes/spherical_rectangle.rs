// SPDX-License-Identifier: GPL-3.0-or-later
//! Rectangles seen from a point, sampled uniformly by solid angle.

use std::f32::consts::TAU;

use crate::light::shapes::area::Area;
use crate::math::trig::{asin, sin_cos_turns};
use crate::math::vector::Vec3;

/// A spherical rectangle. Ureña, Fajardo and King 2013, "An Area-Preserving Parametrization for Spherical
/// Rectangles", with arcsines instead of arccosines, which keep the precision of small rectangles (as in Cycles).
pub(super) struct SphericalRectangle {
    /// Extents of the rectangle in its own frame, relative to the receiver.
    x: [f32; 2],
    y: [f32; 2],
    /// Distance of the plane, negative as in the paper.
    z: f32,
    /// Sign that maps the paper's z axis to the normal of the light.
    sign: f32,
    /// z components of the normals of the lower and upper side.
    b: [f32; 2],
    /// Sum of two internal angles, as arcsines.
    g: f32,
    pub(super) solid_angle: f32,
}

impl SphericalRectangle {
    /// The rectangle as seen from `from`; `None` if its solid angle is too small for f32, in which case the caller
    /// samples the area.
    #[inline]
    pub(super) fn new(area: &Area, from: Vec3) -> Option<Self> {
        let axis = area.centre - from;
        let z = area.normal.dot(axis).abs();
        // The paper takes the distance of the plane as negative.
        let z = -z;
        // Extents in the light's frame, relative to the receiver.
        let (xc, yc) = (area.unit_u.dot(axis), area.unit_v.dot(axis));
        let x = [xc - area.half[0], xc + area.half[0]];
        let y = [yc - area.half[1], yc + area.half[1]];
        // The normals of the four sides have these z components; the angles between them give the solid angle.
        let n = [-y[0], x[1], y[1], -x[0]].map(|c| c / (c * c + z * z).sqrt());
        let g = [
            asin(-n[0] * n[1]),
            asin(-n[1] * n[2]),
            asin(-n[2] * n[3]),
            asin(-n[3] * n[0]),
        ];
        let solid_angle = -(g[0] + g[1] + g[2] + g[3]);
        // Reject rectangles that are too small or seen at too grazing an angle for f32.
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

    /// Returns the vector from the receiver to a point of the rectangle, for two random numbers.
    #[inline]
    pub(super) fn sample(&self, area: &Area, u: [f32; 2]) -> Vec3 {
        // Choose the x coordinate so that the solid angle to its left is the fraction u[0].
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
        // Choose the y coordinate uniformly on the arc at that x.
        let d2 = xu * xu + self.z * self.z;
        // Sines of the lower and upper end of the arc.
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
