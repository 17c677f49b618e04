// SPDX-License-Identifier: GPL-3.0-or-later
//! Whether a triangle and a box have a point in common, by separating axes (Akenine-Möller 2001), in
//! f64 with margins: "no" is certain, "yes" may be wrong by a hair.

use crate::geom::vec3::{Vec3, cross, dot, map, sub, widen};

/// Products of f64 lose less than 2^-50 of their factors; this leaves room.
const MARGIN: f64 = 1.0 / (1_u64 << 40) as f64;

/// A triangle with the axes that may separate it from cubes.
pub struct TriangleBox {
    corners: [Vec3; 3],
    /// Normal of the plane, and bound on what its rounding does to a height over it.
    normal: (Vec3, f64),
    /// The nine cross products of edges and axes.
    across: [Vec3; 9],
    /// Largest distance between any two points of the scene, or more.
    span: f64,
}

impl TriangleBox {
    /// For a triangle and cubes of a scene whose coordinates are at most `magnitude`, cubes reaching
    /// beyond it by no more than their side.
    pub fn new(corners: [[f32; 3]; 3], magnitude: f32) -> Self {
        let corners = map(corners, widen);
        let [a, b, c] = corners;
        let edges = [sub(b, a), sub(c, b), sub(a, c)];
        let span = 16.0 * f64::from(magnitude);
        let size = |e: Vec3| e[0].abs() + e[1].abs() + e[2].abs();
        // A normal of nearly parallel edges is inexact; its error is small against the edges' product.
        let doubt = MARGIN * size(edges[0]) * size(edges[1]) * span;
        let mut across = [[0.0; 3]; 9];
        for (i, e) in edges.iter().enumerate() {
            across[3 * i] = [0.0, -e[2], e[1]];
            across[3 * i + 1] = [e[2], 0.0, -e[0]];
            across[3 * i + 2] = [-e[1], e[0], 0.0];
        }
        Self {
            corners,
            normal: (cross(edges[0], edges[1]), doubt),
            across,
            span,
        }
    }

    /// Whether the triangle may meet the cube of this centre that reaches so far along each axis.
    pub fn meets(&self, centre: Vec3, reach: f64) -> bool {
        self.meets_box(centre, [reach; 3])
    }

    /// Whether it may meet the box of this centre that reaches so far.
    pub fn meets_box(&self, centre: Vec3, reach: Vec3) -> bool {
        let corners = map(self.corners, |p| sub(p, centre));
        let apart = |axis: Vec3, doubt: f64| {
            let [x, y, z] = map(corners, |p| dot(axis, p));
            let (low, high) = (x.min(y).min(z), x.max(y).max(z));
            let size = map(axis, f64::abs);
            let limit = dot(reach, size) + doubt;
            low > limit || high < -limit
        };
        let units = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        if units.iter().any(|axis| apart(*axis, MARGIN * self.span)) {
            return false;
        }
        let (normal, doubt) = self.normal;
        if apart(normal, doubt) {
            return false;
        }
        !self.across.iter().any(|axis| {
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
    fn a_triangle_across_a_corner_is_told_from_one_beyond_it() {
        let touching = [[1.5, 0.0, 0.0], [0.0, 1.5, 0.0], [0.0, 0.0, 1.5]];
        let beyond = touching.map(|p| p.map(|x: f32| x * 2.1));
        let meets = |v| TriangleBox::new(v, 4.0).meets([0.5; 3], 0.5);
        assert!(meets(touching) && !meets(beyond));
        // The corner itself, exactly.
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
