// SPDX-License-Identifier: GPL-3.0-or-later
//! Rectangles as seen from a point, sampled evenly over their solid angle.

use std::f32::consts::TAU;

use super::super::trig::{asin, sin_cos_turns};
use super::super::vector::Vec3;
use super::area::Area;

/// Ureña, Fajardo and King 2013, "An Area-Preserving Parametrization for Spherical Rectangles",
/// with arcsines instead of arccosines so that small rectangles keep their digits (as in Cycles).
pub(super) struct SphericalRectangle {
    x: [f32; 2],
    y: [f32; 2],
    z: f32,
    sign: f32,
    b: [f32; 2],
    g: f32,
    pub(super) solid_angle: f32,
}

impl SphericalRectangle {
    /// `None` when the solid angle is too small for f32; sample the area then.
    #[inline]
    pub(super) fn new(area: &Area, from: Vec3) -> Option<Self> {
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
    pub(super) fn sample(&self, area: &Area, u: [f32; 2]) -> Vec3 {
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
