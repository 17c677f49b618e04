// SPDX-License-Identifier: GPL-3.0-or-later
//! Rows: sixteen rays side by side, a number of each in a vector.

use super::super::ray::Ray;
use super::place;
use fearless_simd::{Bytes, Simd, SimdBase, SimdMask, f32x4, f32x16, mask32x16, u32x16};

/// Rays side by side.
pub const LANES: usize = 16;

/// One number for each ray of a row.
pub type Row = [f32; LANES];

/// The same number for all.
#[inline(always)]
pub fn splat<S: Simd>(simd: S, x: f32) -> f32x16<S> {
    f32x16::splat(simd, x)
}

/// A row as a vector.
#[inline(always)]
pub fn load<S: Simd>(simd: S, row: &Row) -> f32x16<S> {
    f32x16::from_slice(simd, row)
}

/// The lanes of a mask.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "there are 16 lanes")]
pub fn bits<S: Simd>(mask: mask32x16<S>) -> u16 {
    mask.to_bitmask() as u16
}

/// The lanes in which two vectors have the same bits.
#[inline(always)]
pub fn alike<S: Simd>(a: f32x16<S>, b: f32x16<S>) -> u16 {
    bits(a.bitcast::<u32x16<S>>().simd_eq(b.bitcast::<u32x16<S>>()))
}

/// The numbers of sixteen rays, one of each in a vector.
pub struct Numbers<S: Simd> {
    /// Origins, per axis.
    pub o: [f32x16<S>; 3],
    /// Directions, per axis.
    pub d: [f32x16<S>; 3],
    /// Where the rays begin to count.
    pub t_min: f32x16<S>,
    /// Where they end.
    pub t_max: f32x16<S>,
}

impl<S: Simd> Numbers<S> {
    /// Of the rays of a row of a tile that is full.
    #[inline(always)]
    pub fn of_row(simd: S, rays: &[Ray], row: usize) -> Self {
        let mut places = [0; LANES];
        for (lane, own) in places.iter_mut().enumerate() {
            *own = place(row, lane);
        }
        Self::at(simd, rays, &places)
    }

    /// Of the rays at these places.
    #[inline(always)]
    pub fn at(simd: S, rays: &[Ray], places: &[usize; LANES]) -> Self {
        let a = four(simd, rays, [places[0], places[1], places[2], places[3]]);
        let b = four(simd, rays, [places[4], places[5], places[6], places[7]]);
        let c = four(simd, rays, [places[8], places[9], places[10], places[11]]);
        let d = four(simd, rays, [places[12], places[13], places[14], places[15]]);
        let mut all = [splat(simd, 0.0); 8];
        for (i, all) in all.iter_mut().enumerate() {
            *all = simd.combine_f32x8(
                simd.combine_f32x4(a[i], b[i]),
                simd.combine_f32x4(c[i], d[i]),
            );
        }
        let [ox, oy, oz, dx, dy, dz, t_min, t_max] = all;
        Self {
            o: [ox, oy, oz],
            d: [dx, dy, dz],
            t_min,
            t_max,
        }
    }
}

/// The eight numbers of each of four rays.
#[inline(always)]
fn four<S: Simd>(simd: S, rays: &[Ray], [a, b, c, d]: [usize; 4]) -> [f32x4<S>; 8] {
    let (a, b, c, d) = (&rays[a], &rays[b], &rays[c], &rays[d]);
    let begins = [
        begin(simd, a),
        begin(simd, b),
        begin(simd, c),
        begin(simd, d),
    ];
    let ends = [end(simd, a), end(simd, b), end(simd, c), end(simd, d)];
    let [ox, oy, oz, dx] = transposed(simd, begins);
    let [dy, dz, t_min, t_max] = transposed(simd, ends);
    [ox, oy, oz, dx, dy, dz, t_min, t_max]
}

/// The first four numbers of a ray, which lie side by side.
#[inline(always)]
fn begin<S: Simd>(simd: S, ray: &Ray) -> f32x4<S> {
    f32x4::from_slice(simd, &[ray.o[0], ray.o[1], ray.o[2], ray.d[0]])
}

/// The last four.
#[inline(always)]
fn end<S: Simd>(simd: S, ray: &Ray) -> f32x4<S> {
    f32x4::from_slice(simd, &[ray.d[1], ray.d[2], ray.t_min, ray.t_max])
}

#[inline(always)]
fn transposed<S: Simd>(simd: S, [a, b, c, d]: [f32x4<S>; 4]) -> [f32x4<S>; 4] {
    let (even, odd) = (simd.zip_low_f32x4(a, c), simd.zip_low_f32x4(b, d));
    let (even_high, odd_high) = (simd.zip_high_f32x4(a, c), simd.zip_high_f32x4(b, d));
    [
        simd.zip_low_f32x4(even, odd),
        simd.zip_high_f32x4(even, odd),
        simd.zip_low_f32x4(even_high, odd_high),
        simd.zip_high_f32x4(even_high, odd_high),
    ]
}
