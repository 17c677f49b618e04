// SPDX-License-Identifier: GPL-3.0-or-later
//! The choice of a light for a segment of a ray within a medium, and of a point of the segment near that light.
//!
//! The light that arrives at a point of the segment falls with the square of the distance, so points are chosen by the
//! angle under which the light sees them: equi-angular sampling, Kulla and Fajardo 2012, "Importance Sampling
//! Techniques for Path Tracing in Participating Media". The light is chosen by the integral of its irradiance. Only the
//! part of the segment counts that the light reaches: the cone of a spot light, the front of an area light.

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
    /// Where the part of the segment that the light reaches begins and ends.
    pub span: [f32; 2],
    /// The angles under which the light sees the segment; `None` for a light infinitely far away.
    pub angles: Option<Angles>,
}

/// The angles between the perpendicular from a light to a line and the points of a part of that line.
#[derive(Debug, Clone, Copy)]
pub struct Angles {
    /// Distance along the segment of the foot of the perpendicular.
    foot: f32,
    /// Length of the perpendicular, at least the radius of the light.
    height: f32,
    /// The angles of the start and of the end.
    ends: [f32; 2],
    /// Distances along the segment of the start and of the end.
    span: [f32; 2],
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
    /// Returns where the part of the segment that the lights of a sphere reach begins and ends; `None` if they reach
    /// none of it. `flat`: whether they lie in the plane across the axis of their emission.
    fn lit(&self, sphere: &BoundingSphere, flat: bool) -> Option<[f32; 2]> {
        let from = self.origin - sphere.centre;
        let part = (sphere.emission).lit_part(from, self.direction, sphere.radius, flat)?;
        let span = [part[0].max(0.0), part[1].min(self.length)];
        (span[0] < span[1]).then_some(span)
    }

    /// Returns the angles under which the centre of a light of this radius sees a part of the segment.
    pub fn angles(&self, centre: Vec3, radius: f32, span: [f32; 2]) -> Angles {
        let to_centre = centre - self.origin;
        let foot = to_centre.dot(self.direction);
        let away = (to_centre - self.direction * foot).length();
        // A light on the line, without a size, still sees the segment's parts under different angles.
        let least = (1e-5 * to_centre.length()).max(1e-12);
        let height = away.max(radius).max(least);
        Angles {
            foot,
            height,
            ends: span.map(|at| atan((at - foot) / height)),
            span,
        }
    }

    /// Estimates the integral of the irradiance from a sphere over the segment: in vacuum within six percent, in a
    /// medium by the transmittance to the nearest point. Lights are chosen by it, so that its error is noise alone; 0
    /// only where they reach nothing.
    fn importance(&self, sphere: &BoundingSphere) -> f32 {
        self.lit(sphere, false)
            .map_or(0.0, |span| self.importance_of(sphere, span))
    }

    /// Like [`Self::importance`], of a part of the segment.
    fn importance_of(&self, sphere: &BoundingSphere, [start, end]: [f32; 2]) -> f32 {
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
        let end = end.min(start + 1e3 * ((foot - start).abs() + height));
        let (before, after) = (start - foot, end - foot);
        let angle = about_angle((end - start) * height, height * height + before * after);
        // Attenuate the light up to the point nearest the sphere.
        let depth = self.extinction * (foot - sphere.radius).clamp(start, end);
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
        (self.foot + self.height * tangent).clamp(self.span[0], self.span[1])
    }

    /// Returns the density with which [`Self::sample`] finds this distance.
    pub fn density(&self, distance: f32) -> f32 {
        let along = (distance - self.foot) / self.height;
        1.0 / (self.opening() * self.height * (1.0 + along * along))
    }
}

impl Lights {
    /// Chooses a light for a segment by a random number in [0, 1). Every light that could arrive at some point of the
    /// segment may be chosen. Returns `None` if there is none.
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
        let light = &self.lights[index];
        let Some(sphere) = light.bounding_sphere(0) else {
            return Some(Chosen {
                index,
                probability,
                span: [0.0, segment.length],
                angles: None,
            });
        };
        let span = segment.lit(&sphere, light.is_flat())?;
        Some(Chosen {
            index,
            probability,
            span,
            angles: Some(segment.angles(sphere.centre, sphere.radius, span)),
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
            let angles = segment.angles(centre, radius, [0.0, length]);
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
            let exact = segment.angles(centre, radius, [0.0, length]);
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

    /// Light that arrives at a point of a segment by one sample of the only light.
    fn arriving(lights: &Lights, segment: &Segment, t: f32, u: [f32; 2]) -> f32 {
        let receiver = Receiver {
            point: segment.origin + segment.direction * t,
            normal: Vec3::ZERO,
            sets: u32::MAX,
            each: false,
            bounce: 0,
        };
        let arrival = lights.sample(receiver, 0.5, u);
        arrival.map_or(0.0, |arrival| arrival.radiance.x)
    }

    #[test]
    fn the_part_that_a_light_reaches_is_sampled_and_holds_all_of_its_light() {
        let spot = |size: f32, radius: f32| LightKind::Spot {
            radius,
            size,
            blend: 0.15,
        };
        let square = LightKind::Area {
            shape: crate::light::AreaShape::Square,
            size: 0.4,
            size_y: 0.4,
            spread: 1.0,
        };
        // Light falls from (0, 0, 1): across the segment, which begins outside of a cone or in it, or past its tip.
        let kinds = [
            spot(0.3, 0.0),
            spot(1.2, 0.0),
            spot(0.6, 0.05),
            spot(PI, 0.0),
            square,
        ];
        let ways = [
            (vec3(-3.0, 0.1, -1.0), vec3(1.0, 0.0, 0.0), 7.0),
            (vec3(0.05, 0.0, -1.0), vec3(0.6, 0.0, -0.8), f32::INFINITY),
            (vec3(-0.02, 0.0, -4.0), vec3(0.0, 0.0, 1.0), 9.0),
            (vec3(-2.0, 0.0, 3.0), vec3(0.6, 0.0, -0.8), 9.0),
        ];
        let (seen, varying) = (Visibility::ALL, Varying::default());
        for kind in kinds {
            let lamp = [light(kind, at(0.0, 0.0, 1.0), 1.0)];
            let lights = Lights::new(&lamp, &[], None, seen, &[], &varying).unwrap();
            for (origin, direction, length) in ways {
                let segment = Segment {
                    origin,
                    direction,
                    length,
                    extinction: 0.2,
                };
                let arriving = |t: f32, u: [f32; 2]| arriving(&lights, &segment, t, u);
                // The integral over the whole segment, with light samples spread evenly.
                let steps = 40_000_u32;
                let spread = |i: u32| [i, i * 7919].map(|i| (i % 211) as f32 / 211.0 + 2e-3);
                let each = (0..steps).map(|i| {
                    let share = (i as f32 + 0.5) / steps as f32;
                    let (t, stretch) = if length.is_finite() {
                        (length * share, length)
                    } else {
                        (share / (1.0 - share), (1.0 - share).powi(-2))
                    };
                    f64::from(arriving(t, spread(i)) * stretch) / f64::from(steps)
                });
                let integral: f64 = each.sum();
                let Some(chosen) = lights.choose_along(&segment, 0.5) else {
                    assert!(integral < 1e-9, "{kind:?} {origin:?}: {integral}");
                    continue;
                };
                let angles = chosen.angles.unwrap();
                let (mut mean, mut arrived) = (0.0, 0);
                for i in 0..steps {
                    let t = angles.sample((i as f32 + 0.5) / steps as f32);
                    let value = arriving(t, spread(i));
                    arrived += u32::from(value > 0.0);
                    mean += f64::from(value / angles.density(t)) / f64::from(steps);
                }
                let error = (mean / integral - 1.0).abs();
                assert!(error < 0.01, "{kind:?} {origin:?}: {mean} {integral}");
                // Nearly every sample is lit; of a light with a size, the bound is loose near the light.
                let least = if matches!(kind, LightKind::Spot { radius: 0.0, .. }) {
                    0.95
                } else {
                    0.1
                };
                let share = f64::from(arrived) / f64::from(steps);
                assert!(share > least, "{kind:?} {origin:?}: {share}");
            }
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
