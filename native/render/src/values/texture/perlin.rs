// SPDX-License-Identifier: GPL-3.0-or-later
//! Gradient noise in one to four dimensions, with the values of Blender's Noise Texture: Perlin 2002 ("Improving
//! Noise") over Jenkins' lookup3 hash.

use crate::values::texture::hash::lookup3;

/// Factors that scale the sums of gradients to -1..1, by the number of dimensions; the values of Blender.
pub(super) const SCALES: [f32; 4] = [0.25, 0.6616, 0.982, 0.8344];

/// The noise repeats with this period, because f32 is too coarse for noise at larger coordinates.
pub(super) const PERIOD: f32 = 100_000.0;

/// Coordinates beyond this are whole numbers, at which the noise would be zero; they are shifted by half a cell.
const SPARSE: f32 = 1_000_000.0;

/// Returns the noise at a point, about -1..1.
pub fn signed<const N: usize>(p: [f32; N]) -> f32 {
    if p.iter().any(|x| !x.is_finite()) {
        return 0.0;
    }
    let p = p.map(|x| {
        let shift = if x.abs() >= SPARSE { 0.5 } else { 0.0 };
        // The remainder of what is below the period is itself.
        let within = if x.abs() < PERIOD { x } else { x % PERIOD };
        within + shift
    });
    let cell = p.map(f32::floor);
    let f: [f32; N] = std::array::from_fn(|k| p[k] - cell[k]);
    let fade = f.map(|t| t * t * t * (t * (t * 6.0 - 15.0) + 10.0));
    // Gradients of all corners of the cell; bit k of a corner's number is its side along axis k. Their hashes are
    // computed together, in the lanes of registers.
    let first = cell.map(|x| x as i32 as u32);
    let mut hashes = [0_u32; 16];
    let mut values = [0.0_f32; 16];
    for (corner, hash) in hashes.iter_mut().take(1 << N).enumerate() {
        let side = |k: usize| (corner >> k & 1) as u32;
        *hash = lookup3::<N>(std::array::from_fn(|k| first[k].wrapping_add(side(k))));
    }
    for (corner, value) in values.iter_mut().take(1 << N).enumerate() {
        let side = |k: usize| corner >> k & 1;
        *value = gradient::<N>(
            hashes[corner],
            std::array::from_fn(|k| f[k] - side(k) as f32),
        );
    }
    // Blend them along one axis after the other.
    for (k, fade) in fade.into_iter().enumerate() {
        for i in 0..1 << (N - 1 - k) {
            let (a, b) = (values[2 * i], values[2 * i + 1]);
            values[i] = a + fade * (b - a);
        }
    }
    SCALES[N - 1] * values[0]
}

/// Dot product of an offset from a corner with the gradient that the hash chooses.
fn gradient<const N: usize>(hash: u32, offset: [f32; N]) -> f32 {
    let at = |k: usize| offset.get(k).copied().unwrap_or(0.0);
    let (x, y, z, w) = (at(0), at(1), at(2), at(3));
    let signed = |value: f32, bit: u32| if hash & bit == 0 { value } else { -value };
    match N {
        1 => signed((1 + (hash & 7)) as f32, 8) * x,
        2 => {
            let (u, v) = if hash & 7 < 4 { (x, y) } else { (y, x) };
            signed(u, 1) + signed(2.0 * v, 2)
        }
        3 => {
            let h = hash & 15;
            let u = if h < 8 { x } else { y };
            let v = match h {
                0..4 => y,
                12 | 14 => x,
                _ => z,
            };
            signed(u, 1) + signed(v, 2)
        }
        _ => {
            let h = hash & 31;
            let u = if h < 24 { x } else { y };
            let v = if h < 16 { y } else { z };
            let s = if h < 8 { z } else { w };
            signed(u, 1) + signed(v, 2) + signed(s, 4)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Largest and smallest noise along a line, which must be continuous.
    fn extremes(at: impl Fn(f32) -> f32) -> (f32, f32) {
        let mut extremes = (0.0_f32, 0.0_f32);
        for i in 0..4000 {
            let x = i as f32 * 0.01 - 20.0;
            assert!((at(x) - at(x + 1e-4)).abs() < 1e-3);
            extremes = (extremes.0.min(at(x)), extremes.1.max(at(x)));
        }
        extremes
    }

    #[test]
    fn noise_is_zero_at_lattice_points_and_continuous() {
        for i in -3..4 {
            assert_eq!(signed([i as f32]), 0.0);
            assert_eq!(signed([i as f32, 2.0]), 0.0);
            assert_eq!(signed([i as f32, 2.0, -5.0]), 0.0);
            assert_eq!(signed([i as f32, 2.0, -5.0, 1.0]), 0.0);
        }
        for (low, high) in [
            extremes(|x| signed([x])),
            extremes(|x| signed([x, x * 0.7 + 0.3])),
            extremes(|x| signed([x, x * 0.7 + 0.3, 0.4 - x * 0.2])),
            extremes(|x| signed([x, x * 0.7 + 0.3, 0.4 - x * 0.2, x * 0.11])),
        ] {
            assert!(
                low < -0.4 && low > -1.0 && high > 0.4 && high < 1.0,
                "{low} {high}"
            );
        }
        assert_eq!(signed([f32::NAN, 0.0, 0.0]), 0.0);
        assert!(signed([2e6_f32, 1e7, 0.3]).is_finite());
    }
}
