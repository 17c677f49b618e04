// SPDX-License-Identifier: GPL-3.0-or-later
//! The aperture of a camera with depth of field.

use crate::check::{Error, Result, within};
use crate::math::trig::sin_cos_turns;

/// Parameters of an aperture, as in Blender and Cycles; lengths in scene units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LensParams {
    /// Radius; 0 = a pinhole.
    pub radius: f64,
    /// Number of diaphragm blades; fewer than 3 make a disk.
    pub blades: u32,
    /// Rotation of the blades, radians.
    pub rotation: f64,
    /// Height of the aperture divided by its width; 2 = anamorphic.
    pub ratio: f64,
    /// Depth of the plane in focus.
    pub focus: f64,
}

impl Default for LensParams {
    fn default() -> Self {
        Self {
            radius: 0.0,
            blades: 0,
            rotation: 0.0,
            ratio: 1.0,
            focus: 1.0,
        }
    }
}

/// An aperture prepared for sampling.
#[derive(Debug, Clone)]
pub struct Lens {
    /// Half width and half height.
    size: [f32; 2],
    /// Corners of a regular polygon of radius 1, the first one repeated at the end; empty for a disk.
    corners: Vec<[f32; 2]>,
    /// Depth of the plane in focus.
    pub focus: f32,
}

impl Lens {
    /// The aperture, or `None` for a pinhole.
    ///
    /// # Errors
    /// [`Error::NonFinite`] or [`Error::Spec`] if a number is not finite or out of range.
    pub fn new(params: &LensParams) -> Result<Option<Self>> {
        // Check the numbers; the message names the key.
        let check = |value: f64, low: f64, high: f64, key: &str| {
            within(value, low, high, || format!("camera['{key}']"))
        };
        check(params.radius, 0.0, 1e30, "aperture_radius")?;
        check(params.rotation, -1e6, 1e6, "aperture_rotation")?;
        check(params.ratio, 1e-6, 1e6, "aperture_ratio")?;
        check(params.focus, 0.0, 1e30, "focus_distance")?;
        if params.blades > MAX_BLADES {
            return Err(Error::Spec(format!(
                "camera['aperture_blades'] must lie in 0..{MAX_BLADES}, got {}",
                params.blades
            )));
        }
        if params.radius == 0.0 {
            return Ok(None);
        }
        // Fewer than three blades make no polygon.
        let blades = if params.blades < 3 { 0 } else { params.blades };
        let corner = |k: u32| {
            // The first side is perpendicular to the rotated x axis.
            let turns = params.rotation / std::f64::consts::TAU
                + (f64::from(k) - 0.5) / f64::from(blades.max(1));
            let (sin, cos) = sin_cos_turns((turns - turns.floor()) as f32);
            [cos, sin]
        };
        let corners = match blades {
            0 => Vec::new(),
            n => (0..=n).map(corner).collect(),
        };
        Ok(Some(Self {
            size: [(params.radius / params.ratio) as f32, params.radius as f32],
            corners,
            // Keep the focus off the lens itself, where the directions would be undefined.
            focus: (params.focus as f32).max(1e-5),
        }))
    }

    /// Maps two random numbers to a point of the aperture, uniform by area: offsets to the right and up.
    #[inline]
    pub fn sample(&self, [u, v]: [f32; 2]) -> [f32; 2] {
        let [x, y] = if self.corners.is_empty() {
            disk(u, v)
        } else {
            // Choose a triangle of the fan around the centre, then a point in it.
            let sides = self.corners.len() - 1;
            let at = u * sides as f32;
            let side = (at as usize).min(sides - 1);
            let root = (at - side as f32).sqrt();
            let (a, b) = (root * (1.0 - v), root * v);
            let (p, q) = (self.corners[side], self.corners[side + 1]);
            [a * p[0] + b * q[0], a * p[1] + b * q[1]]
        };
        [x * self.size[0], y * self.size[1]]
    }
}

/// Largest number of blades; a polygon of more is practically a disk.
const MAX_BLADES: u32 = 1024;

/// Maps the unit square to the unit disk, uniform by area (Shirley and Chiu 1997): concentric squares become
/// concentric circles.
fn disk(u: f32, v: f32) -> [f32; 2] {
    let (a, b) = (2.0 * u - 1.0, 2.0 * v - 1.0);
    // The larger coordinate is the radius, the ratio of the two gives the angle within an eighth of a turn.
    let (radius, eighths) = if a.abs() > b.abs() {
        (a, b / a)
    } else if b != 0.0 {
        (b, 2.0 - a / b)
    } else {
        return [0.0; 2];
    };
    let turns = eighths / 8.0;
    let (sin, cos) = sin_cos_turns(turns - turns.floor());
    [radius * cos, radius * sin]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(params: LensParams) -> Vec<[f32; 2]> {
        let lens = Lens::new(&params).unwrap().unwrap();
        let n = 64;
        (0..n * n)
            .map(|i| {
                let [u, v] = [i % n, i / n].map(|k| (k as f32 + 0.5) / n as f32);
                lens.sample([u, v])
            })
            .collect()
    }

    #[test]
    fn a_disk_is_sampled_uniformly() {
        let all = points(LensParams {
            radius: 2.0,
            ..Default::default()
        });
        let inside = |r: f32| all.iter().filter(|p| p[0].hypot(p[1]) <= r).count() as f32;
        assert_eq!(inside(2.0) as usize, all.len());
        assert!((inside(1.0) / all.len() as f32 - 0.25).abs() < 0.01);
        let right = all.iter().filter(|p| p[0] > 0.0).count() as f32;
        assert!((right / all.len() as f32 - 0.5).abs() < 0.01);
    }

    #[test]
    fn three_blades_make_a_rotated_triangle() {
        let params = LensParams {
            radius: 1.0,
            blades: 3,
            ..Default::default()
        };
        let all = points(params);
        let max = |k: usize, sign: f32| all.iter().map(|p| p[k] * sign).fold(-9.0, f32::max);
        // The first side is perpendicular to the x axis at cos 60°; the third corner lies opposite.
        assert!((max(0, 1.0) - 0.5).abs() < 0.02 && (max(0, -1.0) - 1.0).abs() < 0.05);
        let turned = points(LensParams {
            rotation: std::f64::consts::PI,
            ..params
        });
        let max = turned.iter().map(|p| p[0]).fold(-9.0, f32::max);
        assert!((max - 1.0).abs() < 0.05);
    }

    #[test]
    fn an_anamorphic_lens_is_narrow() {
        let all = points(LensParams {
            radius: 1.0,
            ratio: 2.0,
            ..Default::default()
        });
        let max = |k: usize| all.iter().map(|p| p[k]).fold(-9.0, f32::max);
        assert!((max(0) - 0.5).abs() < 0.02 && (max(1) - 1.0).abs() < 0.02);
    }

    #[test]
    fn invalid_parameters_are_named_and_a_pinhole_has_no_lens() {
        assert!(Lens::new(&LensParams::default()).unwrap().is_none());
        for (params, key) in [
            (
                LensParams {
                    radius: f64::NAN,
                    ..Default::default()
                },
                "aperture_radius",
            ),
            (
                LensParams {
                    ratio: 0.0,
                    ..Default::default()
                },
                "aperture_ratio",
            ),
            (
                LensParams {
                    blades: 9999,
                    ..Default::default()
                },
                "aperture_blades",
            ),
            (
                LensParams {
                    focus: -1.0,
                    ..Default::default()
                },
                "focus_distance",
            ),
        ] {
            let text = Lens::new(&params).unwrap_err().to_string();
            assert!(text.contains(key), "{text}");
        }
    }
}
