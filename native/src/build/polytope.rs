// SPDX-License-Identifier: GPL-3.0-or-later
//! Convex polytopes: cells of trees with oblique planes.
//!
//! The areas of both parts of a cut need no cut. With unit direction `w`, facets `F` of outward unit
//! normal `n_F`, and `a_F(t)` the area of `F` below height `t`, the vector areas of a closed body sum
//! to zero, so
//!
//! ```text
//! below(t) = sum a_F(t) (1 - w.n_F)        above(t) = sum (|F| - a_F(t)) (1 + w.n_F)
//! ```
//!
//! count the face of the cut too, and every term is positive. The derivative of `a_F` is the length
//! of the cut through `F` over the sine of its slope, and that length is a difference of positions
//! on the two edges where the cut enters and leaves `F`. So both sums are sums over edges, each edge
//! adding a quadratic polynomial of how much of it lies below the cut.

use super::cell::Plane;
use super::profile::{EdgeTerm, Profile};
use crate::geom::Aabb;
use crate::geom::vec3::{Vec3, add_scaled, cross, dot, length, sub, widen};

/// Vertices within this share of the scene's size of a plane count as lying on it. Where a plane runs through
/// vertices that rounding moved, some of an edge's ends may, and leave no polytope: then more do, or fewer.
const ON: [f64; 3] = [
    1.0 / (1_u64 << 40) as f64,
    1.0 / (1_u64 << 36) as f64,
    1.0 / (1_u64 << 46) as f64,
];

/// Planes nearer than this share of the scene's size to a cell's end are not tried.
pub const NEAR: f32 = 1.0 / (1 << 21) as f32;

/// A facet whose slope has a smaller sine squared is perpendicular to the direction.
const LEVEL: f64 = 1e-18;

/// Vertices are numbered in a byte. Depth limits keep even simple polytopes below this.
const VERTICES: usize = 250;

#[expect(
    clippy::cast_possible_truncation,
    reason = "shares need no more than f32"
)]
fn narrow(x: f64) -> f32 {
    x as f32
}

/// A face of a polytope.
#[derive(Debug, Clone, Copy)]
pub struct Facet {
    /// Outward unit normal.
    pub normal: Vec3,
    /// Area.
    pub area: f64,
    first: u16,
    count: u16,
}

/// An edge: it runs from `a` to `b` in the loop of its left facet.
#[derive(Debug, Clone, Copy)]
struct Edge {
    a: u8,
    b: u8,
    left: u8,
    right: u8,
}

/// A bounded convex polytope with at least four facets.
#[derive(Debug, Clone)]
pub struct Polytope {
    vertices: Vec<Vec3>,
    facets: Vec<Facet>,
    /// Vertices of all facets, counter-clockwise seen from outside.
    loops: Vec<u8>,
    edges: Vec<Edge>,
    area: f64,
    /// Largest coordinate of the scene.
    magnitude: f64,
}

/// A polytope under construction.
struct Draft {
    vertices: Vec<Vec3>,
    facets: Vec<Facet>,
    loops: Vec<u8>,
}

impl Polytope {
    /// A box.
    pub fn from_box(bounds: &Aabb, magnitude: f32) -> Self {
        let vertices = (0..8)
            .map(|corner| {
                std::array::from_fn(|k| {
                    let end = if corner >> k & 1 == 0 {
                        bounds.min[k]
                    } else {
                        bounds.max[k]
                    };
                    f64::from(end)
                })
            })
            .collect();
        let mut draft = Draft {
            vertices,
            facets: Vec::with_capacity(8),
            loops: Vec::with_capacity(32),
        };
        for k in 0..3 {
            let (i, j) = (1 << ((k + 1) % 3), 1 << ((k + 2) % 3));
            for (side, sign) in [(0, -1.0), (1, 1.0)] {
                let base = (side << k) as u8;
                let mut face = [base, base | i, base | i | j, base | j];
                if side == 0 {
                    face.reverse();
                }
                let mut normal = [0.0; 3];
                normal[k] = sign;
                draft.facet(normal, face);
            }
        }
        draft.finish(f64::from(magnitude)).expect("a box is closed")
    }

    /// Surface area.
    pub fn area(&self) -> f64 {
        self.area
    }

    /// Faces.
    pub fn facets(&self) -> &[Facet] {
        &self.facets
    }

    /// Corners of a face, counter-clockwise seen from outside.
    pub fn corners(&self, facet: &Facet) -> impl Iterator<Item = Vec3> {
        let first = usize::from(facet.first);
        self.loops[first..first + usize::from(facet.count)]
            .iter()
            .map(|&v| self.vertices[usize::from(v)])
    }

    /// Vertices minus edges plus faces: 2 for every polytope (Euler).
    pub fn euler(&self) -> usize {
        self.vertices.len() + self.facets.len() - self.edges.len()
    }

    /// Length of the sum of the faces' vector areas: 0 for a closed surface but for rounding.
    pub fn gap(&self) -> f64 {
        let sum = self
            .facets
            .iter()
            .fold([0.0; 3], |sum, f| add_scaled(sum, f.area, f.normal));
        length(sum)
    }

    /// What rounding may do to sums of areas of this polytope.
    pub fn area_noise(&self) -> f64 {
        1e-9 * self.area + Self::AREA_NOISE * self.magnitude * self.area.sqrt()
    }

    /// What rounding of the vertices does to areas, in units of the scene's size times the root of
    /// the area: some vertices are snapped to planes.
    const AREA_NOISE: f64 = 1024.0 * ON[0];

    /// Largest coordinate of the scene.
    pub fn magnitude(&self) -> f64 {
        self.magnitude
    }

    /// How far the polytope reaches along `direction`; see [`super::cell::Cell::extent`].
    pub fn extent(&self, direction: [f32; 3], out: &mut Profile) -> bool {
        let n = widen(direction);
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        out.heights.clear();
        out.heights.extend(self.vertices.iter().map(|&v| {
            let height = dot(n, v);
            low = if height < low { height } else { low };
            high = if height > high { height } else { high };
            height
        }));
        (out.low, out.high) = (narrow(low), narrow(high));
        out.margin = NEAR * narrow(self.magnitude);
        out.walls = false;
        self.area > 0.0 && n != [0.0; 3]
    }

    /// How the surface divides when the polytope is cut along `direction`; see
    /// [`super::cell::Cell::divide`].
    pub fn divide(&self, direction: [f32; 3], out: &mut Profile) {
        let n = widen(direction);
        let norm = length(n);
        let w = n.map(|x| x / norm);
        out.slope = 0.0;
        out.edges.clear();

        // Per facet, the tangent of the cut over (1 + nu) and (1 - nu), each in the form that does not
        // cancel.
        let tangents = &mut out.tangents;
        tangents.clear();
        let (mut start_below, mut start_above) = (0.0, 0.0);
        for facet in &self.facets {
            let nu = dot(w, facet.normal);
            let t = cross(w, facet.normal);
            let sine2 = dot(t, t);
            start_above += facet.area * (1.0 + nu);
            if sine2 < LEVEL {
                start_below += facet.area * (1.0 - nu);
                tangents.push([[0.0; 2]; 3]);
                continue;
            }
            let (down, up) = if nu < 0.0 {
                ((1.0 - nu) / sine2, 1.0 / (1.0 - nu))
            } else {
                (1.0 / (1.0 + nu), (1.0 + nu) / sine2)
            };
            let [x, y, z] = t;
            tangents.push([[down * x, up * x], [down * y, up * y], [down * z, up * z]]);
        }
        // A level face on top adds nothing below: its factor is zero but for rounding.
        out.constant = [
            narrow(start_below / self.area),
            narrow(start_above / self.area),
        ];

        let origin = self.vertices[0];
        let heights = &out.heights;
        let base = f64::from(out.low);
        let scale = 1.0 / (norm * self.area);
        let shortest = 1e-12 * f64::from(out.high - out.low);
        for edge in &self.edges {
            let (a, b) = (usize::from(edge.a), usize::from(edge.b));
            let reach = heights[b] - heights[a];
            if reach.abs() <= shortest {
                continue;
            }
            // Seen from the facet in whose loop the edge runs upwards.
            let (a, b, up, down, reach) = if reach > 0.0 {
                (a, b, edge.left, edge.right, reach)
            } else {
                (b, a, edge.right, edge.left, -reach)
            };
            let (up, down) = (&tangents[usize::from(up)], &tangents[usize::from(down)]);
            let p = sub(self.vertices[a], origin);
            let m = sub(self.vertices[b], self.vertices[a]);
            let slope = 0.5 * scale / reach;
            // Below and above side by side, two numbers in one register.
            let (mut linear, mut quadratic) = ([0.0; 2], [0.0; 2]);
            for k in 0..3 {
                for side in 0..2 {
                    let g = up[k][side] - down[k][side];
                    linear[side] += p[k] * g;
                    quadratic[side] += m[k] * g;
                }
            }
            out.edges.push(EdgeTerm {
                start: narrow(heights[a] - base),
                reach: narrow(reach),
                below: [narrow(scale * linear[0]), narrow(slope * quadratic[0])],
                above: [narrow(scale * linear[1]), narrow(slope * quadratic[1])],
            });
        }
    }

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

    fn facet(&mut self, normal: Vec3, ring: [u8; 4]) {
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
    fn finish(self, magnitude: f64) -> Option<Polytope> {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::build::cell::Direction;
    use proptest::prelude::*;

    fn unit_box() -> Polytope {
        Polytope::from_box(
            &Aabb {
                min: [-1.0, 0.0, 2.0],
                max: [1.0, 3.0, 3.0],
            },
            3.0,
        )
    }

    fn sound(cell: &Polytope) {
        assert_eq!(cell.euler(), 2);
        assert!(cell.gap() <= cell.area_noise(), "{}", cell.gap());
    }

    #[test]
    fn a_box_is_a_polytope() {
        sound(&unit_box());
        assert_eq!(unit_box().area(), 22.0);
    }

    fn direction() -> impl Strategy<Value = [f32; 3]> {
        prop_oneof![
            [-1.0_f32..1.0, -1.0_f32..1.0, -1.0_f32..1.0],
            [-1_i8..2, -1_i8..2, -1_i8..2].prop_map(|v| v.map(f32::from)),
            // Nearly an axis.
            [0_u8..3, 0_u8..3].prop_map(|[k, small]| std::array::from_fn(|i| if i == k as usize {
                1.0
            } else if i == small as usize {
                1e-5
            } else {
                0.0
            })),
        ]
        .prop_filter("a direction", |v| v.iter().any(|x| x.abs() > 0.1))
        .prop_map(|v| {
            let length = v.iter().map(|x| x * x).sum::<f32>().sqrt();
            v.map(|x| x / length)
        })
    }

    proptest! {
        /// Areas without cutting are the areas of the parts; parts are closed; a cut counts twice.
        #[test]
        fn profiles_are_the_areas_of_the_parts(
            cuts in prop::collection::vec((direction(), 0.05_f32..0.95, any::<bool>()), 1..14)
        ) {
            let mut cell = unit_box();
            let mut profile = Profile::default();
            for (n, at, lower) in cuts {
                if !cell.extent(n, &mut profile) || profile.high - profile.low < 1e-3 {
                    break;
                }
                cell.divide(n, &mut profile);
                let offset = profile.low + at * (profile.high - profile.low);
                let plane = Plane { direction: Direction::Oblique(n), offset };
                let (below, above) = cell.split(plane).expect("a cut inside");
                sound(&below);
                sound(&above);
                let cap = below.facets().last().unwrap().area;
                let sum = below.area() + above.area() - 2.0 * cap;
                prop_assert!((sum / cell.area() - 1.0).abs() < 1e-9, "{} {}", sum, cell.area());
                let (left, right) = profile.shares(offset);
                prop_assert!((f64::from(left) - below.area() / cell.area()).abs() < 1e-4);
                prop_assert!((f64::from(right) - above.area() / cell.area()).abs() < 1e-4);
                let [least_below, least_above] = profile.least_shares(offset);
                prop_assert!(least_below <= left && least_above <= right);
                cell = if lower { below } else { above };
            }
        }
    }

    /// Two hundred cuts by planes a hundredth of a degree apart.
    #[test]
    fn nearly_parallel_cuts_keep_a_cell_closed() {
        let mut cell = unit_box();
        for i in 0..200 {
            let angle = 1.745e-4 * f64::from(i);
            #[expect(clippy::cast_possible_truncation, reason = "a direction")]
            let n = [angle.cos() as f32, angle.sin() as f32, 0.0];
            let plane = Plane {
                direction: Direction::Oblique(n),
                offset: 0.9,
            };
            let before = cell.area();
            if let Some((below, above)) = cell.split(plane) {
                sound(&below);
                sound(&above);
                assert!(below.area() <= before * (1.0 + 1e-12));
                cell = below;
            }
        }
    }
}
