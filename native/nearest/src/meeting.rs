// SPDX-License-Identifier: GPL-3.0-or-later
//! Whether two closed triangles have a point in common, decided exactly.
//!
//! Two triangles meet if and only if an edge of one meets the other. All decisions are signs of determinants
//! (Shewchuk 1997), which f32 coordinates cannot make overflow or underflow. A triangle without area meets what one of
//! its edges meets.

use halfspace_geom::exact::is_degenerate;
use halfspace_geom::vec3::{Vec3, map, widen};
use robust::{Coord, Coord3D, orient2d, orient3d};

/// The pairs of axes onto which points are projected.
const PLANES: [[usize; 2]; 3] = [[0, 1], [1, 2], [2, 0]];

/// A triangle, with what is needed of it several times.
#[derive(Debug, Clone, Copy)]
pub struct Triangle {
    corners: [Vec3; 3],
    /// Whether it has an area.
    has_area: bool,
}

impl Triangle {
    /// Makes a triangle of finite vertices.
    pub fn new(corners: [[f32; 3]; 3]) -> Self {
        let corners = map(corners, widen);
        Self {
            corners,
            has_area: !is_degenerate(corners),
        }
    }

    /// Returns the edge opposite to a vertex.
    fn edge(&self, k: usize) -> [Vec3; 2] {
        [self.corners[(k + 1) % 3], self.corners[(k + 2) % 3]]
    }

    /// Returns whether both triangles have a point in common.
    pub fn meets(&self, other: &Self) -> bool {
        if self.is_beside(other) || other.is_beside(self) {
            return false;
        }
        (0..3).any(|k| other.meets_edge(self.edge(k)) || self.meets_edge(other.edge(k)))
    }

    /// Returns whether two triangles that share a vertex, their corners `own` and `others`, have a further point in
    /// common. The way from the shared vertex to such a point leaves one of them through the opposite edge, and there
    /// it is still in the other.
    pub fn meets_beyond(&self, own: usize, other: &Self, others: usize) -> bool {
        other.meets_edge(self.edge(own)) || self.meets_edge(other.edge(others))
    }

    /// Returns whether the other triangle lies strictly on one side of this one's plane.
    fn is_beside(&self, other: &Self) -> bool {
        let sides = map(other.corners, |p| self.side(p));
        (sides[0] > 0.0 && sides[1] > 0.0 && sides[2] > 0.0)
            || (sides[0] < 0.0 && sides[1] < 0.0 && sides[2] < 0.0)
    }

    /// Returns a number whose sign is the side of the plane on which a point lies.
    fn side(&self, p: Vec3) -> f64 {
        let [a, b, c] = self.corners;
        volume(a, b, c, p)
    }

    /// Returns whether an edge, which may be a point, has a point in common with this triangle.
    fn meets_edge(&self, [p, q]: [Vec3; 2]) -> bool {
        if !self.has_area {
            return (0..3).any(|k| segments_meet([p, q], self.edge(k)));
        }
        let (below, above) = (self.side(p), self.side(q));
        if (below > 0.0 && above > 0.0) || (below < 0.0 && above < 0.0) {
            return false;
        }
        if below == 0.0 && above == 0.0 {
            return self.meets_edge_in_plane([p, q]);
        }
        // The line crosses the plane: it meets the triangle if it passes all edges on one side.
        let turns = [0, 1, 2].map(|k: usize| {
            let [from, to] = self.edge(k);
            volume(p, q, from, to)
        });
        turns.iter().all(|&turn| turn >= 0.0) || turns.iter().all(|&turn| turn <= 0.0)
    }

    /// As [`Self::meets_edge`], for an edge in the plane of a triangle with area.
    fn meets_edge_in_plane(&self, [p, q]: [Vec3; 2]) -> bool {
        let [a, b, c] = self.corners;
        let plane = (PLANES.iter()).find(|&&plane| area(a, b, c, plane) != 0.0);
        let plane = *plane.expect("a triangle with area has a shadow with area");
        let turns = [0, 1, 2].map(|k: usize| {
            let [from, to] = self.edge(k);
            area(from, to, p, plane)
        });
        let inside = turns.iter().all(|&turn| turn >= 0.0) || turns.iter().all(|&turn| turn <= 0.0);
        inside || (0..3).any(|k| shadows_meet([p, q], self.edge(k), plane))
    }
}

/// Returns six times the signed volume of a tetrahedron, with the exact sign.
fn volume(a: Vec3, b: Vec3, c: Vec3, d: Vec3) -> f64 {
    let coord = |[x, y, z]: Vec3| Coord3D { x, y, z };
    orient3d(coord(a), coord(b), coord(c), coord(d))
}

/// Returns twice the signed area of a triangle's projection, with the exact sign.
fn area(a: Vec3, b: Vec3, c: Vec3, [i, j]: [usize; 2]) -> f64 {
    let coord = |p: Vec3| Coord { x: p[i], y: p[j] };
    orient2d(coord(a), coord(b), coord(c))
}

/// Returns whether two segments, which may be points, have a point in common.
fn segments_meet([p, q]: [Vec3; 2], [r, s]: [Vec3; 2]) -> bool {
    if volume(p, q, r, s) != 0.0 {
        return false;
    }
    // Project along an axis that is not parallel to the plane of the four points. If all lie on a line, every
    // projection must meet, and those along which the line does not vanish decide.
    let triples = [[p, q, r], [p, q, s], [r, s, p], [r, s, q]];
    let flat = |plane: [usize; 2]| triples.iter().all(|&[a, b, c]| area(a, b, c, plane) == 0.0);
    match PLANES.iter().find(|&&plane| !flat(plane)) {
        Some(&plane) => shadows_meet([p, q], [r, s], plane),
        None => PLANES
            .iter()
            .all(|&plane| shadows_meet([p, q], [r, s], plane)),
    }
}

/// Returns whether the projections of two segments have a point in common.
fn shadows_meet([p, q]: [Vec3; 2], [r, s]: [Vec3; 2], plane: [usize; 2]) -> bool {
    // Segments on one line meet if their boxes do; others cannot meet unless their boxes do.
    let apart = |k: usize| p[k].max(q[k]) < r[k].min(s[k]) || r[k].max(s[k]) < p[k].min(q[k]);
    if plane.into_iter().any(apart) {
        return false;
    }
    let split = |a: Vec3, b: Vec3, c: Vec3, d: Vec3| {
        let (one, other) = (area(a, b, c, plane), area(a, b, d, plane));
        (one > 0.0 && other > 0.0) || (one < 0.0 && other < 0.0)
    };
    !split(p, q, r, s) && !split(r, s, p, q)
}
