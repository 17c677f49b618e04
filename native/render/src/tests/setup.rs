// SPDX-License-Identifier: GPL-3.0-or-later
//! Small scenes, cameras and lights.

use std::sync::Arc;
use std::time::Duration;

use crate::camera::{CameraParams, Projection};
use crate::film::Unsampled;
use crate::job::{Job, Statistics};
use crate::light::{LightKind, LightParams};
use crate::material::MaterialParams;
use crate::math::vector::{Vec3, vec3};
use crate::scene::{RenderScene, SceneParams};
use crate::settings::{Pass, Settings};
use crate::tests::brute_force::BruteForce;
use crate::values::linking::LightSets;
use crate::values::visibility::Visibility;
use halfspace_scene::Triangles;

/// A mesh built from quads of two triangles each.
#[derive(Default)]
pub struct Mesh {
    pub vertices: Vec<[f32; 3]>,
    pub triangles: Vec<[u32; 3]>,
    pub materials: Vec<i32>,
}

impl Mesh {
    /// Adds a quad with corners in order around it.
    pub fn quad(&mut self, corners: [[f32; 3]; 4], material: i32) {
        let n = self.vertices.len() as u32;
        self.vertices.extend(corners);
        self.triangles
            .extend([[n, n + 1, n + 2], [n, n + 2, n + 3]]);
        self.materials.extend([material; 2]);
    }

    /// Adds a square of half size `h` at height `z`, facing up.
    pub fn floor(&mut self, h: f32, z: f32, material: i32) {
        self.quad([[-h, -h, z], [h, -h, z], [h, h, z], [-h, h, z]], material);
    }

    /// Adds an axis-aligned cube of half size `h` around the origin, facing outwards.
    pub fn cube(&mut self, h: f32, material: i32) {
        for axis in 0..3 {
            for side in [-h, h] {
                let corner = |a: f32, b: f32| {
                    let mut p = [0.0; 3];
                    p[axis] = side;
                    p[(axis + 1) % 3] = a;
                    p[(axis + 2) % 3] = b;
                    p
                };
                let mut q = [corner(-h, -h), corner(h, -h), corner(h, h), corner(-h, h)];
                if side < 0.0 {
                    q.reverse();
                }
                self.quad(q, material);
            }
        }
    }

    /// Adds a sphere of radius 1, made by subdividing an octahedron; returns its corner normals.
    pub fn sphere(&mut self, levels: u32, material: i32) -> Vec<[[f32; 3]; 3]> {
        let (x, y, z) = (
            vec3(1.0, 0.0, 0.0),
            vec3(0.0, 1.0, 0.0),
            vec3(0.0, 0.0, 1.0),
        );
        let mut faces = Vec::new();
        // The four octants whose faces keep the order x, y, z, then those that reverse it.
        for (sx, sy, sz) in [(1., 1., 1.), (-1., 1., -1.), (1., -1., -1.), (-1., -1., 1.)] {
            faces.push([x * sx, y * sy, z * sz]);
        }
        for (sx, sy, sz) in [(-1., 1., 1.), (1., -1., 1.), (1., 1., -1.), (-1., -1., -1.)] {
            faces.push([y * sy, x * sx, z * sz]);
        }
        for _ in 0..levels {
            let mid = |a: Vec3, b: Vec3| (a + b).normalized();
            faces = faces
                .iter()
                .flat_map(|&[a, b, c]| {
                    let (ab, bc, ca) = (mid(a, b), mid(b, c), mid(c, a));
                    [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
                })
                .collect();
        }
        let corners: Vec<_> = faces.iter().map(|f| f.map(Vec3::array)).collect();
        for face in &corners {
            let n = self.vertices.len() as u32;
            self.vertices.extend(face);
            self.triangles.push([n, n + 1, n + 2]);
            self.materials.push(material);
        }
        corners
    }

    /// Brute force over the mesh, in descending order if `reversed`.
    pub fn tracer(&self, reversed: bool) -> Arc<BruteForce> {
        let triangles = Triangles::new(self.vertices.clone(), self.triangles.clone()).unwrap();
        Arc::new(BruteForce {
            triangles,
            reversed,
        })
    }

    /// A scene of the mesh with its materials.
    pub fn scene(&self, params: SceneParams) -> Arc<RenderScene> {
        let params = SceneParams {
            material_index: Some(self.materials.clone()),
            ..params
        };
        Arc::new(RenderScene::new(self.tracer(false), params).unwrap())
    }
}

/// A Lambertian material.
pub fn matte(albedo: f32) -> MaterialParams {
    MaterialParams {
        base_color: [albedo; 3],
        specular: 0.0,
        ..Default::default()
    }
}

/// A translation.
pub fn at(x: f64, y: f64, z: f64) -> [[f64; 4]; 4] {
    [
        [1.0, 0.0, 0.0, x],
        [0.0, 1.0, 0.0, y],
        [0.0, 0.0, 1.0, z],
        [0.0, 0.0, 0.0, 1.0],
    ]
}

/// Placed at (0, 0, 2) and rotated about the x axis.
pub fn tilted(angle: f64) -> [[f64; 4]; 4] {
    let (s, c) = angle.sin_cos();
    [
        [1.0, 0.0, 0.0, 0.0],
        [0.0, c, -s, 0.0],
        [0.0, s, c, 2.0],
        [0.0, 0.0, 0.0, 1.0],
    ]
}

/// Scales the x and y axes of a matrix.
pub fn scaled(mut m: [[f64; 4]; 4], x: f64, y: f64) -> [[f64; 4]; 4] {
    for row in &mut m {
        row[0] *= x;
        row[1] *= y;
    }
    m
}

/// A white light that camera rays do not see.
pub fn light(kind: LightKind, to_world: [[f64; 4]; 4], power: f32) -> LightParams {
    LightParams {
        kind,
        to_world,
        power: [power; 3],
        sphere: false,
        casts_shadow: true,
        visible: Visibility::NOT_BY_CAMERA,
        sets: LightSets::default(),
        group: 0,
        max_bounces: u32::MAX,
        program: None,
    }
}

/// An orthographic camera that looks down on the origin from height 8, with a window of half size `h`.
pub fn from_above(h: f64) -> CameraParams {
    CameraParams {
        projection: Projection::Orthographic,
        to_world: at(0.0, 0.0, 8.0),
        window: [-h, h, -h, h],
        clip_start: 0.1,
        clip_end: 100.0,
        ..Default::default()
    }
}

/// Settings of a square image.
pub fn square(size: u32, samples: u32, max_bounces: u32) -> Settings {
    Settings {
        width: size,
        height: size,
        samples,
        max_bounces,
        ..Default::default()
    }
}

/// Renders to the end. Returns the combined pass and the statistics.
pub fn run(
    scene: &Arc<RenderScene>,
    camera: &CameraParams,
    settings: Settings,
    threads: usize,
) -> (Vec<f32>, Statistics) {
    let [x0, y0, x1, y1] = settings.region();
    let job = Job::start(Arc::clone(scene), camera, settings, threads).unwrap();
    assert!(job.wait(Duration::from_secs(600)), "the render did not end");
    assert_eq!(job.error(), None);
    let mut out = vec![0.0; ((x1 - x0) * (y1 - y0) * 4) as usize];
    job.copy_into(Pass::Combined, Unsampled::Zero, &mut out)
        .unwrap();
    (out, job.statistics())
}

/// Returns the mean of the red channel.
pub fn mean(image: &[f32]) -> f64 {
    let sum: f64 = image.chunks_exact(4).map(|p| f64::from(p[0])).sum();
    sum / (image.len() / 4) as f64
}

/// A perspective camera that sees the whole scene from the side.
pub fn overview() -> CameraParams {
    let (s, c) = 1.2_f64.sin_cos();
    CameraParams {
        to_world: [
            [1.0, 0.0, 0.0, 0.2],
            [0.0, c, -s, -6.0 * s],
            [0.0, s, c, 6.0 * c],
            [0.0, 0.0, 0.0, 1.0],
        ],
        window: [-0.5, 0.5, -0.4, 0.4],
        ..Default::default()
    }
}
