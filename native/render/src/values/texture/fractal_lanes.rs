// SPDX-License-Identifier: GPL-3.0-or-later
//! Sums of octaves of noise at eight points at once, the same to the bit as [`super::fractal`] at each.

use fearless_simd::{Simd, SimdBase, f32x8};

use crate::values::texture::fractal::{Fractal, MAX_DETAIL, NoiseKind, shift};
use crate::values::texture::perlin_lanes::signed;

/// The parameters of fractal noise at eight points. How octaves are combined, and their number, are the same for all.
#[derive(Clone, Copy)]
pub struct FractalLanes<S: Simd> {
    detail: f32,
    normalize: bool,
    roughness: f32x8<S>,
    lacunarity: f32x8<S>,
    distortion: Option<f32x8<S>>,
}

impl<S: Simd> FractalLanes<S> {
    /// The parameters of eight points; `None` if octaves are not simply added, or if the points differ in their number of
    /// octaves or in whether they are distorted.
    #[inline(always)]
    pub fn new(simd: S, each: &[Fractal; 8]) -> Option<Self> {
        let [first, ..] = each;
        let alike = each.iter().all(|one| {
            one.detail == first.detail && (one.distortion == 0.0) == (first.distortion == 0.0)
        });
        if first.kind != NoiseKind::Sum || !alike {
            return None;
        }
        let lanes = |of: fn(&Fractal) -> f32| {
            let numbers: [f32; 8] = std::array::from_fn(|i| of(&each[i]));
            f32x8::from_slice(simd, &numbers)
        };
        Some(Self {
            detail: first.detail.clamp(0.0, MAX_DETAIL),
            normalize: first.normalize,
            roughness: lanes(|one| one.roughness.max(0.0)),
            lacunarity: lanes(|one| one.lacunarity),
            distortion: (first.distortion != 0.0).then(|| lanes(|one| one.distortion)),
        })
    }

    /// Returns the noise at the points, or three noises as a colour.
    #[inline(always)]
    pub fn at<const N: usize>(&self, simd: S, p: [f32x8<S>; N], color: bool) -> [f32x8<S>; 3] {
        let p = self.distorted(simd, p);
        let first = self.sum(simd, p);
        if !color {
            return [first; 3];
        }
        let second = self.sum(simd, moved(p, N as f32));
        [first, second, self.sum(simd, moved(p, (N + 1) as f32))]
    }

    /// Shifts the points along each axis by other noise.
    #[inline(always)]
    fn distorted<const N: usize>(&self, simd: S, p: [f32x8<S>; N]) -> [f32x8<S>; N] {
        let Some(distortion) = self.distortion else {
            return p;
        };
        let mut out = p;
        for (k, x) in out.iter_mut().enumerate() {
            *x += signed(simd, moved(p, k as f32)) * distortion;
        }
        out
    }

    /// Adds octaves of falling amplitude.
    #[inline(always)]
    fn sum<const N: usize>(&self, simd: S, p: [f32x8<S>; N]) -> f32x8<S> {
        let (whole, part) = (self.detail as u32, self.detail - self.detail.floor());
        let one = simd.splat_f32x8(1.0);
        let (mut frequency, mut amplitude) = (one, one);
        let (mut most, mut sum) = (simd.splat_f32x8(0.0), simd.splat_f32x8(0.0));
        let (mut without, mut without_most) = (sum, most);
        // The last octave counts in part.
        let octaves = whole + 1 + u32::from(part != 0.0);
        for octave in 0..octaves {
            if octave == whole + 1 {
                (without, without_most) = (sum, most);
            }
            let mut scaled = p;
            for x in &mut scaled {
                *x *= frequency;
            }
            sum += signed(simd, scaled) * amplitude;
            most += amplitude;
            amplitude *= self.roughness;
            frequency *= self.lacunarity;
        }
        if self.normalize {
            sum = sum * 0.5 / most + 0.5;
            without = without * 0.5 / without_most + 0.5;
        }
        if part == 0.0 {
            sum
        } else {
            without + (sum - without) * part
        }
    }
}

/// Shifts positions as [`super::fractal`] does.
#[inline(always)]
fn moved<S: Simd, const N: usize>(mut p: [f32x8<S>; N], seed: f32) -> [f32x8<S>; N] {
    for (k, x) in p.iter_mut().enumerate() {
        *x += shift::<N>(seed, k);
    }
    p
}
