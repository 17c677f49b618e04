// SPDX-License-Identifier: GPL-3.0-or-later
//! Where rays begin and which surface comes first: closed rooms, sheets close to each other, surfaces that touch.

use std::sync::Arc;

use crate::camera::CameraParams;
use crate::light::LightKind;
use crate::material::MaterialParams;
use crate::material::closure::{ClosureKind, ClosureParams, Input};
use crate::medium::{VolumeClosure, VolumeParams};
use crate::scene::{RenderScene, SceneParams};
use crate::settings::Settings;
use crate::tests::setup::{
    Mesh, at, from_above, light, matte, mean, overview, run, square, tilted,
};
use crate::values::program::Operand;
use crate::values::varying::{ObjectFrame, Varying};

/// A material that only absorbs, within.
fn absorbing(density: f32) -> MaterialParams {
    let mut clear = ClosureParams::new(ClosureKind::Transparent);
    clear.inputs[Input::Color as usize] = Operand::number(1.0);
    MaterialParams {
        closures: vec![clear],
        volume: VolumeParams {
            closures: vec![VolumeClosure {
                absorption: Operand::color([density; 3]),
                ..Default::default()
            }],
            program: Vec::new(),
        },
        ..Default::default()
    }
}

/// Clear glass.
fn glass() -> MaterialParams {
    MaterialParams {
        transmission: 1.0,
        roughness: 0.0,
        ..Default::default()
    }
}

/// Adds an axis-aligned box.
fn block(mesh: &mut Mesh, low: [f32; 3], high: [f32; 3], material: i32) {
    let before = mesh.vertices.len();
    mesh.cube(1.0, material);
    for vertex in &mut mesh.vertices[before..] {
        for k in 0..3 {
            vertex[k] = if vertex[k] < 0.0 { low[k] } else { high[k] };
        }
    }
}

/// A scene of objects, each a mesh of its own, in this order.
fn objects(parts: &[Mesh], order: &[usize], params: SceneParams) -> Arc<RenderScene> {
    let (mut mesh, mut index) = (Mesh::default(), Vec::new());
    for &part in order {
        let (part, number) = (&parts[part], part as u32);
        let n = mesh.vertices.len() as u32;
        mesh.vertices.extend(&part.vertices);
        mesh.triangles
            .extend(part.triangles.iter().map(|t| t.map(|v| v + n)));
        mesh.materials.extend(&part.materials);
        index.resize(mesh.triangles.len(), number);
    }
    let varying = Varying {
        objects: vec![ObjectFrame::default(); parts.len()],
        object_index: index,
        ..Default::default()
    };
    mesh.scene(SceneParams { varying, ..params })
}

/// The mean of boxes of these heights that absorb, one on the other, in a white world from above.
fn absorbed(spans: &[[f32; 2]], order: &[usize]) -> f64 {
    let boxes: Vec<_> = spans
        .iter()
        .map(|&[low, high]| {
            let mut mesh = Mesh::default();
            block(&mut mesh, [-1.0, -1.0, low], [1.0, 1.0, high], 0);
            mesh
        })
        .collect();
    let params = SceneParams {
        materials: vec![absorbing(0.5)],
        world: [1.0; 3].into(),
        ..Default::default()
    };
    let scene = objects(&boxes, order, params);
    let settings = Settings {
        volume_bounces: 100,
        ..square(8, 4, 100)
    };
    mean(&run(&scene, &from_above(0.5), settings, 1).0)
}

#[test]
fn volumes_that_touch_count_their_common_face_once() {
    let cases: [(&[[f32; 2]], f64); 5] = [
        (&[[-1.0, 0.0], [0.0, 1.0]], 2.0),
        (&[[-1.0, -0.5], [-0.5, 0.0], [0.0, 0.5], [0.5, 1.0]], 2.0),
        // Nested with a common face, and three bodies with one face in common.
        (&[[-1.0, 1.0], [0.0, 1.0]], 3.0),
        (&[[-1.0, 1.0], [-1.0, 0.0], [0.0, 1.0]], 4.0),
        // Overlapping.
        (&[[-1.0, 0.5], [0.0, 1.0]], 2.5),
    ];
    for (spans, depth) in cases {
        let forward: Vec<_> = (0..spans.len()).collect();
        let backward: Vec<_> = (0..spans.len()).rev().collect();
        for order in [&forward, &backward] {
            let (found, expected) = (absorbed(spans, order), (-0.5 * depth).exp());
            assert!(
                (found - expected).abs() < 1e-5,
                "{spans:?} {order:?}: {found} {expected}"
            );
        }
    }
}

#[test]
fn cameras_within_volumes_that_touch_know_their_medium() {
    // The ray that looks for the media of the camera passes common faces.
    let mut boxes = Vec::new();
    for [low, high] in [[-1.0, 0.0], [0.0, 1.0], [1.0, 2.0]] {
        let mut mesh = Mesh::default();
        block(&mut mesh, [-9.0, -9.0, low], [9.0, 9.0, high], 0);
        boxes.push(mesh);
    }
    for order in [[0, 1, 2], [2, 1, 0], [1, 0, 2]] {
        let params = SceneParams {
            materials: vec![absorbing(0.5)],
            world: [1.0; 3].into(),
            ..Default::default()
        };
        let camera = CameraParams {
            to_world: at(0.0, 0.0, -0.5),
            clip_start: 0.0,
            ..from_above(0.1)
        };
        let settings = Settings {
            volume_bounces: 100,
            ..square(4, 1, 100)
        };
        let found = mean(&run(&objects(&boxes, &order, params), &camera, settings, 1).0);
        assert!(
            (found - (-0.25_f64).exp()).abs() < 1e-5,
            "{order:?}: {found}"
        );
    }
}

#[test]
fn a_block_on_a_floor_does_not_depend_on_the_order_of_objects() {
    let (mut floor, mut block_of_glass, mut on_top) = Default::default();
    Mesh::floor(&mut floor, 3.0, -0.5, 0);
    block(&mut block_of_glass, [-0.5; 3], [0.5; 3], 1);
    block(&mut on_top, [-0.25, -0.25, 0.5], [0.25, 0.25, 0.75], 2);
    let parts = [floor, block_of_glass, on_top];
    let picture = |order: &[usize], lift: f32| {
        let mut parts = parts.each_ref().map(|part| Mesh {
            vertices: part.vertices.clone(),
            triangles: part.triangles.clone(),
            materials: part.materials.clone(),
        });
        for (k, part) in parts.iter_mut().enumerate() {
            part.vertices
                .iter_mut()
                .for_each(|v| v[2] += lift * k as f32);
        }
        let params = SceneParams {
            materials: vec![matte(0.5), glass(), matte(0.8)],
            lights: vec![light(LightKind::Sun { angle: 0.1 }, tilted(0.5), 3.0)],
            world: [0.4; 3].into(),
            ..Default::default()
        };
        run(
            &objects(&parts, order, params),
            &overview(),
            square(48, 64, 6),
            2,
        )
        .0
    };
    let reference = picture(&[0, 1, 2], 0.0);
    for order in [[1, 0, 2], [2, 1, 0], [0, 2, 1]] {
        assert!(picture(&order, 0.0) == reference, "{order:?}");
    }
    // As with a gap.
    let (touching, apart) = (mean(&reference), mean(&picture(&[0, 1, 2], 1e-4)));
    assert!((touching / apart - 1.0).abs() < 0.003, "{touching} {apart}");
}

/// A room around the origin, its corners scaled and moved.
fn room(corners: [[f32; 3]; 4], scale: f32, offset: [f32; 3]) -> Mesh {
    let mut mesh = Mesh {
        vertices: corners
            .map(|v| [0, 1, 2].map(|k| v[k] * scale + offset[k]))
            .to_vec(),
        ..Default::default()
    };
    mesh.triangles = vec![[0, 1, 2], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
    mesh.materials = vec![0; 4];
    mesh
}

#[test]
fn closed_rooms_stay_exactly_black() {
    // Tetrahedra: regular, with acute corners, and flat.
    let shapes = [
        [
            [-1.0, -1.0, -1.0],
            [1.0, 1.0, -1.0],
            [1.0, -1.0, 1.0],
            [-1.0, 1.0, 1.0],
        ],
        [
            [-0.05, -0.04, -1.0],
            [0.06, -0.03, -1.0],
            [0.01, 0.07, -1.0],
            [0.02, 0.01, 1.0],
        ],
        [
            [-1.0, -0.9, -0.01],
            [1.1, -0.8, -0.012],
            [0.1, 1.2, -0.009],
            [0.03, 0.02, 0.02],
        ],
    ];
    // Far away only the wide rooms are more than a few steps of f32 wide: the last number is that of the shapes.
    let places = [
        (1.0, [0.0; 3], 3),
        (1.0, [100.3, -77.7, 41.9], 3),
        (1e-30, [0.0; 3], 3),
        (1e30, [0.0; 3], 3),
        (1.0, [1.0e4, 2.0e4, -3.0e4], 2),
        (16.0, [1.0e7, -1.0e7, 1.0e7], 1),
    ];
    let mirror = MaterialParams {
        metallic: 1.0,
        roughness: 0.3,
        ..Default::default()
    };
    for (scale, offset, count) in places {
        for shape in &shapes[..count] {
            for material in [matte(0.9), mirror.clone()] {
                let mesh = room(*shape, scale, offset);
                let scene = mesh.scene(SceneParams {
                    materials: vec![material],
                    lights: vec![light(LightKind::Sun { angle: 1.0 }, tilted(0.5), 1e3)],
                    world: [1e3; 3].into(),
                    ..Default::default()
                });
                let middle = [0, 1, 2].map(|k| {
                    let sum: f64 = mesh.vertices.iter().map(|v| f64::from(v[k])).sum();
                    sum / 4.0
                });
                let camera = CameraParams {
                    to_world: at(middle[0], middle[1], middle[2]),
                    window: [-2.0, 2.0, -2.0, 2.0],
                    clip_start: 0.0,
                    clip_end: 1e37,
                    ..Default::default()
                };
                let image = run(&scene, &camera, square(24, 8, 24), 2).0;
                let most = image.chunks_exact(4).map(|p| p[0]).fold(0.0, f32::max);
                assert_eq!(most, 0.0, "{shape:?} {scale} {offset:?}");
            }
        }
    }
}

#[test]
fn pictures_do_not_depend_on_the_scale() {
    // A cube on a floor with a pane of glass, under sun and sky: no length in it.
    let picture = |scale: f32| {
        let mut mesh = Mesh::default();
        mesh.cube(0.5, 0);
        mesh.floor(3.0, -0.5, 0);
        block(&mut mesh, [-1.0, -1.0, 0.7], [1.0, 1.0, 0.75], 1);
        mesh.vertices
            .iter_mut()
            .for_each(|v| *v = v.map(|x| x * scale));
        let scene = mesh.scene(SceneParams {
            materials: vec![matte(0.6), glass()],
            lights: vec![light(LightKind::Sun { angle: 0.1 }, tilted(0.5), 3.0)],
            world: [0.4; 3].into(),
            ..Default::default()
        });
        let mut camera = overview();
        camera
            .to_world
            .iter_mut()
            .take(3)
            .for_each(|row| row[3] *= f64::from(scale));
        (camera.clip_start, camera.clip_end) = (0.0, 1e37);
        run(&scene, &camera, square(24, 32, 5), 2).0
    };
    let one = picture(1.0);
    assert!(mean(&one) > 0.1);
    // Powers of two scale every number exactly.
    for exponent in [-100, -40, -13, 20, 60, 100] {
        let other = picture(2.0_f32.powi(exponent));
        assert!(
            other == one,
            "2^{exponent}: {} {}",
            mean(&other),
            mean(&one)
        );
    }
}

#[test]
fn a_clear_sheet_one_step_before_a_wall_hides_nothing() {
    let clear = MaterialParams {
        alpha: 0.0,
        ..Default::default()
    };
    for offset in [0.0, 3.0, 1e3, 1e5] {
        let picture = |gap: Option<u32>| {
            let mut mesh = Mesh::default();
            let corners = [[-2.0, -2.0], [2.0, -2.0], [2.0, 2.0], [-2.0, 2.0]];
            let wall = corners.map(|[x, y]: [f32; 2]| [x, y, offset + 0.25 * x + 0.125 * y]);
            if let Some(steps) = gap {
                let lifted = wall.map(|mut v| {
                    (0..steps).for_each(|_| v[2] = v[2].next_up());
                    v
                });
                mesh.quad(lifted, 1);
            }
            mesh.quad(wall, 0);
            let scene = mesh.scene(SceneParams {
                materials: vec![matte(0.6), clear.clone()],
                lights: vec![light(LightKind::Sun { angle: 0.0 }, tilted(0.2), 3.0)],
                ..Default::default()
            });
            let mut camera = from_above(1.0);
            camera.to_world[2][3] += f64::from(offset);
            mean(&run(&scene, &camera, square(8, 4, 2), 1).0)
        };
        let without = picture(None);
        for steps in [0, 1, 2, 300] {
            let with = picture(Some(steps));
            assert!(
                (with / without - 1.0).abs() < 1e-4,
                "{offset} {steps}: {with} {without}"
            );
        }
    }
}
