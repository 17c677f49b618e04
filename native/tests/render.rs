// SPDX-License-Identifier: GPL-3.0-or-later
//! One scene, many structures, one identical image.

use halfspace::base::Monitor;
use halfspace::registry::{self, TREES};
use halfspace::render::camera::{CameraParams, Projection};
use halfspace::render::film::Unsampled;
use halfspace::render::job::Job;
use halfspace::render::light::{LightKind, LightParams};
use halfspace::render::material::MaterialParams;
use halfspace::render::scene::{RenderScene, SceneParams};
use halfspace::render::settings::{Pass, Settings};
use halfspace::render::values::linking::LightSets;
use halfspace::render::values::visibility::Visibility;
use halfspace::scene::Triangles;
use halfspace::structure::Structure;
use std::sync::Arc;
use std::time::Duration;

/// A grid of touching boxes on a floor, where planes and edges coincide: the hard case for trees.
fn boxes() -> Triangles {
    let mut vertices = Vec::new();
    let mut triangles = Vec::new();
    for i in 0..4 {
        for j in 0..4 {
            for k in 0..=((i * 7 + j * 3) % 3) {
                let n = u32::try_from(vertices.len()).unwrap();
                for c in 0..8_u8 {
                    let bit = |b: u8| f32::from(c >> b & 1);
                    let [x, y, z] = [i, j, k].map(|v| v as f32);
                    vertices.push([x - 2.0 + bit(0), y - 2.0 + bit(1), z + bit(2)]);
                }
                let faces: [[u32; 4]; 6] = [
                    [0, 2, 3, 1],
                    [4, 5, 7, 6],
                    [0, 1, 5, 4],
                    [2, 6, 7, 3],
                    [0, 4, 6, 2],
                    [1, 3, 7, 5],
                ];
                for [a, b, c, d] in faces {
                    triangles.push([n + a, n + b, n + c]);
                    triangles.push([n + a, n + c, n + d]);
                }
            }
        }
    }
    Triangles::new(vertices, triangles).unwrap()
}

fn scene_params(triangles: usize) -> SceneParams {
    let mut to_world = [[0.0; 4]; 4];
    for (k, row) in to_world.iter_mut().enumerate() {
        row[k] = 1.0;
    }
    // Right above a shared edge of the grid.
    to_world[2][3] = 6.0;
    SceneParams {
        material_index: Some(
            (0..triangles)
                .map(|i| i32::try_from(i / 12 % 3).unwrap())
                .collect(),
        ),
        materials: vec![
            MaterialParams::default(),
            MaterialParams {
                metallic: 1.0,
                roughness: 0.1,
                ..Default::default()
            },
            MaterialParams {
                transmission: 1.0,
                roughness: 0.0,
                alpha: 0.8,
                ..Default::default()
            },
        ],
        lights: vec![LightParams {
            kind: LightKind::Point { radius: 0.0 },
            to_world,
            power: [300.0; 3],
            sphere: false,
            casts_shadow: true,
            visible: Visibility::NOT_BY_CAMERA,
            sets: LightSets::default(),
            group: 0,
            max_bounces: u32::MAX,
            program: None,
        }],
        world: [0.2, 0.3, 0.5].into(),
        ..Default::default()
    }
}

#[test]
fn every_structure_renders_the_same_image() {
    let triangles = Arc::new(boxes());
    // Straight down, so that many rays run inside walls of cells and along edges.
    let mut camera = CameraParams {
        window: [-0.5, 0.5, -0.5, 0.5],
        ..Default::default()
    };
    camera.to_world[2][3] = 9.0;
    let settings = Settings {
        width: 96,
        height: 96,
        samples: 2,
        max_bounces: 5,
        passes: vec![Pass::Combined, Pass::Depth, Pass::Normal, Pass::Position],
        filter_width: 0.0,
        ..Default::default()
    };
    let render = |spec: &str, threads: usize| {
        let config = registry::parse(spec).unwrap();
        let structure =
            Structure::build(Arc::clone(&triangles), config, 1, &Monitor::new()).unwrap();
        let params = scene_params(triangles.len());
        let scene = Arc::new(RenderScene::new(Arc::new(structure), params).unwrap());
        let job = Job::start(scene, &camera, settings.clone(), threads).unwrap();
        assert!(job.wait(Duration::from_secs(600)));
        assert_eq!(job.error(), None);
        settings
            .passes
            .iter()
            .map(|&pass| {
                let mut out = vec![0.0_f32; 96 * 96 * pass.channels()];
                job.copy_into(pass, Unsampled::Zero, &mut out).unwrap();
                out
            })
            .collect::<Vec<_>>()
    };
    let reference = render("brute", 1);
    assert!(
        reference[0].iter().any(|&v| v > 0.1),
        "the picture is not black"
    );
    for tree in TREES {
        for threads in [1, 2] {
            let image = render(tree.id, threads);
            for ((pass, a), b) in settings.passes.iter().zip(&image).zip(&reference) {
                let different = a
                    .iter()
                    .zip(b)
                    .filter(|(a, b)| a.to_bits() != b.to_bits())
                    .count();
                assert_eq!(
                    different,
                    0,
                    "{} on {threads} threads, {}",
                    tree.id,
                    pass.name()
                );
            }
        }
    }
}

/// Camera rays and shadow rays as polygons: those of an orthographic camera, of suns with and without size, and of a
/// point light in one batch.
#[test]
fn polygons_render_sunny_pictures_of_orthographic_cameras() {
    let triangles = Arc::new(boxes());
    let mut camera = CameraParams {
        projection: Projection::Orthographic,
        window: [-3.0, 3.0, -3.0, 3.0],
        ..Default::default()
    };
    // Look down with a slant, from a height, and with half of the picture inside the scene.
    camera.to_world[0][2] = 0.2;
    let light = |kind, x: f64, power: f32| {
        let mut to_world = CameraParams::default().to_world;
        (to_world[0][2], to_world[2][3]) = (x, 6.0);
        LightParams {
            kind,
            to_world,
            power: [power; 3],
            casts_shadow: true,
            visible: Visibility::NOT_BY_CAMERA,
            sphere: true,
            sets: LightSets::default(),
            group: 0,
            max_bounces: u32::MAX,
            program: None,
        }
    };
    let lights = vec![
        light(LightKind::Sun { angle: 0.0 }, 0.3, 2.0),
        light(LightKind::Sun { angle: 0.02 }, -0.5, 2.0),
        light(LightKind::Point { radius: 0.0 }, 0.0, 300.0),
    ];
    let settings = Settings {
        width: 96,
        height: 96,
        samples: 4,
        max_bounces: 2,
        ..Default::default()
    };
    for height in [9.0, 1.5] {
        camera.to_world[2][3] = height;
        let render = |spec: &str| {
            let config = registry::parse(spec).unwrap();
            let structure =
                Structure::build(Arc::clone(&triangles), config, 1, &Monitor::new()).unwrap();
            let params = SceneParams {
                lights: lights.clone(),
                ..Default::default()
            };
            let scene = Arc::new(RenderScene::new(Arc::new(structure), params).unwrap());
            let job = Job::start(scene, &camera, settings.clone(), 2).unwrap();
            assert!(job.wait(Duration::from_secs(600)));
            assert_eq!(job.error(), None);
            let mut out = vec![0.0_f32; 96 * 96 * Pass::Combined.channels()];
            job.copy_into(Pass::Combined, Unsampled::Zero, &mut out)
                .unwrap();
            out
        };
        let reference = render("brute");
        assert!(reference.iter().any(|v| *v > 0.1) && reference.contains(&0.0));
        let polygons = render("octree-beam:traversal=polygon,shadow=beam");
        let pairs = polygons.iter().zip(&reference);
        let different = pairs.filter(|(a, b)| a.to_bits() != b.to_bits()).count();
        assert_eq!(different, 0, "from {height}");
    }
}
