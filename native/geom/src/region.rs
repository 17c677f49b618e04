// SPDX-License-Identifier: GPL-3.0-or-later
//! A convex region that planes split and lines intersect.

use crate::Aabb;
use crate::cell::{Cell, ConvexCell, Direction, Plane};
use crate::clip_area::HalfSpace;
use crate::vec3::{Vec3, dot, widen};

/// A polygon as a list of its vertices, in order around it.
pub type Face = Vec<Vec3>;

/// A straight line in the frame of a structure, `origin + t direction`.
#[derive(Debug, Clone, Copy)]
pub struct Line {
    /// Point at `t = 0`.
    pub origin: Vec3,
    /// Displacement per unit of `t`.
    pub direction: Vec3,
}

impl Line {
    /// Returns the parameter `t` at which the line crosses a plane; not finite if the line is parallel to the
    /// plane.
    pub fn crosses(&self, plane: &Plane) -> f64 {
        self.reaches(widen(plane.direction.vector()), f64::from(plane.offset))
    }

    /// Returns the parameter at which the line crosses the plane `normal · p = offset`.
    fn reaches(&self, normal: Vec3, offset: f64) -> f64 {
        (offset - dot(normal, self.origin)) / dot(normal, self.direction)
    }
}

/// Part of a line, between two parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Span {
    /// Parameter `t` of the beginning.
    pub enter: f64,
    /// Parameter `t` of the end.
    pub leave: f64,
}

/// Convex region of a node, in the frame of its structure.
#[derive(Debug, Clone)]
pub struct Region(ConvexCell);

impl Region {
    /// Returns the region of a whole scene, its box.
    pub fn of_scene(bounds: Aabb) -> Self {
        Self(ConvexCell::from_box(bounds, bounds.magnitude()))
    }

    /// Returns the region of a box in the same scene, with that scene's magnitude.
    pub fn part(&self, bounds: Aabb) -> Self {
        Self(ConvexCell::from_box(bounds, self.0.magnitude()))
    }

    /// Returns the region's box if the region is a box.
    pub fn bounds(&self) -> Option<Aabb> {
        match &self.0 {
            ConvexCell::Box(flat) => Some(flat.bounds()),
            ConvexCell::Polytope(_) => None,
        }
    }

    /// Returns the lower and the upper corner of the smallest box around the region.
    pub fn extent(&self) -> [Vec3; 2] {
        if let Some(bounds) = self.bounds() {
            return [widen(bounds.min), widen(bounds.max)];
        }
        let cell = self.0.polytope();
        let corners = cell.facets().iter().flat_map(|facet| cell.corners(facet));
        let start = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        corners.fold(start, |[low, high], p| {
            [
                [0, 1, 2].map(|k| low[k].min(p[k])),
                [0, 1, 2].map(|k| high[k].max(p[k])),
            ]
        })
    }

    /// Returns the surface area, of both sides if the region is flat.
    pub fn area(&self) -> f64 {
        self.0.area()
    }

    /// Replaces the content of `out` by the half-spaces whose intersection the region is.
    pub fn half_spaces(&self, out: &mut Vec<HalfSpace>) {
        out.clear();
        // Take two half-spaces per axis of a box.
        if let Some(bounds) = self.bounds() {
            for k in 0..3 {
                let normal = widen(Direction::Axis(k).vector());
                out.push(HalfSpace {
                    normal: normal.map(|x| -x),
                    offset: -f64::from(bounds.min[k]),
                });
                out.push(HalfSpace {
                    normal,
                    offset: f64::from(bounds.max[k]),
                });
            }
            return;
        }
        // Take one half-space per face of a polytope.
        let cell = self.0.polytope();
        out.extend(cell.facets().iter().map(|facet| {
            let corner = cell.corners(facet).next().expect("a face has corners");
            HalfSpace {
                normal: facet.normal,
                offset: dot(facet.normal, corner),
            }
        }));
    }

    /// Returns the part of a span of a line inside the region, ends included; `None` if there is none.
    pub fn span(&self, line: &Line, within: Span) -> Option<Span> {
        let Span {
            mut enter,
            mut leave,
        } = within;
        let mut walls = Vec::with_capacity(8);
        self.half_spaces(&mut walls);
        // Clip the span by each half-space. A line parallel to a face misses if it lies outside.
        for HalfSpace { normal, offset } in walls {
            let speed = dot(normal, line.direction);
            if speed == 0.0 {
                if dot(normal, line.origin) > offset {
                    return None;
                }
            } else if speed > 0.0 {
                leave = leave.min(line.reaches(normal, offset));
            } else {
                enter = enter.max(line.reaches(normal, offset));
            }
        }
        (enter <= leave).then_some(Span { enter, leave })
    }

    /// Returns all faces.
    pub fn faces(&self) -> Vec<Face> {
        let cell = self.0.polytope();
        let corners = |facet| cell.corners(facet).collect();
        cell.facets().iter().map(corners).collect()
    }

    /// Returns the cross section with a plane, counter-clockwise as seen from above the plane; empty if the plane
    /// misses the region or rounding removed the section.
    pub fn section(&self, plane: &Plane) -> Face {
        if let (Some(bounds), Direction::Axis(axis)) = (self.bounds(), plane.direction) {
            let inside = bounds.min[axis] <= plane.offset && plane.offset <= bounds.max[axis];
            return if inside {
                rectangle(&bounds, axis, plane.offset).to_vec()
            } else {
                Face::new()
            };
        }
        // Split the polytope; the face of the cut is the section.
        let Some((below, _)) = self.0.polytope().split(*plane) else {
            return Face::new();
        };
        // `split` appends the section to the faces of the lower part.
        let cap = below.facets().last().expect("a polytope has faces");
        below.corners(cap).collect()
    }

    /// Returns the parts below and above a plane.
    pub fn split(&self, plane: Plane) -> [Self; 2] {
        let (below, above) = self.0.split(plane);
        [Self(below), Self(above)]
    }
}

/// Returns the cross section of a box perpendicular to `axis` at `at`, counter-clockwise as seen from above the
/// plane.
pub fn rectangle(cell: &Aabb, axis: usize, at: f32) -> [Vec3; 4] {
    let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
    // Visit the four corners in order, in the plane of the other two axes.
    let ends = [
        (cell.min, cell.min),
        (cell.max, cell.min),
        (cell.max, cell.max),
        (cell.min, cell.max),
    ];
    ends.map(|(u, v)| {
        let mut corner = [at; 3];
        corner[i] = u[i];
        corner[j] = v[j];
        widen(corner)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit() -> Region {
        Region::of_scene(Aabb {
            min: [0.0; 3],
            max: [1.0; 3],
        })
    }

    /// The plane x + y = 1.
    fn diagonal() -> Plane {
        let s = std::f32::consts::FRAC_1_SQRT_2;
        Plane {
            direction: Direction::Oblique([s, s, 0.0]),
            offset: s,
        }
    }

    #[test]
    fn sections_of_a_box_are_its_corners_cut_off() {
        let s = 1.0 / 3.0_f32.sqrt();
        let at = |offset| Plane {
            direction: Direction::Oblique([s; 3]),
            offset,
        };
        assert_eq!(unit().section(&at(2.5 * s)).len(), 3);
        assert_eq!(unit().section(&at(1.5 * s)).len(), 6);
        assert_eq!(unit().section(&at(3.5 * s)).len(), 0);
        let axis = |offset| Plane {
            direction: Direction::Axis(1),
            offset,
        };
        assert_eq!(unit().section(&axis(0.25)).len(), 4);
        assert_eq!(unit().section(&axis(2.0)).len(), 0);
        let [below, above] = unit().split(at(2.5 * s));
        assert_eq!((below.faces().len(), above.faces().len()), (7, 4));
    }

    #[test]
    fn a_cut_through_an_edge_keeps_a_wedge() {
        let [wedge, _] = unit().split(diagonal());
        assert_eq!(wedge.faces().len(), 5);
    }

    #[test]
    fn spans_end_where_the_region_does() {
        let span = |enter, leave| Span { enter, leave };
        let line = Line {
            origin: [-1.0, 0.25, 0.5],
            direction: [2.0, 0.0, 0.0],
        };
        let all = span(f64::NEG_INFINITY, f64::INFINITY);
        assert_eq!(unit().span(&line, all), Some(span(0.5, 1.0)));
        let [wedge, _] = unit().split(diagonal());
        let Span { enter, leave } = wedge.span(&line, all).unwrap();
        assert!((enter - 0.5).abs() < 1e-12 && (leave - 0.875).abs() < 1e-6);
        assert_eq!(unit().span(&line, span(0.6, 0.7)), Some(span(0.6, 0.7)));
        assert_eq!(unit().span(&line, span(1.5, 2.0)), None);
        let beside = Line {
            origin: [-1.0, 1.25, 0.5],
            ..line
        };
        assert_eq!(unit().span(&beside, all), None);
    }
}
