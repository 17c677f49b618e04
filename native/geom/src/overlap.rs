// SPDX-License-Identifier: GPL-3.0-or-later
//! Overlap test of a triangle and a box by separating axes (Akenine-Möller 2001), in f64 with error margins. A negative
//! answer is certain; a positive one may be wrong if the two are within the margin of each other.

use crate::vec3::{Vec3, cross, dot, map, sub, widen};

/// Relative error margin (chosen): each operation in f64 has a relative error of at most 2^-53, far less.
const MARGIN: f64 = 1.0 / (1_u64 << 40) as f64;

/// A triangle with the axes that may separate it from boxes.
pub struct TriangleBox {
    corners: [Vec3; 3],
    /// Normal of the triangle's plane, not normalized.
    normal: Vec3,
    /// Bound on the rounding error of heights along the normal.
    normal_error: f64,
    /// Cross products of the three edges and the three unit axes.
    products: [Vec3; 9],
    /// Upper bound on the distance between any two points of the scene and the boxes to test.
    span: f64,
}

impl TriangleBox {
    /// Computes the axes of a triangle in a scene whose absolute coordinates are at most `magnitude`. A box to test may
    /// extend beyond the scene by at most its side.
    pub fn new(corners: [[f32; 3]; 3], magnitude: f32) -> Self {
        let corners = map(corners, widen);
        let [a, b, c] = corners;
        let edges = [sub(b, a), sub(c, b), sub(a, c)];
        let span = 16.0 * f64::from(magnitude);
        let size = |e: Vec3| e[0].abs() + e[1].abs() + e[2].abs();
        // The normal of nearly parallel edges is inexact; its error is small against the product of the edges.
        let normal_error = MARGIN * size(edges[0]) * size(edges[1]) * span;
        let mut products = [[0.0; 3]; 9];
        // Compute cross products with the unit axes, without multiplications by zero and one.
        for (i, e) in edges.iter().enumerate() {
            products[3 * i] = [0.0, -e[2], e[1]];
            products[3 * i + 1] = [e[2], 0.0, -e[0]];
            products[3 * i + 2] = [-e[1], e[0], 0.0];
        }
        Self {
            corners,
            normal: cross(edges[0], edges[1]),
            normal_error,
            products,
            span,
        }
    }

    /// Returns whether the triangle may overlap the cube with this centre and half side `reach`.
    pub fn meets(&self, centre: Vec3, reach: f64) -> bool {
        self.meets_box(centre, [reach; 3])
    }

    /// Returns whether the triangle may overlap the box with this centre and half sides `reach`.
    pub fn meets_box(&self, centre: Vec3, reach: Vec3) -> bool {
        let corners = map(self.corners, |p| sub(p, centre));
        // Compare the triangle's projection with that of the box, enlarged by the rounding error.
        let apart = |axis: Vec3, error: f64| {
            let [x, y, z] = map(corners, |p| dot(axis, p));
            let (low, high) = (x.min(y).min(z), x.max(y).max(z));
            let size = map(axis, f64::abs);
            let limit = dot(reach, size) + error;
            low > limit || high < -limit
        };
        // Try the separating axes: the box's normals, the triangle's normal, and the cross products of edges.
        let units = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        if units.iter().any(|axis| apart(*axis, MARGIN * self.span)) {
            return false;
        }
        if apart(self.normal, self.normal_error) {
            return false;
        }
        !self.products.iter().any(|axis| {
            let size = axis[0].abs() + axis[1].abs() + axis[2].abs();
            apart(*axis, MARGIN * size * self.span)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_triangle_across_a_corner_is_distinguished_from_one_beyond_it() {
        let touching = [[1.5, 0.0, 0.0], [0.0, 1.5, 0.0], [0.0, 0.0, 1.5]];
        let beyond = touching.map(|p| p.map(|x: f32| x * 2.1));
        let meets = |v| TriangleBox::new(v, 4.0).meets([0.5; 3], 0.5);
        assert!(meets(touching) && !meets(beyond));
        // The vertex of the cube itself, exactly.
        assert!(meets(touching.map(|p| p.map(|x: f32| x * 2.0))));
    }

    proptest! {
        #[test]
        fn a_common_point_is_never_denied(
            v in [[-4i8..5, -4i8..5, -4i8..5], [-4i8..5, -4i8..5, -4i8..5], [-4i8..5, -4i8..5, -4i8..5]],
            low in [-4i8..3, -4i8..3, -4i8..3], size in 1u8..4, s in 0u8..9, t in 0u8..9,
        ) {
            let v = v.map(|p| p.map(f32::from));
            let (s, t) = (f32::from(s) / 8.0, f32::from(t) / 8.0);
            let w = (1.0 - s) * t;
            let p: [f32; 3] = std::array::from_fn(|k| v[0][k] + s * (v[1][k] - v[0][k]) + w * (v[2][k] - v[0][k]));
            let (low, size) = (low.map(f32::from), f32::from(size));
            if (0..3).all(|k| low[k] <= p[k] && p[k] <= low[k] + size) {
                let half = 0.5 * f64::from(size);
                let centre = std::array::from_fn(|k| f64::from(low[k]) + half);
                prop_assert!(TriangleBox::new(v, 8.0).meets(centre, half));
            }
        }
    }
}
