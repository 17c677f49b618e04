// SPDX-License-Identifier: GPL-3.0-or-later
//! Traversal of the media along a ray: transmittance, and the next event.
//!
//! Uniform media are handled in closed form, see [`crate::medium::distance`]. Media that vary are tracked with
//! tentative collisions at the rate of a majorant: transmittance by ratio tracking (Novák et al. 2014, "Residual
//! ratio tracking"), events by weighted spectral tracking (Kutz et al. 2017, "Spectral and decomposition tracking"),
//! which stays unbiased where a medium is denser than its majorant.

use crate::math::sampler::Stream;
use crate::math::vector::Vec3;
use crate::medium::distance::{self, Event};
use crate::medium::mixture::Mixture;
use crate::medium::stack::Stack;
use crate::scene::RenderScene;
use crate::scene::media::MediumRay;
use crate::values::program::Value;

pub mod enclosure;

/// Largest number of tentative collisions on one ray; beyond it, a medium that varies counts as opaque.
const MAX_COLLISIONS: u32 = 1 << 13;

/// Transmittance below which Russian roulette decides whether tracking goes on.
const DIM: f32 = 0.05;

/// Scratch memory of evaluating media.
#[derive(Default)]
pub struct Scratch {
    /// Registers of programs.
    registers: Vec<Value>,
    /// The media at the last point.
    pub mixture: Mixture,
    /// Random numbers of tracking.
    pub stream: Stream,
}

/// A ray within media.
#[derive(Clone, Copy)]
pub struct Through<'a> {
    /// The scene.
    pub scene: &'a RenderScene,
    /// The media that the ray is in.
    pub stack: &'a Stack,
    /// The ray.
    pub ray: MediumRay<'a>,
}

/// Passage of a path along a ray through media.
pub struct Passage {
    /// The next event.
    pub event: Event,
    /// Radiance that the media emit towards the start of the ray, for a throughput of 1.
    pub emitted: Vec3,
    /// Whether the media are the same all along the ray.
    pub uniform: bool,
}

impl Through<'_> {
    /// Fills the mixture with the media at a distance.
    fn evaluate(&self, distance: f32, scratch: &mut Scratch) {
        scratch.mixture.clear();
        for medium in self.stack.media() {
            let Scratch {
                registers, mixture, ..
            } = scratch;
            self.scene
                .add_medium(medium, &self.ray, distance, registers, mixture);
        }
    }

    /// Returns the bound of the extinction of all media; `None` if none of them varies.
    fn majorant(&self, scratch: &mut Scratch) -> Option<f32> {
        let varies = |medium| {
            let volume = self.scene.volume(medium);
            volume.is_some_and(|volume| !volume.is_uniform())
        };
        let media = self.stack.media();
        if !media.iter().any(varies) {
            return None;
        }
        // Media that do not vary are their own bound.
        let mut sum = 0.0;
        for medium in media {
            if varies(medium) {
                sum += self.scene.media.majorant(medium);
                continue;
            }
            let Scratch {
                registers, mixture, ..
            } = scratch;
            mixture.clear();
            self.scene
                .add_medium(medium, &self.ray, 0.0, registers, mixture);
            sum += mixture.extinction.max_abs();
        }
        Some(sum)
    }

    /// Returns the transmittance between two distances along the ray. The stream of `scratch` gives random numbers.
    pub fn transmittance(&self, [start, end]: [f32; 2], scratch: &mut Scratch) -> Vec3 {
        let Some(majorant) = self.majorant(scratch) else {
            self.evaluate(start, scratch);
            return distance::transmittance(scratch.mixture.extinction, end - start);
        };
        // Multiply by the share of each tentative collision that is none.
        let mut through = Vec3::ONE;
        let mut at = start;
        for _ in 0..MAX_COLLISIONS {
            at -= (1.0 - scratch.stream.number()).ln() / majorant;
            if at.is_nan() || at >= end {
                return through;
            }
            self.evaluate(at, scratch);
            through = through * (Vec3::ONE - scratch.mixture.extinction * (1.0 / majorant));
            if through.max_abs() < DIM {
                // Survive with half the probability.
                if scratch.stream.number() < 0.5 {
                    return Vec3::ZERO;
                }
                through *= 2.0;
            }
        }
        Vec3::ZERO
    }

    /// Samples the next event of a path between two distances; afterwards, the mixture is that at the event.
    /// `throughput`: of the path. `scatters`: whether the path may scatter. `random`: for uniform media.
    pub fn sample(
        &self,
        [start, end]: [f32; 2],
        throughput: Vec3,
        scatters: bool,
        random: [f32; 2],
        scratch: &mut Scratch,
    ) -> Passage {
        if let Some(majorant) = self.majorant(scratch) {
            let span = [start, end];
            return self.track(span, throughput, scatters, majorant, scratch);
        }
        self.evaluate(start, scratch);
        let mixture = &scratch.mixture;
        let length = end - start;
        // A path that may not scatter loses what would be scattered.
        let event = if scatters {
            distance::sample(mixture, throughput, length, random)
        } else {
            Event {
                distance: None,
                weight: distance::transmittance(mixture.extinction, length),
            }
        };
        Passage {
            event: Event {
                distance: event.distance.map(|d| start + d),
                ..event
            },
            emitted: distance::emitted(mixture, length),
            uniform: true,
        }
    }

    /// Samples the next event by weighted spectral tracking.
    fn track(
        &self,
        [start, end]: [f32; 2],
        throughput: Vec3,
        scatters: bool,
        majorant: f32,
        scratch: &mut Scratch,
    ) -> Passage {
        let mut weight = Vec3::ONE;
        let mut emitted = Vec3::ZERO;
        let mut at = start;
        let done = |distance, weight, emitted| Passage {
            event: Event { distance, weight },
            emitted,
            uniform: false,
        };
        for _ in 0..MAX_COLLISIONS {
            at -= (1.0 - scratch.stream.number()).ln() / majorant;
            if at.is_nan() || at >= end {
                return done(None, weight, emitted);
            }
            self.evaluate(at, scratch);
            let mixture = &scratch.mixture;
            emitted += weight * mixture.emission * (1.0 / majorant);
            // Choose between scattering and none by what they leave of the throughput; absorption is in the weight.
            let scattered = mixture.scattering() * (1.0 / majorant);
            let none = Vec3::ONE - mixture.extinction * (1.0 / majorant);
            let carried = throughput * weight;
            let [a, b] = [scattered, none].map(|part| (carried * part).mean_abs());
            let probability = if scatters && a > 0.0 {
                a / (a + b)
            } else {
                0.0
            };
            if scratch.stream.number() < probability {
                return done(Some(at), weight * scattered * (1.0 / probability), emitted);
            }
            weight = weight * none * (1.0 / (1.0 - probability));
            // Russian roulette by the larger of throughput and weight keeps dim paths short.
            if weight.max_abs() < DIM {
                if scratch.stream.number() < 0.5 {
                    return done(None, Vec3::ZERO, emitted);
                }
                weight *= 2.0;
            }
        }
        done(None, Vec3::ZERO, emitted)
    }
}
