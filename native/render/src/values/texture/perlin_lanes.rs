// SPDX-License-Identifier: GPL-3.0-or-later
//! Gradient noise at eight points at once, the same to the bit as [`super::perlin`] at each.

use fearless_simd::{Bytes, Select, Simd, SimdBase, SimdFloat, SimdMask, f32x8, u32x8};

use crate::values::texture::hash::{LOOKUP3_FINAL, LOOKUP3_FOURTH, lookup3_start};
use crate::values::texture::perlin::{self, PERIOD, SCALES};

// Loops in place of `map` and `from_fn`: the compiler does not inline vector instructions into closures of the standard
// library.

/// Returns the noise at eight points, given by coordinate.
#[inline(always)]
pub fn signed<S: Simd, const N: usize>(simd: S, p: [f32x8<S>; N]) -> f32x8<S> {
    let (mut cell, mut offset, mut fade) = (p, p, p);
    let mut first = [simd.splat_u32x8(0); N];
    for k in 0..N {
        // Leave coordinates that are not finite, or so large that the noise repeats, to single points.
        if !p[k].abs().simd_lt(PERIOD).all_true() {
            return one_by_one(simd, p);
        }
        cell[k] = p[k].floor();
        let t = p[k] - cell[k];
        offset[k] = t;
        fade[k] = t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
        first[k] = simd.cvt_i32_f32x8(cell[k]).bitcast::<u32x8<S>>();
    }
    // Bit k of a corner's number is its side along axis k.
    let mut values = [simd.splat_f32x8(0.0); 16];
    for (corner, value) in values.iter_mut().take(1 << N).enumerate() {
        let (mut key, mut from) = (first, offset);
        for k in 0..N {
            let side = (corner >> k & 1) as u32;
            key[k] += side;
            from[k] -= side as f32;
        }
        *value = gradient(simd, lookup3(simd, key), from);
    }
    // Blend them along one axis after the other.
    for (k, fade) in fade.into_iter().enumerate() {
        for i in 0..1 << (N - 1 - k) {
            let (a, b) = (values[2 * i], values[2 * i + 1]);
            values[i] = a + fade * (b - a);
        }
    }
    values[0] * SCALES[N - 1]
}

/// [`signed`], point by point.
#[inline(never)]
fn one_by_one<S: Simd, const N: usize>(simd: S, p: [f32x8<S>; N]) -> f32x8<S> {
    let mut points = [[0.0; N]; 8];
    for (k, coordinates) in p.iter().enumerate() {
        let mut lanes = [0.0; 8];
        coordinates.store_slice(&mut lanes);
        for (point, x) in points.iter_mut().zip(lanes) {
            point[k] = x;
        }
    }
    f32x8::from_slice(simd, &points.map(perlin::signed))
}

/// Rotates the bits of each word to the left.
#[inline(always)]
fn rotate<S: Simd>(x: u32x8<S>, bits: u32) -> u32x8<S> {
    (x << bits) | (x >> (32 - bits))
}

/// Hashes eight keys of one to four words as [`super::hash::lookup3`] does.
#[inline(always)]
fn lookup3<S: Simd, const N: usize>(simd: S, key: [u32x8<S>; N]) -> u32x8<S> {
    let mut words = [simd.splat_u32x8(0); 4];
    words[..N].copy_from_slice(&key);
    let start = lookup3_start(N);
    let (mut a, mut b, mut c) = (words[0] + start, words[1] + start, words[2] + start);
    if N == 4 {
        for (x, y, z) in LOOKUP3_FOURTH {
            a = (a - c) ^ rotate(c, x);
            c += b;
            b = (b - a) ^ rotate(a, y);
            a += c;
            c = (c - b) ^ rotate(b, z);
            b += a;
        }
        a += words[3];
    }
    for (x, y, z) in LOOKUP3_FINAL {
        c = (c ^ b) - rotate(b, x);
        a = (a ^ c) - rotate(c, y);
        b = (b ^ a) - rotate(a, z);
    }
    (c ^ b) - rotate(b, 24)
}

/// Returns the values, with the other sign where this bit of the hash is set.
#[inline(always)]
fn signs<S: Simd>(hash: u32x8<S>, bit: u32, values: f32x8<S>) -> f32x8<S> {
    let sign = (hash & (1 << bit)) << (31 - bit);
    (values.bitcast::<u32x8<S>>() ^ sign).bitcast::<f32x8<S>>()
}

/// Dot products of offsets from corners with the gradients that the hashes choose.
#[inline(always)]
fn gradient<S: Simd, const N: usize>(simd: S, hash: u32x8<S>, offset: [f32x8<S>; N]) -> f32x8<S> {
    let mut all = [simd.splat_f32x8(0.0); 4];
    all[..N].copy_from_slice(&offset);
    let [x, y, z, w] = all;
    match N {
        1 => signs(hash, 3, simd.cvt_f32_u32x8((hash & 7) + 1)) * x,
        2 => {
            let first = (hash & 7).simd_lt(4);
            let (u, v) = (first.select(x, y), first.select(y, x));
            signs(hash, 0, u) + signs(hash, 1, v * 2.0)
        }
        3 => {
            let h = hash & 15;
            let u = h.simd_lt(8).select(x, y);
            // 12 and 14 differ in one bit.
            let v = (h & 13).simd_eq(12).select(x, z);
            let v = h.simd_lt(4).select(y, v);
            signs(hash, 0, u) + signs(hash, 1, v)
        }
        _ => {
            let h = hash & 31;
            let u = h.simd_lt(24).select(x, y);
            let v = h.simd_lt(16).select(y, z);
            let s = h.simd_lt(8).select(z, w);
            signs(hash, 0, u) + signs(hash, 1, v) + signs(hash, 2, s)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::dispatch;
    use halfspace_base::simd::levels;
    use proptest::prelude::*;

    fn coordinate() -> impl Strategy<Value = f32> {
        prop_oneof![
            8 => -50.0_f32..50.0,
            2 => -1e5_f32..1e5,
            1 => (-9_i8..9).prop_map(f32::from),
            1 => prop::sample::select(vec![-0.0, 1e-40, -1e-9, 99_999.99, f32::NAN, f32::INFINITY, 1e5, -3e9]),
        ]
    }

    /// Compares the noise in N dimensions with that at single points.
    fn compare<const N: usize>(points: [[f32; N]; 8]) -> Result<(), TestCaseError> {
        let expected = points.map(|p| perlin::signed(p).to_bits());
        for (name, level) in levels() {
            let found = dispatch!(level, simd => {
                           let p: [_; N] = std::array::from_fn(|k| f32x8::from_slice(simd, &points.map(|p| p[k])));
                           let mut noise = [0.0_f32; 8];
            signed(simd, p).store_slice(&mut noise);
            noise.map(f32::to_bits)
                       });
            prop_assert_eq!(found, expected, "{}", name);
        }
        Ok(())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2_000))]
        #[test]
        fn noise_is_that_of_single_points(p in [(); 8].map(|()| [(); 4].map(|()| coordinate()))) {
            compare(p.map(|[x, ..]| [x]))?;
            compare(p.map(|[x, y, ..]| [x, y]))?;
            compare(p.map(|[x, y, z, _]| [x, y, z]))?;
            compare(p)?;
        }
    }
}
