// SPDX-License-Identifier: GPL-3.0-or-later
//! The random walk of a path below a surface: the segments between scattering points in a uniform medium, until one
//! meets the surface from inside.
//!
//! Each segment is sampled by a mixture: directions by the phase function and exponential distances, or directions that
//! prefer the surface and stretched distances ("Dwivedi sampling": Křivánek and d'Eon 2014, "A Zero-Variance-Based
//! Sampling Scheme for Monte Carlo Subsurface Scattering"; densities by Meng, Hanika and Dachsbacher 2016, "Improving
//! the Dwivedi Sampling Scheme", eq. 9 and 10). The balance heuristic weighs them, and the channels that may give the
//! distance. Only the noise depends on the mixture.

use std::f32::consts::TAU;

use crate::math::sampler::Stream;
use crate::math::trig::sin_cos_turns;
use crate::math::vector::{Frame, Vec3, vec3};
use crate::medium::inversion::Coefficients;
use crate::medium::mixture::divided;
use crate::medium::{distance, phase};

/// Largest number of segments, as in Cycles; longer walks are dropped.
const MAX_SEGMENTS: u16 = 256;

/// Throughput below which walks are dropped, as in Cycles.
const DIM: f32 = 1e-6;

/// Number of segments after which scattering is isotropic with the same diffusion, as in Cycles (similarity theory:
/// Wyman, Patterson and Wilson 1989).
const SIMILAR: u16 = 10;

/// A walk between two of its vertices.
#[derive(Debug, Clone, Copy)]
pub struct RandomWalk {
    /// Object that was entered, whose surface alone ends the walk.
    pub object: u32,
    extinction: Vec3,
    scattering: Vec3,
    anisotropy: f32,
    /// Normal at the entrance, outwards.
    normal: Vec3,
    /// Diffusion length in mean free paths.
    diffusion: f32,
    /// Number of segments begun.
    segments: u16,
    segment: Segment,
    stream: Stream,
}

/// The segment that is being traced.
#[derive(Debug, Clone, Copy, Default)]
struct Segment {
    /// Length at which the path scatters.
    length: f32,
    /// Length covered by earlier rays, which other objects have stopped.
    covered: f32,
    /// Probability of each channel to give the length.
    channels: Vec3,
    /// Share of guided samples; 0 for the first segment, whose direction is given.
    guided: f32,
    /// Density of the direction by guided sampling over that by the phase function.
    ratio: f32,
    /// Factor on the extinction by which guided lengths are sampled.
    stretch: f32,
}

/// Where a segment ends.
pub enum End {
    /// The walk continues in this direction.
    Scattered(Vec3),
    /// The path leaves the object.
    Left,
    /// The path is dropped.
    Dropped,
}

impl RandomWalk {
    /// Begins a walk. `normal`: at the entrance, outwards; `throughput`: of the path within the medium; `seed`: of its
    /// random numbers.
    pub fn new(
        medium: &Coefficients,
        anisotropy: f32,
        normal: Vec3,
        object: u32,
        throughput: Vec3,
        seed: u32,
    ) -> Self {
        let mut walk = Self {
            object,
            extinction: medium.extinction,
            scattering: medium.extinction * medium.albedo,
            anisotropy,
            normal,
            diffusion: diffusion_length(medium.albedo.max_component()),
            segments: 0,
            segment: Segment::default(),
            stream: Stream::new(seed),
        };
        walk.begin(throughput, None);
        walk
    }

    /// Returns the length of the segment that is left to trace.
    pub fn left(&self) -> f32 {
        self.segment.length - self.segment.covered
    }

    /// Covers a part of the segment up to another object.
    pub fn cover(&mut self, distance: f32) {
        self.segment.covered += distance;
    }

    /// Ends the segment at the surface, after `hit` further units, or in the medium. Changes the throughput.
    pub fn end(&mut self, d: Vec3, hit: Option<f32>, throughput: &mut Vec3) -> End {
        let Segment {
            length,
            covered,
            channels,
            guided,
            ratio,
            stretch,
        } = self.segment;
        let t = hit.map_or(length, |t| covered + t);
        // Weigh by the mean density over channels and ways of sampling.
        let sigma = self.extinction;
        let through = distance::transmittance(sigma, t);
        let density = |sigma: Vec3| {
            let through = distance::transmittance(sigma, t);
            if hit.is_some() {
                through
            } else {
                sigma * through
            }
        };
        let mut pdf = density(sigma);
        if guided > 0.0 {
            pdf = pdf * (1.0 - guided) + density(sigma * stretch) * (ratio * guided);
        }
        let value = if hit.is_some() {
            through
        } else {
            self.scattering * through
        };
        *throughput = *throughput * value * (1.0 / channels.dot(pdf));
        if !throughput.is_finite() || throughput.max_component() <= 0.0 {
            return End::Dropped;
        }
        if hit.is_some() {
            return End::Left;
        }
        if throughput.max_component() < DIM || self.segments >= MAX_SEGMENTS {
            return End::Dropped;
        }
        // Scatter, and sample the next segment.
        End::Scattered(self.scatter(d, *throughput))
    }

    /// Samples the next direction and segment. `d`: direction before.
    fn scatter(&mut self, d: Vec3, throughput: Vec3) -> Vec3 {
        if self.segments == SIMILAR {
            let absorption = self.extinction - self.scattering;
            self.scattering *= 1.0 - self.anisotropy;
            self.extinction = absorption + self.scattering;
            self.anisotropy = 0.0;
        }
        // Guide less where the phase function is narrow, as Cycles does.
        let guided = 1.0 - self.anisotropy.abs().powf(0.125).max(0.5);
        let is_guided = self.stream.number() < guided;
        let u = [self.stream.number(), self.stream.number()];
        let v = self.diffusion;
        let log = ((v + 1.0) / (v - 1.0)).ln();
        let direction = if is_guided {
            let cos = (v - (v + 1.0) * (-u[0] * log).exp()).clamp(-1.0, 1.0);
            let sin = (1.0 - cos * cos).sqrt();
            let (s, c) = sin_cos_turns(u[1]);
            Frame::around(self.normal).to_world(vec3(sin * c, sin * s, cos))
        } else {
            phase::sample(self.anisotropy, d, u)
        };
        // Remember the densities of the direction until the end of the segment is known.
        let cos = direction.dot(self.normal).clamp(-1.0, 1.0);
        let stretch = 1.0 - cos / v;
        let density = 1.0 / (TAU * (v - cos) * log);
        self.segment = Segment {
            guided,
            ratio: density / phase::density(self.anisotropy, direction.dot(d)),
            stretch,
            ..self.segment
        };
        self.begin(throughput, is_guided.then_some(stretch));
        direction
    }

    /// Samples the length of the next segment. `stretch`: factor on the extinction.
    fn begin(&mut self, throughput: Vec3, stretch: Option<f32>) {
        self.segments += 1;
        // Choose a channel by what it would scatter.
        let share = throughput * divided(self.scattering, self.extinction);
        let total = share.x + share.y + share.z;
        let channels = if total > 0.0 && total.is_finite() {
            share * (1.0 / total)
        } else {
            Vec3::splat(1.0 / 3.0)
        };
        let choice = self.stream.number();
        let sigma = if choice < channels.x {
            self.extinction.x
        } else if choice < channels.x + channels.y || channels.z == 0.0 {
            self.extinction.y
        } else {
            self.extinction.z
        };
        let sigma = sigma * stretch.unwrap_or(1.0);
        self.segment = Segment {
            length: -(1.0 - self.stream.number()).ln() / sigma,
            covered: 0.0,
            channels,
            ..self.segment
        };
    }
}

/// The diffusion length of an albedo in mean free paths: d'Eon and Křivánek 2020, "Zero-Variance Theory for Efficient
/// Subsurface Scattering", eq. 67.
fn diffusion_length(albedo: f32) -> f32 {
    let power = 2.44294 - 0.021_581_3 * albedo + 0.578_637 / albedo;
    (1.0 / (1.0 - albedo.powf(power)).max(1e-12).sqrt()).max(1.0 + 1e-5)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::medium::inversion::Inversion;

    /// Walks in a half space below z = 0 until they leave or are dropped. Returns the mean throughput of those that
    /// leave, and of its square.
    fn reflected(color: Vec3, g: f32, walks: u32) -> (Vec3, Vec3) {
        let up = vec3(0.0, 0.0, 1.0);
        let medium = Coefficients::new(Inversion::RandomWalk, color, vec3(1.0, 0.5, 0.1), g, 1.4);
        let (mut sum, mut squares) = (Vec3::ZERO, Vec3::ZERO);
        for seed in 0..walks {
            let mut throughput = medium.factor;
            let mut stream = Stream::new(Stream::new(seed).fork(9));
            // Enter diffusely.
            let cos = stream.number().sqrt();
            let mut d = vec3((1.0 - cos * cos).sqrt(), 0.0, -cos);
            let mut walk = RandomWalk::new(&medium, g, up, 0, throughput, seed);
            let mut z = 0.0;
            loop {
                let surface = -z / d.z;
                let hit = (d.z > 0.0 && surface < walk.left()).then_some(surface);
                z += d.z * walk.left();
                match walk.end(d, hit, &mut throughput) {
                    End::Scattered(next) => d = next,
                    End::Left => {
                        sum += throughput;
                        squares += throughput * throughput;
                        break;
                    }
                    End::Dropped => break,
                }
            }
        }
        let n = 1.0 / walks as f32;
        (sum * n, squares * n)
    }

    #[test]
    fn a_half_space_reflects_its_colour() {
        // The fit holds for diffuse light on an index-matched half space.
        for g in [0.0, 0.6, -0.4] {
            let color = vec3(0.8, 0.5, 0.2);
            let (mean, squares) = reflected(color, g, 20_000);
            for (c, (m, s)) in color
                .array()
                .into_iter()
                .zip(mean.array().into_iter().zip(squares.array()))
            {
                let error = ((s - m * m).max(0.0) / 20_000.0).sqrt();
                assert!(
                    (m - c).abs() < 0.02 * c + 4.0 * error,
                    "{g}: {m} for {c} ± {error}"
                );
            }
        }
    }

    #[test]
    fn extremes_neither_hang_nor_leave_the_numbers() {
        for (color, radius) in [(1.0, 1e-30), (0.0, 1.0), (1.0, f32::MAX), (f32::NAN, 1.0)] {
            let (color, radius) = (Vec3::splat(color), Vec3::splat(radius));
            let medium = Coefficients::new(Inversion::Legacy, color, radius, 0.9, 1.4);
            let mut throughput = Vec3::ONE;
            let down = vec3(0.0, 0.0, -1.0);
            let mut walk = RandomWalk::new(&medium, 0.9, -down, 0, throughput, 1);
            let mut d = down;
            let mut count = 0;
            while let End::Scattered(next) = walk.end(d, None, &mut throughput) {
                d = next;
                count += 1;
                assert!(d.is_finite() && throughput.is_finite() && count < 300);
            }
        }
    }
}
