// SPDX-License-Identifier: GPL-3.0-or-later
//! Lines in the plane of polygons: the rays that cross two planes of the grid at the same distance.
//!
//! A ray at `r` with speeds `m >= 0` along the axes, in the order of its octant, reaches plane `k` at the distance
//! `(a[k] - r[k]) / m[k]`, where `a[k]` is the offset of the plane. The plane across `x` comes first if
//! `(a[x] - r[x]) m[y] <= (a[y] - r[y]) m[x]`. Either all `r` are 0, or differences have at most 26 bits and `m` has 24:
//! both products are exact in f64, and so is the comparison. A ray along a plane in which it lies crosses it last of all.
//! Distances of several planes are therefore ordered without contradiction.

use crate::form::Form;
use fearless_simd::{Simd, SimdBase, SimdFloat, SimdMask, f32x8};
use halfspace_ray::frame::U;

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

    /// The axes of both planes, ascending.
    #[inline(always)]
    pub fn axes(&self) -> [usize; 2] {
        self.axes.map(|axis| usize::from(axis % 3))
    }

    /// Offsets of both planes.
    #[inline(always)]
    pub fn ahead(&self) -> [f64; 2] {
        self.ahead.map(f64::from)
    }

    /// Whether a ray with this way crosses the plane of the lower axis first; exact.
    #[inline(always)]
    pub fn lower_is_first<F: Form>(&self, form: &F, way: [f32; 3]) -> bool {
        let ([x, y], [a, b]) = (self.axes(), self.ahead());
        let [r, m] = form.parts(way.map(f64::from), f64::from);
        let (one, other) = ((a - r[x]) * m[y], (b - r[y]) * m[x]);
        // Equal products without a speed are those of a ray that lies in the plane of the lower axis.
        one < other || (one == other && m[x] > 0.0)
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

    /// Whether a ray with this way is on this side; exact, so that it is on exactly one.
    #[inline(always)]
    pub fn holds<F: Form>(&self, form: &F, way: [f32; 3]) -> bool {
        self.line.lower_is_first(form, way) == self.lower_first
    }

    /// The masks of those of eight rays that are on this side, and of those for which f32 cannot decide. Speeds are
    /// below 2, so that a height has an error of less than 8 u in the offsets.
    #[inline(always)]
    pub fn sort<S: Simd, F: Form>(&self, simd: S, form: &F, way: &[f32x8<S>; 3]) -> [u64; 2] {
        let splat = |x: f32| f32x8::splat(simd, x);
        let ([x, y], [a, b]) = (self.line.axes(), self.line.ahead);
        let [r, m] = form.parts(*way, splat);
        let height = m[y].mul_sub(splat(a) - r[x], m[x] * (splat(b) - r[y]));
        let size = a.abs() + b.abs() + 2.0 * F::REACH;
        let error = splat(8.0 * U * size + f32::MIN_POSITIVE);
        let below = height.simd_lt(-error).to_bitmask() & 0xff;
        let above = height.simd_gt(error).to_bitmask() & 0xff;
        let inside = if self.lower_first { below } else { above };
        [inside, !(below | above) & 0xff]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::form::{Eye, Parallel};
    use crate::tests::{Random, small_triangles, tree_over};
    use fearless_simd::{Level, dispatch};
    use halfspace_ray::frame::Frame;

    /// Sorts random rays by random lines, half of them as close by the edge as they can pass.
    fn sort_rays<F: Form>(form: &F) {
        let mut random = Random(1);
        let mut undecided = 0;
        for round in 0..20_000 {
            let offset = |axis, x: f32| Ahead { axis, offset: x };
            let (a, b) = (2.0 * random.number(), 2.0 * random.number());
            let (one, other) = (offset(round % 3, a), offset((round + 1) % 3, b));
            let side = Line::first(one, other);
            // Places have few bits, speeds are not negative.
            let mut way = random.point();
            if F::REACH == 0.0 {
                way = way.map(|x| x.abs() * 2.0);
            }
            if round % 2 == 0 {
                let [r, m] = form.parts(way, |x| x);
                let (x, y) = (one.axis, other.axis);
                if F::REACH == 0.0 && a > 0.0 && b > 0.0 {
                    way[y] = (b / a * way[x]).min(1.99);
                } else if F::REACH != 0.0 {
                    let fine = 16_777_216.0;
                    let beside = a - (b - r[y]) * m[x] / m[y];
                    way[x] = (beside.clamp(-1.0, 1.0) * fine).round() / fine;
                }
            }
            let [inside, unsure] = dispatch!(Level::new(), simd => {
                side.sort(simd, form, &way.map(|x| f32x8::splat(simd, x)))
            });
            assert_ne!(side.holds(form, way), side.opposite().holds(form, way));
            assert!(inside == 0 || inside == 0xff);
            undecided += usize::from(unsure != 0);
            let sorted = (inside != 0) == side.holds(form, way);
            assert!(unsure != 0 || sorted, "{side:?} {way:?}");
        }
        assert!((1_000..12_000).contains(&undecided), "{undecided}");
    }

    #[test]
    fn eight_rays_are_sorted_as_one() {
        sort_rays(&Eye([0.0; 3]));
        let scene = small_triangles(&mut Random(2), 9);
        let frame = Frame::new(scene.bounds());
        let (tree, _) = tree_over(&scene, &frame);
        for d in [[0.3, -0.7, 0.4], [1.0, 0.9, -1.1], [-0.01, 0.02, 0.9]] {
            sort_rays(&Parallel::new(&tree, &frame, d, false).unwrap());
        }
    }

    #[test]
    fn a_ray_within_a_plane_crosses_it_last() {
        let plane = |axis, offset| Ahead { axis, offset };
        for axis in 0..3 {
            let mut way = [1.0; 3];
            way[axis] = 0.0;
            let others = [(axis + 1) % 3, (axis + 2) % 3];
            for other in others {
                let own = Line::first(plane(axis, 0.0), plane(other, 0.5));
                assert!(!own.holds(&Eye([0.0; 3]), way), "{axis} {other}");
            }
        }
    }
}
