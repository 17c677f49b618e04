// SPDX-License-Identifier: GPL-3.0-or-later
//! The area of a triangle's part inside a convex region, for statistics.

use crate::vec3::{Vec3, add_scaled, cross, dot, length, sub};

/// All points with `normal . p <= offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HalfSpace {
    /// Outward unit normal.
    pub normal: Vec3,
    /// Height of the bounding plane along the normal.
    pub offset: f64,
}

impl HalfSpace {
    /// Returns the height of a point over the bounding plane; positive outside.
    #[inline]
    pub fn height(&self, p: Vec3) -> f64 {
        dot(self.normal, p) - self.offset
    }
}

/// Returns the area of a triangle.
pub fn triangle_area([a, b, c]: [Vec3; 3]) -> f64 {
    0.5 * length(cross(sub(b, a), sub(c, a)))
}

/// Clips triangles to convex regions, in f64 (Sutherland and Hodgman 1974), and keeps its buffers between calls.
#[derive(Debug, Default)]
pub struct Clipper {
    polygon: Vec<Vec3>,
    clipped: Vec<Vec3>,
}

impl Clipper {
    /// Returns the area of the part of a triangle inside all half-spaces, each moved outwards by `slack`, inwards if
    /// `slack` is negative. Rounding moves an edge of the part by at most 2^-49 of the largest coordinate.
    pub fn area(&mut self, corners: [Vec3; 3], walls: &[HalfSpace], slack: f64) -> f64 {
        self.polygon.clear();
        self.polygon.extend(corners);
        let mut whole = true;
        // Clip the polygon to the half-spaces that contain only a part of the triangle.
        for wall in walls {
            let heights = corners.map(|p| wall.height(p) - slack);
            if heights.iter().all(|&h| h <= 0.0) {
                continue;
            }
            if heights.iter().all(|&h| h > 0.0) {
                return 0.0;
            }
            whole = false;
            self.cut(wall, slack);
        }
        if whole {
            triangle_area(corners)
        } else {
            self.polygon_area()
        }
    }

    /// Replaces the polygon by its part inside a half-space.
    fn cut(&mut self, wall: &HalfSpace, slack: f64) {
        self.clipped.clear();
        for (i, &a) in self.polygon.iter().enumerate() {
            let b = *self.polygon.get(i + 1).unwrap_or(&self.polygon[0]);
            let (from, to) = (wall.height(a) - slack, wall.height(b) - slack);
            if from <= 0.0 {
                self.clipped.push(a);
            }
            // Add the vertex where the edge crosses the plane.
            if (from < 0.0 && to > 0.0) || (from > 0.0 && to < 0.0) {
                self.clipped
                    .push(add_scaled(a, from / (from - to), sub(b, a)));
            }
        }
        std::mem::swap(&mut self.polygon, &mut self.clipped);
    }

    /// Returns the area of the polygon, summed over a fan of triangles.
    fn polygon_area(&self) -> f64 {
        let Some((&first, rest)) = self.polygon.split_first() else {
            return 0.0;
        };
        let sides = rest.windows(2);
        sides
            .map(|side| triangle_area([first, side[0], side[1]]))
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The walls of the box from `low` to `high`.
    fn walls(low: f64, high: f64) -> Vec<HalfSpace> {
        (0..6)
            .map(|face| {
                let sign = if face % 2 == 0 { -1.0 } else { 1.0 };
                let mut normal = [0.0; 3];
                normal[face / 2] = sign;
                let offset = if face % 2 == 0 { -low } else { high };
                HalfSpace { normal, offset }
            })
            .collect()
    }

    #[test]
    fn parts_of_a_triangle_have_their_own_area() {
        let mut clipper = Clipper::default();
        let triangle = [[0.0, 0.0, 0.5], [4.0, 0.0, 0.5], [0.0, 4.0, 0.5]];
        assert_eq!(clipper.area(triangle, &walls(-1.0, 5.0), 0.0), 8.0);
        // The square of side 2, less the corner beyond x + y = 4: exactly its vertex.
        assert_eq!(clipper.area(triangle, &walls(0.0, 2.0), 0.0), 4.0);
        assert_eq!(clipper.area(triangle, &walls(0.0, 3.0), 0.0), 7.0);
        assert_eq!(clipper.area(triangle, &walls(1.0, 3.0), 0.0), 0.0);
        let low = triangle.map(|[x, y, _]| [x, y, 1.0]);
        assert_eq!(clipper.area(low, &walls(1.0, 3.0), 0.0), 2.0);
    }

    /// A triangle in a wall lies inside a region that is closed, and outside of one whose walls are moved inwards.
    #[test]
    fn slack_decides_on_triangles_in_a_wall() {
        let mut clipper = Clipper::default();
        let triangle = [[1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 1.0]];
        assert_eq!(clipper.area(triangle, &walls(0.0, 1.0), 0.0), 0.5);
        assert_eq!(clipper.area(triangle, &walls(0.0, 1.0), -1e-6), 0.0);
        assert_eq!(clipper.area(triangle, &walls(0.0, 1.0), 1e-12), 0.5);
    }
}
