// SPDX-License-Identifier: GPL-3.0-or-later
//! The boxes of the parts of triangles.

use crate::object::Object;
use halfspace_geom::Aabb;
use halfspace_geom::clip::clipped_bounds;
use halfspace_ray::FramedScene;
use halfspace_ray::frame::AXIS_PAD;

/// Cuts triangles with planes along the axes.
#[derive(Clone, Copy)]
pub struct Cutter<'a> {
    framed: FramedScene<'a>,
    /// The scene's largest coordinate.
    magnitude: f32,
    /// Distance by which boxes are moved outwards: more than the rounding errors of a triangle clipped in f64.
    margin: f64,
}

impl<'a> Cutter<'a> {
    /// Makes the cutter of the triangles of a scene.
    pub fn new(framed: FramedScene<'a>) -> Self {
        let magnitude = framed.frame.bounds().magnitude();
        Self {
            framed,
            magnitude,
            margin: f64::from(magnitude) / (1_u64 << 40) as f64,
        }
    }

    /// Returns the distance beyond a plane up to which an object is not cut: the parts would be rounding errors.
    pub fn little(&self) -> f32 {
        4.0 * AXIS_PAD * self.magnitude
    }

    /// Returns the box around the part of an object's triangle inside a cell, up to rounding, or `None` if they do not
    /// meet. It lies inside the cell.
    pub fn about(&self, object: &Object, cell: &Aabb) -> Option<Aabb> {
        let FramedScene { scene, frame } = self.framed;
        let corners = scene.corners(object.id).map(|p| frame.point(p));
        clipped_bounds(corners, cell, self.magnitude)
    }

    /// As [`Self::about`], but the box contains every point of the part.
    pub fn around(&self, object: &Object, cell: &Aabb) -> Option<Aabb> {
        let mut part = self.about(object, cell)?;
        for k in 0..3 {
            part.min[k] = self.outwards(part.min[k], -1.0).max(cell.min[k]);
            part.max[k] = self.outwards(part.max[k], 1.0).min(cell.max[k]);
        }
        Some(part)
    }

    /// Moves an end of a box outwards, towards `sign`, by at least the margin.
    #[expect(clippy::cast_possible_truncation, reason = "rounded outwards")]
    fn outwards(&self, end: f32, sign: f64) -> f32 {
        let moved = (f64::from(end) + sign * self.margin) as f32;
        let end = if sign < 0.0 {
            moved.next_down()
        } else {
            moved.next_up()
        };
        // Adding 0.0 turns -0.0 to 0.0, as in the bounds of triangles.
        end + 0.0
    }
}
