// SPDX-License-Identifier: GPL-3.0-or-later
//! Instances of meshes: their transform, and the error bounds for rays in the mesh's space.

use halfspace_geom::Aabb;
use halfspace_geom::transform::{Inverse, Transform};
use halfspace_geom::vec3::{Vec3, map};

/// An instance of a mesh, with its bounding box in the scene.
#[derive(Debug, Clone, Copy)]
pub struct MeshInstance {
    /// Map from the mesh's space to the scene's, for the vertices of triangles.
    pub to_scene: MeshToScene,
    /// Linear map from the scene's space to the mesh's.
    pub inverse: Inverse,
    /// Per axis of the mesh's space, bound on the distance between a vertex of the mesh and the result of transforming
    /// it to the scene, rounding it there to f32, and transforming it back.
    pub corner_error: Vec3,
    /// Bounding box of the instance in the scene.
    pub bounds: Aabb,
    /// Number of the instance's first triangle.
    pub first: u32,
    /// Index of the mesh.
    pub mesh: u32,
}

/// The map from a mesh's triangles to those of an instance.
#[derive(Debug, Clone, Copy)]
pub struct MeshToScene {
    /// The affine map from the mesh's space to the scene's.
    pub transform: Transform,
    /// Whether the second and third vertices of each triangle are exchanged, which keeps front faces front for
    /// reflections.
    pub mirrored: bool,
}

impl MeshInstance {
    /// Makes an instance of mesh number `mesh`, with its bounds: `boxes` together contain all vertices of the mesh, and
    /// `first` is the number of the instance's first triangle. `None` if the transform is not finite or singular, or if
    /// an image of the boxes reaches half the largest f32.
    pub fn new(
        transform: Transform,
        boxes: &[Aabb],
        mesh: u32,
        first: u32,
        mirrored: bool,
    ) -> Option<Self> {
        let inverse = transform.inverse()?;
        let to_scene = MeshToScene {
            transform,
            mirrored,
        };
        let mut bounds = Aabb::EMPTY;
        let mut error = [0.0; 3];
        if boxes.is_empty() {
            return Some(Self {
                to_scene,
                inverse,
                corner_error: error,
                bounds,
                first,
                mesh,
            });
        }
        // Transform the boxes axis by axis as centre and half extent, and bound the rounding.
        for k in [0, 1, 2] {
            let (mut low, mut high, mut size) = (f64::INFINITY, f64::NEG_INFINITY, 0.0_f64);
            for part in boxes {
                let (mut middle, mut reach, mut sum) = (transform.offset[k], 0.0, 0.0);
                for j in 0..3 {
                    let (min, max) = (f64::from(part.min[j]), f64::from(part.max[j]));
                    let entry = transform.linear[k][j];
                    middle += entry * (0.5 * (min + max));
                    reach += (entry * (0.5 * (max - min))).abs();
                    sum += (entry * min.abs().max(max.abs())).abs();
                }
                low = low.min(middle - reach);
                high = high.max(middle + reach);
                size = size.max(sum + transform.offset[k].abs());
            }
            // Bound the errors: those of f64, here and where vertices are transformed, add up to at most 16 epsilon,
            // and each vertex is rounded to f32 once.
            let exact = 16.0 * f64::EPSILON * size;
            let magnitude = low.abs().max(high.abs()) + exact;
            error[k] = f64::from(f32::EPSILON) * 0.5 * magnitude * (1.0 + 1e-6)
                + exact
                + f64::from(f32::from_bits(1));
            // Reject coordinates out of range, and round the bounds outwards.
            if magnitude.is_nan() || magnitude >= f64::from(f32::MAX) * 0.5 {
                return None;
            }
            bounds.min[k] = outwards(low - error[k], -1.0);
            bounds.max[k] = outwards(high + error[k], 1.0);
        }
        Some(Self {
            to_scene,
            inverse,
            corner_error: inverse.reach(error),
            bounds,
            first,
            mesh,
        })
    }
}

impl MeshToScene {
    /// Returns the vertices of a triangle in the scene, in the instance's orientation; `None` if one of them is not
    /// finite.
    #[inline(always)]
    pub fn corners(&self, corners: [[f32; 3]; 3]) -> Option<[[f32; 3]; 3]> {
        let [a, b, c] = map(corners, |p| self.transform.point(p));
        // Infinity and NaN multiplied by zero are NaN.
        let finite = |p: [f32; 3]| (p[0] * 0.0 + p[1] * 0.0) + p[2] * 0.0 == 0.0;
        if !(finite(a) && finite(b) && finite(c)) {
            return None;
        }
        Some(if self.mirrored { [a, c, b] } else { [a, b, c] })
    }
}

/// Rounds to f32, downwards for `sign` -1 and upwards for 1.
#[expect(clippy::cast_possible_truncation, reason = "rounded outwards")]
fn outwards(x: f64, sign: f64) -> f32 {
    let near = x as f32;
    if (f64::from(near) - x) * sign >= 0.0 {
        near
    } else if sign > 0.0 {
        near.next_up()
    } else {
        near.next_down()
    }
}
