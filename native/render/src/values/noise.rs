// SPDX-License-Identifier: GPL-3.0-or-later
//! Gradient noise in three dimensions and its fractal sum, with the same values as Blender's Noise Texture: Perlin
//! 2002 ("Improving Noise") over Jenkins' lookup3 hash.

use crate::math::vector::{Vec3, vec3};

/// Factor that scales the sum of gradients to -1..1; the value of Blender.
const SCALE: f32 = 0.982;

/// The final mix of lookup3.
fn mix_bits(mut a: u32, mut b: u32, mut c: u32) -> u32 {
    for (x, y, z) in [(14, 11, 25), (16, 4, 14)] {
        c = (c ^ b).wrapping_sub(b.rotate_left(x));
        a = (a ^ c).wrapping_sub(c.rotate_left(y));
        b = (b ^ a).wrapping_sub(a.rotate_left(z));
    }
    (c ^ b).wrapping_sub(b.rotate_left(24))
}

/// Hashes the coordinates of a lattice point.
fn hash3(x: u32, y: u32, z: u32) -> u32 {
    // The initial value of lookup3 for a key of three words.
    let start = 0xdead_beef_u32.wrapping_add((3 << 2) + 13);
    mix_bits(
        start.wrapping_add(x),
        start.wrapping_add(y),
        start.wrapping_add(z),
    )
}

/// Hashes two numbers to one in 0..1.
fn hash_unit(x: f32, y: f32) -> f32 {
    // The initial value of lookup3 for a key of two words.
    let start = 0xdead_beef_u32.wrapping_add((2 << 2) + 13);
    let h = mix_bits(
        start.wrapping_add(x.to_bits()),
        start.wrapping_add(y.to_bits()),
        start,
    );
    h as f32 / u32::MAX as f32
}

/// Dot product of an offset with one of twelve gradients towards the edges of a cube.
fn gradient(hash: u32, x: f32, y: f32, z: f32) -> f32 {
    let h = hash & 15;
    let u = if h < 8 { x } else { y };
    let v = if h < 4 {
        y
    } else if h == 12 || h == 14 {
        x
    } else {
        z
    };
    (if h & 1 == 0 { u } else { -u }) + (if h & 2 == 0 { v } else { -v })
}

/// Returns the noise at a point, about -1..1.
pub fn signed(p: Vec3) -> f32 {
    if !p.is_finite() {
        return 0.0;
    }
    // Beyond this distance f32 is too coarse for noise; Blender repeats it with the same period.
    let p = p.map(|x| {
        if x.abs() >= 100_000.0 {
            x % 100_000.0
        } else {
            x
        }
    });
    // Blend the gradients of the eight lattice points around p with the quintic fade curve.
    let cell = p.map(f32::floor);
    let f = p - cell;
    let fade = f.map(|t| t * t * t * (t * (t * 6.0 - 15.0) + 10.0));
    let [cx, cy, cz] = [cell.x, cell.y, cell.z].map(|c| c as i32 as u32);
    let corner = |i: u32, j: u32, k: u32| {
        let hash = hash3(cx.wrapping_add(i), cy.wrapping_add(j), cz.wrapping_add(k));
        gradient(hash, f.x - i as f32, f.y - j as f32, f.z - k as f32)
    };
    let mix = |a: f32, b: f32, t: f32| a + t * (b - a);
    let layer = |k: u32| {
        mix(
            mix(corner(0, 0, k), corner(1, 0, k), fade.x),
            mix(corner(0, 1, k), corner(1, 1, k), fade.x),
            fade.y,
        )
    };
    SCALE * mix(layer(0), layer(1), fade.z)
}

/// Parameters of the fractal sum of noise.
#[derive(Debug, Clone, Copy)]
pub struct Fractal {
    /// Number of octaves after the first, 0..15; a fraction blends in the last one.
    pub detail: f32,
    /// Amplitude of each octave divided by that of the previous one.
    pub roughness: f32,
    /// Frequency of each octave divided by that of the previous one.
    pub lacunarity: f32,
    /// Whether the sum is scaled to 0..1.
    pub normalize: bool,
}

/// Returns the sum of octaves of noise at a point.
pub fn fractal(p: Vec3, settings: Fractal) -> f32 {
    let detail = settings.detail.clamp(0.0, 15.0);
    let roughness = settings.roughness.max(0.0);
    // Add octaves, keeping the largest possible sum for the normalization.
    let (mut frequency, mut amplitude, mut max_sum, mut sum) = (1.0, 1.0, 0.0, 0.0);
    for _ in 0..=detail as u32 {
        sum += signed(p * frequency) * amplitude;
        max_sum += amplitude;
        amplitude *= roughness;
        frequency *= settings.lacunarity;
    }
    // A fraction of an octave interpolates between the sums without and with it.
    let part = detail - detail.floor();
    let finish = |sum: f32, max_sum: f32| {
        if settings.normalize {
            0.5 * sum / max_sum + 0.5
        } else {
            sum
        }
    };
    let whole = finish(sum, max_sum);
    if part == 0.0 {
        return whole;
    }
    let more = finish(sum + signed(p * frequency) * amplitude, max_sum + amplitude);
    whole + part * (more - whole)
}

/// Returns three sums as a colour; the points of the second and third are shifted far away.
pub fn fractal_color(p: Vec3, settings: Fractal) -> Vec3 {
    let shifted = |seed: f32| {
        // Offsets between 100 and 200 decorrelate the channels.
        let offset = vec3(
            100.0 + 100.0 * hash_unit(seed, 0.0),
            100.0 + 100.0 * hash_unit(seed, 1.0),
            100.0 + 100.0 * hash_unit(seed, 2.0),
        );
        fractal(p + offset, settings)
    };
    vec3(fractal(p, settings), shifted(3.0), shifted(4.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_zero_at_lattice_points_and_continuous() {
        for i in -3..4 {
            assert_eq!(signed(vec3(i as f32, 2.0, -5.0)), 0.0);
        }
        let mut extremes = (0.0_f32, 0.0_f32);
        for i in 0..4000 {
            let at = |x: f32| signed(vec3(x, x * 0.7 + 0.3, 0.4 - x * 0.2));
            let x = i as f32 * 0.01 - 20.0;
            assert!((at(x) - at(x + 1e-4)).abs() < 1e-3);
            extremes = (extremes.0.min(at(x)), extremes.1.max(at(x)));
        }
        assert!(extremes.0 < -0.4 && extremes.0 > -1.0 && extremes.1 > 0.4 && extremes.1 < 1.0);
        assert_eq!(signed(vec3(f32::NAN, 0.0, 0.0)), 0.0);
    }

    #[test]
    fn a_fraction_of_an_octave_changes_the_sum_continuously() {
        let p = vec3(0.3, 1.7, 2.2);
        let of = |detail| {
            let settings = Fractal {
                detail,
                roughness: 0.5,
                lacunarity: 2.0,
                normalize: true,
            };
            fractal(p, settings)
        };
        assert!((of(2.0) - of(2.001)).abs() < 1e-2);
        assert!((0.0..1.0).contains(&of(15.0)));
    }
}
