// SPDX-License-Identifier: GPL-3.0-or-later
//! The flat polygons of a scene: neighbouring triangles of one material in one plane, which mirror or refract a beam as
//! one.

use crate::material::Material;
use crate::scene::RenderScene;
use halfspace_geom::vec3::{cross, dot, length, map, sub, widen};

/// A plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// Unit normal.
    pub normal: [f64; 3],
    /// Dot product of the normal with each point of the plane.
    pub offset: f64,
}

impl Plane {
    /// The plane of a triangle, or `None` if it has no area.
    fn of(corners: [[f32; 3]; 3]) -> Option<Self> {
        let [a, b, c] = corners.map(widen);
        let n = cross(sub(b, a), sub(c, a));
        let area = length(n);
        if !(area > 0.0 && area.is_finite()) {
            return None;
        }
        let normal = map(n, |x| x / area);
        Some(Self {
            normal,
            offset: dot(normal, a),
        })
    }

    /// Whether these vertices lie in the plane, up to [`FLAT`].
    fn contains(&self, corners: [[f32; 3]; 3]) -> bool {
        corners.map(widen).iter().all(|&v| {
            let size = v
                .iter()
                .fold(self.offset.abs(), |most, x| most.max(x.abs()));
            self.height(v).abs() <= FLAT * size
        })
    }

    /// Returns the height of a point above the plane.
    pub fn height(&self, point: [f64; 3]) -> f64 {
        dot(self.normal, point) - self.offset
    }
}

/// Largest distance from a plane at which a vertex counts as in it, relative to the largest coordinate of either: two
/// roundings of f32, by which the vertices of a flat polygon that was moved or turned miss its plane.
const FLAT: f64 = 2.0 * f32::EPSILON as f64;

/// Marks triangles without a plane.
const NO_PLANE: u32 = u32::MAX;

/// The polygons of the materials that can mirror or refract.
#[derive(Debug)]
pub struct Polygons {
    /// For each triangle the index of its polygon's plane, or [`NO_PLANE`].
    plane_of: Vec<u32>,
    planes: Vec<Plane>,
}

impl Polygons {
    /// Joins the triangles of a scene that share an edge, a material and a plane. Takes O(n log n) for n triangles.
    pub fn of(scene: &RenderScene) -> Self {
        let tracer = &*scene.tracer;
        let count = u32::try_from(tracer.count()).expect("triangle numbers are 32 bits wide");
        let material = |id: u32| scene.attributes.at(id).material();
        // Find the triangles that have a plane, and their edges, which sorting brings together.
        let mut edges = Vec::new();
        let mut plane_of = vec![NO_PLANE; count as usize];
        let mut planes = Vec::new();
        for id in 0..count {
            let Material {
                reflects, refracts, ..
            } = scene.materials[material(id)];
            let corners = tracer.corners(id);
            let Some(plane) = Plane::of(corners).filter(|_| reflects || refracts) else {
                continue;
            };
            plane_of[id as usize] = planes.len() as u32;
            planes.push(plane);
            // Adding 0 makes -0 and 0 the same vertex.
            let bits = corners.map(|v| v.map(|x| (x + 0.0).to_bits()));
            for k in 0..3 {
                let (a, b) = (bits[k], bits[(k + 1) % 3]);
                edges.push((a.min(b), a.max(b), material(id), id));
            }
        }
        edges.sort_unstable();
        // Give triangles across an edge the lower plane of both, if it contains the other triangle.
        let mut first: Vec<u32> = (0..planes.len() as u32).collect();
        let same = |a: &Edge, b: &Edge| (a.0, a.1, a.2) == (b.0, b.1, b.2);
        for around in edges.chunk_by(same) {
            for pair in around.windows(2) {
                let [a, b] =
                    [pair[0].3, pair[1].3].map(|id| root(&mut first, plane_of[id as usize]));
                let (low, high, other) = if a < b {
                    (a, b, pair[1].3)
                } else {
                    (b, a, pair[0].3)
                };
                if planes[low as usize].contains(tracer.corners(other)) {
                    first[high as usize] = low;
                }
            }
        }
        // Leave a triangle its own plane if joins have led too far from it.
        for id in 0..count {
            let own = plane_of[id as usize];
            if own != NO_PLANE {
                let joint = root(&mut first, own);
                if planes[joint as usize].contains(tracer.corners(id)) {
                    plane_of[id as usize] = joint;
                }
            }
        }
        Self { plane_of, planes }
    }

    /// Returns the plane of a triangle's polygon, if the triangle has an area and its material can mirror or refract.
    #[inline(always)]
    pub fn plane(&self, triangle: u32) -> Option<&Plane> {
        self.planes.get(self.plane_of[triangle as usize] as usize)
    }
}

/// An edge: its vertices in ascending order of their bits, the material and the number of its triangle.
type Edge = ([u32; 3], [u32; 3], usize, u32);

/// Returns the lowest plane that a plane was joined to. Halves the path to it, so that long strips of triangles stay
/// cheap.
fn root(first: &mut [u32], mut plane: u32) -> u32 {
    while first[plane as usize] != plane {
        let next = first[first[plane as usize] as usize];
        first[plane as usize] = next;
        plane = next;
    }
    plane
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::MaterialParams;
    use crate::scene::SceneParams;
    use crate::tests::setup::{Mesh, matte};

    #[test]
    fn quads_are_one_polygon_and_cubes_are_six() {
        let mut mesh = Mesh::default();
        mesh.cube(1.3, 0);
        mesh.floor(5.0, -3.0, 1);
        // A neighbour in the same plane, of another material.
        mesh.quad(
            [
                [5.0, -5.0, -3.0],
                [9.0, -5.0, -3.0],
                [9.0, 5.0, -3.0],
                [5.0, 5.0, -3.0],
            ],
            0,
        );
        // A fold of 0.1 degrees is not flat.
        mesh.quad(
            [
                [5.0, 5.0, -3.0],
                [9.0, 5.0, -3.0],
                [9.0, 6.0, -3.002],
                [5.0, 6.0, -3.002],
            ],
            0,
        );
        // Diffuse surfaces mirror nothing; triangles without area have no plane.
        mesh.quad([[0.0, 0.0, 7.0]; 4], 0);
        mesh.floor(1.0, 8.0, 2);
        let scene = mesh.scene(SceneParams {
            materials: vec![
                MaterialParams::default(),
                MaterialParams::default(),
                matte(0.5),
            ],
            ..Default::default()
        });
        let polygons = Polygons::of(&scene);
        let plane = |id: u32| polygons.plane_of[id as usize];
        for side in 0..6 {
            assert_eq!(plane(2 * side), plane(2 * side + 1), "side {side}");
            assert!(side == 0 || plane(2 * side) != plane(2 * side - 1));
        }
        assert_eq!(plane(12), plane(13));
        assert_eq!(plane(14), plane(15));
        assert_ne!(plane(12), plane(14), "another material");
        assert_ne!(plane(14), plane(16), "a fold");
        assert_eq!([plane(18), plane(20)], [NO_PLANE; 2]);
        assert_eq!(polygons.plane(18), None);
    }
}
