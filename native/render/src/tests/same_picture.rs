// SPDX-License-Identifier: GPL-3.0-or-later
//! The image does not depend on threads, structures or steps.

use std::sync::Arc;

use crate::light::{AreaShape, LightKind};
use crate::material::MaterialParams;
use crate::scene::{RenderScene, SceneParams};
use crate::settings::Settings;
use crate::tests::setup::{Mesh, at, light, mean, overview, run, tilted};

/// A scene that uses every feature.
fn rich() -> (Mesh, SceneParams) {
    let mut mesh = Mesh::default();
    let sphere = mesh.sphere(2, 1);
    let mut normals = sphere;
    mesh.floor(3.0, -1.0, 0);
    mesh.quad(
        [
            [-2.0, 1.5, -1.0],
            [2.0, 1.5, -1.0],
            [2.0, 1.5, 2.0],
            [-2.0, 1.5, 2.0],
        ],
        2,
    );
    mesh.quad(
        [
            [1.0, -1.0, -1.0],
            [2.0, -1.0, -1.0],
            [2.0, -1.0, 1.0],
            [1.0, -1.0, 1.0],
        ],
        3,
    );
    normals.extend([[[0.0, 0.0, 1.0]; 3]; 2]);
    normals.extend([[[0.0, -1.0, 0.0]; 3]; 4]);
    let params = SceneParams {
        materials: vec![
            MaterialParams::default(),
            MaterialParams {
                transmission: 0.7,
                roughness: 0.1,
                ..Default::default()
            },
            MaterialParams {
                metallic: 1.0,
                roughness: 0.2,
                ..Default::default()
            },
            MaterialParams {
                alpha: 0.4,
                emission: [0.5, 0.2, 0.1],
                ..Default::default()
            },
        ],
        corner_normals: Some(normals),
        lights: vec![
            light(LightKind::Point { radius: 0.1 }, at(1.0, -2.0, 3.0), 100.0),
            light(LightKind::Sun { angle: 0.1 }, tilted(0.5), 1.0),
            light(
                LightKind::Area {
                    shape: AreaShape::Disk,
                    size: 1.0,
                    size_y: 1.0,
                    spread: std::f32::consts::PI,
                },
                at(0.0, 0.0, 3.0),
                50.0,
            ),
        ],
        world: [0.1, 0.2, 0.3].into(),
        ..Default::default()
    };
    (mesh, params)
}

#[test]
fn the_image_is_identical_for_all_threads_tracers_and_steps() {
    let (mesh, params) = rich();
    let params = SceneParams {
        material_index: Some(mesh.materials.clone()),
        ..params
    };
    let base = Settings {
        width: 70,
        height: 45,
        samples: 5,
        max_bounces: 4,
        ..Default::default()
    };
    let scenes = [false, true]
        .map(|reversed| Arc::new(RenderScene::new(mesh.tracer(reversed), params.clone()).unwrap()));
    let (reference, _) = run(&scenes[0], &overview(), base.clone(), 1);
    assert!(mean(&reference) > 0.05, "the picture is not black");
    for (scene, threads, step_samples) in [
        (0, 2, None),
        (0, 5, Some(1)),
        (1, 1, Some(3)),
        (1, 3, Some(5)),
    ] {
        let settings = Settings {
            step_samples,
            ..base.clone()
        };
        let (image, _) = run(&scenes[scene], &overview(), settings, threads);
        assert!(
            image == reference,
            "scene {scene} threads {threads} steps {step_samples:?}"
        );
    }
    // A border renders the same pixels as the full frame.
    let border = Settings {
        border: Some([13, 7, 50, 40]),
        ..base.clone()
    };
    let (part, _) = run(&scenes[0], &overview(), border, 2);
    for (i, pixel) in part.chunks_exact(4).enumerate() {
        let full = ((i / 37 + 7) * 70 + i % 37 + 13) * 4;
        assert_eq!(pixel, &reference[full..full + 4], "border pixel {i}");
    }
    let (other, _) = run(&scenes[0], &overview(), Settings { seed: 1, ..base }, 2);
    assert!(other != reference, "the seed matters");
}
