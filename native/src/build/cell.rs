// SPDX-License-Identifier: GPL-3.0-or-later
//! Cells: the part of space that a node of a plane tree stands for.

use crate::geom::Aabb;

/// A direction along which planes are tried.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Direction {
    /// The unit vector of axis 0, 1 or 2.
    Axis(usize),
}

/// A split plane: all points with `direction . x = offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// The plane's normal.
    pub direction: Direction,
    /// Its height along the normal, in the frame of the walk.
    pub offset: f32,
}

/// The surface of both parts of a cell cut at height `low + x`, as shares of the whole surface:
/// `constant + slope * x` below, and the same with `high - low - x` above.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Profile {
    /// Lowest height of the cell.
    pub low: f32,
    /// Highest height of the cell.
    pub high: f32,
    /// The share of a cut at the very end: the end face, twice.
    pub constant: f32,
    /// The share gained per unit of height.
    pub slope: f32,
}

impl Profile {
    /// The shares of the parts below and above height `at`; above 1 together, as the cut counts
    /// for both.
    #[inline(always)]
    pub fn shares(&self, at: f32) -> (f32, f32) {
        (
            self.constant + self.slope * (at - self.low),
            self.constant + self.slope * (self.high - at),
        )
    }
}

/// A convex cell that can be cut in two.
pub trait Cell: Clone + Send + Sync {
    /// Surface area.
    fn area(&self) -> f64;
    /// How the surface divides when the cell is cut along `direction`; `None` for a cell without
    /// surface, which no ray distribution ever prices.
    fn profile(&self, direction: Direction) -> Option<Profile>;
    /// The parts below and above a plane through the cell.
    fn split(&self, plane: Plane) -> (Self, Self);
    /// A box around the cell.
    fn bounds(&self) -> Aabb;
}

/// A cell bounded by axis-aligned planes only.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoxCell(pub Aabb);

impl Cell for BoxCell {
    fn area(&self) -> f64 {
        self.0.area()
    }

    fn profile(&self, direction: Direction) -> Option<Profile> {
        let Direction::Axis(k) = direction;
        let area = self.0.area();
        if area <= 0.0 {
            return None;
        }
        let (i, j) = (self.0.extent((k + 1) % 3), self.0.extent((k + 2) % 3));
        #[expect(
            clippy::cast_possible_truncation,
            reason = "shares need no more than f32"
        )]
        let share = |x: f64| (2.0 * x / area) as f32;
        Some(Profile {
            low: self.0.min[k],
            high: self.0.max[k],
            constant: share(i * j),
            slope: share(i + j),
        })
    }

    fn split(&self, plane: Plane) -> (Self, Self) {
        let Direction::Axis(k) = plane.direction;
        let (mut below, mut above) = (self.0, self.0);
        below.max[k] = plane.offset;
        above.min[k] = plane.offset;
        (Self(below), Self(above))
    }

    fn bounds(&self) -> Aabb {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_of_a_cut_box_are_those_of_its_parts() {
        let cell = BoxCell(Aabb {
            min: [0.0, 1.0, -1.0],
            max: [2.0, 4.0, 4.0],
        });
        for k in 0..3 {
            let direction = Direction::Axis(k);
            let profile = cell.profile(direction).unwrap();
            let offset = profile.low + 0.25 * (profile.high - profile.low);
            let (below, above) = cell.split(Plane { direction, offset });
            let (left, right) = profile.shares(offset);
            assert!((f64::from(left) - below.area() / cell.area()).abs() < 1e-6);
            assert!((f64::from(right) - above.area() / cell.area()).abs() < 1e-6);
        }
    }

    #[test]
    fn a_line_has_no_profile() {
        let line = BoxCell(Aabb {
            min: [0.0; 3],
            max: [1.0, 0.0, 0.0],
        });
        assert_eq!(line.profile(Direction::Axis(0)), None);
    }
}
