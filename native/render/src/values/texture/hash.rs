// SPDX-License-Identifier: GPL-3.0-or-later
//! Hashes of positions with the values of Blender's procedural textures: Jenkins' lookup3 for numbers, and PCG for
//! cells (Jarzynski and Olano 2020, "Hash Functions for GPU Rendering", JCGT 9 (3)).

use crate::math::vector::{Vec3, vec3};

/// Rotations of the rounds of lookup3 that mix three words reversibly, as far as a key of four words takes them.
pub(super) const LOOKUP3_FOURTH: [(u32, u32, u32); 2] = [(4, 6, 8), (16, 19, 4)];

/// Rotations of the final mix of lookup3 but for its last step.
pub(super) const LOOKUP3_FINAL: [(u32, u32, u32); 2] = [(14, 11, 25), (16, 4, 14)];

/// Initial value of all three words of lookup3 for a key of this many words.
pub(super) const fn lookup3_start(words: usize) -> u32 {
    0xdead_beef_u32.wrapping_add(((words as u32) << 2) + 13)
}

/// Hashes one to four words with lookup3.
#[inline(always)]
pub fn lookup3<const N: usize>(key: [u32; N]) -> u32 {
    // Start all three words with the length of the key, and add the first three words of it.
    let start = lookup3_start(N);
    let word = |k: usize| key.get(k).copied().unwrap_or(0);
    let [mut a, mut b, mut c] = [0, 1, 2].map(|k| start.wrapping_add(word(k)));
    // A fourth word is added after a round that mixes the others reversibly.
    if N == 4 {
        for (x, y, z) in LOOKUP3_FOURTH {
            a = a.wrapping_sub(c) ^ c.rotate_left(x);
            c = c.wrapping_add(b);
            b = b.wrapping_sub(a) ^ a.rotate_left(y);
            a = a.wrapping_add(c);
            c = c.wrapping_sub(b) ^ b.rotate_left(z);
            b = b.wrapping_add(a);
        }
        a = a.wrapping_add(word(3));
    }
    // The final mix.
    for (x, y, z) in LOOKUP3_FINAL {
        c = (c ^ b).wrapping_sub(b.rotate_left(x));
        a = (a ^ c).wrapping_sub(c.rotate_left(y));
        b = (b ^ a).wrapping_sub(a.rotate_left(z));
    }
    (c ^ b).wrapping_sub(b.rotate_left(24))
}

/// Hashes numbers, by their bits, to one in 0..=1.
pub fn unit<const N: usize>(key: [f32; N]) -> f32 {
    lookup3(key.map(f32::to_bits)) as f32 / u32::MAX as f32
}

/// Hashes a position to a colour.
pub fn color<const N: usize>(p: [f32; N]) -> Vec3 {
    let at = |k: usize| p.get(k).copied().unwrap_or(0.0);
    let (x, y, z, w) = (at(0), at(1), at(2), at(3));
    // The further channels hash a longer key, or the same numbers in another order.
    match N {
        1 => vec3(unit([x]), unit([x, 1.0]), unit([x, 2.0])),
        2 => vec3(unit([x, y]), unit([x, y, 1.0]), unit([x, y, 2.0])),
        3 => vec3(unit([x, y, z]), unit([x, y, z, 1.0]), unit([x, y, z, 2.0])),
        _ => vec3(unit([x, y, z, w]), unit([z, x, w, y]), unit([w, z, y, x])),
    }
}

/// Hashes a cell to a point of the unit cube.
pub fn cell_point<const N: usize>(cell: [i32; N]) -> [f32; N] {
    let at = |k: usize| cell.get(k).copied().unwrap_or(0);
    let mut hashed = [0.0; 4];
    match N {
        1 => hashed[0] = unit([at(0) as f32]),
        2 => hashed[..2].copy_from_slice(&pcg2([at(0), at(1)])),
        3 => hashed[..3].copy_from_slice(&pcg3([at(0), at(1), at(2)])),
        _ => hashed = pcg4([at(0), at(1), at(2), at(3)]),
    }
    std::array::from_fn(|k| hashed[k])
}

/// Hashes a cell to a point of the unit cube as Blender did before 5.0, by lookup3.
pub fn earlier_cell_point<const N: usize>(cell: [i32; N]) -> [f32; N] {
    let at = |k: usize| cell.get(k).copied().unwrap_or(0) as f32;
    let (x, y, z, w) = (at(0), at(1), at(2), at(3));
    // The further numbers hash a longer key, or the same one rotated.
    let hashed = match N {
        1 => [unit([x]), 0.0, 0.0, 0.0],
        2 => [unit([x, y]), unit([x, y, 1.0]), 0.0, 0.0],
        3 => [
            unit([x, y, z]),
            unit([x, y, z, 1.0]),
            unit([x, y, z, 2.0]),
            0.0,
        ],
        _ => [[x, y, z, w], [w, x, y, z], [z, w, x, y], [y, z, w, x]].map(unit),
    };
    std::array::from_fn(|k| hashed[k])
}

/// Hashes a cell to a colour.
pub fn cell_color<const N: usize>(cell: [i32; N]) -> Vec3 {
    let at = |k: usize| cell.get(k).copied().unwrap_or(0);
    match N {
        1 => color([at(0) as f32]),
        // The third number is 0 in two dimensions.
        2 | 3 => Vec3::from(pcg3([at(0), at(1), at(2)])),
        _ => {
            let [r, g, b, _] = pcg4([at(0), at(1), at(2), at(3)]);
            vec3(r, g, b)
        }
    }
}

/// Factor of the linear congruential generator.
const FACTOR: i32 = 1_664_525;

/// Advances the linear congruential generators, and mixes them twice by `mix`, with the high bits shifted down in
/// between. Returns numbers in 0..=1.
fn pcg<const N: usize>(key: [i32; N], mix: impl Fn(&mut [i32; N])) -> [f32; N] {
    let mut v = key.map(|x| x.wrapping_mul(FACTOR).wrapping_add(1_013_904_223));
    mix(&mut v);
    // The shift is arithmetic, because Blender's numbers are signed.
    v = v.map(|x| x ^ (x >> 16));
    mix(&mut v);
    v.map(|x| (x & i32::MAX) as f32 / i32::MAX as f32)
}

/// The hash of two numbers to two.
fn pcg2(key: [i32; 2]) -> [f32; 2] {
    pcg(key, |[x, y]| {
        *x = x.wrapping_add(y.wrapping_mul(FACTOR));
        *y = y.wrapping_add(x.wrapping_mul(FACTOR));
    })
}

/// The hash of three numbers to three.
fn pcg3(key: [i32; 3]) -> [f32; 3] {
    pcg(key, |[x, y, z]| {
        *x = x.wrapping_add(y.wrapping_mul(*z));
        *y = y.wrapping_add(z.wrapping_mul(*x));
        *z = z.wrapping_add(x.wrapping_mul(*y));
    })
}

/// The hash of four numbers to four.
fn pcg4(key: [i32; 4]) -> [f32; 4] {
    pcg(key, |[x, y, z, w]| {
        *x = x.wrapping_add(y.wrapping_mul(*w));
        *y = y.wrapping_add(z.wrapping_mul(*x));
        *z = z.wrapping_add(x.wrapping_mul(*y));
        *w = w.wrapping_add(y.wrapping_mul(*z));
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hashes_are_spread_evenly_and_neighbours_differ() {
        let mut sums = [0.0_f64; 9];
        for i in 0..1000 {
            let [a] = cell_point([i]);
            let [b, c] = cell_point([i, 3]);
            let [d, e, f] = cell_point([i, 3, -1]);
            let [g, h, k, _] = cell_point([i, 3, -1, 7]);
            for (sum, x) in sums.iter_mut().zip([a, b, c, d, e, f, g, h, k]) {
                assert!((0.0..=1.0).contains(&x));
                *sum += f64::from(x) / 1000.0;
            }
        }
        assert!(
            sums.iter().all(|mean| (mean - 0.5).abs() < 0.04),
            "{sums:?}"
        );
        assert_ne!(color([1.0, 2.0, 3.0, 4.0]), color([1.0, 2.0, 3.0, 5.0]));
        assert_eq!(cell_color([4, 5]), cell_color([4, 5, 0]));
    }
}
