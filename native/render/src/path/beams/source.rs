// SPDX-License-Identifier: GPL-3.0-or-later
//! Origin or direction that the rays of a beam share, and how a plane changes it.

use crate::math::vector::Vec3;
use crate::path::beams::polygons::Plane;
use crate::scene::surface::Surface;
use halfspace_geom::vec3::{add_scaled, dot, length, map, widen};
use halfspace_ray::Ray;

/// Origin or direction that the rays of a beam share.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Source {
    /// Nothing: the ray is in no beam.
    None,
    /// The origin, an eye or its image.
    Point(Vec3),
    /// The direction, of unit length.
    Direction(Vec3),
}

/// Event of a beam at a plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Event {
    /// It is mirrored.
    Mirrored,
    /// It passes a boundary. `eta`: index of refraction of the far side over that of the near side.
    Refracted {
        /// The ratio.
        eta: f32,
    },
}

impl Source {
    /// Returns the source of the rays that go on from a plane, or [`Source::None`] if there is no such beam: the eye
    /// lies in the plane, the reflection is total, or a number leaves the range of f32.
    pub fn after(self, event: Event, plane: &Plane) -> Self {
        let narrow = |v: [f64; 3]| Vec3::from(v.map(|x| x as f32));
        let source = match self {
            Self::None => Self::None,
            Self::Point(eye) => {
                let eye = widen(eye.array());
                let height = plane.height(eye);
                // Measure heights along the normal: the image of a mirror lies as far behind it, that of a boundary
                // as far away as the ratio of the indices makes it, on the same side.
                let moved = match event {
                    Event::Mirrored => -2.0,
                    Event::Refracted { eta } => f64::from(eta) - 1.0,
                };
                if height == 0.0 {
                    return Self::None;
                }
                Self::Point(narrow(add_scaled(eye, moved * height, plane.normal)))
            }
            Self::Direction(d) => {
                let d = widen(d.array());
                let along = dot(d, plane.normal);
                let next = match event {
                    Event::Mirrored => add_scaled(d, -2.0 * along, plane.normal),
                    Event::Refracted { eta } => {
                        // Snell's law: the part along the plane shrinks by eta, the length stays 1.
                        let aside =
                            map(add_scaled(d, -along, plane.normal), |x| x / f64::from(eta));
                        let rest = 1.0 - dot(aside, aside);
                        if rest <= 0.0 {
                            return Self::None;
                        }
                        add_scaled(aside, rest.sqrt() * along.signum(), plane.normal)
                    }
                };
                Self::Direction(narrow(map(next, |x| x / length(next))))
            }
        };
        match source {
            Self::Point(v) | Self::Direction(v) if v.is_finite() => source,
            _ => Self::None,
        }
    }

    /// Returns the ray of the beam that leaves a surface near the direction `towards`, that of the single ray; `None` if
    /// the ray is in no beam, or rounding moves it off its triangle.
    pub fn ray_from(self, surface: &Surface<'_>, towards: Vec3) -> Option<Ray> {
        match self {
            Self::None => None,
            Self::Direction(d) => {
                let leaves = d.dot(surface.geometric) * towards.dot(surface.geometric) > 0.0;
                leaves.then(|| surface.ray(d, f32::INFINITY))
            }
            Self::Point(eye) => surface.ray_through(eye, towards),
        }
    }

    /// A number that is equal for equal sources, bit for bit, and orders them.
    pub fn key(self) -> u128 {
        let (kind, v) = match self {
            Self::None => return 0,
            Self::Point(v) => (1, v),
            Self::Direction(v) => (2, v),
        };
        v.array()
            .into_iter()
            .fold(kind, |key, x| key << 32 | u128::from(x.to_bits()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vector::{angle, vec3};
    use std::f32::consts::FRAC_PI_2;

    /// The plane z = 1.
    fn plane() -> Plane {
        Plane {
            normal: [0.0, 0.0, 1.0],
            offset: 1.0,
        }
    }

    #[test]
    fn a_mirror_has_the_eye_behind_it() {
        let eye = Source::Point(vec3(3.0, 4.0, 6.0));
        let image = eye.after(Event::Mirrored, &plane());
        assert_eq!(image, Source::Point(vec3(3.0, 4.0, -4.0)));
        assert_eq!(image.after(Event::Mirrored, &plane()), eye);
    }

    #[test]
    fn a_boundary_scales_the_height_of_the_eye() {
        let eye = Source::Point(vec3(3.0, 4.0, 6.0));
        let image = eye.after(Event::Refracted { eta: 1.5 }, &plane());
        assert_eq!(image, Source::Point(vec3(3.0, 4.0, 8.5)));
        // A slab shifts the eye only.
        let below = Plane {
            normal: [0.0, 0.0, -1.0],
            offset: 1.0,
        };
        let out = image.after(Event::Refracted { eta: 1.0 / 1.5 }, &below);
        let Source::Point(out) = out else {
            panic!("{out:?}")
        };
        assert!((out - vec3(3.0, 4.0, 6.0 - (2.0 - 2.0 / 1.5))).max_abs() < 1e-5);
    }

    #[test]
    fn parallel_beams_follow_snell() {
        let d = vec3(0.6, 0.0, -0.8);
        let sun = Source::Direction(d);
        let mirrored = sun.after(Event::Mirrored, &plane());
        assert_eq!(mirrored, Source::Direction(vec3(0.6, 0.0, 0.8)));
        let Source::Direction(inside) = sun.after(Event::Refracted { eta: 1.5 }, &plane()) else {
            panic!("refracted")
        };
        assert!((inside - vec3(0.4, 0.0, -0.84_f32.sqrt())).max_abs() < 1e-6);
        let total = sun.after(Event::Refracted { eta: 0.5 }, &plane());
        assert_eq!(total, Source::None, "total reflection");
    }

    #[test]
    fn degenerate_beams_end() {
        let inside = Source::Point(vec3(5.0, 5.0, 1.0));
        assert_eq!(inside.after(Event::Mirrored, &plane()), Source::None);
        let far = Source::Point(vec3(0.0, 0.0, -3e38));
        let beyond = far.after(Event::Refracted { eta: 3.0 }, &plane());
        assert_eq!(beyond, Source::None, "not a number of f32");
        assert_eq!(Source::None.after(Event::Mirrored, &plane()), Source::None);
    }

    #[test]
    fn keys_distinguish_sources() {
        let v = vec3(1.0, 2.0, 3.0);
        let keys = [
            Source::None,
            Source::Point(v),
            Source::Direction(v),
            Source::Point(-v),
        ];
        for (i, a) in keys.iter().enumerate() {
            for (j, b) in keys.iter().enumerate() {
                assert_eq!(a.key() == b.key(), i == j);
            }
        }
        assert!((angle(vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0)) - FRAC_PI_2).abs() < 1e-5);
        assert_eq!(angle(v, v), 0.0);
    }
}
