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

/// Marks a vertex without an index.
const NONE: u8 = u8::MAX;

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
        let mut part = Part {
            whole: self,
            heights,
            sign,
            draft: Draft {
                vertices: Vec::with_capacity(self.vertices.len() + 4),
                facets: Vec::with_capacity(self.facets.len() + 1),
                loops: Vec::with_capacity(self.loops.len() + 8),
            },
            kept: [NONE; VERTICES],
            crossings: Vec::with_capacity(8),
            on: [false; VERTICES + 1],
        };
        // Clip the faces, and collect their sides on the plane.
        let mut section = Section {
            next: [NONE; VERTICES + 1],
            sides: 0,
            first: NONE,
        };
        for facet in &self.facets {
            let begin = part.draft.loops.len();
            let inside = part.clip(facet)?;
            // Drop faces that lie outside, or touch the part only along a side.
            let count = part.draft.loops.len() - begin;
            if !inside || count < 3 {
                part.draft.loops.truncate(begin);
                continue;
            }
            section.add(&part.draft.loops[begin..], &part.on)?;
            part.draft.close(facet.normal, begin)?;
        }
        // Close the part by the section.
        let mut draft = part.draft;
        let begin = draft.loops.len();
        section.write(&mut draft.loops)?;
        draft.close(normal, begin)?;
        draft.finish(self.magnitude)
    }
}

/// One side of a split under construction.
struct Part<'a> {
    whole: &'a Polytope,
    /// Heights of the vertices of the whole over the plane; multiplied by `sign`, they are negative inside.
    heights: &'a [f64],
    sign: f64,
    /// The kept faces.
    draft: Draft,
    /// Index in the draft of each vertex of the whole, or [`NONE`].
    kept: [u8; VERTICES],
    /// Edges that the plane cuts.
    crossings: Vec<Crossing>,
    /// Whether each vertex of the current face's new loop lies on the plane.
    on: [bool; VERTICES + 1],
}

/// An edge that the plane cuts, by the indices of its vertices in ascending order.
struct Crossing {
    low: u8,
    high: u8,
    /// Index of its new vertex in the draft.
    vertex: u8,
}

impl Part<'_> {
    /// Appends the loop of the part of a face; returns whether the face has a vertex inside. `None` if there are
    /// too many vertices.
    #[inline(always)]
    fn clip(&mut self, facet: &Facet) -> Option<bool> {
        let from = usize::from(facet.first);
        let ring = &self.whole.loops[from..from + usize::from(facet.count)];
        let begin = self.draft.loops.len();
        let mut inside = false;
        for (i, &a) in ring.iter().enumerate() {
            let b = *ring.get(i + 1).unwrap_or(&ring[0]);
            let (ha, hb) = (
                self.sign * self.heights[usize::from(a)],
                self.sign * self.heights[usize::from(b)],
            );
            // Keep a vertex inside or on the plane.
            if ha <= 0.0 {
                inside |= ha < 0.0;
                let kept = &mut self.kept[usize::from(a)];
                if *kept == NONE {
                    *kept = self.draft.vertex(self.whole.vertices[usize::from(a)])?;
                }
                self.on[self.draft.loops.len() - begin] = ha == 0.0;
                self.draft.loops.push(*kept);
            }
            // Add the vertex where the side crosses the plane.
            if (ha < 0.0 && hb > 0.0) || (ha > 0.0 && hb < 0.0) {
                let vertex = self.crossing(a.min(b), a.max(b))?;
                self.on[self.draft.loops.len() - begin] = true;
                self.draft.loops.push(vertex);
            }
        }
        Some(inside)
    }

    /// Returns the new vertex of an edge that the plane cuts, which both faces of the edge share.
    #[inline(always)]
    fn crossing(&mut self, low: u8, high: u8) -> Option<u8> {
        let mut crossings = self.crossings.iter();
        if let Some(known) = crossings.find(|c| (c.low, c.high) == (low, high)) {
            return Some(known.vertex);
        }
        // Interpolate between the edge's vertices.
        let (p, q) = (
            self.whole.vertices[usize::from(low)],
            self.whole.vertices[usize::from(high)],
        );
        let (hp, hq) = (
            self.heights[usize::from(low)],
            self.heights[usize::from(high)],
        );
        let vertex = self
            .draft
            .vertex(add_scaled(p, hp / (hp - hq), sub(q, p)))?;
        self.crossings.push(Crossing { low, high, vertex });
        Some(vertex)
    }
}

/// The new face of a part, put together from the sides of the other faces that lie on the plane.
struct Section {
    /// Successor of each vertex in the loop, or [`NONE`].
    next: [u8; VERTICES + 1],
    /// Number of sides.
    sides: usize,
    /// A vertex of the loop.
    first: u8,
}

impl Section {
    /// Adds the sides of a face that lie on the plane, in the opposite direction; `on` as in [`Part`]. `None` if two
    /// sides begin at one vertex.
    #[inline(always)]
    fn add(&mut self, ring: &[u8], on: &[bool; VERTICES + 1]) -> Option<()> {
        for i in 0..ring.len() {
            let j = if i + 1 < ring.len() { i + 1 } else { 0 };
            if on[i] && on[j] {
                let (x, y) = (ring[i], ring[j]);
                if self.next[usize::from(y)] != NONE {
                    return None;
                }
                self.next[usize::from(y)] = x;
                self.first = y;
                self.sides += 1;
            }
        }
        Some(())
    }

    /// Appends the loop; `None` unless the sides form a single one.
    #[inline(always)]
    fn write(&self, loops: &mut Vec<u8>) -> Option<()> {
        if self.sides < 3 {
            return None;
        }
        let mut vertex = self.first;
        for _ in 0..self.sides {
            loops.push(vertex);
            vertex = self.next[usize::from(vertex)];
            if vertex == NONE {
                return None;
            }
        }
        (vertex == self.first).then_some(())
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
        const NO_EDGE: u16 = u16::MAX;
        let mut latest = [NO_EDGE; VERTICES];
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
                if twin == NO_EDGE {
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
