// SPDX-License-Identifier: GPL-3.0-or-later
//! Cells: the regions of space that nodes of a plane tree cover.

use crate::Aabb;
use crate::polytope::{NEAR, Polytope};
use crate::profile::Profile;
use std::sync::OnceLock;

/// A direction along which split planes are tried.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Direction {
    /// Unit vector of axis 0, 1 or 2: a comparison with its planes takes one coordinate.
    Axis(usize),
    /// Any vector of about unit length: a comparison with its planes takes a dot product. It may coincide with an
    /// axis, in trees whose nodes are all of this kind.
    Oblique([f32; 3]),
}

impl Direction {
    /// Returns the direction as a vector.
    pub fn vector(self) -> [f32; 3] {
        match self {
            Self::Axis(k) => std::array::from_fn(|i| f32::from(u8::from(i == k))),
            Self::Oblique(n) => n,
        }
    }

    /// Returns the height of a point along the direction, rounded; equal points have equal heights.
    #[inline(always)]
    pub fn height(self, p: [f32; 3]) -> f32 {
        match self {
            Self::Axis(k) => p[k],
            // Adding 0.0 turns -0.0 to 0.0, as in the bounds of boxes.
            Self::Oblique(n) => n[0] * p[0] + n[1] * p[1] + n[2] * p[2] + 0.0,
        }
    }
}

/// A split plane: all points with `direction . x = offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// The plane's normal.
    pub direction: Direction,
    /// Height of the plane along the normal, in the frame of the structure.
    pub offset: f32,
}

/// One side of a split plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaneSide {
    /// The plane.
    pub plane: Plane,
    /// Whether the side lies above the plane.
    pub above: bool,
}

/// A convex cell that a plane can split in two.
pub trait Cell: Clone + Send + Sync {
    /// Returns the surface area.
    fn area(&self) -> f64;
    /// Returns the bytes that the cell has allocated.
    fn allocated(&self) -> usize;
    /// Writes the cell's extent along `direction` and the range where planes may lie to `out`. Returns whether the
    /// cell has a surface area, by which the cost model divides.
    fn extent(&self, direction: Direction, out: &mut Profile) -> bool;
    /// Writes the surface areas of both parts as a function of the plane's height along `direction` to `out`,
    /// which an earlier call of [`Self::extent`] filled. Much more expensive than the extent alone.
    fn divide(&self, direction: Direction, out: &mut Profile);
    /// Returns the parts below and above a plane through the cell. Where rounding makes a part degenerate, it is the
    /// whole cell: cells only determine costs, never which child receives a triangle.
    fn split(&self, plane: Plane) -> (Self, Self);
    /// Returns the parts below and above a plane, each only if its entry in `wanted` is set.
    fn parts(&self, plane: Plane, wanted: [bool; 2]) -> [Option<Self>; 2] {
        if wanted == [false; 2] {
            return [None, None];
        }
        let (below, above) = self.split(plane);
        [wanted[0].then_some(below), wanted[1].then_some(above)]
    }
}

/// A cell bounded by axis-aligned planes only.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoxCell(pub Aabb);

impl Cell for BoxCell {
    fn area(&self) -> f64 {
        self.0.area()
    }

    fn allocated(&self) -> usize {
        0
    }

    fn extent(&self, direction: Direction, out: &mut Profile) -> bool {
        let Direction::Axis(k) = direction else {
            unreachable!("trees of boxes have axis-aligned planes only");
        };
        // Triangles are clipped exactly to the faces of a box, so planes in the faces need no margin.
        (out.low, out.high) = (self.0.min[k], self.0.max[k]);
        (out.margin, out.walls) = (0.0, true);
        self.0.area() > 0.0
    }

    fn divide(&self, direction: Direction, out: &mut Profile) {
        let Direction::Axis(k) = direction else {
            unreachable!("trees of boxes have axis-aligned planes only");
        };
        let area = self.0.area();
        let (i, j) = (self.0.extent((k + 1) % 3), self.0.extent((k + 2) % 3));
        let share = |x: f64| 2.0 * x / area;
        out.linear(share(i * j), share(i + j));
    }

    fn split(&self, plane: Plane) -> (Self, Self) {
        let Direction::Axis(k) = plane.direction else {
            unreachable!("trees of boxes have axis-aligned planes only");
        };
        // Both parts share the plane.
        let (mut below, mut above) = (self.0, self.0);
        below.max[k] = plane.offset;
        above.min[k] = plane.offset;
        (Self(below), Self(above))
    }
}

/// A cell bounded by planes of any direction: a box as long as all its planes are axis-aligned, which in most
/// trees holds for the upper levels, otherwise a polytope.
#[derive(Debug, Clone)]
pub enum ConvexCell {
    /// Axis-aligned.
    Box(LazyPolytope),
    /// Any convex polytope.
    Polytope(Polytope),
}

/// A box, and the same cell as a polytope once it is needed.
#[derive(Debug, Clone)]
pub struct LazyPolytope {
    cell: BoxCell,
    /// Largest absolute coordinate of the scene.
    magnitude: f32,
    /// The box as a polytope, computed when the first oblique plane is tried.
    polytope: OnceLock<Box<Polytope>>,
}

impl LazyPolytope {
    /// Returns the box.
    pub fn bounds(&self) -> Aabb {
        self.cell.0
    }

    /// Returns the box as a polytope.
    fn polytope(&self) -> &Polytope {
        self.polytope
            .get_or_init(|| Box::new(Polytope::from_box(&self.cell.0, self.magnitude)))
    }
}

impl ConvexCell {
    /// Makes a cell from a box, in a scene whose largest absolute coordinate is `magnitude`.
    pub fn from_box(bounds: Aabb, magnitude: f32) -> Self {
        Self::Box(LazyPolytope {
            cell: BoxCell(bounds),
            magnitude,
            polytope: OnceLock::new(),
        })
    }

    /// Returns the largest absolute coordinate of the scene.
    pub fn magnitude(&self) -> f32 {
        match self {
            Self::Box(boxed) => boxed.magnitude,
            #[expect(clippy::cast_possible_truncation, reason = "it was an f32")]
            Self::Polytope(cell) => cell.magnitude() as f32,
        }
    }

    /// Returns the cell as a polytope.
    pub fn polytope(&self) -> &Polytope {
        match self {
            Self::Box(boxed) => boxed.polytope(),
            Self::Polytope(cell) => cell,
        }
    }
}

impl Cell for ConvexCell {
    fn area(&self) -> f64 {
        match self {
            Self::Box(boxed) => boxed.cell.area(),
            Self::Polytope(cell) => cell.area(),
        }
    }

    fn allocated(&self) -> usize {
        match self {
            Self::Box(boxed) => {
                (boxed.polytope.get()).map_or(0, |cell| size_of::<Polytope>() + cell.allocated())
            }
            Self::Polytope(cell) => cell.allocated(),
        }
    }

    fn extent(&self, direction: Direction, out: &mut Profile) -> bool {
        match (self, direction) {
            (Self::Box(boxed), Direction::Axis(_)) => {
                let surface = boxed.cell.extent(direction, out);
                // Triangles are not clipped to the faces of convex cells, so none is certain to lie in a face.
                out.walls = false;
                out.margin = NEAR * boxed.magnitude;
                surface
            }
            _ => self.polytope().extent(direction.vector(), out),
        }
    }

    fn divide(&self, direction: Direction, out: &mut Profile) {
        match (self, direction) {
            (Self::Box(boxed), Direction::Axis(_)) => boxed.cell.divide(direction, out),
            _ => self.polytope().divide(direction.vector(), out),
        }
    }

    fn split(&self, plane: Plane) -> (Self, Self) {
        if let (Self::Box(boxed), Direction::Axis(_)) = (self, plane.direction) {
            let (below, above) = boxed.cell.split(plane);
            return (
                Self::from_box(below.0, boxed.magnitude),
                Self::from_box(above.0, boxed.magnitude),
            );
        }
        // Keep the whole cell for both children if rounding allows no split.
        match self.polytope().split(plane) {
            Some((below, above)) => (Self::Polytope(below), Self::Polytope(above)),
            None => (self.clone(), self.clone()),
        }
    }

    fn parts(&self, plane: Plane, wanted: [bool; 2]) -> [Option<Self>; 2] {
        if wanted == [false; 2] {
            return [None, None];
        }
        if let (Self::Box(_), Direction::Axis(_)) = (self, plane.direction) {
            let (below, above) = self.split(plane);
            return [wanted[0].then_some(below), wanted[1].then_some(above)];
        }
        match self.polytope().parts(plane, wanted) {
            Some(parts) => parts.map(|part| part.map(Self::Polytope)),
            None => wanted.map(|wanted| wanted.then(|| self.clone())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_of_a_split_box_are_those_of_its_parts() {
        let cell = BoxCell(Aabb {
            min: [0.0, 1.0, -1.0],
            max: [2.0, 4.0, 4.0],
        });
        let mut profile = Profile::default();
        for k in 0..3 {
            let direction = Direction::Axis(k);
            assert!(cell.extent(direction, &mut profile));
            cell.divide(direction, &mut profile);
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
        assert!(!line.extent(Direction::Axis(0), &mut Profile::default()));
    }
}
