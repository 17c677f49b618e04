// SPDX-License-Identifier: GPL-3.0-or-later
//! Samples of several lights at one point, where a scene has few.
//!
//! A light that is chosen alone brings noise wherever another one is occluded: a sun outside a room takes most of the
//! samples of the lamp within. So each lamp, the background, and all emissive triangles together, are sampled with a
//! probability of their own, which is 1 for those that could bring a quarter of the light or more. Shadow rays are much
//! cheaper than the paths that need them.

use std::ops::Range;

use crate::light::{Arrival, Lights, MAX_COMPARED, Receiver};

/// Largest number of lamps, background and emissive triangles together (chosen: each one costs time at every point).
const MAX_SEVERAL: usize = 8;

/// Number of samples that the probabilities would add up to if none were above 1. Measured on the Country kitchen with a
/// sun and a lamp, relative to one light at a time: variance 0.51 with 2, 0.35 with 4, times 1.08 and 1.10.
const SAMPLES: f32 = 4.0;

/// Estimates of the irradiance that the lights bring to a point.
pub(super) struct Weights {
    pub(super) each: [f32; MAX_COMPARED],
    pub(super) total: f32,
}

/// Returns the index of the weight within which `left` lies, if they follow each other from 0; `None` if all are 0.
pub(super) fn pick(weights: &[f32], mut left: f32) -> Option<usize> {
    // Subtract weights until the remainder lies within one; rounding at the end keeps the last light.
    let mut chosen = None;
    for (index, &weight) in weights.iter().enumerate() {
        if weight > 0.0 {
            chosen = Some(index);
            if left < weight {
                break;
            }
            left -= weight;
        }
    }
    chosen
}

impl Lights {
    /// Returns the weights of all lights, which are at most [`MAX_COMPARED`]; `None` if none can contribute, or their sum
    /// overflows.
    pub(super) fn weights(&self, receiver: Receiver) -> Option<Weights> {
        let (mut each, mut total) = ([0.0; MAX_COMPARED], 0.0);
        for (weight, light) in each.iter_mut().zip(&self.lights) {
            *weight = light.importance(receiver);
            total += *weight;
        }
        (total > 0.0 && total.is_finite()).then_some(Weights { each, total })
    }

    /// The lights that are sampled independently of each other: lamps, all triangles, the background.
    fn strata(&self) -> impl Iterator<Item = Range<usize>> {
        let end = self.lights.len();
        let world = end - usize::from(self.map.is_some());
        let lamps = (0..self.lamps).map(|lamp| lamp..lamp + 1);
        let rest = [self.lamps..world, world..end];
        lamps.chain(rest.into_iter().filter(|lights| !lights.is_empty()))
    }

    /// Whether the lights are few but more than one, so that [`Self::sample_several`] is worth its time.
    pub(super) fn are_several(&self) -> bool {
        self.lights.len() <= MAX_COMPARED && (2..=MAX_SEVERAL).contains(&self.strata().count())
    }

    /// Samples several lights, and a point on each. `choice`: random number in [0, 1), which decides for all lights,
    /// whose samples are added up; `point`: returns two more for the light with this number; `take`: called with each
    /// sample that arrives.
    #[inline]
    pub fn sample_several(
        &self,
        receiver: Receiver,
        choice: f32,
        point: impl Fn(u32) -> [f32; 2],
        mut take: impl FnMut(Arrival),
    ) {
        let Some(Weights { each, total }) = self.weights(receiver) else {
            return;
        };
        for (number, lights) in (0..).zip(self.strata()) {
            let weights = &each[lights.clone()];
            let sum: f32 = weights.iter().sum();
            let probability = (sum * (SAMPLES / total)).min(1.0);
            // Decide by the number whether there is a sample, and choose with what is left of it a light.
            if choice >= probability {
                continue;
            }
            let arrival = pick(weights, choice / probability * sum).and_then(|index| {
                let share = weights[index] / sum;
                self.arrive(
                    receiver,
                    lights.start + index,
                    share * probability,
                    point(number),
                )
            });
            arrival.into_iter().for_each(&mut take);
        }
    }

    /// Returns the probability with which [`Self::sample_several`] samples a light.
    pub(super) fn several_probability(&self, receiver: Receiver, index: usize) -> f32 {
        let Some(Weights { each, total }) = self.weights(receiver) else {
            return 0.0;
        };
        let Some(lights) = self.strata().find(|lights| lights.contains(&index)) else {
            return 0.0;
        };
        let sum: f32 = each[lights].iter().sum();
        if sum > 0.0 {
            each[index] / sum * (sum * (SAMPLES / total)).min(1.0)
        } else {
            0.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::{EmissiveTriangle, Emitter, LightKind, LightParams};
    use crate::math::sampler::PixelSampler;
    use crate::math::vector::{Vec3, vec3};
    use crate::tests::setup::{at, light};
    use crate::values::linking::LightSets;
    use crate::values::varying::Varying;
    use crate::values::visibility::Visibility;

    fn lights(lamps: &[LightParams], triangles: &[EmissiveTriangle]) -> Lights {
        let (seen, varying) = (Visibility::ALL, Varying::default());
        Lights::new(lamps, triangles, None, seen, &[], &varying).unwrap()
    }

    fn corners(x: f32) -> [Vec3; 3] {
        let corner = |x, y| vec3(x, y, 1.0);
        [corner(x, 0.0), corner(x + 1.0, 0.0), corner(x, 1.0)]
    }

    #[test]
    fn lights_are_sampled_as_often_as_their_probabilities_state() {
        let lamps = [
            light(LightKind::Sun { angle: 0.0 }, at(0.0, 0.0, 1.0), 2.0),
            light(LightKind::Point { radius: 0.0 }, at(0.0, 1.0, 1.0), 40.0),
        ];
        let emissive = |triangle, x| EmissiveTriangle {
            triangle,
            visible: Visibility::ALL,
            sets: LightSets::default(),
            corners: corners(x),
            radiance: 1.0,
        };
        let lights = lights(&lamps, &[emissive(0, 0.5), emissive(1, -2.0)]);
        assert!(lights.several());
        let receiver = Receiver {
            point: vec3(0.2, 0.1, -2.0),
            normal: vec3(0.0, 0.0, 1.0),
            sets: u32::MAX,
            each: true,
            bounce: 0,
        };
        let (sampler, n) = (PixelSampler::new(5, 2, 1), 1 << 14);
        let (mut lamps, mut count, mut angle) = (0, [0_u32; 2], 0.0);
        for i in 0..n {
            let (choice, point) = (sampler.pair(i, 9)[0], |number| sampler.pair(i, number));
            lights.sample_several(receiver, choice, point, |arrival| match arrival.emitter {
                Emitter::Triangle(triangle, _) => {
                    count[triangle as usize] += 1;
                    angle += f64::from(1.0 / arrival.pdf);
                }
                _ => lamps += 1,
            });
        }
        // A lamp that brings more than a quarter of the light is always sampled.
        let of_lamps = [0, 1].map(|lamp| f64::from(lights.probability(receiver, lamp)));
        assert!(of_lamps[0] == 1.0 && of_lamps[1] < 0.9, "{of_lamps:?}");
        let found = f64::from(lamps) / f64::from(n);
        assert!(
            (found - of_lamps[0] - of_lamps[1]).abs() < 0.002,
            "{found} {of_lamps:?}"
        );
        for (triangle, count) in (2..).zip(count) {
            let expected = lights.probability(receiver, triangle);
            let found = f64::from(count) / f64::from(n);
            assert!(expected < 0.9, "{expected}");
            assert!(
                (found - f64::from(expected)).abs() < 0.002,
                "{found} {expected}"
            );
        }
        // The mean of 1 / density is the solid angle of both triangles.
        let solid = |x: f32| {
            let [a, b, c] = corners(x).map(|corner| (corner - receiver.point).normalized());
            let volume = a.dot(b.cross(c)).abs();
            f64::from(2.0 * volume.atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a)))
        };
        let ratio = angle / f64::from(n) / (solid(0.5) + solid(-2.0));
        assert!((ratio - 1.0).abs() < 0.01, "{ratio}");
    }

    #[test]
    fn one_light_and_many_lights_are_chosen_alone() {
        let lamp = light(LightKind::Point { radius: 0.1 }, at(0.0, 0.0, 1.0), 1.0);
        let several = |count: usize| lights(&vec![lamp.clone(); count], &[]).several();
        assert_eq!(
            [1, 2, 8, 9, 40].map(several),
            [false, true, true, false, false]
        );
    }
}
