// SPDX-License-Identifier: GPL-3.0-or-later
//! Perfect splits: the bounds of the part of a triangle inside a box (Havran and Bittner 2002; Wald and Havran
//! 2006, section 4.3.1), by the polygon clipping of Sutherland and Hodgman 1974.

use crate::Aabb;
use crate::vec3::{Vec3, widen};

/// Largest number of vertices of a triangle clipped by six planes: each plane adds at most one.
const CORNERS: usize = 9;

/// Returns the bounds of a triangle's part inside `cell`, or `None` if they do not meet.
///
/// The clipping planes are moved outwards by 2^-40 of the largest coordinate `magnitude`, far above the rounding
/// of f64 and far below that of f32, so a triangle that touches the cell is always kept. The result is rounded
/// outwards and lies inside `cell`.
pub fn clipped_bounds(v: [[f32; 3]; 3], cell: &Aabb, magnitude: f32) -> Option<Aabb> {
    let margin = f64::from(magnitude) / (1_u64 << 40) as f64;
    // Start with the triangle in f64.
    let mut polygon = [[0.0; 3]; CORNERS];
    for (corner, p) in polygon.iter_mut().zip(v) {
        *corner = widen(p);
    }
    let mut n = 3;
    let whole = Aabb::of_triangle(v);
    // Clip only at the faces that the triangle's box crosses.
    for k in 0..3 {
        if whole.min[k] < cell.min[k] {
            n = cut(&mut polygon, n, k, 1.0, f64::from(cell.min[k]) - margin);
        }
        if whole.max[k] > cell.max[k] {
            n = cut(&mut polygon, n, k, -1.0, -f64::from(cell.max[k]) - margin);
        }
    }
    if n == 0 {
        return None;
    }
    // Bound the polygon, rounded outwards, inside the cell.
    let mut bounds = *cell;
    for k in 0..3 {
        let heights = polygon[..n].iter().map(|p| p[k]);
        let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| {
            (l.min(x), h.max(x))
        });
        bounds.min[k] = bounds.min[k].max(round_down(low));
        bounds.max[k] = bounds.max[k].min(round_up(high));
    }
    Some(bounds)
}

/// Keeps the part of a convex polygon where `sign * x_k >= offset`; returns its number of vertices.
#[inline]
fn cut(polygon: &mut [Vec3; CORNERS], n: usize, k: usize, sign: f64, offset: f64) -> usize {
    let mut out = [[0.0; 3]; CORNERS];
    let mut count = 0;
    let mut push = |p: Vec3| {
        // Rounding can make a polygon slightly concave and produce one vertex too many. The last slot then keeps
        // the newest vertex; the bounds lose at most the margin.
        out[count.min(CORNERS - 1)] = p;
        count += 1;
    };
    for i in 0..n {
        let (a, b) = (polygon[i], polygon[(i + 1) % n]);
        let (ha, hb) = (sign * a[k] - offset, sign * b[k] - offset);
        if ha >= 0.0 {
            push(a);
        }
        // The edge crosses the plane: add the intersection, exactly on the plane along axis `k`.
        if (ha < 0.0) != (hb < 0.0) {
            let s = ha / (ha - hb);
            let mut p: Vec3 = std::array::from_fn(|i| a[i] + s * (b[i] - a[i]));
            p[k] = sign * offset;
            push(p);
        }
    }
    *polygon = out;
    count.min(CORNERS)
}

/// Returns the largest f32 that is at most `x`.
#[expect(clippy::cast_possible_truncation, reason = "rounding is the point")]
fn round_down(x: f64) -> f32 {
    let nearest = x as f32;
    if f64::from(nearest) > x {
        nearest.next_down()
    } else {
        nearest
    }
}

/// Returns the smallest f32 that is at least `x`.
fn round_up(x: f64) -> f32 {
    -round_down(-x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_corner_cut_off_a_triangle_is_small() {
        let v = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
        let cell = Aabb {
            min: [3.0, 0.0, -1.0],
            max: [4.0, 4.0, 1.0],
        };
        let bounds = clipped_bounds(v, &cell, 4.0).unwrap();
        assert_eq!((bounds.min[0], bounds.max[0]), (3.0, 4.0));
        assert!(bounds.max[1] >= 1.0 && bounds.max[1] < 1.000_001);
        let missed = Aabb {
            min: [3.0, 3.0, -1.0],
            max: [4.0, 4.0, 1.0],
        };
        assert_eq!(clipped_bounds(v, &missed, 4.0), None);
    }

    proptest! {
        #[test]
        fn every_point_of_the_triangle_in_the_cell_is_in_the_bounds(
            v in [[-4i8..5, -4i8..5, -4i8..5], [-4i8..5, -4i8..5, -4i8..5], [-4i8..5, -4i8..5, -4i8..5]],
            low in [-4i8..3, -4i8..3, -4i8..3],
            size in [0u8..4, 0u8..4, 0u8..4],
            s in 0u8..9, t in 0u8..9,
        ) {
            let v = v.map(|p| p.map(f32::from));
            let min = low.map(f32::from);
            let max = std::array::from_fn(|k| min[k] + f32::from(size[k]));
            let cell = Aabb { min, max };
            // All values are exact in f32: coordinates and weights have few bits.
            let (s, t) = (f32::from(s) / 8.0, f32::from(t) / 8.0);
            let (u, w) = (s, (1.0 - s) * t);
            let p: [f32; 3] = std::array::from_fn(|k| v[0][k] + u * (v[1][k] - v[0][k]) + w * (v[2][k] - v[0][k]));
            if (0..3).all(|k| min[k] <= p[k] && p[k] <= max[k]) {
                let bounds = clipped_bounds(v, &cell, 8.0);
                prop_assert!(bounds.is_some_and(|b| (0..3).all(|k| b.min[k] <= p[k] && p[k] <= b.max[k])));
            }
        }
    }
}
