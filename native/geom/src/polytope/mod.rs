// SPDX-License-Identifier: GPL-3.0-or-later
//! Convex polytopes: cells of trees with oblique planes.
//!
//! The areas of both parts of a cut can be computed without cutting. Let `w` be a unit direction, `F` the facets with
//! outward unit normals `n_F`, and `a_F(t)` the area of `F` below height `t`. The vector areas of a closed body sum to
//! zero. Therefore
//!
//! ```text
//! below(t) = sum a_F(t) (1 - w.n_F)        above(t) = sum (|F| - a_F(t)) (1 + w.n_F)
//! ```
//!
//! are the surface areas of the parts, the face of the cut included, and every term is nonnegative. The derivative of
//! `a_F` is the length of the cut through `F` divided by the sine of its slope, and that length is a difference of
//! positions on the two edges where the cut enters and leaves `F`. Both sums are therefore sums over edges, and each
//! edge adds a quadratic polynomial of the part of it that lies below the cut.

use crate::Aabb;
use crate::profile::{EdgeTerm, Profile};
use crate::vec3::{Vec3, add_scaled, cross, dot, length, sub, widen};

mod cut;
#[cfg(test)]
mod tests;
use cut::{Draft, ON};

/// Distance of a plane from a cell's end, per unit of the scene's largest coordinate, below which the plane is not
/// tried.
pub const NEAR: f32 = 1.0 / (1 << 21) as f32;

/// Facets whose normal makes an angle of smaller squared sine with the direction count as perpendicular to it (chosen).
const LEVEL: f64 = 1e-18;

/// Rounds a share to f32.
#[expect(
    clippy::cast_possible_truncation,
    reason = "shares need no more than f32"
)]
fn narrow(x: f64) -> f32 {
    x as f32
}

/// A facet of a polytope.
#[derive(Debug, Clone, Copy)]
pub struct Facet {
    /// Outward unit normal.
    pub normal: Vec3,
    /// Area.
    pub area: f64,
    /// Index of its first vertex in the loops.
    first: u16,
    /// Number of vertices.
    count: u16,
}

/// An edge from vertex `a` to vertex `b` in the loop of its left facet; the right facet has it in reverse.
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
    /// Vertices of all facets, counter-clockwise as seen from outside.
    loops: Vec<u8>,
    edges: Vec<Edge>,
    area: f64,
    /// Largest coordinate of the scene.
    magnitude: f64,
}

impl Polytope {
    /// Makes a polytope from a box.
    pub fn from_box(bounds: &Aabb, magnitude: f32) -> Self {
        // Bit k of a vertex's index selects the end along axis k.
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
            // Add two facets per axis, each counter-clockwise as seen from outside.
            for (side, sign) in [(0, -1.0), (1, 1.0)] {
                let base = (side << k) as u8;
                // Facets at the lower end have the reverse orientation.
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

    /// Returns the surface area.
    pub fn area(&self) -> f64 {
        self.area
    }

    /// Returns the facets.
    pub fn facets(&self) -> &[Facet] {
        &self.facets
    }

    /// Returns the vertices of a facet, counter-clockwise as seen from outside.
    pub fn corners(&self, facet: &Facet) -> impl Iterator<Item = Vec3> {
        let first = usize::from(facet.first);
        self.loops[first..first + usize::from(facet.count)]
            .iter()
            .map(|&v| self.vertices[usize::from(v)])
    }

    /// Returns the number of vertices minus edges plus facets: 2 for every polytope (Euler).
    pub fn euler(&self) -> usize {
        self.vertices.len() + self.facets.len() - self.edges.len()
    }

    /// Returns the length of the sum of the facets' vector areas: 0 for a closed surface, up to rounding.
    pub fn gap(&self) -> f64 {
        let sum = self
            .facets
            .iter()
            .fold([0.0; 3], |sum, f| add_scaled(sum, f.area, f.normal));
        length(sum)
    }

    /// Returns a bound on the rounding error of sums of areas of this polytope.
    pub fn area_noise(&self) -> f64 {
        1e-9 * self.area + Self::AREA_NOISE * self.magnitude * self.area.sqrt()
    }

    /// Rounding error of areas that comes from that of vertices, some of which are snapped to planes, in units of the
    /// scene's largest coordinate multiplied by the square root of the area.
    const AREA_NOISE: f64 = 1024.0 * ON[0];

    /// Returns the largest coordinate of the scene.
    pub fn magnitude(&self) -> f64 {
        self.magnitude
    }

    /// Returns the bytes of its lists.
    pub fn allocated(&self) -> usize {
        size_of_val(&*self.vertices)
            + size_of_val(&*self.facets)
            + size_of_val(&*self.loops)
            + size_of_val(&*self.edges)
    }

    /// Writes the extent of the polytope along `direction`; see [`crate::cell::Cell::extent`].
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

    /// Writes the areas of both parts as functions of the cut's height along `direction`; see
    /// [`crate::cell::Cell::divide`].
    pub fn divide(&self, direction: [f32; 3], out: &mut Profile) {
        let n = widen(direction);
        let norm = length(n);
        let w = n.map(|x| x / norm);
        out.slope = 0.0;
        out.edges.clear();

        // Per facet, with nu = w . n, compute w x n, which lies along the cut, times (1 - nu) / sin^2 = 1 / (1 + nu)
        // and times (1 + nu) / sin^2 = 1 / (1 - nu), each in the form without cancellation.
        let tangents = &mut out.tangents;
        tangents.clear();
        let (mut start_below, mut start_above) = (0.0, 0.0);
        for facet in &self.facets {
            let nu = dot(w, facet.normal);
            let t = cross(w, facet.normal);
            let sine2 = dot(t, t);
            start_above += facet.area * (1.0 + nu);
            // A facet perpendicular to the direction adds its whole area at one height, and its edges add nothing.
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
        // Such a facet at the upper end adds nothing below: its factor 1 - nu is zero up to rounding.
        out.constant = [
            narrow(start_below / self.area),
            narrow(start_above / self.area),
        ];

        // Add the quadratic polynomial of each edge.
        let origin = self.vertices[0];
        let heights = &out.heights;
        let base = f64::from(out.low);
        let scale = 1.0 / (norm * self.area);
        let shortest = 1e-12 * f64::from(out.high - out.low);
        for edge in &self.edges {
            let (a, b) = (usize::from(edge.a), usize::from(edge.b));
            // Skip edges perpendicular to the direction.
            let reach = heights[b] - heights[a];
            if reach.abs() <= shortest {
                continue;
            }
            // Orient the edge upwards: `up` is the facet in whose loop it runs upwards.
            let (a, b, up, down, reach) = if reach > 0.0 {
                (a, b, edge.left, edge.right, reach)
            } else {
                (b, a, edge.right, edge.left, -reach)
            };
            let (up, down) = (&tangents[usize::from(up)], &tangents[usize::from(down)]);
            // Positions relative to one vertex reduce cancellation.
            let p = sub(self.vertices[a], origin);
            let m = sub(self.vertices[b], self.vertices[a]);
            let slope = 0.5 * scale / reach;
            // Below and above in adjacent lanes, two numbers in one register.
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
}
