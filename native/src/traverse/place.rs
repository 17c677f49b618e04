// SPDX-License-Identifier: GPL-3.0-or-later
//! An instance: where a mesh stands, and what a ray in the mesh's space needs to know of it.

use crate::geom::Aabb;
use crate::geom::transform::{Inverse, Transform};
use crate::geom::vec3::{Vec3, map};

/// An instance of a mesh.
#[derive(Debug, Clone, Copy)]
pub struct Place {
    /// Mesh to scene.
    pub transform: Transform,
    /// Scene to mesh.
    pub inverse: Inverse,
    /// How far the corners as they stand in the scene, rounded there, are from the mesh's own when they are
    /// brought back, per axis.
    pub corner_error: Vec3,
    /// The box of the corners in the scene.
    pub bounds: Aabb,
    /// The number of its first triangle.
    pub first: u32,
    /// Which mesh it is of.
    pub mesh: u32,
    /// Whether the second and the third corner of each triangle change places, so that fronts stay fronts.
    pub mirrored: bool,
}

/// What brings a triangle of a mesh to where it stands.
#[derive(Debug, Clone, Copy)]
pub struct InMesh {
    transform: Transform,
    mirrored: bool,
}

impl Place {
    /// A mesh, of which these boxes together hold all corners, in a place; `None` where the transform is not
    /// finite, is singular, or leads out of the range of f32.
    pub fn new(
        transform: Transform,
        boxes: &[Aabb],
        (mesh, first): (u32, u32),
        mirrored: bool,
    ) -> Option<Self> {
        let inverse = transform.inverse()?;
        let mut bounds = Aabb::EMPTY;
        let mut error = [0.0; 3];
        if boxes.is_empty() {
            return Some(Self {
                transform,
                inverse,
                corner_error: error,
                bounds,
                first,
                mesh,
                mirrored,
            });
        }
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
            // f64 rounds a handful of times, here and where corners are computed, and f32 once.
            let exact = 16.0 * f64::EPSILON * size;
            let magnitude = low.abs().max(high.abs()) + exact;
            error[k] = f64::from(f32::EPSILON) * 0.5 * magnitude * (1.0 + 1e-6)
                + exact
                + f64::from(f32::from_bits(1));
            if magnitude.is_nan() || magnitude >= f64::from(f32::MAX) * 0.5 {
                return None;
            }
            bounds.min[k] = outwards(low - error[k], -1.0);
            bounds.max[k] = outwards(high + error[k], 1.0);
        }
        Some(Self {
            transform,
            inverse,
            corner_error: inverse.reach(error),
            bounds,
            first,
            mesh,
            mirrored,
        })
    }

    /// What brings its triangles to where they stand.
    #[inline(always)]
    pub fn in_mesh(&self) -> InMesh {
        InMesh {
            transform: self.transform,
            mirrored: self.mirrored,
        }
    }
}

impl InMesh {
    /// The corners of a triangle in the scene; `None` where one of them is not finite.
    #[inline(always)]
    pub fn corners(&self, corners: [[f32; 3]; 3]) -> Option<[[f32; 3]; 3]> {
        let [a, b, c] = map(corners, |p| self.transform.point(p));
        let finite = |p: [f32; 3]| (p[0] * 0.0 + p[1] * 0.0) + p[2] * 0.0 == 0.0;
        if !(finite(a) && finite(b) && finite(c)) {
            return None;
        }
        Some(if self.mirrored { [a, c, b] } else { [a, b, c] })
    }
}

/// A bound as f32, rounded downwards or upwards.
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
