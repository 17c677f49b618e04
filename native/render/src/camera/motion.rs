// SPDX-License-Identifier: GPL-3.0-or-later
//! Motion of points in the picture, for the vector pass.

use crate::camera::Camera;
use crate::math::vector::Vec3;

impl Camera {
    /// Returns the raster position of a point in pixels; `None` behind a perspective camera, and for panoramas.
    fn raster(&self, point: Vec3) -> Option<[f32; 2]> {
        self.raster_of(point - self.origin)
    }

    /// Like [`Self::raster`], for a point relative to the camera's origin.
    fn raster_of(&self, mut film: Vec3) -> Option<[f32; 2]> {
        if self.panorama.is_some() {
            return None;
        }
        if self.perspective {
            let depth = film.dot(self.forward);
            if depth <= 0.0 {
                return None;
            }
            film *= 1.0 / depth;
        }
        let film = film - self.corner;
        Some([self.right, self.up].map(|step| film.dot(step) / step.dot(step)))
    }

    /// Returns the motion of a point in pixels: from here to its place in the picture before, and from its place in
    /// the one after to here, as in Cycles; 0 where a place is not known. `moved`: the point in these pictures; `None` =
    /// where it is.
    pub fn motion(&self, point: Vec3, moved: [Option<Vec3>; 2]) -> [f32; 4] {
        self.between(self.raster(point), |camera, side| {
            camera.raster(moved[side].unwrap_or(point))
        })
    }

    /// Like [`Self::motion`], for the background in a direction; 0 for parallel cameras.
    pub fn background_motion(&self, direction: Vec3) -> [f32; 4] {
        if !self.perspective {
            return [0.0; 4];
        }
        self.between(self.raster_of(direction), |camera, _| {
            camera.raster_of(direction)
        })
    }

    /// Returns the motion of what is at a place in this picture. `place`: returns that in the picture before (0) or
    /// after (1).
    fn between(
        &self,
        here: Option<[f32; 2]>,
        place: impl Fn(&Self, usize) -> Option<[f32; 2]>,
    ) -> [f32; 4] {
        let mut out = [0.0; 4];
        let Some([x, y]) = here else {
            return out;
        };
        for side in 0..2 {
            let camera = self.motion.as_ref().map_or(self, |motion| &motion[side]);
            if let Some([x1, y1]) = place(camera, side) {
                let sign = if side == 0 { 1.0 } else { -1.0 };
                out[2 * side] = sign * (x1 - x);
                out[2 * side + 1] = sign * (y1 - y);
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{CameraParams, Projection};
    use crate::math::vector::vec3;

    fn near(a: [f32; 4], b: [f32; 4]) -> bool {
        a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-4)
    }

    #[test]
    fn points_and_cameras_move_the_picture() {
        for (projection, scale) in [
            (Projection::Perspective, 0.5),
            (Projection::Orthographic, 1.0),
        ] {
            // The window of size 2 has 10 × 20 pixels, so one unit at depth 1 is 5 pixels to the right, 10 upwards.
            let rest = CameraParams {
                projection,
                ..Default::default()
            };
            let mut aside = rest.clone();
            aside.to_world[0][3] = 2.0;
            let camera = |motion| {
                let params = CameraParams {
                    motion,
                    ..rest.clone()
                };
                Camera::new(&params, 10, 20).unwrap()
            };
            let point = vec3(0.3, 0.1, -2.0);
            // Only the point moves: it was 1 unit to the left, and will be 1 unit higher.
            let moved = [vec3(-1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0)].map(|by| Some(point + by));
            let found = camera(None).motion(point, moved);
            let expected = [-5.0 * scale, 0.0, 0.0, -10.0 * scale];
            assert!(near(found, expected), "{projection:?}: {found:?}");
            // Only the camera moves: it was where it is, and will be 2 units to the right.
            let found = camera(Some(Box::new([rest.clone(), aside]))).motion(point, [None; 2]);
            let expected = [0.0, 0.0, 10.0 * scale, 0.0];
            assert!(near(found, expected), "{projection:?}: {found:?}");
        }
        // The background moves with the direction and the lens, not with the place of the camera.
        let mut zoomed = CameraParams::default();
        zoomed.to_world[0][3] = 2.0;
        zoomed.window = [-0.5, 0.5, -1.0, 1.0];
        let params = CameraParams {
            motion: Some(Box::new([CameraParams::default(), zoomed])),
            ..Default::default()
        };
        let camera = Camera::new(&params, 10, 20).unwrap();
        let found = camera.background_motion(vec3(0.4, 0.2, -2.0));
        assert!(near(found, [0.0, 0.0, -1.0, 0.0]), "{found:?}");
        // Behind the camera there is no place in the picture.
        let camera = Camera::new(&CameraParams::default(), 10, 20).unwrap();
        assert_eq!(camera.motion(vec3(0.0, 0.0, 1.0), [None; 2]), [0.0; 4]);
    }
}
