// SPDX-License-Identifier: GPL-3.0-or-later
//! Shafts: the segments of a beam as a whole, from a box around their starts to a box around their ends.
//!
//! At a fraction `s` of their length all segments lie in the box interpolated between the two at `s` (the
//! interval rays of Boulos, Wald and Shirley 2006; Haines and Wallace 1991 cull with the convex hull, which is
//! the same for a pyramid along an axis). A box that meets the interpolated box at no `s` is met by no segment.
//! The test takes six comparisons of `s` for eight boxes at a time.

use fearless_simd::{Select, Simd, SimdBase, SimdMask, f32x8};
use halfspace_geom::vec3::map;
use halfspace_ray::frame::U;

/// One face of the interpolated box, moving linearly with `s`: it passes coordinate `c` at
/// `s = (c - base) inv`.
#[derive(Clone, Copy)]
struct Wall {
    base: f32,
    inv: f32,
    /// Whether that passing ends the overlap with the box, which bounds `s` from above; otherwise it begins the
    /// overlap.
    closes: bool,
}

/// All points between two boxes.
pub struct Shaft {
    /// Per axis the lower face, which must not have passed a box's upper face, and the upper face, which must
    /// have reached its lower face.
    walls: [[Wall; 2]; 3],
}

/// An axis-aligned box, as smallest and largest coordinates.
#[derive(Debug, Clone, Copy)]
pub struct Extent {
    /// Smallest coordinates.
    pub low: [f32; 3],
    /// Largest coordinates.
    pub high: [f32; 3],
}

impl Extent {
    /// The empty box.
    pub const NOTHING: Self = Self {
        low: [f32::INFINITY; 3],
        high: [f32::NEG_INFINITY; 3],
    };

    /// Extends the box to contain a point.
    #[inline(always)]
    pub fn add(&mut self, p: [f32; 3]) {
        for (k, x) in p.into_iter().enumerate() {
            self.low[k] = self.low[k].min(x);
            self.high[k] = self.high[k].max(x);
        }
    }
}

impl Shaft {
    /// The shaft from one box to another, whose coordinates may be off by `pad`, against boxes whose
    /// coordinates are at most `magnitude`.
    ///
    /// Two differences, a reciprocal and a product put `s` off by 4 u of itself. That moves the face by
    /// `4 u |c - base|`, at most 8 u of the largest coordinate. Two of these are compared: 32 u cover both, and the
    /// rounding of the faces.
    #[inline(always)]
    pub fn new(from: &Extent, to: &Extent, pad: f32, magnitude: f32) -> Self {
        let mut largest = magnitude;
        for k in 0..3 {
            for x in [from.low[k], from.high[k], to.low[k], to.high[k]] {
                largest = largest.max(x.abs());
            }
        }
        let pad = 2.0 * pad + 32.0 * U * largest + f32::MIN_POSITIVE;
        let wall = |from: f32, to: f32, closes: bool| {
            let slope = to - from;
            Wall {
                base: from,
                inv: 1.0 / slope,
                closes: slope.is_sign_positive() == closes,
            }
        };
        Self {
            walls: map([0, 1, 2], |k: usize| {
                [
                    wall(from.low[k] - pad, to.low[k] - pad, true),
                    wall(from.high[k] + pad, to.high[k] + pad, false),
                ]
            }),
        }
    }

    /// Mask of those of eight boxes that some segment may meet.
    #[inline(always)]
    pub fn meets<S: Simd>(&self, simd: S, low: &[f32x8<S>; 3], high: &[f32x8<S>; 3]) -> u64 {
        let mut after = f32x8::splat(simd, 0.0);
        let mut before = f32x8::splat(simd, 1.0);
        for k in 0..3 {
            for (wall, face) in self.walls[k].iter().zip([high[k], low[k]]) {
                let share = (face - f32x8::splat(simd, wall.base)) * f32x8::splat(simd, wall.inv);
                // Ignore NaN, which results for a face at rest in the box's own face.
                if wall.closes {
                    before = share.simd_lt(before).select(share, before);
                } else {
                    after = share.simd_gt(after).select(share, after);
                }
            }
        }
        after.simd_le(before).to_bitmask() & 0xff
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch};
    use proptest::prelude::*;

    fn coordinate() -> impl Strategy<Value = f32> {
        prop_oneof![(-4i8..4).prop_map(f32::from), -1.0f32..1.0, -1e-3f32..1e-3]
    }

    fn point() -> impl Strategy<Value = [f32; 3]> {
        [coordinate(), coordinate(), coordinate()]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]
        #[test]
        fn a_box_with_a_point_of_a_segment_is_met(
            segments in prop::collection::vec((point(), point()), 1..6),
            pick in any::<prop::sample::Index>(), at in 0.0f32..1.0, size in point(),
        ) {
            let (mut from, mut to) = (Extent::NOTHING, Extent::NOTHING);
            for (start, end) in &segments {
                from.add(*start);
                to.add(*end);
            }
            // A box that contains a point of one of the segments must be met.
            let shaft = Shaft::new(&from, &to, 0.0, 8.0);
            let (start, end) = segments[pick.index(segments.len())];
            let inside: [f32; 3] = map([0, 1, 2], |k: usize| start[k] * (1.0 - at) + end[k] * at);
            // The point is a corner of the box.
            let mut cell = Extent::NOTHING;
            cell.add(inside);
            cell.add(map([0, 1, 2], |k: usize| inside[k] + size[k]));
            prop_assert!(meets(&shaft, &cell));
        }
    }

    fn meets(shaft: &Shaft, cell: &Extent) -> bool {
        dispatch!(Level::new(), simd => {
            let splat = |p: [f32; 3]| [
                f32x8::splat(simd, p[0]), f32x8::splat(simd, p[1]), f32x8::splat(simd, p[2]),
            ];
            shaft.meets(simd, &splat(cell.low), &splat(cell.high)) == 0xff
        })
    }

    #[test]
    fn boxes_beside_the_shaft_are_not_met() {
        let point = |p: [f32; 3]| {
            let mut extent = Extent::NOTHING;
            extent.add(p);
            extent
        };
        let mut to = point([4.0, -1.0, 1.0]);
        to.add([4.0, 1.0, 3.0]);
        let shaft = Shaft::new(&point([0.0; 3]), &to, 0.0, 4.0);
        assert!(meets(&shaft, &point([2.0, 0.4, 1.0])));
        for aside in [
            [2.0, 0.6, 1.0],
            [2.0, 0.0, 0.4],
            [-0.1, 0.0, 0.0],
            [4.1, 0.0, 2.0],
        ] {
            assert!(!meets(&shaft, &point(aside)), "{aside:?}");
        }
    }
}
