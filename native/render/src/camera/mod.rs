// SPDX-License-Identifier: GPL-3.0-or-later
//! Camera rays: perspective and orthographic, through a pinhole or a thin lens, and panoramic.

use crate::camera::lens::{Lens, LensParams};
use crate::camera::panorama::Panorama;
use crate::camera::poses::Moving;
use crate::camera::rolling::{Rolling, RollingParams};
use crate::check::{Error, Result, finite};
use crate::math::vector::Vec3;
use crate::path::beams::source::Source;
use crate::values::view::View;
use halfspace_ray::Ray;

pub mod filter;
pub mod lens;
mod motion;
pub mod panorama;
mod panoramic;
pub mod poses;
pub mod rolling;

/// How the film is projected.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Projection {
    /// All rays from one point; the window lies at distance 1 along -Z.
    Perspective,
    /// Parallel rays; the window is in scene units.
    Orthographic,
    /// All rays from one point, see [`Panorama`]; the window is 0 to 1 along both sides. It focuses and clips by
    /// distance.
    Panoramic(Panorama),
}

/// Parameters of a camera, which looks along its own -Z with +Y up.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraParams {
    /// ClosureKind of projection.
    pub projection: Projection,
    /// Camera to scene transform: rows of a matrix applied to column vectors.
    pub to_world: [[f64; 4]; 4],
    /// Left, right, bottom and top edge of the full frame, before any border is applied.
    pub window: [f64; 4],
    /// Depth along -Z of the near clipping plane.
    pub clip_start: f64,
    /// Depth along -Z of the far clipping plane.
    pub clip_end: f64,
    /// Depth of field.
    pub lens: LensParams,
    /// The camera in the picture before this one, and in the one after, for the vector pass; they have no motion.
    pub motion: Option<Box<[CameraParams; 2]>>,
    /// Transforms like `to_world` at equal intervals while the shutter is open, in place of it for rays; fewer than two
    /// = the camera stands still.
    pub poses: Vec<[[f64; 4]; 4]>,
    /// A rolling shutter, if the rows are not exposed together.
    pub rolling: Option<RollingParams>,
}

/// A camera prepared for generating rays.
#[derive(Debug, Clone)]
pub struct Camera {
    perspective: bool,
    origin: Vec3,
    /// Unit vector of the viewing direction.
    forward: Vec3,
    /// Lower left corner of the window relative to the origin; at depth 1 for perspective.
    corner: Vec3,
    /// Step of one pixel to the right, and one upwards.
    right: Vec3,
    up: Vec3,
    /// Unit vectors to the right and up, which span the lens.
    axes: [Vec3; 2],
    /// Depths of the near and far clipping planes.
    clip: [f32; 2],
    lens: Option<Lens>,
    view: View,
    panorama: Option<Panorama>,
    /// Angle between pixels of a panorama.
    pixel_angle: Option<f32>,
    /// The camera in the picture before this one, and in the one after.
    motion: Option<Box<[Camera; 2]>>,
    moving: Option<Box<Moving>>,
    rolling: Option<Rolling>,
}

/// End of the interval of a ray that does not exist.
const EMPTY: f32 = -1.0;

impl Camera {
    /// A camera for a film of `width` × `height` pixels.
    ///
    /// # Errors
    /// If a number is not finite, or the window, the clip range or an axis of the matrix is empty.
    pub fn new(params: &CameraParams, width: u32, height: u32) -> Result<Self> {
        // Check the numbers, the window and the clip range.
        for (i, row) in params.to_world.iter().enumerate() {
            finite(row, || format!("camera['to_world'][{i}]"))?;
        }
        finite(&params.window, || "camera['window']".into())?;
        let [left, right, bottom, top] = params.window;
        if left == right || bottom == top {
            return Err(Error::Spec(format!(
                "camera['window'] is empty: left {left}, right {right}, bottom {bottom}, top {top}"
            )));
        }
        // Infinite clip distances are allowed, NaN is not.
        let (start, end) = (params.clip_start, params.clip_end);
        if start.is_nan() || end.is_nan() || start >= end {
            return Err(Error::Spec(format!(
                "camera['clip_start'] must be below camera['clip_end'], got {start} and {end}"
            )));
        }
        // Take the unit axes of the camera from the columns of the matrix.
        let column = |k: usize| [0, 1, 2].map(|row| params.to_world[row][k]);
        let axes = [column(0), column(1), column(2)].map(unit);
        let [Some(x), Some(y), Some(z)] = axes else {
            return Err(Error::Spec(
                "camera['to_world'] has an axis of length zero".into(),
            ));
        };
        let panorama = match params.projection {
            Projection::Panoramic(panorama) if !panorama.is_finite() => {
                return Err(Error::NonFinite("camera: its panorama".into()));
            }
            Projection::Panoramic(panorama) => Some(panorama),
            _ => None,
        };
        let motion = match &params.motion {
            None => None,
            Some(motion) => {
                let [before, after] = &**motion;
                let side = |params| Self::new(params, width, height);
                Some(Box::new([side(before)?, side(after)?]))
            }
        };
        let perspective = params.projection != Projection::Orthographic;
        // `at` maps a position in the window and a depth to a vector in scene space, in f64 until the end.
        let at = |sx: f64, sy: f64, depth: f64| {
            let v = [0, 1, 2].map(|k| (sx * x[k] + sy * y[k] - depth * z[k]) as f32);
            Vec3::from(v)
        };
        let origin = Vec3::from(column(3).map(|v| v as f32));
        let forward = at(0.0, 0.0, 1.0).normalized();
        Ok(Self {
            perspective,
            origin,
            forward,
            view: View {
                origin,
                axes: [at(1.0, 0.0, 0.0), at(0.0, 1.0, 0.0), forward],
                window: params.window.map(|x| x as f32),
                perspective,
            },
            corner: at(left, bottom, f64::from(u8::from(perspective))),
            right: at((right - left) / f64::from(width), 0.0, 0.0),
            up: at(0.0, (top - bottom) / f64::from(height), 0.0),
            axes: [at(1.0, 0.0, 0.0), at(0.0, 1.0, 0.0)],
            lens: Lens::new(&params.lens)?,
            panorama,
            motion,
            pixel_angle: panorama.map(|it| it.pixel_angle(width)),
            moving: Moving::new(params, width, height)?,
            rolling: (params.rolling.as_ref())
                .map(|rolling| Rolling::new(rolling, height))
                .transpose()?,
            clip: [
                if perspective { start.max(0.0) } else { start } as f32,
                end as f32,
            ],
        })
    }

    /// Returns the ray through the raster position (x, y) in pixels; (0, 0) is the lower left corner of the frame.
    /// The direction has unit length, and the ray interval spans the clip range. `lens`: returns two random numbers
    /// in [0, 1); called only if the camera has a lens.
    #[inline]
    pub fn ray(&self, x: f32, y: f32, lens: impl FnOnce() -> [f32; 2]) -> Ray {
        if let Some(panorama) = &self.panorama {
            return self.panoramic_ray(panorama, x, y, lens);
        }
        match &self.lens {
            None => self.sharp_ray(x, y),
            Some(it) => self.lens_ray(x, y, it, it.sample(lens())),
        }
    }

    /// Like [`Self::ray`], at a time from 0 to 1 of the shutter's opening, which is drawn only if the camera moves.
    #[inline]
    pub fn ray_at(
        &self,
        x: f32,
        y: f32,
        lens: impl FnOnce() -> [f32; 2],
        time: impl FnOnce() -> f32,
    ) -> Ray {
        match &self.moving {
            None => self.ray(x, y, lens),
            Some(moving) => moving.poses.placed(&moving.local.ray(x, y, lens), time()),
        }
    }

    /// Returns the camera's frame.
    pub fn view(&self) -> &View {
        &self.view
    }

    /// Returns the rolling shutter, if there is one.
    pub fn rolling(&self) -> Option<&Rolling> {
        self.rolling.as_ref()
    }

    /// Whether the camera is a pinhole (or sharp orthographic) one that stands still.
    pub fn is_sharp(&self) -> bool {
        self.lens.is_none() && self.panorama.is_none() && self.moving.is_none()
    }

    /// Returns what all camera rays share: the pinhole, the direction of an orthographic camera, or nothing with a lens
    /// or if the camera moves.
    pub fn source(&self) -> Source {
        if self.panorama.is_some() || self.moving.is_some() {
            return Source::None;
        }
        match (&self.lens, self.perspective) {
            (Some(_), _) => Source::None,
            (None, true) => Source::Point(self.origin),
            (None, false) => Source::Direction(self.forward),
        }
    }

    /// The ray from a point on the lens to the point where the sharp ray crosses the plane in focus.
    fn lens_ray(&self, x: f32, y: f32, lens: &Lens, [right, up]: [f32; 2]) -> Ray {
        // Find the point on the window and the point on the lens.
        let film = self.corner + self.right * x + self.up * y;
        let aside = self.axes[0] * right + self.axes[1] * up;
        // Start on the lens and point in focus, both relative to the camera.
        let (from, focus) = if self.perspective {
            (aside, film * lens.focus)
        } else {
            (film + aside, film + self.forward * lens.focus)
        };
        let d = (focus - from).normalized();
        // Scale the clip depths to distances along the ray.
        let per_depth = 1.0 / d.dot(self.forward);
        let [t_min, t_max] = self.clip.map(|depth| depth * per_depth);
        Ray {
            o: (self.origin + from).array(),
            d: d.array(),
            t_min,
            t_max,
        }
    }

    /// The ray of the pinhole, or of the window's plane for orthographic projection.
    fn sharp_ray(&self, x: f32, y: f32) -> Ray {
        let film = self.corner + self.right * x + self.up * y;
        if self.perspective {
            // The ray has unit length, so clip depths are scaled by the length to depth 1.
            let length = film.length();
            let d = film * (1.0 / length);
            let [t_min, t_max] = self.clip.map(|depth| depth * length);
            Ray {
                o: self.origin.array(),
                d: d.array(),
                t_min,
                t_max,
            }
        } else {
            let o = self.origin + film;
            Ray {
                o: o.array(),
                d: self.forward.array(),
                t_min: self.clip[0],
                t_max: self.clip[1],
            }
        }
    }

    /// Whether a camera ray exists: a panorama does not cover the whole frame.
    #[inline]
    pub fn sees(&self, ray: &Ray) -> bool {
        self.panorama.is_none() || ray.t_max != EMPTY
    }

    /// Returns the depth of a point: its distance from the camera's plane, along -Z.
    #[inline]
    pub fn depth(&self, point: Vec3) -> f32 {
        if self.panorama.is_some() {
            (point - self.origin).length()
        } else {
            (point - self.origin).dot(self.forward)
        }
    }

    /// Returns the width of a pixel in scene units, at a distance from the camera.
    #[inline]
    pub fn pixel_width(&self, distance: f32) -> f32 {
        let width = self.right.length();
        if let Some(angle) = self.pixel_angle {
            angle * distance
        } else if self.perspective {
            width * distance
        } else {
            width
        }
    }

    /// Returns the distance of a point from the camera's centre, or from its plane for orthographic projection.
    #[inline]
    pub fn distance(&self, point: Vec3) -> f32 {
        if self.perspective {
            (point - self.origin).length()
        } else {
            self.depth(point)
        }
    }
}

/// Normalizes a vector; `None` if its length is 0.
fn unit(v: [f64; 3]) -> Option<[f64; 3]> {
    let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    (length > 0.0).then(|| v.map(|x| x / length))
}

impl Default for CameraParams {
    /// At the origin, with a square field of view of 90 degrees.
    fn default() -> Self {
        let mut to_world = [[0.0; 4]; 4];
        for (k, row) in to_world.iter_mut().enumerate() {
            row[k] = 1.0;
        }
        Self {
            projection: Projection::Perspective,
            to_world,
            window: [-1.0, 1.0, -1.0, 1.0],
            clip_start: 0.1,
            clip_end: 1000.0,
            lens: LensParams::default(),
            motion: None,
            poses: Vec::new(),
            rolling: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vector::vec3;

    fn none() -> [f32; 2] {
        panic!("a sharp camera needs no random numbers")
    }

    #[test]
    fn rays_through_a_lens_meet_in_the_plane_in_focus() {
        for projection in [Projection::Perspective, Projection::Orthographic] {
            let params = CameraParams {
                projection,
                lens: LensParams {
                    radius: 0.5,
                    focus: 4.0,
                    ..Default::default()
                },
                ..Default::default()
            };
            let camera = Camera::new(&params, 10, 10).unwrap();
            let at_focus = |lens: [f32; 2]| {
                let ray = camera.ray(2.0, 7.0, || lens);
                let (o, d) = (Vec3::from(ray.o), Vec3::from(ray.d));
                assert!((ray.t_min * -d.z - 0.1).abs() < 1e-5, "the clip is a depth");
                assert!((d.length() - 1.0).abs() < 1e-6);
                (o, o + d * (4.0 / -d.z))
            };
            let (a, b) = (at_focus([0.1, 0.9]), at_focus([0.8, 0.3]));
            assert!((a.0 - b.0).length() > 0.1, "they start in different places");
            assert!((a.1 - b.1).length() < 1e-5, "and meet");
            let sharp = Camera::new(
                &CameraParams {
                    projection,
                    ..Default::default()
                },
                10,
                10,
            );
            let ray = sharp.unwrap().ray(2.0, 7.0, none);
            let seen = Vec3::from(ray.o) + Vec3::from(ray.d) * (4.0 / -ray.d[2]);
            assert!((a.1 - seen).length() < 1e-5, "where the sharp ray does");
        }
    }

    #[test]
    fn perspective_rays_meet_the_window_and_clip_by_depth() {
        let params = CameraParams {
            window: [-1.0, 3.0, -2.0, 2.0],
            ..Default::default()
        };
        let camera = Camera::new(&params, 40, 20).unwrap();
        let ray = camera.ray(40.0, 0.0, none);
        let d = Vec3::from(ray.d) * (1.0 / -ray.d[2]);
        assert!((d - vec3(3.0, -2.0, -1.0)).length() < 1e-6);
        assert!(
            (ray.t_min * -ray.d[2] - 0.1).abs() < 1e-6,
            "the clip distance is a depth"
        );
        assert!((camera.depth(vec3(5.0, 5.0, -7.0)) - 7.0).abs() < 1e-6);
    }

    #[test]
    fn orthographic_rays_are_parallel_and_start_on_the_camera_plane() {
        let mut params = CameraParams {
            projection: Projection::Orthographic,
            ..Default::default()
        };
        params.to_world[2][3] = 8.0;
        let camera = Camera::new(&params, 10, 10).unwrap();
        let (a, b) = (camera.ray(0.0, 0.0, none), camera.ray(10.0, 5.0, none));
        assert_eq!((a.d, b.d), ([0.0, 0.0, -1.0], [0.0, 0.0, -1.0]));
        assert!((Vec3::from(b.o) - vec3(1.0, 0.0, 8.0)).length() < 1e-6);
        assert!((a.t_min - 0.1).abs() < 1e-7);
    }

    #[test]
    fn invalid_parameters_are_named() {
        let mut nan = CameraParams::default();
        nan.to_world[1][2] = f64::NAN;
        let flat = CameraParams {
            window: [1.0, 1.0, 0.0, 1.0],
            ..Default::default()
        };
        let clip = CameraParams {
            clip_end: 0.01,
            ..Default::default()
        };
        for (params, name) in [(nan, "to_world"), (flat, "window"), (clip, "clip_start")] {
            assert!(
                Camera::new(&params, 4, 4)
                    .unwrap_err()
                    .to_string()
                    .contains(name)
            );
        }
    }
}
