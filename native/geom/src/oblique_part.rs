// SPDX-License-Identifier: GPL-3.0-or-later
//! Clips a triangle to both sides of an oblique plane, by the polygon clipping of Sutherland and Hodgman 1974.

use crate::Aabb;
use crate::clip_area::HalfSpace;
use crate::vec3::{Vec3, add_scaled, dot, map, sub, widen};

/// An oblique plane, and buffers for clipping triangles.
pub struct Cutter {
    normal: Vec3,
    height: f64,
    /// Distance by which both parts extend beyond the plane: 2^-40 of the scene's largest coordinate, far more than
    /// rounding errors of f64 and far less than those of f32.
    margin: f64,
    /// A piece that extends beyond the plane by at most this distance is not cut.
    little: f64,
    /// The part of the triangle inside the bounds.
    inside: Vec<Vec3>,
    /// The part of `inside` on one side of the plane.
    part: Vec<Vec3>,
    /// Output buffer of [`keep`].
    cut: Vec<Vec3>,
}

impl Cutter {
    /// Makes a cutter for the plane `normal . x = offset` in a scene whose largest absolute coordinate is `magnitude`.
    /// Pieces that extend beyond the plane by at most `little` are not cut.
    pub fn new(normal: [f32; 3], offset: f32, magnitude: f32, little: f32) -> Self {
        Self {
            normal: widen(normal),
            height: f64::from(offset),
            margin: f64::from(magnitude) / (1_u64 << 40) as f64,
            little: f64::from(little),
            inside: Vec::new(),
            part: Vec::new(),
            cut: Vec::new(),
        }
    }

    /// Clips a triangle to `bounds`, and returns the boxes around the parts of this piece below and above the plane;
    /// the box of a missing part is empty. For a piece on one side alone, the box of that side is `bounds` itself.
    pub fn parts(&mut self, triangle: [[f32; 3]; 3], bounds: &Aabb) -> [Aabb; 2] {
        self.inside.clear();
        self.inside.extend(triangle.map(widen));
        let whole = Aabb::of_triangle(triangle);
        // Clip the triangle at the faces of `bounds` that it crosses.
        for k in 0..3 {
            for (sign, end, beyond) in [
                (1.0, bounds.max[k], whole.max[k] > bounds.max[k]),
                (-1.0, bounds.min[k], whole.min[k] < bounds.min[k]),
            ] {
                if beyond {
                    let mut normal = [0.0; 3];
                    normal[k] = sign;
                    let side = HalfSpace {
                        normal,
                        offset: sign * f64::from(end) + self.margin,
                    };
                    keep(&mut self.inside, side, &mut self.cut);
                }
            }
        }
        // Find the extent of the piece along the normal.
        let heights = self
            .inside
            .iter()
            .map(|&p| dot(self.normal, p) - self.height);
        let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
            (low.min(x), high.max(x))
        });
        // Keep the box whole if the piece lies on one side, or nearly so.
        let one_side = high <= self.margin || low >= -self.margin;
        if one_side || high.min(-low) <= self.little {
            return if high <= -low {
                [*bounds, Aabb::EMPTY]
            } else {
                [Aabb::EMPTY, *bounds]
            };
        }
        // Clip the piece to each side, and bound the parts.
        [1.0, -1.0].map(|sign| {
            self.part.clear();
            self.part.extend_from_slice(&self.inside);
            let side = HalfSpace {
                normal: self.normal.map(|x| sign * x),
                offset: sign * self.height + self.margin,
            };
            keep(&mut self.part, side, &mut self.cut);
            hull(&self.part, bounds)
        })
    }
}

/// Keeps the part of a convex polygon inside a half-space; `cut` is a buffer.
fn keep(polygon: &mut Vec<Vec3>, side: HalfSpace, cut: &mut Vec<Vec3>) {
    cut.clear();
    for (i, &a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        let (from, to) = (side.height(a), side.height(b));
        if from <= 0.0 {
            cut.push(a);
        }
        if (from <= 0.0) != (to <= 0.0) {
            cut.push(add_scaled(a, from / (from - to), sub(b, a)));
        }
    }
    std::mem::swap(polygon, cut);
}

/// Returns a box around a polygon within `bounds`, rounded outwards.
#[expect(clippy::cast_possible_truncation, reason = "rounded outwards")]
fn hull(polygon: &[Vec3], bounds: &Aabb) -> Aabb {
    let around = polygon.iter().fold(Aabb::EMPTY, |all, p| Aabb {
        min: map([0, 1, 2], |k: usize| {
            all.min[k].min((p[k] as f32).next_down())
        }),
        max: map([0, 1, 2], |k: usize| {
            all.max[k].max((p[k] as f32).next_up())
        }),
    });
    Aabb {
        min: map([0, 1, 2], |k: usize| around.min[k].max(bounds.min[k])),
        max: map([0, 1, 2], |k: usize| around.max[k].min(bounds.max[k])),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn corner() -> [std::ops::Range<i8>; 3] {
        [-4..5, -4..5, -4..5]
    }

    proptest! {
        // Few random points lie in the bounds, and few planes cut what is there.
        #![proptest_config(ProptestConfig::with_cases(20_000))]
        /// Coordinates, weights and heights have few bits, so that all values are exact.
        #[test]
        fn every_point_of_the_triangle_is_in_the_part_on_its_side(
            v in [corner(), corner(), corner()],
            low in [-4i8..3, -4i8..3, -4i8..3],
            size in [0u8..4, 0u8..4, 0u8..4],
            normal in [-2i8..3, -2i8..3, -2i8..3],
            offset in -16i8..17,
            s in 0u8..9, t in 0u8..9,
        ) {
            let v = v.map(|p| p.map(f32::from));
            let min = low.map(f32::from);
            let max = std::array::from_fn(|k| min[k] + f32::from(size[k]));
            let bounds = Aabb { min, max };
            let normal = normal.map(|x| f32::from(x) / 4.0);
            let offset = f32::from(offset) / 4.0;
            let (s, t) = (f32::from(s) / 8.0, f32::from(t) / 8.0);
            let (u, w) = (s, (1.0 - s) * t);
            let p: [f32; 3] = std::array::from_fn(|k| v[0][k] + u * (v[1][k] - v[0][k]) + w * (v[2][k] - v[0][k]));
            let holds = |b: &Aabb| (0..3).all(|k| b.min[k] <= p[k] && p[k] <= b.max[k]);
            if holds(&bounds) {
                let [below, above] = Cutter::new(normal, offset, 8.0, 1e-5).parts(v, &bounds);
                let height = normal[0] * p[0] + normal[1] * p[1] + normal[2] * p[2] - offset;
                // A point in the plane may be in either part.
                prop_assert!(height >= 0.0 || holds(&below), "{p:?} below, {below:?}");
                prop_assert!(height <= 0.0 || holds(&above), "{p:?} above, {above:?}");
                prop_assert!(holds(&below) || holds(&above));
            }
        }
    }
}
