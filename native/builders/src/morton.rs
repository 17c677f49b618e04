// SPDX-License-Identifier: GPL-3.0-or-later
//! Objects in the order of the Z-order curve (Morton 1966) through the box of their centres.

use crate::object::Object;
use halfspace_geom::Aabb;
use rayon::prelude::*;

/// Number of bits of a code: 21 for each axis.
pub const BITS: u32 = 63;

/// Largest coordinate of the curve along an axis.
const LAST_CELL: f32 = 2_097_151.0;

/// Objects that one task moves (chosen).
const PART: usize = 1 << 12;

/// Returns the codes of the objects in ascending order, and the objects in this order, those of equal codes as given.
/// Bit `BITS - 1 - i` of a code belongs to axis `i % 3`.
pub fn sort(objects: &[Object]) -> (Vec<u64>, Vec<Object>) {
    let centre = |object: &Object| [0, 1, 2].map(|k| object.centre(k));
    let join = |a: Aabb, b: Aabb| a.union(&b);
    let points = objects.par_iter().with_min_len(PART).map(|object| {
        let at = centre(object);
        Aabb { min: at, max: at }
    });
    let centres = points.reduce(|| Aabb::EMPTY, join);
    // Cells are cubes: the widest axis has all of them.
    let widest = (0..3)
        .map(|k| centres.max[k] - centres.min[k])
        .fold(0.0, f32::max);
    let scale = LAST_CELL / widest.max(f32::MIN_POSITIVE);
    let code = |object: &Object| {
        let at = centre(object);
        (0..3).fold(0_u64, |code, k| {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "21 bits"
            )]
            let cell = ((at[k] - centres.min[k]) * scale).clamp(0.0, LAST_CELL) as u64;
            code << 1 | spread(cell)
        })
    };
    let pairs = objects.par_iter().enumerate().with_min_len(PART);
    #[expect(clippy::cast_possible_truncation, reason = "fewer than 2^31 objects")]
    let mut order: Vec<_> = pairs.map(|(i, object)| (code(object), i as u32)).collect();
    order.par_sort_unstable();
    let sorted = order.par_iter().with_min_len(PART);
    sorted.map(|&(code, i)| (code, objects[i as usize])).unzip()
}

/// Moves 21 bits apart, so that two others fit between any two.
fn spread(bits: u64) -> u64 {
    let masks = [
        (32, 0x001f_0000_0000_ffff),
        (16, 0x001f_0000_ff00_00ff),
        (8, 0x100f_00f0_0f00_f00f),
        (4, 0x10c3_0c30_c30c_30c3),
        (2, 0x1249_2492_4924_9249),
    ];
    masks
        .iter()
        .fold(bits, |bits, (shift, mask)| (bits | bits << shift) & mask)
}
