// SPDX-License-Identifier: GPL-3.0-or-later
//! Reordering of incoherent rays, so that consecutive rays visit the same parts of a tree (Pharr et al. 1997;
//! Moon et al. 2010): sorted by the grid cell of their origin, then by the octant of their direction.
//!
//! If the tree is larger than the caches, rays in random order fetch its nodes from memory again and again. The hits do
//! not depend on the order.

use halfspace_geom::Aabb;

/// Smallest number of rays that are reordered; fewer rarely share cells.
const LEAST: usize = 1 << 14;

/// Largest number of rays that are reordered at once. More need more memory, and each cell already has many.
const WINDOW: usize = 1 << 20;

/// Binary logarithm of the number of cells along an axis.
const CELL_BITS: u32 = 6;

/// Number of pairs of consecutive rays in the sample.
const PAIRS: usize = 256;

/// Fraction of the scene's extent beyond which the origins of consecutive rays are far apart.
const APART: f32 = 1.0 / 32.0;

/// Whether rays with these origins gain from another order: there are enough of them, and most start far from the
/// previous ray.
pub fn scattered(origins: &[[f32; 3]], bounds: &Aabb) -> bool {
    if origins.len() < LEAST || bounds.is_empty() {
        return false;
    }
    let far = APART * (0..3).fold(0.0, |most: f32, k| most.max(bounds.max[k] - bounds.min[k]));
    // Compare a sample of pairs of consecutive rays.
    let step = origins.len() / PAIRS;
    let apart = |i: usize| {
        let (a, b) = (origins[i * step], origins[i * step + 1]);
        (0..3).any(|k| (a[k] - b[k]).abs() > far)
    };
    2 * (0..PAIRS).filter(|&i| apart(i)).count() > PAIRS
}

/// Memory for reordering, in bytes per ray: two copies of the key for sorting, and its index.
pub const BYTES: usize = 2 * size_of::<u64>() + size_of::<u32>();

/// Number of `rays` to reorder at once so that all threads get work.
pub fn window(rays: usize, threads: usize) -> usize {
    rays.div_ceil(threads.max(1)).clamp(LEAST, WINDOW)
}

/// The permutation that sorts the rays: indices into the input, which has at most 2^32 rays.
pub fn order(origins: &[[f32; 3]], directions: &[[f32; 3]], bounds: &Aabb) -> Vec<u32> {
    let cells = (1_u32 << CELL_BITS) as f32;
    let scale = std::array::from_fn(|k| cells / (bounds.max[k] - bounds.min[k]));
    let mut keys: Vec<u64> = (0_u32..)
        .zip(origins.iter().zip(directions))
        .map(|(i, (o, d))| u64::from(key(o, d, bounds.min, scale)) << 32 | u64::from(i))
        .collect();
    // Sort by the upper half; the lower half carries the index.
    radsort::sort_by_key(&mut keys, |key| (key >> 32) as u32);
    keys.into_iter().map(|key| key as u32).collect()
}

/// Sort key of a ray: the cell's index along a Morton curve (1966), then the signs of the direction.
#[inline(always)]
fn key(o: &[f32; 3], d: &[f32; 3], low: [f32; 3], scale: [f32; 3]) -> u32 {
    let mut key = 0;
    for k in 0..3 {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "saturates, and NaN becomes 0: any order is correct"
        )]
        let cell = (((o[k] - low[k]) * scale[k]) as u32).min((1 << CELL_BITS) - 1);
        key |= spread(cell) << (3 + k) | u32::from(d[k].is_sign_negative()) << k;
    }
    key
}

/// Inserts two zeros after each bit.
#[inline(always)]
const fn spread(bits: u32) -> u32 {
    let bits = (bits | bits << 8) & 0x0300_f00f;
    let bits = (bits | bits << 4) & 0x030c_30c3;
    (bits | bits << 2) & 0x0924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_spread() {
        for i in 0..6 {
            assert_eq!(spread(1 << i), 1 << (3 * i));
        }
        assert_eq!(spread(0b11_0101), 0b001_001_000_001_000_001);
    }

    fn unit() -> Aabb {
        Aabb {
            min: [0.0; 3],
            max: [1.0; 3],
        }
    }

    /// Points of a cube, each far from the one before it.
    fn points(n: usize) -> Vec<[f32; 3]> {
        let at = |i: usize, step: usize| (i * step % 1009) as f32 / 1009.0;
        (0..n)
            .map(|i| [at(i, 499), at(i, 313), at(i, 701)])
            .collect()
    }

    #[test]
    fn only_many_rays_in_random_order_are_scattered() {
        let random = points(LEAST);
        assert!(scattered(&random, &unit()));
        assert!(!scattered(&random[1..], &unit()), "too few");
        let mut one_after_another = random.clone();
        one_after_another.sort_unstable_by(|a, b| a.partial_cmp(b).unwrap());
        let along_x: Vec<_> = one_after_another.iter().map(|p| [p[0], 0.5, 0.5]).collect();
        assert!(!scattered(&along_x, &unit()));
        assert!(!scattered(&vec![[0.5; 3]; LEAST], &unit()), "of one camera");
        assert!(!scattered(&vec![[f32::NAN; 3]; LEAST], &unit()));
    }

    #[test]
    fn every_thread_has_rays_to_reorder() {
        assert_eq!(window(1 << 22, 1), WINDOW);
        assert_eq!(window(1 << 20, 4), 1 << 18);
        assert_eq!(window((1 << 20) + 1, 4), (1 << 18) + 1);
        assert_eq!(window(LEAST, 64), LEAST);
    }

    #[test]
    fn every_ray_occurs_once_and_neighbours_start_near() {
        let mut origins = points(5000);
        origins[7] = [f32::INFINITY, -f32::INFINITY, f32::NAN];
        let directions: Vec<_> = origins.iter().map(|p| p.map(|x| x - 0.5)).collect();
        let flat = Aabb {
            min: [0.0, 0.0, 0.5],
            max: [1.0, 1.0, 0.5],
        };
        for bounds in [unit(), flat] {
            let order = order(&origins, &directions, &bounds);
            let mut indices = order.clone();
            indices.sort_unstable();
            assert!(indices.into_iter().eq(0..5000));
            // Sum the distances between consecutive origins, which sorting shortens.
            let length = |order: &[u32]| -> f32 {
                let finite = order.iter().filter(|&&i| i != 7);
                let points: Vec<_> = finite.map(|&i| origins[i as usize]).collect();
                let step = |p: &[[f32; 3]]| (p[0][0] - p[1][0]).abs() + (p[0][1] - p[1][1]).abs();
                points.windows(2).map(step).sum()
            };
            let before: Vec<_> = (0..5000).collect();
            assert!(
                length(&order) < 0.3 * length(&before),
                "{} of {}",
                length(&order),
                length(&before)
            );
        }
    }
}
