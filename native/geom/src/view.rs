// SPDX-License-Identifier: GPL-3.0-or-later
//! The plane of view of a beam, at unit depth before the eye: convex polygons in it, and its intersections with planes
//! through the eye.
//!
//! A point `(x, y)` of the plane stands for the direction `(1, x, y)`, whose first component lies along the common axis
//! of the beam's rays. A line is an affine function of `x` and `y`; its sign at a pixel, computed once in f64, assigns
//! the pixel to the polygon on that side.
//!
//! A cut computes corners with an error of about 1e-14, because `|x|` and `|y|` are at most 4. Bounds over a polygon
//! are widened by [`NOISE`], a thousand times that error, because a polygon is cut many times.

use crate::vec3::{Vec3, cross, dot};

/// Error bound of an affine function with unit coefficients at the corners of a polygon (chosen, see above).
pub const NOISE: f64 = 1e-11;

/// Largest number of corners; a cut that would make more is omitted.
const CORNERS: usize = 12;

/// An affine function on the plane of view: constant, and coefficients of `x` and `y`.
#[derive(Debug, Clone, Copy)]
pub struct Line(pub [f64; 3]);

impl Line {
    /// Returns the value at a point.
    #[inline(always)]
    pub fn at(&self, [x, y]: [f64; 2]) -> f64 {
        self.0[0] + self.0[1] * x + self.0[2] * y
    }
}

/// A convex polygon in the plane of view.
#[derive(Debug, Clone, Copy)]
pub struct Polygon {
    corners: [[f64; 2]; CORNERS],
    count: usize,
}

impl Polygon {
    /// Makes an axis-aligned rectangle.
    pub fn rectangle(low: [f64; 2], high: [f64; 2]) -> Self {
        let mut corners = [[0.0; 2]; CORNERS];
        corners[0] = low;
        corners[1] = [high[0], low[1]];
        corners[2] = high;
        corners[3] = [low[0], high[1]];
        Self { corners, count: 4 }
    }

    /// Returns the corners, in order.
    pub fn corners(&self) -> &[[f64; 2]] {
        &self.corners[..self.count]
    }

    /// Returns bounds on the values of a function on the polygon, with the margin for rounding.
    #[inline(always)]
    pub fn range(&self, line: &Line) -> (f64, f64) {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for corner in self.corners() {
            let value = line.at(*corner);
            low = low.min(value);
            high = high.max(value);
        }
        let [a, b, c] = line.0;
        let noise = NOISE * (a.abs() + 4.0 * (b.abs() + c.abs()));
        (low - noise, high + noise)
    }

    /// Returns the part on which a function is not negative (Sutherland and Hodgman 1974): the whole polygon if that
    /// part has too many corners, `None` if it is empty.
    pub fn part(&self, line: &Line) -> Option<Self> {
        let mut part = Self {
            corners: [[0.0; 2]; CORNERS],
            count: 0,
        };
        let mut previous = self.corners[self.count - 1];
        let mut value = line.at(previous);
        // Keep the corners on the positive side, and add the points where edges cross the line.
        for &corner in self.corners() {
            let next = line.at(corner);
            let crosses = (value >= 0.0) != (next >= 0.0);
            if part.count + usize::from(crosses) + 1 > CORNERS {
                return Some(*self);
            }
            if crosses {
                let share = value / (value - next);
                part.corners[part.count] =
                    [0, 1].map(|k| previous[k] + share * (corner[k] - previous[k]));
                part.count += 1;
            }
            if next >= 0.0 {
                part.corners[part.count] = corner;
                part.count += 1;
            }
            (previous, value) = (corner, next);
        }
        (part.count > 0).then_some(part)
    }
}

/// The map from directions to the plane of view.
#[derive(Debug, Clone, Copy)]
pub struct View {
    /// The common axis of the rays, and the two others.
    axes: [usize; 3],
    /// 1 if the rays ascend along the axis, -1 if they descend.
    sign: f64,
}

impl View {
    /// Makes the view along `axis`, descending if `negative`.
    pub fn new(axis: usize, negative: bool) -> Self {
        Self {
            axes: [axis, (axis + 1) % 3, (axis + 2) % 3],
            sign: if negative { -1.0 } else { 1.0 },
        }
    }

    /// Returns the point that stands for a direction.
    #[inline(always)]
    pub fn pixel(&self, d: [f32; 3]) -> [f64; 2] {
        let [a, i, j] = self.axes;
        [i, j].map(|k| f64::from(d[k]) / f64::from(d[a]))
    }

    /// Returns the dot product of `n` and a direction, per unit of depth, as a function on the plane of view.
    #[inline(always)]
    pub fn speed(&self, n: Vec3) -> Line {
        Line(self.axes.map(|k| self.sign * n[k]))
    }

    /// Returns the edges of a triangle with corners relative to the eye, as functions that are positive inside;
    /// `None` if the triangle is seen edge-on.
    pub fn edges(&self, [a, b, c]: [Vec3; 3]) -> Option<[Line; 3]> {
        let volume = dot(cross(a, b), c);
        if volume == 0.0 || !volume.is_finite() {
            return None;
        }
        // Orient the edges so that the inside is positive.
        let orientation = volume.signum();
        let edge = |p: Vec3, q: Vec3| {
            let Line(l) = self.speed(cross(p, q));
            Line(l.map(|x| orientation * x))
        };
        Some([edge(a, b), edge(b, c), edge(c, a)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_triangle_splits_a_square_into_pieces_that_own_every_point_once() {
        let view = View::new(2, true);
        let edges = view
            .edges([[0.5, 0.5, -1.0], [-1.0, 0.0, -2.0], [0.0, -1.2, -2.0]])
            .expect("it is seen from the front");
        // Cut the part outside each edge off the square.
        let square = Polygon::rectangle([-1.0, -1.0], [1.0, 1.0]);
        let (mut rest, mut pieces) = (Some(square), Vec::new());
        for edge in &edges {
            let Some(polygon) = rest else { break };
            let outside = Line(edge.0.map(|x| -x));
            pieces.extend(polygon.part(&outside));
            rest = polygon.part(edge);
        }
        assert_eq!(pieces.len(), 3);
        let middle = rest.expect("the triangle lies in the square");
        assert_eq!(middle.corners().len(), 3);
        let area = |polygon: &Polygon| {
            let c = polygon.corners();
            let twice: f64 = (0..c.len())
                .map(|i| {
                    let (p, q) = (c[i], c[(i + 1) % c.len()]);
                    p[0] * q[1] - p[1] * q[0]
                })
                .sum();
            0.5 * twice
        };
        let sum: f64 = pieces.iter().chain([&middle]).map(area).sum();
        assert!((sum - 4.0).abs() < 1e-12, "{sum}");
        assert!(pieces.iter().all(|piece| area(piece) > 0.0));
        // The same triangle with the opposite orientation.
        let behind = view.edges([[0.5, 0.5, -1.0], [0.0, -1.2, -2.0], [-1.0, 0.0, -2.0]]);
        let centre = [-0.05, 0.0];
        for edges in [Some(edges), behind] {
            assert!(
                edges
                    .expect("seen")
                    .iter()
                    .all(|edge| edge.at(centre) > 0.0)
            );
        }
    }
}
