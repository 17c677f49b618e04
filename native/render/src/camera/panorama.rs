// SPDX-License-Identifier: GPL-3.0-or-later
//! Panoramic projections, with the pictures of Cycles. A camera looks along its -Z with +Y up.

use std::f32::consts::{FRAC_PI_2, PI};

use crate::math::vector::{Vec3, vec3};

/// A panoramic projection: the direction of each position in the picture. Angles are in radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Panorama {
    /// Longitudes and latitudes along the sides of the picture.
    Equirectangular {
        /// Lowest and highest longitude, positive to the right.
        longitude: [f32; 2],
        /// Lowest and highest latitude.
        latitude: [f32; 2],
    },
    /// A fisheye lens whose angles are proportional to the distance from the centre.
    Equidistant {
        /// Full field of view, along the side of the picture.
        fov: f32,
    },
    /// A fisheye lens that keeps areas.
    Equisolid {
        /// Full field of view.
        fov: f32,
        /// Focal length, in the unit of the sensor.
        focal: f32,
        /// Width and height of the sensor.
        sensor: [f32; 2],
    },
    /// A fisheye lens whose angle is the negative of a polynomial of the distance from the centre.
    Polynomial {
        /// Full field of view.
        fov: f32,
        /// Coefficients, the constant one first.
        coefficients: [f32; 5],
        /// Width and height of the sensor.
        sensor: [f32; 2],
    },
    /// The reflection in a ball.
    MirrorBall,
    /// A cylinder around the camera, of radius 1.
    CentralCylindrical {
        /// Lowest and highest longitude, positive to the right.
        longitude: [f32; 2],
        /// Lowest and highest height on the cylinder.
        height: [f32; 2],
    },
    /// A face of a cube around the camera, whose angles are proportional to the distances from its centre lines.
    CubeFace,
}

impl Panorama {
    /// Returns the unit direction in camera space at a position in the picture, 0 to 1 along each side from the lower
    /// left corner; `None` where the projection has none.
    pub fn direction(&self, u: f32, v: f32) -> Option<Vec3> {
        match *self {
            Self::Equirectangular {
                longitude: [west, east],
                latitude: [south, north],
            } => {
                let (sin_phi, cos_phi) = (west + (east - west) * u).sin_cos();
                let (sin_theta, cos_theta) = (south + (north - south) * v).sin_cos();
                Some(vec3(cos_theta * sin_phi, sin_theta, -cos_theta * cos_phi))
            }
            Self::Equidistant { fov } => {
                let (x, y) = (2.0 * u - 1.0, 2.0 * v - 1.0);
                let r = x.hypot(y);
                (r <= 1.0).then(|| fisheye(x, y, r, 0.5 * fov * r))
            }
            Self::Equisolid { fov, focal, sensor } => {
                let (x, y) = ((u - 0.5) * sensor[0], (v - 0.5) * sensor[1]);
                let r = x.hypot(y);
                let inside = r <= 2.0 * focal * (0.25 * fov).sin();
                inside.then(|| fisheye(x, y, r, 2.0 * (r / (2.0 * focal)).clamp(-1.0, 1.0).asin()))
            }
            Self::Polynomial {
                fov,
                coefficients: [a, b, c, d, e],
                sensor,
            } => {
                let (x, y) = ((u - 0.5) * sensor[0], (v - 0.5) * sensor[1]);
                let r = x.hypot(y);
                let theta = -(a + r * (b + r * (c + r * (d + r * e))));
                (theta.abs() <= 0.5 * fov).then(|| fisheye(x, y, r, theta))
            }
            Self::MirrorBall => {
                let (x, y) = (2.0 * u - 1.0, 2.0 * v - 1.0);
                let z2 = 1.0 - x * x - y * y;
                // Mirror the view along -Z at the normal of the ball, which faces the viewer.
                (z2 >= 0.0).then(|| {
                    let normal = vec3(x, y, -z2.sqrt());
                    normal * (-2.0 * normal.z) + vec3(0.0, 0.0, 1.0)
                })
            }
            Self::CentralCylindrical {
                longitude: [west, east],
                height: [low, high],
            } => {
                let (sin_phi, cos_phi) = (west + (east - west) * u).sin_cos();
                Some(vec3(sin_phi, low + (high - low) * v, -cos_phi))
            }
            Self::CubeFace => {
                let tangent = |side: f32| ((side - 0.5) * FRAC_PI_2).tan();
                Some(vec3(tangent(u), tangent(v), -1.0))
            }
        }
        .filter(|d| d.is_finite())
        .map(Vec3::normalized)
    }

    /// Returns roughly the angle between neighbouring pixels of a picture that is `width` pixels wide.
    pub fn pixel_angle(&self, width: u32) -> f32 {
        let angle = match *self {
            Self::Equirectangular {
                longitude: [west, east],
                ..
            }
            | Self::CentralCylindrical {
                longitude: [west, east],
                ..
            } => (east - west).abs(),
            Self::Equidistant { fov }
            | Self::Equisolid { fov, .. }
            | Self::Polynomial { fov, .. } => fov,
            Self::MirrorBall => 2.0 * PI,
            Self::CubeFace => FRAC_PI_2,
        };
        angle / width as f32
    }

    /// Whether all its numbers are finite.
    pub fn is_finite(&self) -> bool {
        match *self {
            Self::Equirectangular {
                longitude: [a, b],
                latitude: [c, d],
            }
            | Self::CentralCylindrical {
                longitude: [a, b],
                height: [c, d],
            } => [a, b, c, d].iter().all(|x| x.is_finite()),
            Self::Equidistant { fov } => fov.is_finite(),
            Self::Equisolid {
                fov,
                focal,
                sensor: [a, b],
            } => [fov, focal, a, b].iter().all(|x| x.is_finite()),
            Self::Polynomial {
                fov,
                coefficients,
                sensor,
            } => fov.is_finite() && coefficients.iter().chain(&sensor).all(|x| x.is_finite()),
            Self::MirrorBall | Self::CubeFace => true,
        }
    }
}

/// Returns the direction at an angle `theta` from the view, on the side of (x, y), whose length is `r`.
fn fisheye(x: f32, y: f32, r: f32, theta: f32) -> Vec3 {
    let (sin, cos) = theta.sin_cos();
    if r == 0.0 {
        return vec3(sin, 0.0, -cos);
    }
    vec3(sin * x / r, sin * y / r, -cos)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SENSOR: [f32; 2] = [36.0, 24.0];

    fn all() -> [Panorama; 7] {
        [
            Panorama::Equirectangular {
                longitude: [-PI, PI],
                latitude: [-FRAC_PI_2, FRAC_PI_2],
            },
            Panorama::CentralCylindrical {
                longitude: [-PI, PI],
                height: [-1.0, 1.0],
            },
            Panorama::CubeFace,
            Panorama::Equidistant { fov: PI },
            Panorama::Equisolid {
                fov: PI,
                focal: 10.5,
                sensor: SENSOR,
            },
            Panorama::Polynomial {
                fov: PI,
                coefficients: [0.0, -0.1, 0.0, 0.0, 0.0],
                sensor: SENSOR,
            },
            Panorama::MirrorBall,
        ]
    }

    #[test]
    fn the_centre_looks_ahead_and_the_sides_to_their_sides() {
        for panorama in all() {
            let at = |u, v| panorama.direction(u, v).unwrap();
            assert!(
                (at(0.5, 0.5) - vec3(0.0, 0.0, -1.0)).length() < 1e-6,
                "{panorama:?}"
            );
            for (u, v) in [(0.6, 0.5), (0.4, 0.5), (0.5, 0.6), (0.5, 0.4), (0.55, 0.58)] {
                let d = at(u, v);
                assert!((d.length() - 1.0).abs() < 1e-6);
                assert!(
                    (d.x - (u - 0.5)).abs() < 0.8 && d.x * (u - 0.5) >= -1e-6,
                    "{panorama:?}"
                );
                assert!(d.y * (v - 0.5) >= -1e-6, "{panorama:?} {u} {v}: {d:?}");
            }
        }
    }

    #[test]
    fn beyond_the_circle_there_is_nothing() {
        let [sphere, cylinder, face, round @ ..] = all();
        for whole in [sphere, cylinder, face] {
            assert!(whole.direction(0.0, 0.0).is_some(), "{whole:?}");
        }
        for panorama in round {
            assert!(panorama.direction(0.0, 0.0).is_none(), "{panorama:?}");
        }
    }

    #[test]
    fn numbers_that_are_not_finite_are_found() {
        assert!(all().iter().all(Panorama::is_finite));
        assert!(!Panorama::Equidistant { fov: f32::NAN }.is_finite());
    }
}
