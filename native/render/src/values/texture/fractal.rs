// SPDX-License-Identifier: GPL-3.0-or-later
//! Sums and products of octaves of noise, with the values of Blender's Noise Texture: Musgrave's fractals in Ebert et
//! al. 2003, "Texturing and Modeling", chapter 16.

use crate::math::vector::{Vec3, vec3};
use crate::values::math_nodes::named;
use crate::values::texture::hash::unit;
use crate::values::texture::perlin::signed;

/// Largest number of octaves after the first.
pub(super) const MAX_DETAIL: f32 = 15.0;

named! {
    /// How octaves are combined.
    NoiseKind {
        Sum = "FBM", Multifractal = "MULTIFRACTAL", Hybrid = "HYBRID_MULTIFRACTAL",
        Ridged = "RIDGED_MULTIFRACTAL", Terrain = "HETERO_TERRAIN",
    }
}

/// Parameters of fractal noise.
#[derive(Debug, Clone, Copy)]
pub struct Fractal {
    /// How octaves are combined.
    pub kind: NoiseKind,
    /// Number of octaves after the first, 0..15; a fraction blends in the last one.
    pub detail: f32,
    /// Amplitude of each octave divided by that of the previous one.
    pub roughness: f32,
    /// Frequency of each octave divided by that of the previous one.
    pub lacunarity: f32,
    /// Added to each octave of hybrid, ridged and terrain noise.
    pub offset: f32,
    /// Factor on the weight of each octave of hybrid and ridged noise.
    pub gain: f32,
    /// Shift of the point by other noise.
    pub distortion: f32,
    /// Whether the sum of octaves is scaled to 0..1.
    pub normalize: bool,
}

impl Fractal {
    /// Returns the noise at a point.
    pub fn at<const N: usize>(self, p: [f32; N]) -> f32 {
        self.octaves(self.distorted(p))
    }

    /// Returns three noises as a colour; the points of the second and third are shifted far away.
    pub fn color_at<const N: usize>(self, p: [f32; N]) -> Vec3 {
        let p = self.distorted(p);
        // The first seeds belong to the distortion.
        let shifted = |seed: usize| self.octaves(moved(p, seed as f32));
        vec3(self.octaves(p), shifted(N), shifted(N + 1))
    }

    /// Shifts the point along each axis by other noise.
    fn distorted<const N: usize>(self, p: [f32; N]) -> [f32; N] {
        if self.distortion == 0.0 {
            return p;
        }
        std::array::from_fn(|k| p[k] + signed(moved(p, k as f32)) * self.distortion)
    }

    fn octaves<const N: usize>(self, p: [f32; N]) -> f32 {
        let settings = Self {
            detail: self.detail.clamp(0.0, MAX_DETAIL),
            roughness: self.roughness.max(0.0),
            ..self
        };
        match self.kind {
            NoiseKind::Sum => settings.sum(p),
            NoiseKind::Multifractal => settings.multifractal(p),
            NoiseKind::Hybrid => settings.hybrid(p),
            NoiseKind::Ridged => settings.ridged(p),
            NoiseKind::Terrain => settings.terrain(p),
        }
    }

    /// The number of whole octaves after the first, and the fraction of the next.
    fn parts(self) -> (u32, f32) {
        (self.detail as u32, self.detail - self.detail.floor())
    }

    /// Adds octaves of falling amplitude.
    fn sum<const N: usize>(self, p: [f32; N]) -> f32 {
        // Keep the largest possible sum for the normalization.
        let (whole, part) = self.parts();
        let (mut frequency, mut amplitude, mut max_sum, mut sum) = (1.0, 1.0, 0.0, 0.0);
        for _ in 0..=whole {
            sum += signed(scaled(p, frequency)) * amplitude;
            max_sum += amplitude;
            amplitude *= self.roughness;
            frequency *= self.lacunarity;
        }
        // A fraction of an octave interpolates between the sums without and with it.
        let finish = |sum: f32, max_sum: f32| {
            if self.normalize {
                0.5 * sum / max_sum + 0.5
            } else {
                sum
            }
        };
        let without = finish(sum, max_sum);
        if part == 0.0 {
            return without;
        }
        let more = sum + signed(scaled(p, frequency)) * amplitude;
        without + part * (finish(more, max_sum + amplitude) - without)
    }

    /// Multiplies octaves around 1.
    fn multifractal<const N: usize>(self, mut p: [f32; N]) -> f32 {
        let (whole, part) = self.parts();
        let (mut value, mut power) = (1.0, 1.0);
        for _ in 0..=whole {
            value *= power * signed(p) + 1.0;
            power *= self.roughness;
            p = scaled(p, self.lacunarity);
        }
        if part != 0.0 {
            value *= part * power * signed(p) + 1.0;
        }
        value
    }

    /// Adds octaves in proportion to the value so far, so that valleys stay smooth.
    fn terrain<const N: usize>(self, mut p: [f32; N]) -> f32 {
        let (whole, part) = self.parts();
        let mut value = self.offset + signed(p);
        let mut power = self.roughness;
        p = scaled(p, self.lacunarity);
        for _ in 0..whole {
            value += (signed(p) + self.offset) * power * value;
            power *= self.roughness;
            p = scaled(p, self.lacunarity);
        }
        if part != 0.0 {
            value += part * (signed(p) + self.offset) * power * value;
        }
        value
    }

    /// Adds octaves weighted by the product of those before.
    fn hybrid<const N: usize>(self, mut p: [f32; N]) -> f32 {
        const SMALLEST_WEIGHT: f32 = 0.001; // as in Blender
        let (whole, part) = self.parts();
        let (mut value, mut weight, mut power) = (0.0, 1.0_f32, 1.0);
        for _ in 0..=whole {
            if weight <= SMALLEST_WEIGHT {
                break;
            }
            weight = weight.min(1.0);
            let signal = (signed(p) + self.offset) * power;
            power *= self.roughness;
            value += weight * signal;
            weight *= self.gain * signal;
            p = scaled(p, self.lacunarity);
        }
        if part != 0.0 && weight > SMALLEST_WEIGHT {
            value += part * weight.min(1.0) * (signed(p) + self.offset) * power;
        }
        value
    }

    /// Adds octaves that have ridges where the noise is zero, weighted by the octave before.
    fn ridged<const N: usize>(self, mut p: [f32; N]) -> f32 {
        let ridge = |p: [f32; N]| (self.offset - signed(p).abs()).powi(2);
        let mut signal = ridge(p);
        let (mut value, mut power) = (signal, self.roughness);
        for _ in 0..self.parts().0 {
            p = scaled(p, self.lacunarity);
            signal = ridge(p) * (signal * self.gain).clamp(0.0, 1.0);
            value += signal * power;
            power *= self.roughness;
        }
        value
    }
}

/// Scales a position.
fn scaled<const N: usize>(p: [f32; N], factor: f32) -> [f32; N] {
    p.map(|x| x * factor)
}

/// Shifts a position by 100 to 200 along each axis, which decorrelates the noise.
fn moved<const N: usize>(p: [f32; N], seed: f32) -> [f32; N] {
    std::array::from_fn(|k| p[k] + shift::<N>(seed, k))
}

/// The shift of [`moved`] along an axis.
pub(super) fn shift<const N: usize>(seed: f32, axis: usize) -> f32 {
    let shift = if N == 1 {
        unit([seed])
    } else {
        unit([seed, axis as f32])
    };
    100.0 + 100.0 * shift
}

#[cfg(test)]
mod tests {
    use super::*;

    const BASE: Fractal = Fractal {
        kind: NoiseKind::Sum,
        detail: 2.0,
        roughness: 0.5,
        lacunarity: 2.0,
        offset: 0.7,
        gain: 1.5,
        distortion: 0.0,
        normalize: true,
    };

    #[test]
    fn a_fraction_of_an_octave_changes_the_value_continuously() {
        let p = [0.3, 1.7, 2.2];
        for &(name, kind) in NoiseKind::NAMED {
            let of = |detail| {
                Fractal {
                    kind,
                    detail,
                    ..BASE
                }
                .at(p)
            };
            assert!((of(2.0) - of(2.001)).abs() < 1e-2, "{name}");
            // The ridges have whole octaves only.
            assert_eq!(of(2.0) == of(2.5), kind == NoiseKind::Ridged, "{name}");
            assert!(of(15.0).is_finite(), "{name}");
        }
        assert!(
            (0.0..1.0).contains(
                &Fractal {
                    detail: 15.0,
                    ..BASE
                }
                .at(p)
            )
        );
    }

    #[test]
    fn channels_differ_and_distortion_moves_the_point() {
        let color = BASE.color_at([0.3, 1.7]);
        assert_eq!(color.x, BASE.at([0.3, 1.7]));
        assert!(color.x != color.y && color.y != color.z);
        let distorted = Fractal {
            distortion: 1.0,
            ..BASE
        };
        assert_ne!(distorted.at([0.3]), BASE.at([0.3]));
    }
}
