// SPDX-License-Identifier: GPL-3.0-or-later
//! Sixteen rays in structure-of-arrays layout, one vector per quantity.

use crate::tile::ray_index;
use fearless_simd::{Bytes, Simd, SimdBase, f32x4, f32x16, mask32x16, u32x16};
use halfspace_ray::Ray;
use halfspace_ray::columns::transposed;
use halfspace_ray::frame::ToFrame;
use halfspace_trace::row::{LANES, bits, splat};

/// Mask of the lanes in which two vectors are bitwise equal.
#[inline(always)]
pub fn bitwise_equal<S: Simd>(a: f32x16<S>, b: f32x16<S>) -> u16 {
    bits(a.bitcast::<u32x16<S>>().simd_eq(b.bitcast::<u32x16<S>>()))
}

/// Four rays, of the places from `first` on, by columns. A function, since a closure may be compiled apart from its
/// caller, without the caller's instructions.
#[inline(always)]
fn quarter<S: Simd>(simd: S, rays: &[Ray], places: &[usize; LANES], first: usize) -> [f32x4<S>; 8] {
    let [a, b, c, d] = std::array::from_fn(|lane| &rays[places[first + lane]]);
    transposed(simd, [a, b, c, d])
}

/// The quantities of sixteen rays, one vector each.
pub struct Numbers<S: Simd> {
    /// Origins, per axis.
    pub o: [f32x16<S>; 3],
    /// Directions, per axis.
    pub d: [f32x16<S>; 3],
    /// Smallest distances of hits.
    pub t_min: f32x16<S>,
    /// Largest distances of hits.
    pub t_max: f32x16<S>,
}

impl<S: Simd> Numbers<S> {
    /// Loads the rays of a row of a full tile.
    #[inline(always)]
    pub fn of_row(simd: S, rays: &[Ray], row: usize) -> Self {
        let mut places = [0; LANES];
        for (lane, own) in places.iter_mut().enumerate() {
            *own = ray_index(row, lane);
        }
        Self::at(simd, rays, &places)
    }

    /// Loads the rays with these indices.
    #[inline(always)]
    pub fn at(simd: S, rays: &[Ray], places: &[usize; LANES]) -> Self {
        // Transpose four rays at a time, then join the quarters.
        let (a, b) = (
            quarter(simd, rays, places, 0),
            quarter(simd, rays, places, 4),
        );
        let (c, d) = (
            quarter(simd, rays, places, 8),
            quarter(simd, rays, places, 12),
        );
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

    /// Converts the origins to a frame, which must be unscaled; returns the mask of those that it does not round.
    #[inline(always)]
    pub fn translate(&mut self, simd: S, to_frame: &ToFrame) -> mask32x16<S> {
        let (origin, exact) = (to_frame.origin(), to_frame.exact());
        self.o = [
            self.o[0] - splat(simd, origin[0]),
            self.o[1] - splat(simd, origin[1]),
            self.o[2] - splat(simd, origin[2]),
        ];
        self.o[0].abs().simd_le(splat(simd, exact[0]))
            & self.o[1].abs().simd_le(splat(simd, exact[1]))
            & self.o[2].abs().simd_le(splat(simd, exact[2]))
    }
}
