// SPDX-License-Identifier: GPL-3.0-or-later
//! An interval in f64 that contains the exact squared distance of a point from a triangle.
//!
//! Its ends do not depend on the accuracy of the closest point that f64 computes: any point of the triangle is at least
//! as far away as the closest one, and for any direction the triangle is at least as far away as its nearest vertex
//! along it. For the exact closest point and the direction to it, both are the distance (the duality gap is zero).

use crate::feature::{Feature, Seen, dot, ends};
use crate::number::U;
use halfspace_geom::vec3::{Vec3, add_scaled, map, sub, widen};

/// An interval of squared distances.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Span {
    /// At most the exact squared distance.
    pub low: f64,
    /// At least the exact squared distance.
    pub high: f64,
}

/// Error of a point of the triangle per largest component of its vertices. Derived: each component is a sum of three
/// products with weights whose sum is 1, at most ten roundings, and a vector is at most sqrt(3) times its largest
/// component: 18 roundings; the rest covers second-order terms.
const POINT_ERROR: f64 = 32.0 * U;

/// Error of an inner product per product of the largest components. Derived: three products of at most four roundings
/// each; the rest covers second-order terms.
const DOT_ERROR: f64 = 16.0 * U;

/// Relative error of a few operations.
const FEW: f64 = 16.0 * U;

impl Span {
    /// Returns the interval of a point and a triangle.
    #[inline]
    pub fn new(point: [f32; 3], corners: [[f32; 3]; 3]) -> Self {
        let seen = seen(point, corners);
        let (closest, direction) = closest(&seen);
        let largest = |v: Vec3| v[0].abs().max(v[1].abs()).max(v[2].abs());
        let size = seen.corners.iter().fold(0.0, |m, &v| largest(v).max(m));
        // The distance of a point of the triangle is an upper bound.
        let above = dot(&closest, &closest).sqrt() * (1.0 + FEW) + POINT_ERROR * size;
        let high = above * above * (1.0 + FEW);
        // The height of the lowest vertex in any direction is a lower bound.
        let heights = map(seen.corners, |v| dot(&v, &direction));
        let least = heights[0].min(heights[1]).min(heights[2]);
        let least = least - DOT_ERROR * size * largest(direction);
        let low = if least > 0.0 {
            least * least / dot(&direction, &direction) * (1.0 - FEW)
        } else {
            0.0
        };
        Self { low, high }
    }
}

/// Returns a triangle relative to a point, in f64.
#[inline(always)]
pub fn seen(point: [f32; 3], corners: [[f32; 3]; 3]) -> Seen<f64> {
    let (point, [a, b, c]) = (widen(point), map(corners, widen));
    Seen {
        corners: [sub(a, point), sub(b, point), sub(c, point)],
        sides: [sub(c, b), sub(a, c), sub(b, a)],
    }
}

/// Returns a point of the triangle near the closest one, relative to the query's point, and a direction near that to
/// the closest point. The point lies in the triangle up to [`POINT_ERROR`], whatever the rounding of the weights.
#[inline(always)]
fn closest(seen: &Seen<f64>) -> (Vec3, Vec3) {
    let normal = seen.normal();
    let weights = seen.weights(&normal);
    let corners = &seen.corners;
    if weights.iter().all(|&weight| weight > 0.0) {
        let sum = weights[0] + weights[1] + weights[2];
        let shares = weights.iter().map(|weight| weight / sum);
        let point = shares
            .zip(corners)
            .fold([0.0; 3], |point, (share, &v)| add_scaled(point, share, v));
        // The normal is a better direction than a short vector that is a difference of long ones.
        let side = dot(&normal, &corners[0]).signum();
        return (point, map(normal, |x| x * side));
    }
    let feature = seen
        .closest_edge()
        .expect("f64 counts every sign as certain");
    let point = match feature {
        Feature::Vertex(k) => corners[k],
        Feature::Edge(k) => {
            let (from, side) = (corners[ends(k).0], seen.sides[k]);
            let share = -dot(&from, &side) / dot(&side, &side);
            add_scaled(from, share.clamp(0.0, 1.0), side)
        }
        Feature::Face => unreachable!("the boundary has no face"),
    };
    (point, point)
}
