// SPDX-License-Identifier: GPL-3.0-or-later
//! Convex polygons in the plane of directions, and their clipping (Sutherland and Hodgman 1974).
//!
//! Directions of one octant are points of a triangle: divided by the sum of their components, these are `p`, `q` and
//! `1 - p - q`, all between 0 and 1, whatever the angle of view.

/// Largest number of corners. A clip adds at most one; a polygon that has this number is no longer clipped, and stays
/// larger than its beam.
pub const CORNERS: usize = 16;

/// A convex polygon.
#[derive(Debug, Clone, Copy)]
pub struct Polygon {
    corners: [[f64; 2]; CORNERS],
    count: usize,
}

/// Heights of the corners over a line.
#[derive(Debug, Clone, Copy)]
pub struct Heights {
    at: [f64; CORNERS],
    /// Smallest one.
    pub least: f64,
    /// Largest one.
    pub most: f64,
}

impl Polygon {
    /// The rectangle between two corners.
    pub fn rectangle([low, high]: [[f64; 2]; 2]) -> Self {
        let mut corners = [[0.0; 2]; CORNERS];
        corners[..4].copy_from_slice(&[low, [high[0], low[1]], high, [low[0], high[1]]]);
        Self { corners, count: 4 }
    }

    /// The corners, in order.
    #[inline(always)]
    pub fn corners(&self) -> &[[f64; 2]] {
        &self.corners[..self.count]
    }

    /// The heights of the corners over the line with these coefficients of `p`, `q` and 1.
    #[inline(always)]
    pub fn heights(&self, [by_p, by_q, constant]: [f64; 3]) -> Heights {
        let mut heights = Heights {
            at: [0.0; CORNERS],
            least: f64::INFINITY,
            most: f64::NEG_INFINITY,
        };
        for (height, [p, q]) in heights.at.iter_mut().zip(self.corners()) {
            *height = by_p * p + by_q * q + constant;
            heights.least = heights.least.min(*height);
            heights.most = heights.most.max(*height);
        }
        heights
    }

    /// The part where heights are at most `limit`; the polygon itself where that would have too many corners.
    #[inline(always)]
    pub fn below(&self, heights: &Heights, limit: f64) -> Self {
        self.clip(heights, 1.0, limit)
    }

    /// The part where heights are at least `limit`; the polygon itself where that would have too many corners.
    #[inline(always)]
    pub fn above(&self, heights: &Heights, limit: f64) -> Self {
        self.clip(heights, -1.0, -limit)
    }

    /// Keeps what is inside one line, edge by edge.
    #[inline(always)]
    fn clip(&self, heights: &Heights, sign: f64, limit: f64) -> Self {
        if self.count == CORNERS {
            return *self;
        }
        let mut cut = Self {
            corners: [[0.0; 2]; CORNERS],
            count: 0,
        };
        let mut last = self.count - 1;
        let mut last_height = sign * heights.at[last] - limit;
        for i in 0..self.count {
            let height = sign * heights.at[i] - limit;
            // Add the point where an edge crosses the line, then the corner if it is inside.
            if (height > 0.0) != (last_height > 0.0) {
                let (from, to) = (self.corners[last], self.corners[i]);
                let share = last_height / (last_height - height);
                cut.push([
                    from[0] + share * (to[0] - from[0]),
                    from[1] + share * (to[1] - from[1]),
                ]);
            }
            if height <= 0.0 {
                cut.push(self.corners[i]);
            }
            (last, last_height) = (i, height);
        }
        cut
    }

    #[inline(always)]
    fn push(&mut self, corner: [f64; 2]) {
        // Rounding alone could add a second corner; one that finds no place is on an edge.
        if self.count < CORNERS {
            self.corners[self.count] = corner;
            self.count += 1;
        }
    }

    /// The area.
    #[inline(always)]
    pub fn area(&self) -> f64 {
        let Some(&[p, q]) = self.corners().first() else {
            return 0.0;
        };
        // Add up the triangles that the edges form with the first corner.
        let mut sum = 0.0;
        let mut last = [0.0; 2];
        for corner in &self.corners()[1..] {
            let edge = [corner[0] - p, corner[1] - q];
            sum += last[0] * edge[1] - last[1] * edge[0];
            last = edge;
        }
        0.5 * sum.abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit() -> Polygon {
        Polygon::rectangle([[0.0; 2], [1.0; 2]])
    }

    #[test]
    fn both_parts_of_a_clipped_polygon_have_its_area() {
        let mut left = unit();
        for line in [
            [1.0, 0.3, -0.7],
            [0.2, 1.0, -0.6],
            [-1.0, 0.9, 0.1],
            [1.0, 1.0, -0.9],
        ] {
            let heights = left.heights(line);
            let (below, above) = (left.below(&heights, 0.0), left.above(&heights, 0.0));
            assert!(below.area() > 0.0 && above.area() > 0.0, "{line:?}");
            assert!((below.area() + above.area() - left.area()).abs() < 1e-15);
            assert!(below.heights(line).most < 1e-15 && above.heights(line).least > -1e-15);
            left = below;
        }
    }

    #[test]
    fn a_limit_moves_the_cut_outwards() {
        let heights = unit().heights([1.0, 0.0, -0.5]);
        assert_eq!(unit().below(&heights, 0.125).area(), 0.625);
        assert_eq!(unit().above(&heights, -0.125).area(), 0.625);
    }

    #[test]
    fn a_polygon_of_too_many_corners_stays_whole() {
        let mut round = Polygon::rectangle([[-1.0; 2], [1.0; 2]]);
        for i in 0..40 {
            let angle = f64::from(i) * 2.4;
            let line = [angle.cos(), angle.sin(), -1.0];
            let heights = round.heights(line);
            round = round.below(&heights, 0.0);
        }
        assert_eq!(round.corners().len(), CORNERS);
        assert!(round.area() > std::f64::consts::PI);
    }
}
