// SPDX-License-Identifier: GPL-3.0-or-later
//! Splits polytopes: clips the faces one by one, closes the cut with the loop of their new sides, and pairs the
//! sides again. The result is a valid polytope or `None`.

use crate::cell::Plane;
use crate::polytope::{Edge, Facet, Polytope};
use crate::vec3::{Vec3, add_scaled, cross, dot, length, sub, widen};

/// Distance of a vertex from a plane, per unit of the scene's largest coordinate, up to which it counts as lying
/// on the plane. If rounding of vertices near the plane leaves no valid polytope, a larger and then a smaller
/// distance are tried.
pub const ON: [f64; 3] = [
    1.0 / (1_u64 << 40) as f64,
    1.0 / (1_u64 << 36) as f64,
    1.0 / (1_u64 << 46) as f64,
];

/// Largest number of vertices: their indices are bytes. Depth limits keep even simple polytopes below this.
const VERTICES: usize = 250;

/// A polytope under construction.
pub struct Draft {
    pub vertices: Vec<Vec3>,
    pub facets: Vec<Facet>,
    pub loops: Vec<u8>,
}

impl Polytope {
    /// Returns the parts below and above a plane; `None` if the plane misses the polytope, or if rounding leaves
    /// an invalid part.
    pub fn split(&self, plane: Plane) -> Option<(Self, Self)> {
        let [below, above] = self.parts(plane, [true; 2])?;
        below.zip(above)
    }

    /// Returns those of the two parts whose entry in `wanted` is set; `None` as in [`Self::split`].
    pub fn parts(&self, plane: Plane, wanted: [bool; 2]) -> Option<[Option<Self>; 2]> {
        ON.iter()
            .find_map(|&on| self.parts_within(plane, wanted, on))
    }

    /// Returns the parts, where vertices within the relative distance `on` of the plane count as lying on it.
    fn parts_within(&self, plane: Plane, wanted: [bool; 2], on: f64) -> Option<[Option<Self>; 2]> {
        let n = widen(plane.direction.vector());
        // Compute the height of each vertex over the plane.
        let mut heights = [0.0; VERTICES];
        for (height, &v) in heights.iter_mut().zip(&self.vertices) {
            let h = dot(n, v) - f64::from(plane.offset);
            // Snap each vertex once, so that all faces agree on it.
            *height = if h.abs() <= on * self.magnitude {
                0.0
            } else {
                h
            };
        }
        let heights = &heights[..self.vertices.len()];
        // The plane must have vertices strictly on both sides.
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

    /// Returns the part where `sign * height <= 0`, closed by a face of outward normal `normal`.
    fn part(&self, heights: &[f64], sign: f64, normal: Vec3) -> Option<Self> {
        // Collect the kept faces in a draft.
        let mut draft = Draft {
            vertices: Vec::with_capacity(self.vertices.len() + 4),
            facets: Vec::with_capacity(self.facets.len() + 1),
            loops: Vec::with_capacity(self.loops.len() + 8),
        };
        const NONE: u8 = u8::MAX;
        let mut kept = [NONE; VERTICES];
        // Edges that the plane cuts, each with its new vertex.
        let mut crossings: Vec<(u8, u8, u8)> = Vec::with_capacity(8);
        // Loop of the new face, as the successor of each vertex; filled from the cut sides of the faces.
        let mut next = [NONE; VERTICES + 1];
        let (mut sides, mut first) = (0, NONE);
        // Whether each vertex of the current face's new loop lies on the plane.
        let mut on = [false; VERTICES + 1];
        for facet in &self.facets {
            // Clip the loop of this face.
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
                // Add the vertex where the side crosses the plane, shared with the neighbouring face.
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
            // Drop faces that lie outside, or touch the part only along a side.
            let count = draft.loops.len() - begin;
            if !inside || count < 3 {
                draft.loops.truncate(begin);
                continue;
            }
            // A side on the plane, reversed, is a side of the new face.
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
        // Close the new face: its sides must form one loop.
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
    /// Adds a vertex and returns its index; `None` if there are too many.
    fn vertex(&mut self, p: Vec3) -> Option<u8> {
        if self.vertices.len() >= VERTICES {
            return None;
        }
        self.vertices.push(p);
        u8::try_from(self.vertices.len() - 1).ok()
    }

    /// Adds a quadrilateral face.
    pub fn facet(&mut self, normal: Vec3, ring: [u8; 4]) {
        let begin = self.loops.len();
        self.loops.extend(ring);
        self.close(normal, begin).expect("few facets");
    }

    /// Makes a face of the loop that begins at `begin`; `None` if there are too many faces.
    fn close(&mut self, normal: Vec3, begin: usize) -> Option<()> {
        if self.facets.len() >= VERTICES {
            return None;
        }
        let corner = |i: usize| self.vertices[usize::from(self.loops[i])];
        let origin = corner(begin);
        let mut sum = [0.0; 3];
        // Sum the vector areas of a triangle fan.
        for i in begin + 1..self.loops.len() - 1 {
            let triangle = cross(sub(corner(i), origin), sub(corner(i + 1), origin));
            sum = add_scaled(sum, 0.5, triangle);
        }
        // The area is that of the projection along the normal; rounding may make it negative.
        self.facets.push(Facet {
            normal,
            area: dot(sum, normal).max(0.0),
            first: u16::try_from(begin).ok()?,
            count: u16::try_from(self.loops.len() - begin).ok()?,
        });
        Some(())
    }

    /// Pairs the sides of the faces; `None` unless every side has exactly one partner.
    pub fn finish(self, magnitude: f64) -> Option<Polytope> {
        let mut edges: Vec<Edge> = Vec::with_capacity(self.loops.len() / 2);
        // The latest edge from each vertex, and the edge before each: short lists, in which the second face of an
        // edge finds it quickly.
        const NONE: u16 = u16::MAX;
        let mut latest = [NONE; VERTICES];
        let mut before: Vec<u16> = Vec::with_capacity(self.loops.len() / 2);
        let mut open = 0;
        // Match each side with the opposite side of another face.
        for (index, facet) in self.facets.iter().enumerate() {
            let face = u8::try_from(index).ok()?;
            let from = usize::from(facet.first);
            let ring = &self.loops[from..from + usize::from(facet.count)];
            for (i, &a) in ring.iter().enumerate() {
                let b = *ring.get(i + 1).unwrap_or(&ring[0]);
                // Find the edge in the opposite direction, or add a new one.
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
        // Euler's formula excludes sides that more than two faces share.
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
