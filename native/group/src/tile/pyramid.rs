// SPDX-License-Identifier: GPL-3.0-or-later
//! The pyramid that contains the directions of a tile, and the part of it that contains each row's: a triangle
//! is tested against the whole pyramid first, then against the part of each row.
//!
//! In the plane at height 1 along the common axis of the rays, directions are points, the pyramid is a
//! parallelogram with the sides of the tile, and each row lies in a smaller parallelogram with parallel sides.
//! A dot product with a direction is affine there: if it is negative at the corners, it is negative inside.

use crate::tile::{LANES, Tile, load, row_and_lane, splat};
use fearless_simd::{Select, Simd, SimdBase, SimdMask, f32x16, mask32x16};

/// The directions of a tile of `R` rows, bounded.
#[derive(Debug, Clone, Copy)]
pub struct Pyramid<const R: usize> {
    /// Four directions: the parallelogram's origin, the ends of two sides, and the opposite corner. Components
    /// are below 2.
    pub corners: [[f32; 3]; 4],
    /// Centre of each row's part, as fractions of the two sides.
    pub middle: [[f32; R]; 2],
    /// Half extent of each row's part, in the same units.
    pub half: [[f32; R]; 2],
    /// Largest ratio of the length of a row's directions to that of the same directions on the parallelogram.
    pub stretch: [f32; R],
}

/// Error bound of the fractions of a side, added to each half extent.
const PART_ERROR: f32 = 1e-5;

impl<const R: usize> Pyramid<R> {
    /// The pyramid around the active rays of a tile whose directions have these ranges; `None` if they spread
    /// too far.
    #[inline(always)]
    pub fn new<S: Simd>(simd: S, tile: &Tile<R>, ranges: [(f32, f32); 3]) -> Option<Self> {
        // Slopes stay below 8, and their error below 2^-20.
        let advance = |k: usize| ranges[k].0.max(-ranges[k].1);
        let axis = (0..3).fold(0, |a, b| if advance(b) > advance(a) { b } else { a });
        if advance(axis) < 0.25 {
            return None;
        }
        let sides = Sides::new(tile, axis)?;
        let rows = Rows::new(simd, tile, &sides);
        let range = [rows.range(0, &sides), rows.range(1, &sides)];
        let sign = 1.0_f32.copysign(ranges[axis].0 + ranges[axis].1);
        let (corners, scale) = sides.corners(range, sign)?;
        let mut pyramid = Self {
            corners,
            middle: [[0.0; R]; 2],
            half: [[0.0; R]; 2],
            stretch: [1.0; R],
        };
        // Convert each row's bounds to fractions of the sides.
        for (n, (from, to, pad)) in range.into_iter().enumerate() {
            let inverse = 1.0 / (to - from);
            for row in 0..R {
                // Rows without rays get infinite bounds, which are never read.
                let first = (rows.low[n][row] - pad - from) * inverse;
                let last = (rows.high[n][row] + pad - from) * inverse;
                pyramid.middle[n][row] = 0.5 * (first + last);
                pyramid.half[n][row] = 0.5 * (last - first) + PART_ERROR;
            }
        }
        for (row, stretch) in pyramid.stretch.iter_mut().enumerate() {
            if tile.active[row] != 0 {
                *stretch = rows.tallest[row] / scale * (1.0 + PART_ERROR);
            }
        }
        Some(pyramid)
    }
}

/// Affine coordinates in the plane at height 1 along an axis: an origin and two sides.
struct Sides {
    axis: usize,
    /// The two other axes, the coordinates in the plane.
    others: [usize; 2],
    origin: [f32; 2],
    e1: [f32; 2],
    e2: [f32; 2],
    /// Signed area of the parallelogram of the sides.
    area: f32,
}

impl Sides {
    /// The sides of a full tile; unit sides for a partial tile, and for one whose own sides are too unequal or too
    /// parallel. `None` if no ray is active.
    #[inline(always)]
    fn new<const R: usize>(tile: &Tile<R>, axis: usize) -> Option<Self> {
        let [i, j] = [(axis + 1) % 3, (axis + 2) % 3];
        let first = (0..R * LANES).find(|&ray| {
            let (row, lane) = row_and_lane(ray);
            tile.active[row] >> lane & 1 == 1
        })?;
        let axes = [axis, i, j];
        let origin = slopes(tile, axes, first);
        let (mut e1, mut e2) = ([1.0, 0.0], [0.0, 1.0]);
        let mut area: f32 = 1.0;
        if tile.active.iter().all(|&row| row == u16::MAX) {
            // Use two distant rays: in a tile of 64, the ends of the first row of pixels and of the first column.
            let right = less(slopes(tile, axes, R * LANES - 57), origin);
            let down = less(slopes(tile, axes, 56), origin);
            let (w, h) = (length(right), length(down));
            let cross = right[0] * down[1] - right[1] * down[0];
            if cross.abs() > 0.1 * w * h && w < 16.0 * h && h < 16.0 * w {
                (e1, e2, area) = (right, down, cross);
            }
        }
        Some(Self {
            axis,
            others: [i, j],
            origin,
            e1,
            e2,
            area,
        })
    }

    /// The four directions to the ends of these ranges of the sides, with `sign` along the axis, and the scale
    /// they were multiplied by; `None` if they are too steep.
    #[inline(always)]
    fn corners(
        &self,
        [(a0, a1, _), (b0, b1, _)]: [(f32, f32, f32); 2],
        sign: f32,
    ) -> Option<([[f32; 3]; 4], f32)> {
        let [i, j] = self.others;
        let mut steepest = 0.0_f32;
        let mut corners = [[0.0; 3]; 4];
        for (corner, [a, b]) in (corners.iter_mut()).zip([[a0, b0], [a1, b0], [a0, b1], [a1, b1]]) {
            let (u, v) = (self.e1, self.e2);
            let at = [
                self.origin[0] + a * u[0] + b * v[0],
                self.origin[1] + a * u[1] + b * v[1],
            ];
            (corner[self.axis], corner[i], corner[j]) = (sign, sign * at[0], sign * at[1]);
            steepest = steepest.max(at[0].abs()).max(at[1].abs());
        }
        // Error bounds need components below 2.
        let scale = match steepest {
            x if x < 1.75 => 1.0,
            x if x < 7.0 => 0.25,
            x if x < 28.0 => 0.0625,
            _ => return None,
        };
        for corner in &mut corners {
            for x in corner {
                *x *= scale;
            }
        }
        Some((corners, scale))
    }
}

/// Slopes of a ray of a tile: its components along two axes divided by that along the first one.
#[inline(always)]
fn slopes<const R: usize>(tile: &Tile<R>, [axis, i, j]: [usize; 3], ray: usize) -> [f32; 2] {
    let (row, lane) = row_and_lane(ray);
    let d = &tile.d[row];
    [d[i][lane] / d[axis][lane], d[j][lane] / d[axis][lane]]
}

#[inline(always)]
fn less(a: [f32; 2], b: [f32; 2]) -> [f32; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

/// Bounds of the rays of each row, as fractions of the two sides.
struct Rows<const R: usize> {
    low: [[f32; R]; 2],
    high: [[f32; R]; 2],
    /// Largest component along the axis.
    tallest: [f32; R],
}

impl<const R: usize> Rows<R> {
    #[inline(always)]
    fn new<S: Simd>(simd: S, tile: &Tile<R>, sides: &Sides) -> Self {
        let Sides {
            axis,
            others: [i, j],
            origin,
            e1,
            e2,
            area,
        } = *sides;
        let inverse = splat(simd, 1.0 / area);
        let mut rows = Self {
            low: [[f32::INFINITY; R]; 2],
            high: [[f32::NEG_INFINITY; R]; 2],
            tallest: [0.0; R],
        };
        // Solve for the fractions by Cramer's rule, and reduce them over each row.
        for row in 0..R {
            if tile.active[row] == 0 {
                continue;
            }
            let active = mask32x16::from_bitmask(simd, u64::from(tile.active[row]));
            let d = &tile.d[row];
            let advance: f32x16<S> = active.select(load(simd, &d[axis]), splat(simd, 1.0));
            let x = load(simd, &d[i]) / advance - splat(simd, origin[0]);
            let y = load(simd, &d[j]) / advance - splat(simd, origin[1]);
            let parts = [
                (x * splat(simd, e2[1]) - y * splat(simd, e2[0])) * inverse,
                (y * splat(simd, e1[0]) - x * splat(simd, e1[1])) * inverse,
            ];
            for (n, part) in parts.into_iter().enumerate() {
                let below: f32x16<S> = active.select(part, splat(simd, f32::INFINITY));
                let above: f32x16<S> = active.select(part, splat(simd, f32::NEG_INFINITY));
                rows.low[n][row] = below.reduce_min();
                rows.high[n][row] = above.reduce_max();
            }
            rows.tallest[row] = advance.abs().reduce_max();
        }
        rows
    }

    /// The range of fractions of side `n` that contains all rays, and the margin for rounding that it includes.
    #[inline(always)]
    fn range(&self, n: usize, sides: &Sides) -> (f32, f32, f32) {
        // Derived: the roundings of slopes, fractions and corners move the sides by less than 2^-18 in all, and
        // by less than 10^-4 of the tile.
        let other = length([sides.e2, sides.e1][n]);
        let low = self.low[n].iter().copied().fold(f32::INFINITY, f32::min);
        let high = (self.high[n].iter().copied()).fold(f32::NEG_INFINITY, f32::max);
        let pad = 4e-6 * other / sides.area.abs() + 1e-4 * (1.0 + low.abs() + high.abs());
        (low - pad, high + pad, pad)
    }
}

#[inline(always)]
fn length(a: [f32; 2]) -> f32 {
    (a[0] * a[0] + a[1] * a[1]).sqrt()
}
