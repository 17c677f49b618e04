// SPDX-License-Identifier: GPL-3.0-or-later
//! Lines in the plane of directions: the rays that cross two planes of the grid at the same distance.
//!
//! A ray with speeds `m >= 0` along the axes, in the order of its octant, reaches plane `k` at the distance `a[k] /
//! m[k]`, where `a[k]` is the offset of the plane from the common origin. The plane across `x` comes first if `a[x] m[y]
//! <= a[y] m[x]`. Offsets and speeds are f32, so both products are exact in f64, and so is the comparison. Distances of
//! several planes are therefore ordered without contradiction.

use fearless_simd::{Simd, SimdBase, SimdFloat, SimdMask, f32x8};
use halfspace_ray::frame::U;

/// Tolerance of the height of a corner over a line, relative to the offsets. Derived: a height has a rounding error of
/// less than 8 units of f64 in the offsets; a polygon larger by this factor moves a ray by less than 1e-10 of the
/// scene's size, and leaves contain what is within 1e-6 of it.
const TOLERANCE: f64 = 1e-11;

/// The rays that cross two planes at the same distance.
#[derive(Debug, Clone, Copy, Default)]
pub struct Line {
    /// The axes of both planes, ascending.
    axes: [u8; 2],
    /// Offsets of the planes from the origin.
    ahead: [f32; 2],
}

/// A plane across an axis, by its offset from the origin.
#[derive(Debug, Clone, Copy)]
pub struct Ahead {
    /// The axis.
    pub axis: usize,
    /// The offset along the rays of the octant.
    pub offset: f32,
}

/// One side of a line.
#[derive(Debug, Clone, Copy, Default)]
pub struct Side {
    /// The line.
    pub line: Line,
    /// Whether these are the rays that cross the plane of the lower axis first, or at the same distance; else those that
    /// cross it later.
    pub lower_first: bool,
}

impl Line {
    /// The line of two planes across different axes, and whether the plane `one` is the first of it.
    #[inline(always)]
    pub fn new(one: Ahead, other: Ahead) -> (Self, bool) {
        #[expect(clippy::cast_possible_truncation, reason = "0 to 2")]
        let line = |a: Ahead, b: Ahead| Self {
            axes: [a.axis as u8, b.axis as u8],
            ahead: [a.offset, b.offset],
        };
        if one.axis < other.axis {
            (line(one, other), true)
        } else {
            (line(other, one), false)
        }
    }

    /// The side of the rays that cross the plane `one` before the plane `other`.
    #[inline(always)]
    pub fn first(one: Ahead, other: Ahead) -> Side {
        let (line, lower_first) = Self::new(one, other);
        Side { line, lower_first }
    }

    /// Coefficients of the height over the line, for directions whose components `[p, q, 1 - p - q]` add up to 1: those
    /// of `p` and `q`, and the constant. A height above 0 means that the plane of the lower axis comes later.
    #[inline(always)]
    pub fn coefficients(&self) -> [f64; 3] {
        let mut by = [0.0; 3];
        by[usize::from(self.axes[1] % 3)] += f64::from(self.ahead[0]);
        by[usize::from(self.axes[0] % 3)] -= f64::from(self.ahead[1]);
        [by[0] - by[2], by[1] - by[2], by[2]]
    }

    /// Heights up to this count as on the line.
    #[inline(always)]
    pub fn tolerance(&self) -> f64 {
        TOLERANCE * (f64::from(self.ahead[0].abs()) + f64::from(self.ahead[1].abs()))
    }

    /// Whether a ray with these speeds crosses the plane of the lower axis first; exact.
    #[inline(always)]
    pub fn lower_is_first(&self, m: [f32; 3]) -> bool {
        let [x, y] = self.axes.map(|axis| f64::from(m[usize::from(axis % 3)]));
        f64::from(self.ahead[0]) * y <= f64::from(self.ahead[1]) * x
    }
}

impl Side {
    /// The other side of the line.
    #[inline(always)]
    pub fn opposite(self) -> Self {
        Self {
            lower_first: !self.lower_first,
            ..self
        }
    }

    /// Whether a ray with these speeds is on this side; exact, so that it is on exactly one.
    #[inline(always)]
    pub fn holds(&self, m: [f32; 3]) -> bool {
        self.line.lower_is_first(m) == self.lower_first
    }

    /// The masks of those of eight rays that are on this side, and of those for which f32 cannot decide. Speeds are
    /// below 2, so that a height has an error of less than 8 u in the offsets.
    #[inline(always)]
    pub fn sort<S: Simd>(&self, simd: S, m: &[f32x8<S>; 3]) -> [u64; 2] {
        let splat = |x: f32| f32x8::splat(simd, x);
        let [a, b] = self.line.ahead;
        let [x, y] = self.line.axes.map(|axis| m[usize::from(axis % 3)]);
        let height = y.mul_sub(splat(a), x * splat(b));
        let error = splat(8.0 * U * (a.abs() + b.abs()) + f32::MIN_POSITIVE);
        let below = height.simd_lt(-error).to_bitmask() & 0xff;
        let above = height.simd_gt(error).to_bitmask() & 0xff;
        let inside = if self.lower_first { below } else { above };
        [inside, !(below | above) & 0xff]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch};

    #[test]
    fn eight_rays_are_sorted_as_one() {
        let mut state = 1_u32;
        let mut number = |range: f32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32 * range
        };
        let mut undecided = 0;
        for round in 0..20_000 {
            let offset = |axis, x: f32| Ahead { axis, offset: x };
            let (a, b) = (number(4.0) - 2.0, number(4.0) - 2.0);
            let (one, other) = (offset(round % 3, a), offset((round + 1) % 3, b));
            let side = Line::first(one, other);
            let mut m: [f32; 3] = std::array::from_fn(|_| number(2.0));
            // Half of the rays pass as close by the edge as they can.
            if round % 2 == 0 && a > 0.0 && b > 0.0 {
                m[other.axis] = (b / a * m[one.axis]).min(1.99);
            }
            let [inside, unsure] = dispatch!(Level::new(), simd => {
                side.sort(simd, &m.map(|x| f32x8::splat(simd, x)))
            });
            assert_ne!(side.holds(m), side.opposite().holds(m));
            assert!(inside == 0 || inside == 0xff);
            undecided += usize::from(unsure != 0);
            assert!(
                unsure != 0 || (inside != 0) == side.holds(m),
                "{side:?} {m:?}"
            );
        }
        assert!((1_000..12_000).contains(&undecided), "{undecided}");
    }
}
