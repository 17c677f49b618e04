// SPDX-License-Identifier: GPL-3.0-or-later
//! Gabor noise: sparse waves in Gaussian windows (Lagae, Lefebvre, Drettakis and Dutré 2009, "Procedural Noise using
//! Sparse Gabor Convolution"; phase and intensity after Tricard et al. 2019, "Procedural Phasor Noise"), with the
//! values of Blender's texture.

use std::f32::consts::{PI, TAU};

use crate::math::trig::sin_cos_turns;
use crate::math::vector::{Vec3, vec3};
use crate::values::math_nodes::named;
use crate::values::texture::hash::unit;

named! {
    /// Outputs of the Gabor texture.
    GaborOutput {
        Value = "Value", Phase = "Phase", Intensity = "Intensity",
    }
}

/// Waves per cell.
const IMPULSES: u16 = 8;

/// Parameters of the noise.
#[derive(Debug, Clone, Copy)]
pub struct Gabor {
    /// Waves per unit of the scaled position.
    pub frequency: f32,
    /// Share of a half turn by which directions differ, 0 to 1.
    pub isotropy: f32,
    /// Returned quantity.
    pub output: GaborOutput,
}

impl Gabor {
    /// Returns the noise at (x, y), with waves along an angle, radians.
    pub fn at_2d(&self, [x, y]: [f32; 2], angle: f32) -> f32 {
        let cell = [x.floor(), y.floor()];
        let mut sum = [0.0; 2];
        for step in 0..9_u8 {
            let near = [cell[0] + nearby(step), cell[1] + nearby(step / 3)];
            for impulse in 0..IMPULSES {
                let [turn, place, sign] = seeds(impulse);
                let [a, b] = near;
                let offset = vec3(
                    x - a - unit([a, b, place]),
                    y - b - unit([place, a, b]),
                    0.0,
                );
                let turned = angle + (unit([a, b, turn]) - 0.5) * PI * self.isotropy;
                let along = || {
                    let (sin, cos) = sin_cos(turned);
                    vec3(cos, sin, 0.0)
                };
                self.add(&mut sum, offset, unit([a, b, sign]), along);
            }
        }
        // The variance of the sum: half of the waves' number, times a quarter, the mean of the squared window.
        self.output(sum, 1.0)
    }

    /// Returns the noise at a position, with waves along a direction.
    pub fn at_3d(&self, p: Vec3, direction: Vec3) -> f32 {
        let direction = direction.normalized_or(Vec3::ZERO);
        let polar = direction.z.clamp(-1.0, 1.0).acos();
        let around = direction.y.atan2(direction.x);
        let cell = p.map(f32::floor);
        let mut sum = [0.0; 2];
        for step in 0..27_u8 {
            let near = cell + vec3(nearby(step), nearby(step / 3), nearby(step / 9));
            for impulse in 0..IMPULSES {
                let [turn, place, sign] = seeds(impulse);
                let [a, b, c] = near.array();
                let center = [
                    unit([a, b, c, place]),
                    unit([c, a, place, b]),
                    unit([place, c, b, a]),
                ];
                let along = || {
                    if self.isotropy == 0.0 {
                        return direction;
                    }
                    let most = PI * self.isotropy;
                    let (sin, cos) = sin_cos(polar + unit([a, b, c, turn]) * most);
                    let (y, x) = sin_cos(around + unit([c, a, turn, b]) * most);
                    vec3(sin * x, sin * y, cos)
                };
                let offset = p - near - Vec3::from(center);
                self.add(&mut sum, offset, unit([a, b, c, sign]), along);
            }
        }
        // The mean of the squared window is 1 / (4 √2).
        self.output(sum, std::f32::consts::FRAC_1_SQRT_2.sqrt())
    }

    /// Adds the wave of one impulse to the sum of cosines and sines. offset: from the impulse. sign: below 1/2, the
    /// wave is subtracted.
    fn add(&self, sum: &mut [f32; 2], offset: Vec3, sign: f32, along: impl Fn() -> Vec3) {
        let squared = offset.dot(offset);
        if squared >= 1.0 {
            return;
        }
        // The Gaussian is cut off smoothly at 1.
        let (_, cos) = sin_cos(PI * squared);
        let window = (-PI * squared).exp() * (0.5 + 0.5 * cos);
        let weight = if sign < 0.5 { -window } else { window };
        let (sin, cos) = sin_cos(TAU * self.frequency * offset.dot(along()));
        sum[0] += weight * cos;
        sum[1] += weight * sin;
    }

    /// Selects an output of the sum, whose standard deviation is given.
    fn output(&self, [real, imaginary]: [f32; 2], deviation: f32) -> f32 {
        let most = 6.0 * deviation;
        match self.output {
            GaborOutput::Value => 0.5 + 0.5 * imaginary / most,
            GaborOutput::Phase => (imaginary.atan2(real) + PI) / TAU,
            GaborOutput::Intensity => real.hypot(imaginary) / most,
        }
    }
}

/// Coordinate of a neighbour of a cell: -1, 0 or 1, by the last digit to base 3.
fn nearby(step: u8) -> f32 {
    f32::from(step % 3) - 1.0
}

/// Seeds of an impulse: for its direction, its place, and its sign.
fn seeds(impulse: u16) -> [f32; 3] {
    [0, 1, 2].map(|k| f32::from(3 * impulse + k))
}

/// Sine and cosine of an angle, radians.
fn sin_cos(angle: f32) -> (f32, f32) {
    let turns = angle / TAU;
    sin_cos_turns(turns - turns.floor())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values along a line, of both kinds.
    fn values(gabor: Gabor) -> Vec<f32> {
        let at = |i: u16| f32::from(i) * 0.173;
        let along = vec3(1.0, 0.5, 0.25);
        (0..400)
            .flat_map(|i| {
                [
                    gabor.at_2d([at(i), 0.4], 0.3),
                    gabor.at_3d(vec3(at(i), 0.4, -at(i)), along),
                ]
            })
            .collect()
    }

    #[test]
    fn the_mean_is_a_half_and_the_deviation_that_of_the_normalization() {
        let noise = values(Gabor {
            frequency: 2.0,
            isotropy: 1.0,
            output: GaborOutput::Value,
        });
        let mean = noise.iter().sum::<f32>() / 800.0;
        let variance = noise.iter().map(|x| (x - mean).powi(2)).sum::<f32>() / 800.0;
        assert!((mean - 0.5).abs() < 0.02, "{mean}");
        // A value of one deviation is 1 / 12 = 0.083 from the mean.
        assert!((0.07..0.13).contains(&variance.sqrt()), "{variance}");
    }

    #[test]
    fn phases_cover_a_turn_and_absurd_parameters_give_numbers_or_none() {
        let gabor = |frequency, output| Gabor {
            frequency,
            isotropy: 0.5,
            output,
        };
        let phases = values(gabor(2.0, GaborOutput::Phase));
        assert!(phases.iter().all(|x| (0.0..=1.0).contains(x)));
        assert!(phases.iter().any(|&x| x < 0.1) && phases.iter().any(|&x| x > 0.9));
        for frequency in [0.0, -3.0, 1e30, f32::INFINITY, f32::NAN] {
            values(gabor(frequency, GaborOutput::Intensity));
        }
        let still = gabor(2.0, GaborOutput::Value).at_3d(vec3(0.3, 0.4, 0.5), Vec3::ZERO);
        assert!(still.is_finite());
    }
}
