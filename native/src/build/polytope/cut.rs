// SPDX-License-Identifier: GPL-3.0-or-later
//! Cutting polytopes: faces clipped one by one, the cut closed by the ring of their new sides, and the sides paired
//! again. What comes out is a polytope, or nothing.

use super::{Edge, Facet, Polytope};
use crate::build::cell::Plane;
use crate::geom::vec3::{Vec3, add_scaled, cross, dot, length, sub, widen};

/// Vertices within this share of the scene's size of a plane count as lying on it. Where a plane runs through
/// vertices that rounding moved, some of an edge's ends may, and leave no polytope: then more do, or fewer.
pub(super) const ON: [f64; 3] = [
    1.0 / (1_u64 << 40) as f64,
    1.0 / (1_u64 << 36) as f64,
    1.0 / (1_u64 << 46) as f64,
];

/// Vertices are numbered in a byte. Depth limits keep even simple polytopes below this.
const VERTICES: usize = 250;

/// A polytope under construction.
pub(super) struct Draft {
    pub(super) vertices: Vec<Vec3>,
    pub(super) facets: Vec<Facet>,
    pub(super) loops: Vec<u8>,
}

impl Polytope {
    /// The parts below and above a plane; `None` when the plane does not part the polytope, or
    /// when rounding left a part that is no polytope.
    pub fn split(&self, plane: Plane) -> Option<(Self, Self)> {
        let [below, above] = self.parts(plane, [true; 2])?;
        below.zip(above)
    }

    /// Those of the two parts that are wanted.
    pub fn parts(&self, plane: Plane, wanted: [bool; 2]) -> Option<[Option<Self>; 2]> {
        ON.iter()
            .find_map(|&on| self.parts_within(plane, wanted, on))
    }

    /// The same, where vertices within this share of the scene's size lie on the plane.
    fn parts_within(&self, plane: Plane, wanted: [bool; 2], on: f64) -> Option<[Option<Self>; 2]> {
        let n = widen(plane.direction.vector());
        let mut heights = [0.0; VERTICES];
        for (height, &v) in heights.iter_mut().zip(&self.vertices) {
            let h = dot(n, v) - f64::from(plane.offset);
            // Snapped once per vertex, so that all faces agree on it.
            *height = if h.abs() <= on * self.magnitude {
                0.0
            } else {
                h
            };
        }
        let heights = &heights[..self.vertices.len()];
        if !(heights.iter().any(|&h| h < 0.0) && heights.iter().any(|&h| h > 0.0)) {
            return None;
        }
        let norm = length(n);
        let normal = n.map(|x| x / norm);
        let mut parts = [None, None];
        if wanted[0] {
            parts[0] = Some(self.part(heights, 1.0, normal)?);
        }
        if wanted[1] {
            parts[1] = Some(self.part(heights, -1.0, normal.map(|x| -x))?);
        }
        Some(parts)
    }

    /// The part where `sign * height <= 0`, closed by a face of outward normal `normal`.
    fn part(&self, heights: &[f64], sign: f64, normal: Vec3) -> Option<Self> {
        let mut draft = Draft {
            vertices: Vec::with_capacity(self.vertices.len() + 4),
            facets: Vec::with_capacity(self.facets.len() + 1),
            loops: Vec::with_capacity(self.loops.len() + 8),
        };
        const NONE: u8 = u8::MAX;
        let mut kept = [NONE; VERTICES];
        // Cut edges, each with its new vertex.
        let mut crossings: Vec<(u8, u8, u8)> = Vec::with_capacity(8);
        // The cap's loop, as the vertex that follows each; filled from the faces' cut sides.
        let mut next = [NONE; VERTICES + 1];
        let (mut sides, mut first) = (0, NONE);
        // Whether each vertex of a new loop lies on the plane.
        let mut on = [false; VERTICES + 1];
        for facet in &self.facets {
            let from = usize::from(facet.first);
            let ring = &self.loops[from..from + usize::from(facet.count)];
            let begin = draft.loops.len();
            let mut inside = false;
            for (i, &a) in ring.iter().enumerate() {
                let b = *ring.get(i + 1).unwrap_or(&ring[0]);
                let (ha, hb) = (
                    sign * heights[usize::from(a)],
                    sign * heights[usize::from(b)],
                );
                if ha <= 0.0 {
                    inside |= ha < 0.0;
                    let place = &mut kept[usize::from(a)];
                    if *place == NONE {
                        *place = draft.vertex(self.vertices[usize::from(a)])?;
                    }
                    on[draft.loops.len() - begin] = ha == 0.0;
                    draft.loops.push(*place);
                }
                if (ha < 0.0 && hb > 0.0) || (ha > 0.0 && hb < 0.0) {
                    let (low, high) = (a.min(b), a.max(b));
                    let known = crossings.iter().find(|c| (c.0, c.1) == (low, high));
                    let place = if let Some(&(_, _, place)) = known {
                        place
                    } else {
                        let (p, q) = (
                            self.vertices[usize::from(low)],
                            self.vertices[usize::from(high)],
                        );
                        let (hp, hq) = (heights[usize::from(low)], heights[usize::from(high)]);
                        let place = draft.vertex(add_scaled(p, hp / (hp - hq), sub(q, p)))?;
                        crossings.push((low, high, place));
                        place
                    };
                    on[draft.loops.len() - begin] = true;
                    draft.loops.push(place);
                }
            }
            let count = draft.loops.len() - begin;
            if !inside || count < 3 {
                draft.loops.truncate(begin);
                continue;
            }
            for i in 0..count {
                let j = if i + 1 < count { i + 1 } else { 0 };
                if on[i] && on[j] {
                    let (x, y) = (draft.loops[begin + i], draft.loops[begin + j]);
                    if next[usize::from(y)] != NONE {
                        return None;
                    }
                    next[usize::from(y)] = x;
                    first = y;
                    sides += 1;
                }
            }
            draft.close(facet.normal, begin)?;
        }
        if sides < 3 {
            return None;
        }
        let begin = draft.loops.len();
        let mut vertex = first;
        for _ in 0..sides {
            draft.loops.push(vertex);
            vertex = next[usize::from(vertex)];
            if vertex == NONE {
                return None;
            }
        }
        if vertex != first {
            return None;
        }
        draft.close(normal, begin)?;
        draft.finish(self.magnitude)
    }
}

impl Draft {
    /// Adds a vertex; `None` when there are too many.
    fn vertex(&mut self, p: Vec3) -> Option<u8> {
        if self.vertices.len() >= VERTICES {
            return None;
        }
        self.vertices.push(p);
        u8::try_from(self.vertices.len() - 1).ok()
    }

    pub(super) fn facet(&mut self, normal: Vec3, ring: [u8; 4]) {
        let begin = self.loops.len();
        self.loops.extend(ring);
        self.close(normal, begin).expect("few facets");
    }

    /// Makes a face of the loop that begins at `begin`; `None` when there are too many faces.
    fn close(&mut self, normal: Vec3, begin: usize) -> Option<()> {
        if self.facets.len() >= VERTICES {
            return None;
        }
        let corner = |i: usize| self.vertices[usize::from(self.loops[i])];
        let origin = corner(begin);
        let mut sum = [0.0; 3];
        for i in begin + 1..self.loops.len() - 1 {
            let triangle = cross(sub(corner(i), origin), sub(corner(i + 1), origin));
            sum = add_scaled(sum, 0.5, triangle);
        }
        self.facets.push(Facet {
            normal,
            area: dot(sum, normal).max(0.0),
            first: u16::try_from(begin).ok()?,
            count: u16::try_from(self.loops.len() - begin).ok()?,
        });
        Some(())
    }

    /// Pairs the faces' sides; `None` unless every side has exactly one partner.
    pub(super) fn finish(self, magnitude: f64) -> Option<Polytope> {
        let mut edges: Vec<Edge> = Vec::with_capacity(self.loops.len() / 2);
        // The latest edge from each vertex, and the one before each: few, so that an edge's second face finds it
        // quickly.
        const NONE: u16 = u16::MAX;
        let mut latest = [NONE; VERTICES];
        let mut before: Vec<u16> = Vec::with_capacity(self.loops.len() / 2);
        let mut open = 0;
        for (index, facet) in self.facets.iter().enumerate() {
            let face = u8::try_from(index).ok()?;
            let from = usize::from(facet.first);
            let ring = &self.loops[from..from + usize::from(facet.count)];
            for (i, &a) in ring.iter().enumerate() {
                let b = *ring.get(i + 1).unwrap_or(&ring[0]);
                let mut twin = latest[usize::from(b)];
                while let Some(edge) = edges.get_mut(usize::from(twin)) {
                    if edge.b == a && edge.right == u8::MAX {
                        edge.right = face;
                        open -= 1;
                        break;
                    }
                    twin = before[usize::from(twin)];
                }
                if twin == NONE {
                    before.push(latest[usize::from(a)]);
                    latest[usize::from(a)] = u16::try_from(edges.len()).ok()?;
                    open += 1;
                    edges.push(Edge {
                        a,
                        b,
                        left: face,
                        right: u8::MAX,
                    });
                }
            }
        }
        // Euler's formula rules out sides that more than two faces share.
        if open != 0 || self.vertices.len() + self.facets.len() != edges.len() + 2 {
            return None;
        }
        let area = self.facets.iter().map(|f| f.area).sum();
        Some(Polytope {
            vertices: self.vertices,
            facets: self.facets,
            loops: self.loops,
            edges,
            area,
            magnitude,
        })
    }
}
