// SPDX-License-Identifier: GPL-3.0-or-later
//! Beams of mirrored and refracted rays against single rays.

use std::sync::Arc;

use crate::camera::CameraParams;
use crate::camera::lens::LensParams;
use crate::film::Unsampled;
use crate::job::{Job, Statistics};
use crate::light::LightKind;
use crate::material::MaterialParams;
use crate::material::closure::{ClosureKind, ClosureParams, Input};
use crate::scene::{RenderScene, SceneParams};
use crate::settings::{Integrator, Pass, Settings};
use crate::tests::setup::{Mesh, at, from_above, light, matte, mean, overview, run, square};
use crate::values::program::Operand;

/// A cube, and a sheet of `material` above or behind it, under a small lamp that mirrors show.
fn scene(material: MaterialParams, sheet: [[f32; 3]; 4]) -> Arc<RenderScene> {
    let mut mesh = Mesh::default();
    mesh.cube(0.5, 0);
    mesh.floor(3.0, -0.5, 0);
    mesh.quad(sheet, 1);
    mesh.scene(SceneParams {
        materials: vec![matte(0.6), material],
        lights: vec![light(
            LightKind::Point { radius: 0.05 },
            at(1.0, -2.0, 3.0),
            200.0,
        )],
        world: [0.2; 3].into(),
        ..Default::default()
    })
}

/// A wall behind the cube, as seen by [`overview`].
const WALL: [[f32; 3]; 4] = [
    [-2.0, 1.5, -0.5],
    [2.0, 1.7, -0.5],
    [2.0, 1.7, 2.0],
    [-2.0, 1.5, 2.0],
];

/// A pane above the cube.
const PANE: [[f32; 3]; 4] = [
    [-2.0, -2.0, 1.0],
    [2.0, -2.0, 1.0],
    [2.0, 2.0, 1.0],
    [-2.0, 2.0, 1.0],
];

/// A material of one closure without roughness.
fn smooth(kind: ClosureKind, ior: f32) -> MaterialParams {
    let mut closure = ClosureParams::new(kind);
    closure.inputs[Input::Roughness as usize] = Operand::number(0.0);
    closure.inputs[Input::Ior as usize] = Operand::number(ior);
    MaterialParams {
        closures: vec![closure],
        ..Default::default()
    }
}

fn settings(beams: bool) -> Settings {
    Settings {
        integrator: Integrator::Whitted,
        secondary_beams: beams,
        ..square(96, 4, 4)
    }
}

/// Renders with single rays and with beams; returns the mean brightness, the mean difference and the statistics.
fn both(scene: &Arc<RenderScene>, camera: &CameraParams) -> (f64, f64, Statistics) {
    let (single, none) = run(scene, camera, settings(false), 1);
    let (beams, statistics) = run(scene, camera, settings(true), 2);
    assert_eq!((none.work.beams, none.work.rays_beams), (0, 0));
    let difference: f64 = single
        .iter()
        .zip(&beams)
        .map(|(a, b)| f64::from((a - b).abs()))
        .sum();
    (mean(&single), difference / single.len() as f64, statistics)
}

#[test]
fn mirrors_show_the_same_picture() {
    let scene = scene(smooth(ClosureKind::Glossy, 1.5), WALL);
    for camera in [overview(), from_above(2.0)] {
        let (brightness, difference, statistics) = both(&scene, &camera);
        assert!(
            difference < 1e-3 * brightness,
            "{difference} of {brightness}"
        );
        let deviation = statistics.work.beam_deviation;
        assert!(deviation < 1e-5, "rounding only, got {deviation}");
    }
    let (_, _, statistics) = both(&scene, &overview());
    assert!(statistics.work.rays_secondary > 500);
    assert!(statistics.work.beam_deviation > 0.0, "beams were sent");
}

#[test]
fn refraction_is_approximate_by_the_ratio_of_tangents() {
    let scene = scene(smooth(ClosureKind::Refraction, 1.33), PANE);
    // Seen from above at the angle a, of which the rays of a narrow camera differ little.
    for (degrees, most) in [(5.0_f64, 1e-3), (20.0, 0.02), (60.0, 0.5)] {
        let (s, c) = degrees.to_radians().sin_cos();
        let camera = CameraParams {
            to_world: [
                [1.0, 0.0, 0.0, 0.0],
                [0.0, c, -s, -40.0 * s],
                [0.0, s, c, 40.0 * c],
                [0.0, 0.0, 0.0, 1.0],
            ],
            window: [-0.04, 0.04, -0.04, 0.04],
            ..Default::default()
        };
        let (_, difference, statistics) = both(&scene, &camera);
        // The worst ray looks 0.04 √2 radians past the axis.
        let worst = degrees.to_radians() + 0.04 * 2.0_f64.sqrt();
        let tangent = (worst.tan() / 1.33).atan();
        let error = tangent - (worst.sin() / 1.33).asin();
        let deviation = f64::from(statistics.work.beam_deviation);
        assert!(
            deviation <= error * 1.01 + 1e-5,
            "{degrees}: {deviation} {error}"
        );
        assert!(deviation >= error * 0.5, "{degrees}: {deviation} {error}");
        assert!(difference < most, "{degrees}: {difference}");
    }
    // Parallel rays obey Snell's law exactly.
    let (brightness, difference, statistics) = both(&scene, &from_above(1.5));
    assert!(
        difference < 1e-3 * brightness,
        "{difference} of {brightness}"
    );
    assert!(statistics.work.beam_deviation < 1e-5);
}

#[test]
fn rays_outside_of_beams_go_singly_and_are_equal_to_the_bit() {
    // A lens has no common origin, and rough mirrors scatter.
    let mirror = scene(smooth(ClosureKind::Glossy, 1.5), WALL);
    let lens = CameraParams {
        lens: LensParams {
            radius: 0.05,
            focus: 6.0,
            ..Default::default()
        },
        ..overview()
    };
    let rough = scene(
        MaterialParams {
            metallic: 1.0,
            roughness: 0.3,
            ..Default::default()
        },
        WALL,
    );
    for (scene, camera) in [(&mirror, &lens), (&rough, &overview())] {
        let (single, _) = run(scene, camera, settings(false), 1);
        let (beams, statistics) = run(scene, camera, settings(true), 1);
        assert!(single == beams);
        assert_eq!(statistics.work.beam_deviation, 0.0);
    }
}

#[test]
fn facing_mirrors_and_a_camera_in_the_plane_render() {
    let mut mesh = Mesh::default();
    mesh.quad(WALL, 0);
    mesh.quad(WALL.map(|[x, y, z]| [x, -y, z]), 0);
    mesh.cube(0.3, 1);
    let scene = mesh.scene(SceneParams {
        materials: vec![smooth(ClosureKind::Glossy, 1.5), matte(0.5)],
        world: [1.0; 3].into(),
        ..Default::default()
    });
    let deep = Settings {
        max_bounces: 30,
        ..settings(true)
    };
    for camera in [
        CameraParams {
            to_world: at(0.0, 0.0, 1.0),
            ..Default::default()
        },
        // In the plane of the first wall.
        CameraParams {
            to_world: at(0.0, 1.6, 1.0),
            ..Default::default()
        },
    ] {
        let job = Job::start(Arc::clone(&scene), &camera, deep.clone(), 2).unwrap();
        assert!(job.wait(std::time::Duration::from_secs(600)));
        assert_eq!(job.error(), None);
        let mut out = vec![0.0; 96 * 96 * 4];
        job.copy_into(Pass::Combined, Unsampled::Zero, &mut out)
            .unwrap();
        assert!(out.iter().all(|x| x.is_finite()));
        let single = run(
            &scene,
            &camera,
            Settings {
                secondary_beams: false,
                ..deep.clone()
            },
            1,
        )
        .0;
        let (a, b) = (mean(&out), mean(&single));
        assert!((a - b).abs() < 0.01 * b, "{a} {b}");
    }
}

#[test]
fn other_integrators_refuse_beams() {
    for integrator in [Integrator::Path, Integrator::Ambient] {
        let settings = Settings {
            integrator,
            ..settings(true)
        };
        let error = settings.check().unwrap_err().to_string();
        assert!(error.contains("secondary_beams"), "{error}");
    }
}
