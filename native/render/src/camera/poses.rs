// SPDX-License-Identifier: GPL-3.0-or-later
//! A camera that moves while its shutter is open.

use crate::camera::{Camera, CameraParams};
use crate::check::{Error, Result, finite};
use crate::math::vector::Vec3;
use halfspace_ray::Ray;

/// Largest number of poses.
const MAX_POSES: usize = 256;

/// A camera that moves.
#[derive(Debug, Clone)]
pub(super) struct Moving {
    pub(super) poses: Poses,
    /// The same camera at the origin.
    pub(super) local: Camera,
}

impl Moving {
    /// The moving camera of these parameters; `None` if it stands still.
    pub(super) fn new(params: &CameraParams, width: u32, height: u32) -> Result<Option<Box<Self>>> {
        let Some(poses) = Poses::new(&params.poses)? else {
            return Ok(None);
        };
        let still = CameraParams {
            to_world: IDENTITY,
            poses: Vec::new(),
            rolling: None,
            motion: None,
            ..params.clone()
        };
        let local = Camera::new(&still, width, height)?;
        Ok(Some(Box::new(Self { poses, local })))
    }
}

/// The transform of a camera at the origin.
const IDENTITY: [[f64; 4]; 4] = [
    [1.0, 0.0, 0.0, 0.0],
    [0.0, 1.0, 0.0, 0.0],
    [0.0, 0.0, 1.0, 0.0],
    [0.0, 0.0, 0.0, 1.0],
];

/// Position and orientation of a camera.
#[derive(Debug, Clone, Copy)]
struct Pose {
    origin: [f64; 3],
    /// Unit quaternion: w, x, y, z.
    rotation: [f64; 4],
}

/// The poses of a camera, equally spaced over the time of the shutter. Between two of them the position is
/// interpolated linearly and the rotation by normalized quaternions, which departs from a steady rotation by at most
/// angle³ / 240 rad: 0.002 rad for poses 45 degrees apart.
#[derive(Debug, Clone)]
pub struct Poses {
    poses: Vec<Pose>,
}

impl Poses {
    /// The poses of these transforms, which are free of scale; `None` with fewer than two.
    ///
    /// # Errors
    /// If a number is not finite, an axis has no length, or there are too many.
    pub fn new(poses: &[[[f64; 4]; 4]]) -> Result<Option<Self>> {
        if poses.len() < 2 {
            return Ok(None);
        }
        if poses.len() > MAX_POSES {
            return Err(Error::Spec(format!(
                "camera['poses']: more than {MAX_POSES} poses, got {}",
                poses.len()
            )));
        }
        let mut out: Vec<Pose> = Vec::with_capacity(poses.len());
        for (i, matrix) in poses.iter().enumerate() {
            for row in matrix {
                finite(row, || format!("camera['poses'][{i}]"))?;
            }
            let rotation = quaternion(matrix).ok_or_else(|| {
                Error::Spec(format!("camera['poses'][{i}] has an axis of length zero"))
            })?;
            // Two quaternions represent a rotation; take the one nearer to the last pose.
            let last = out.last().map_or(rotation, |pose| pose.rotation);
            let dot: f64 = (0..4).map(|k| last[k] * rotation[k]).sum();
            out.push(Pose {
                origin: [0, 1, 2].map(|k| matrix[k][3]),
                rotation: rotation.map(|x| if dot < 0.0 { -x } else { x }),
            });
        }
        Ok(Some(Self { poses: out }))
    }

    /// Moves a ray from the camera's space to the scene at a time from 0, where the shutter opens, to 1.
    pub fn placed(&self, ray: &Ray, time: f32) -> Ray {
        // Find the poses before and after.
        let last = self.poses.len() - 1;
        let place = f64::from(time.clamp(0.0, 1.0)) * last as f64;
        let index = (place as usize).min(last - 1);
        let share = place - index as f64;
        let [a, b] = [self.poses[index], self.poses[index + 1]];
        let between = |a: f64, b: f64| a + (b - a) * share;
        let origin = [0, 1, 2].map(|k| between(a.origin[k], b.origin[k]));
        let rotation = unit([0, 1, 2, 3].map(|k| between(a.rotation[k], b.rotation[k])));
        // Rotate origin and direction in f64, and round once.
        let turned = |v: [f32; 3]| rotated(rotation, v.map(f64::from));
        let [o, d] = [turned(ray.o), turned(ray.d)];
        let d = Vec3::from(d.map(|x| x as f32)).normalized();
        Ray {
            o: [0, 1, 2].map(|k| (origin[k] + o[k]) as f32),
            d: d.array(),
            ..*ray
        }
    }
}

/// Divides a quaternion by its length; that of no rotation if it has none.
fn unit(q: [f64; 4]) -> [f64; 4] {
    let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    if length > 0.0 {
        q.map(|x| x / length)
    } else {
        [1.0, 0.0, 0.0, 0.0]
    }
}

/// Rotates a vector by a unit quaternion.
fn rotated([w, x, y, z]: [f64; 4], v: [f64; 3]) -> [f64; 3] {
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ]
    };
    let u = [x, y, z];
    let t = cross(u, v).map(|c| 2.0 * c);
    let s = cross(u, t);
    [0, 1, 2].map(|k| v[k] + w * t[k] + s[k])
}

/// Returns the unit quaternion of a matrix's axes; `None` if one has no length. The largest component is computed
/// first, which keeps the digits (Shepperd 1978).
fn quaternion(matrix: &[[f64; 4]; 4]) -> Option<[f64; 4]> {
    let mut m = [[0.0; 3]; 3];
    for axis in 0..3 {
        let column = [0, 1, 2].map(|row| matrix[row][axis]);
        let length = column.iter().map(|x| x * x).sum::<f64>().sqrt();
        if !(length > 0.0 && length.is_finite()) {
            return None;
        }
        for row in 0..3 {
            m[row][axis] = column[row] / length;
        }
    }
    let trace = m[0][0] + m[1][1] + m[2][2];
    let squares = [trace, m[0][0], m[1][1], m[2][2]];
    let largest = (0..4).max_by(|&a, &b| squares[a].total_cmp(&squares[b]))?;
    let q = if largest == 0 {
        [
            1.0 + trace,
            m[2][1] - m[1][2],
            m[0][2] - m[2][0],
            m[1][0] - m[0][1],
        ]
    } else {
        let (i, j, k) = (largest - 1, largest % 3, (largest + 1) % 3);
        let mut q = [m[k][j] - m[j][k], 0.0, 0.0, 0.0];
        q[1 + i] = 1.0 + m[i][i] - m[j][j] - m[k][k];
        q[1 + j] = m[j][i] + m[i][j];
        q[1 + k] = m[k][i] + m[i][k];
        q
    };
    Some(unit(q))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rotated about z by an angle, at (x, 0, 0).
    fn pose(angle: f64, x: f64) -> [[f64; 4]; 4] {
        let (s, c) = angle.sin_cos();
        [
            [c, -s, 0.0, x],
            [s, c, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
        ]
    }

    const RAY: Ray = Ray {
        o: [0.0; 3],
        d: [1.0, 0.0, 0.0],
        t_min: 0.1,
        t_max: 9.0,
    };

    #[test]
    fn poses_are_met_and_what_lies_between_is_half_way() {
        for turn in [0.0, 1.0, 2.5, 3.1] {
            let poses = [
                pose(turn, 0.0),
                pose(turn + 0.4, 2.0),
                pose(turn + 0.4, 2.0),
            ];
            let moving = Poses::new(&poses).unwrap().unwrap();
            for (time, angle, x) in [
                (0.0, turn, 0.0),
                (0.25, turn + 0.2, 1.0),
                (1.0, turn + 0.4, 2.0),
            ] {
                let ray = moving.placed(&RAY, time);
                assert!((f64::from(ray.o[0]) - x).abs() < 1e-6, "{turn} {time}");
                assert!(
                    (f64::from(ray.d[0]) - angle.cos()).abs() < 1e-6,
                    "{turn} {time}"
                );
                assert!(
                    (f64::from(ray.d[1]) - angle.sin()).abs() < 1e-6,
                    "{turn} {time}"
                );
                assert_eq!((ray.t_min, ray.t_max), (0.1, 9.0));
            }
        }
    }

    #[test]
    fn every_axis_survives_the_quaternion() {
        // Half turns about each axis make each component the largest.
        for axis in 0..3 {
            let mut matrix = [[0.0; 4]; 4];
            for (k, row) in matrix.iter_mut().enumerate() {
                row[k] = if k == axis || k == 3 { 1.0 } else { -1.0 };
            }
            let q = quaternion(&matrix).unwrap();
            for k in 0..3 {
                let mut v = [0.0; 3];
                v[k] = 1.0;
                assert!((rotated(q, v)[k] - matrix[k][k]).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn absurd_poses_are_named() {
        let mut bad = pose(0.0, 0.0);
        bad[0][3] = f64::NAN;
        let error = Poses::new(&[pose(0.0, 0.0), bad]).unwrap_err();
        assert!(error.to_string().contains("camera['poses'][1]"), "{error}");
        let flat = Poses::new(&[pose(0.0, 0.0), [[0.0; 4]; 4]]);
        assert!(flat.unwrap_err().to_string().contains("axis"));
        assert!(Poses::new(&[pose(0.0, 0.0)]).unwrap().is_none());
    }
}
