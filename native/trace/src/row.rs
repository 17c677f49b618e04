// SPDX-License-Identifier: GPL-3.0-or-later
//! Rows: sixteen numbers, one per ray, which vectors of f32 take at once.

use fearless_simd::{Simd, SimdBase, SimdMask, f32x16, mask32x16};

/// Number of rays of a row.
pub const LANES: usize = 16;

/// One number of each ray of a row.
pub type Row = [f32; LANES];

/// A vector of equal numbers.
#[inline(always)]
pub fn splat<S: Simd>(simd: S, x: f32) -> f32x16<S> {
    f32x16::splat(simd, x)
}

/// Loads a row as a vector.
#[inline(always)]
pub fn load<S: Simd>(simd: S, row: &Row) -> f32x16<S> {
    f32x16::from_slice(simd, row)
}

/// The bits of a mask.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "there are 16 lanes")]
pub fn bits<S: Simd>(mask: mask32x16<S>) -> u16 {
    mask.to_bitmask() as u16
}
