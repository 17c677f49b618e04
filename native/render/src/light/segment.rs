// SPDX-License-Identifier: GPL-3.0-or-later
//! The choice of a light for a segment of a ray within a medium, and of a point of the segment near that light.
//!
//! The light that arrives at a point of the segment falls with the square of the distance, so points are chosen by the
//! angle under which the light sees them: equi-angular sampling, Kulla and Fajardo 2012, "Importance Sampling
//! Techniques for Path Tracing in Participating Media". The light is chosen by the integral of its irradiance.

use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

use crate::light::many::Many;
use crate::light::several::pick;
use crate::light::tree::BoundingSphere;
use crate::light::{Arrival, Lights, MAX_COMPARED, Receiver};
use crate::math::trig::{asin, sin_cos_turns};
use crate::math::vector::Vec3;

/// Smallest factor of the attenuation on the way to the point nearest a light, so that no light is left out (chosen).
const DIMMEST: f32 = 0.01;

/// A segment of a ray.
#[derive(Debug, Clone, Copy)]
pub struct Segment {
    /// The start.
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
    /// Length, which may be infinite.
    pub length: f32,
    /// Mean extinction coefficient.
    pub extinction: f32,
}

/// A light chosen for a segment.
#[derive(Debug, Clone, Copy)]
pub struct Chosen {
    index: usize,
    probability: f32,
    /// The angles under which the light sees the segment; `None` for a light infinitely far away.
    pub angles: Option<Angles>,
}

/// The angles between the perpendicular from a light to a line and the points of a segment of that line.
#[derive(Debug, Clone, Copy)]
pub struct Angles {
    /// Distance along the segment of the foot of the perpendicular.
    foot: f32,
    /// Length of the perpendicular, at least the radius of the light.
    height: f32,
    /// The angles of the start and of the end.
    ends: [f32; 2],
    /// Length of the segment.
    length: f32,
}

/// Returns the arctangent in radians.
fn atan(x: f32) -> f32 {
    if x.is_infinite() {
        return FRAC_PI_2.copysign(x);
    }
    asin(x / (1.0 + x * x).sqrt())
}

/// Returns the angle of the vector `(x, y)` to the first axis, for `y` of at least 0, within 0.004 radians: a parabola
/// for the arctangent of up to 1 (Rajan et al. 2006, "Efficient approximations for the arctangent function").
fn about_angle(y: f32, x: f32) -> f32 {
    let arctangent = |r: f32| r * (FRAC_PI_4 + 0.273 * (1.0 - r.abs()));
    if x.abs() < y {
        FRAC_PI_2 - arctangent(x / y)
    } else if x < 0.0 {
        PI + arctangent(y / x)
    } else if x > 0.0 {
        arctangent(y / x)
    } else {
        0.0
    }
}

impl Segment {
    /// Returns the angles under which the centre of a light of this radius sees the segment.
    pub fn angles(&self, centre: Vec3, radius: f32) -> Angles {
        let to_centre = centre - self.origin;
        let foot = to_centre.dot(self.direction);
        let away = (to_centre - self.direction * foot).length();
        // A light on the line, without a size, still sees the segment's parts under different angles.
        let least = (1e-5 * to_centre.length()).max(1e-12);
        let height = away.max(radius).max(least);
        Angles {
            foot,
            height,
            ends: [-foot, self.length - foot].map(|along| atan(along / height)),
            length: self.length,
        }
    }

    /// Estimates the integral of the irradiance from a sphere over the segment: in vacuum within six percent, in a
    /// medium by the transmittance to the nearest point. Lights are chosen by it, so that its error is noise alone.
    fn importance(&self, sphere: &BoundingSphere) -> f32 {
        let to_centre = sphere.centre - self.origin;
        let foot = to_centre.dot(self.direction);
        let away2 = to_centre.length2() - foot * foot;
        let radius2 = sphere.radius * sphere.radius;
        let height = away2
            .max(radius2)
            .max(1e-10 * to_centre.length2())
            .max(1e-24)
            .sqrt();
        // The angle between the directions from the centre to both ends, of which an infinite one is far away.
        let length = self.length.min(1e3 * (foot.abs() + height));
        let angle = about_angle(length * height, height * height - foot * (length - foot));
        // What is left of the light at the point nearest the sphere.
        let depth = self.extinction * (foot - sphere.radius).clamp(0.0, length);
        let through = (1.0 / (1.0 + depth * (1.0 + 0.5 * depth))).max(DIMMEST);
        sphere.brightness * through * (angle.max(1e-7) / height)
    }

    /// Returns the integral of the transmittance: the length of a segment in vacuum that receives as much from afar.
    fn effective_length(&self) -> f32 {
        let depth = self.extinction * self.length;
        if depth > 1e-3 {
            (1.0 - (-depth).exp()) / self.extinction
        } else {
            self.length
        }
    }
}

impl Angles {
    /// The angle between both ends; positive, so that no segment is without a density.
    fn opening(&self) -> f32 {
        (self.ends[1] - self.ends[0]).max(1e-7)
    }

    /// Returns a distance from the start. `u`: a random number in [0, 1).
    pub fn sample(&self, u: f32) -> f32 {
        let angle = self.ends[0] + u * (self.ends[1] - self.ends[0]);
        let (sine, cosine) = sin_cos_turns(angle.abs() / TAU);
        let tangent = (sine / cosine.max(1e-7)).copysign(angle);
        (self.foot + self.height * tangent).clamp(0.0, self.length)
    }

    /// Returns the density with which [`Self::sample`] finds this distance.
    pub fn density(&self, distance: f32) -> f32 {
        let along = (distance - self.foot) / self.height;
        1.0 / (self.opening() * self.height * (1.0 + along * along))
    }
}

impl Lights {
    /// Chooses a light for a segment by a random number in [0, 1). Every light that could arrive at some point of the
    /// segment may be chosen, since the sides to which lights shine are not considered. Returns `None` without lights.
    pub fn choose_along(&self, segment: &Segment, choice: f32) -> Option<Chosen> {
        let n = self.lights.len();
        let (index, probability) = if n == 1 {
            (0, 1.0)
        } else if let Some(many) = &self.many {
            many.choose_along(segment, choice)?
        } else {
            // Compare the lights one by one.
            let mut each = [0.0; MAX_COMPARED];
            for (weight, light) in each.iter_mut().zip(&self.lights) {
                *weight = match light.bounding_sphere(0) {
                    Some(sphere) => segment.importance(&sphere),
                    None => light.brightness * segment.effective_length(),
                };
            }
            let total: f32 = each.iter().sum();
            if !(total > 0.0 && total.is_finite()) {
                return None;
            }
            let index = pick(&each[..n], choice * total)?;
            (index, each[index] / total)
        };
        let sphere = self.lights[index].bounding_sphere(0);
        let angles = sphere.map(|sphere| segment.angles(sphere.centre, sphere.radius));
        Some(Chosen {
            index,
            probability,
            angles,
        })
    }

    /// Samples a point on a light that was chosen for a segment. The radiance is divided by the probability of that
    /// choice; the density competes with scattered rays, and so contains the probability of the light at the receiver.
    /// `u`: two random numbers in [0, 1). Returns `None` if no light arrives.
    pub fn sample_chosen(
        &self,
        receiver: Receiver,
        chosen: Chosen,
        u: [f32; 2],
    ) -> Option<Arrival> {
        let arrival = self.arrive(receiver, chosen.index, chosen.probability, u)?;
        let there = self.probability(receiver, chosen.index) / chosen.probability;
        Some(Arrival {
            pdf: if arrival.pdf.is_finite() {
                arrival.pdf * there
            } else {
                arrival.pdf
            },
            ..arrival
        })
    }
}

impl Many {
    /// Chooses a light for a segment by a random number in [0, 1). Returns its index and its probability.
    fn choose_along(&self, segment: &Segment, choice: f32) -> Option<(usize, f32)> {
        let near = self.tree.estimate(|sphere| segment.importance(sphere));
        let share =
            self.share_of_far_from(near, self.far_brightness * segment.effective_length())?;
        self.choose_side(share, choice, |left| {
            self.tree
                .choose_by(|sphere| segment.importance(sphere), left)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::emission::Emission;
    use crate::light::{LightKind, LightParams};
    use crate::math::vector::vec3;
    use crate::tests::setup::{at, light};
    use crate::values::varying::Varying;
    use crate::values::visibility::Visibility;

    const SEGMENT: Segment = Segment {
        origin: Vec3 {
            x: -2.0,
            y: 0.1,
            z: 0.0,
        },
        direction: Vec3 {
            x: 1.0,
            y: 0.0,
            z: 0.0,
        },
        length: 7.0,
        extinction: 0.2,
    };

    #[test]
    fn distances_have_their_density() {
        for (centre, radius, length) in [
            (vec3(1.0, 0.1, 0.0), 0.0, 7.0),
            (vec3(1.0, 0.3, -0.4), 0.2, 7.0),
            (vec3(-9.0, 1.0, 0.0), 0.1, 3.0),
            (vec3(30.0, 1.0, 0.0), 4.0, 3.0),
        ] {
            let segment = Segment { length, ..SEGMENT };
            let angles = segment.angles(centre, radius);
            // The share of distances below `t` is the integral of the density.
            let (n, mut below) = (4000, 0.0);
            for i in 0..n {
                let [a, b] = [i, i + 1].map(|k| angles.sample(k as f32 / n as f32));
                let middle = angles.sample((i as f32 + 0.5) / n as f32);
                below += f64::from(b - a) * f64::from(angles.density(middle));
                // Steps that rounding does not blur, over which the density hardly changes.
                if (1e-4..1e-3).contains(&((b - a) / length)) {
                    let share = f64::from(b - a) * f64::from(angles.density(middle)) * f64::from(n);
                    assert!((share - 1.0).abs() < 0.1, "{centre:?} {i}: {share}");
                }
            }
            assert!((below - 1.0).abs() < 0.02, "{centre:?}: {below}");
        }
    }

    #[test]
    fn importance_is_near_the_integral_of_the_irradiance() {
        for (centre, radius, length) in [
            (vec3(1.0, 0.5, 0.0), 0.0, 7.0),
            (vec3(-9.0, 1.0, 0.0), 0.1, 3.0),
            (vec3(3.0, 1.0, 2.0), 0.1, f32::INFINITY),
            (vec3(30.0, 1.0, 0.0), 4.0, 3.0),
        ] {
            let sphere = BoundingSphere {
                emission: Emission::ALL,
                centre,
                radius,
                brightness: 2.0,
                light: 0,
            };
            let segment = Segment {
                length,
                extinction: 0.0,
                ..SEGMENT
            };
            let exact = segment.angles(centre, radius);
            let integral = 2.0 * exact.opening() / exact.height;
            let error = segment.importance(&sphere) / integral - 1.0;
            assert!(error.abs() < 0.06, "{centre:?}: {error}");
            // On the way through a medium it is less, but never 0.
            let dim = Segment {
                extinction: 50.0,
                ..segment
            };
            assert!((0.0..=1.06 * integral).contains(&dim.importance(&sphere)));
            assert!(dim.importance(&sphere) > 0.0);
        }
    }

    #[test]
    fn lights_are_chosen_by_probabilities_that_add_up() {
        let point = LightKind::Point { radius: 0.1 };
        let lamps = |count: usize| -> Vec<LightParams> {
            let lamp = |i: usize| light(point, at(0.3 * i as f64, 1.0, 0.0), 1.0 + i as f32);
            let sun = light(LightKind::Sun { angle: 0.0 }, at(0.0, 0.0, 1.0), 0.1);
            (0..count).map(lamp).chain([sun]).collect()
        };
        // One by one, and by the tree.
        for count in [3, 60] {
            let (seen, varying) = (Visibility::ALL, Varying::default());
            let lights = Lights::new(&lamps(count), &[], None, seen, &[], &varying).unwrap();
            let n = 20_000;
            let (mut found, mut stated) = (vec![0.0; count + 1], vec![0.0; count + 1]);
            for i in 0..n {
                let chosen = lights.choose_along(&SEGMENT, (i as f32 + 0.5) / n as f32);
                let chosen = chosen.unwrap();
                found[chosen.index] += 1.0 / n as f32;
                stated[chosen.index] = chosen.probability;
                assert_eq!(chosen.angles.is_some(), chosen.index < count);
            }
            for (index, (found, stated)) in found.into_iter().zip(stated).enumerate() {
                assert!(found > 0.0, "{index} is never chosen");
                assert!((found - stated).abs() < 2e-3, "{index}: {found} {stated}");
            }
        }
    }
}
