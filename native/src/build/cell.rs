// SPDX-License-Identifier: GPL-3.0-or-later
//! Cells: the part of space that a node of a plane tree stands for.

use super::polytope::{NEAR, Polytope};
use super::profile::Profile;
use crate::geom::Aabb;

/// A direction along which planes are tried.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Direction {
    /// The unit vector of axis 0, 1 or 2: its planes are compared with a coordinate.
    Axis(usize),
    /// Any vector of about unit length: its planes take a dot product. May well be an axis, for
    /// trees whose nodes are all of this kind.
    Oblique([f32; 3]),
}

impl Direction {
    /// The direction as a vector.
    pub fn vector(self) -> [f32; 3] {
        match self {
            Self::Axis(k) => std::array::from_fn(|i| f32::from(u8::from(i == k))),
            Self::Oblique(n) => n,
        }
    }

    /// The height of a point: rounded, but the same for the same point wherever it is asked.
    #[inline(always)]
    pub fn height(self, p: [f32; 3]) -> f32 {
        match self {
            Self::Axis(k) => p[k],
            // Positive zero, as in the bounds of boxes.
            Self::Oblique(n) => n[0] * p[0] + n[1] * p[1] + n[2] * p[2] + 0.0,
        }
    }
}

/// A split plane: all points with `direction . x = offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// The plane's normal.
    pub direction: Direction,
    /// Its height along the normal, in the frame of the walk.
    pub offset: f32,
}

/// A convex cell that can be cut in two.
pub trait Cell: Clone + Send + Sync {
    /// Surface area.
    fn area(&self) -> f64;
    /// How the surface divides when the cell is cut along `direction`, into `out`. Returns whether
    /// there is anything to divide: no ray distribution ever prices a cell without surface.
    fn profile(&self, direction: Direction, out: &mut Profile) -> bool;
    /// The parts below and above a plane through the cell. A part that rounding lost is the whole
    /// cell again: cells price planes and never decide where a triangle goes.
    fn split(&self, plane: Plane) -> (Self, Self);
}

/// A cell bounded by axis-aligned planes only.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoxCell(pub Aabb);

impl Cell for BoxCell {
    fn area(&self) -> f64 {
        self.0.area()
    }

    fn profile(&self, direction: Direction, out: &mut Profile) -> bool {
        let Direction::Axis(k) = direction else {
            unreachable!("trees of boxes have axis-aligned planes only");
        };
        let area = self.0.area();
        if area <= 0.0 {
            return false;
        }
        let (i, j) = (self.0.extent((k + 1) % 3), self.0.extent((k + 2) % 3));
        let share = |x: f64| 2.0 * x / area;
        out.linear((self.0.min[k], self.0.max[k]), share(i * j), share(i + j));
        true
    }

    fn split(&self, plane: Plane) -> (Self, Self) {
        let Direction::Axis(k) = plane.direction else {
            unreachable!("trees of boxes have axis-aligned planes only");
        };
        let (mut below, mut above) = (self.0, self.0);
        below.max[k] = plane.offset;
        above.min[k] = plane.offset;
        (Self(below), Self(above))
    }
}

/// A cell bounded by any planes: a box as long as all its planes are axis-aligned, which in most
/// trees holds for the upper levels, and a polytope after that.
#[derive(Debug, Clone)]
pub enum ConvexCell {
    /// Axis-aligned, and the largest coordinate of the scene.
    Box(BoxCell, f32),
    /// Any convex polytope.
    Polytope(Polytope),
}

impl ConvexCell {
    /// The cell as a polytope.
    pub fn polytope(&self) -> Polytope {
        match self {
            Self::Box(cell, magnitude) => Polytope::from_box(&cell.0, *magnitude),
            Self::Polytope(cell) => cell.clone(),
        }
    }
}

impl Cell for ConvexCell {
    fn area(&self) -> f64 {
        match self {
            Self::Box(cell, _) => cell.area(),
            Self::Polytope(cell) => cell.area(),
        }
    }

    fn profile(&self, direction: Direction, out: &mut Profile) -> bool {
        match (self, direction) {
            (Self::Box(cell, magnitude), Direction::Axis(_)) => {
                let surface = cell.profile(direction, out);
                // Triangles are not cut to the faces of convex cells, so none lies in one for sure.
                out.walls = false;
                out.margin = NEAR * magnitude;
                surface
            }
            (Self::Box(..), Direction::Oblique(n)) => self.polytope().profile(n, out),
            (Self::Polytope(cell), _) => cell.profile(direction.vector(), out),
        }
    }

    fn split(&self, plane: Plane) -> (Self, Self) {
        let parts = match (self, plane.direction) {
            (Self::Box(cell, magnitude), Direction::Axis(_)) => {
                let (below, above) = cell.split(plane);
                return (Self::Box(below, *magnitude), Self::Box(above, *magnitude));
            }
            (Self::Box(..), Direction::Oblique(_)) => self.polytope().split(plane),
            (Self::Polytope(cell), _) => cell.split(plane),
        };
        match parts {
            Some((below, above)) => (Self::Polytope(below), Self::Polytope(above)),
            None => (self.clone(), self.clone()),
        }
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
        let mut profile = Profile::default();
        for k in 0..3 {
            let direction = Direction::Axis(k);
            assert!(cell.profile(direction, &mut profile));
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
        assert!(!line.profile(Direction::Axis(0), &mut Profile::default()));
    }
}
