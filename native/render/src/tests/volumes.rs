// SPDX-License-Identifier: GPL-3.0-or-later
//! Pictures of volumes against closed forms.

use crate::camera::{CameraParams, Projection};
use crate::light::LightKind;
use crate::light::world::WorldParams;
use crate::material::MaterialParams;
use crate::material::closure::{ClosureKind, ClosureParams, Input};
use crate::medium::{VolumeClosure, VolumeParams};
use crate::scene::SceneParams;
use crate::settings::Settings;
use crate::tests::setup::{Mesh, at, from_above, light, matte, mean, run, square};
use crate::values::math_nodes::Math;
use crate::values::program::{Coordinate, Op, Operand, Shift, Step};

/// A volume of one closure with constant coefficients.
fn volume(scattering: [f32; 3], absorption: [f32; 3], emission: f32, g: f32) -> VolumeParams {
    VolumeParams {
        closures: vec![VolumeClosure {
            scattering: Operand::color(scattering),
            absorption: Operand::color(absorption),
            emission: Operand::number(emission),
            anisotropy: Operand::number(g),
        }],
        program: Vec::new(),
    }
}

/// A volume whose coefficients rise linearly along z, from 0 at the lower face of a cube of half size 1.
fn rising(scattering: f32, absorption: f32) -> VolumeParams {
    let step = |op, args| Step { op, args };
    let times = |factor| {
        let args = vec![
            Operand::Register(2),
            Operand::number(factor),
            Operand::number(0.0),
        ];
        step(Op::Math(Math::Multiply, false), args)
    };
    VolumeParams {
        closures: vec![VolumeClosure {
            scattering: Operand::Register(3),
            absorption: Operand::Register(4),
            ..Default::default()
        }],
        program: vec![
            step(Op::Coordinate(Coordinate::Position, Shift::None), vec![]),
            step(Op::Channel(2), vec![Operand::Register(0)]),
            step(
                Op::Math(Math::Add, false),
                vec![
                    Operand::Register(1),
                    Operand::number(1.0),
                    Operand::number(0.0),
                ],
            ),
            times(scattering),
            times(absorption),
        ],
    }
}

/// A material with only this volume.
fn only(volume: VolumeParams) -> MaterialParams {
    let mut clear = ClosureParams::new(ClosureKind::Transparent);
    clear.inputs[Input::Color as usize] = Operand::number(1.0);
    MaterialParams {
        closures: vec![clear],
        volume,
        ..Default::default()
    }
}

/// Settings without limits that matter.
fn deep(size: u32, samples: u32) -> Settings {
    Settings {
        volume_bounces: 1000,
        ..square(size, samples, 1000)
    }
}

/// Renders cubes of half size 1 around the origin, one for each material, in a white world from above.
fn cubes(materials: Vec<MaterialParams>, settings: Settings) -> Vec<f32> {
    let mut mesh = Mesh::default();
    (0..materials.len()).for_each(|m| mesh.cube(1.0 - 0.25 * m as f32, m as i32));
    let mut varying = crate::values::varying::Varying::default();
    let frame = crate::values::varying::ObjectFrame::default();
    varying.objects = vec![frame; materials.len()];
    varying.object_index = (0..materials.len() as u32).flat_map(|m| [m; 12]).collect();
    let scene = mesh.scene(SceneParams {
        materials,
        varying,
        world: [1.0; 3].into(),
        ..Default::default()
    });
    run(&scene, &from_above(0.5), settings, 2).0
}

/// The means of the channels.
fn means(image: &[f32]) -> [f64; 3] {
    let n = (image.len() / 4) as f64;
    [0, 1, 2].map(|c| image.chunks_exact(4).map(|p| f64::from(p[c])).sum::<f64>() / n)
}

#[test]
fn a_medium_that_only_scatters_neither_gains_nor_loses_light() {
    for (density, g) in [(0.5, 0.0), (3.0, 0.7), (8.0, -0.5), (3.0, 1.0), (3.0, -1.0)] {
        let image = cubes(
            vec![only(volume([density; 3], [0.0; 3], 0.0, g))],
            deep(8, 64),
        );
        let brightness = mean(&image);
        assert!(
            (brightness - 1.0).abs() < 0.002,
            "{density} {g}: {brightness}"
        );
    }
    // Each channel on its own, and a medium that varies.
    let coloured = only(volume([0.3, 2.0, 5.0], [0.0; 3], 0.0, 0.2));
    for channel in means(&cubes(vec![coloured], deep(16, 256))) {
        assert!((channel - 1.0).abs() < 0.02, "{channel}");
    }
    let varying = mean(&cubes(vec![only(rising(2.0, 0.0))], deep(16, 64)));
    assert!((varying - 1.0).abs() < 0.002, "{varying}");
}

#[test]
fn absorption_follows_beer_and_lambert() {
    // Two units of the outer medium, and nested in it 1.5 units in which both add up.
    let outer = [0.1, 0.5, 2.0];
    let inner = [1.0, 0.0, 0.25];
    let nested = vec![
        only(volume([0.0; 3], outer, 0.0, 0.0)),
        only(volume([0.0; 3], inner, 0.0, 0.0)),
    ];
    let image = cubes(nested, deep(4, 1));
    for (k, channel) in means(&image).into_iter().enumerate() {
        let depth = 2.0 * f64::from(outer[k]) + 1.5 * f64::from(inner[k]);
        assert!((channel - (-depth).exp()).abs() < 1e-5, "{k}: {channel}");
    }
    // The integral of a coefficient that rises from 0 to 2 over two units is 2.
    let varying = mean(&cubes(vec![only(rising(0.0, 1.0))], deep(32, 64)));
    assert!((varying - (-2.0_f64).exp()).abs() < 2e-3, "{varying}");
}

#[test]
fn a_transparent_film_is_as_opaque_as_media_absorb() {
    let alpha = |materials| {
        let film_transparent = true;
        let image = cubes(
            materials,
            Settings {
                film_transparent,
                ..deep(4, 1)
            },
        );
        image.chunks_exact(4).map(|p| f64::from(p[3])).sum::<f64>() / 16.0
    };
    // Two units of the medium before the background, and a quarter of a unit before a hole.
    let fog = only(volume([0.0; 3], [0.5; 3], 0.0, 0.0));
    let hole = MaterialParams {
        hole: true,
        ..Default::default()
    };
    for (materials, depth) in [(vec![fog.clone()], 1.0), (vec![fog, hole], 0.125)] {
        let (found, expected) = (alpha(materials), 1.0 - f64::exp(-depth));
        assert!((found - expected).abs() < 1e-5, "{found} {expected}");
    }
}

#[test]
fn emission_is_attenuated_by_its_own_medium() {
    let glowing = only(volume([0.0; 3], [0.5; 3], 3.0, 0.0));
    let brightness = mean(&cubes(vec![glowing], deep(4, 1)));
    let passed = (-1.0_f64).exp();
    let expected = passed + 3.0 * (1.0 - passed) / 0.5;
    assert!((brightness - expected).abs() < 1e-4, "{brightness}");
}

#[test]
fn a_single_scattering_event_has_the_phase_function_of_a_lamp() {
    // A thin fog below a distant lamp: single scattering towards the camera by 90 degrees.
    for g in [-0.4_f32, 0.0, 0.6] {
        let mut mesh = Mesh::default();
        mesh.cube(1.0, 0);
        let density = 0.01_f32;
        let mut to_world = at(0.0, 0.0, 0.0);
        // Shine along +x.
        (to_world[0][0], to_world[0][2]) = (0.0, -1.0);
        (to_world[2][0], to_world[2][2]) = (1.0, 0.0);
        let scene = mesh.scene(SceneParams {
            materials: vec![only(volume([density; 3], [0.0; 3], 0.0, g))],
            lights: vec![light(LightKind::Sun { angle: 0.0 }, to_world, 1.0)],
            ..Default::default()
        });
        let settings = Settings {
            volume_bounces: 0,
            ..square(32, 512, 4)
        };
        let brightness = mean(&run(&scene, &from_above(0.01), settings, 2).0);
        // Along z, 1 unit in front of the axis's point where the lamp has come through half a cube.
        let phase = f64::from(1.0 - g * g)
            / (4.0 * std::f64::consts::PI * (1.0 + f64::from(g * g)).powf(1.5));
        let sigma = f64::from(density);
        let expected = phase * (1.0 - (-2.0 * sigma).exp()) * (-sigma).exp();
        assert!(
            (brightness / expected - 1.0).abs() < 0.02,
            "{g}: {brightness} {expected}"
        );
    }
}

#[test]
fn shadows_are_dimmed_by_the_media_on_the_way() {
    // A cube of absorbing medium floats between the lamp and the floor; the camera looks under it from the side.
    let mut mesh = Mesh::default();
    mesh.cube(1.0, 0);
    mesh.floor(9.0, -2.0, 1);
    let absorbing = |amount| only(volume([0.0; 3], [amount; 3], 0.0, 0.0));
    let lit = |amount: f32, radius: f32| {
        let scene = mesh.scene(SceneParams {
            materials: vec![absorbing(amount), matte(0.8)],
            lights: vec![light(LightKind::Point { radius }, at(0.0, 0.0, 3.0), 100.0)],
            ..Default::default()
        });
        let camera = CameraParams {
            to_world: [
                [1.0, 0.0, 0.0, 0.0],
                [0.0, 0.0, -1.0, -5.0],
                [0.0, 1.0, 0.0, -1.9],
                [0.0, 0.0, 0.0, 1.0],
            ],
            window: [-0.001, 0.001, -0.020_5, -0.019_5],
            ..Default::default()
        };
        mean(
            &run(
                &scene,
                &camera,
                Settings {
                    samples: 256,
                    ..deep(4, 1)
                },
                2,
            )
            .0,
        )
    };
    for radius in [0.0, 0.2] {
        let ratio = lit(0.3, radius) / lit(0.0, radius);
        assert!((ratio - (-0.6_f64).exp()).abs() < 5e-3, "{radius}: {ratio}");
    }
}

#[test]
fn a_camera_inside_of_a_volume_and_a_world_of_fog() {
    // The camera is 8 units above the origin; a cube of half size 9 contains it.
    let fog = || volume([0.0; 3], [0.1; 3], 0.0, 0.0);
    let mut mesh = Mesh::default();
    mesh.cube(9.0, 0);
    mesh.floor(1.0, 0.0, 1);
    let glow = MaterialParams {
        emission: [1.0; 3],
        base_color: [0.0; 3],
        specular: 0.0,
        ..Default::default()
    };
    let scene = mesh.scene(SceneParams {
        materials: vec![only(fog()), glow.clone()],
        ..Default::default()
    });
    let orthographic = mean(&run(&scene, &from_above(0.5), deep(4, 1), 1).0);
    // The medium begins at the near clipping plane, 0.1 below the camera.
    let expected = (-0.79_f64).exp();
    assert!((orthographic - expected).abs() < 1e-4, "{orthographic}");
    let mut mesh = Mesh::default();
    mesh.floor(1.0, 0.0, 0);
    let scene = mesh.scene(SceneParams {
        materials: vec![glow],
        world: WorldParams {
            volume: fog(),
            ..[1.0; 3].into()
        },
        ..Default::default()
    });
    let world = mean(&run(&scene, &from_above(0.5), deep(4, 1), 1).0);
    assert!((world - expected).abs() < 1e-4, "{world}");
}

#[test]
fn media_begin_on_the_near_clipping_plane() {
    // The camera is 3 units above the origin, outside of a cube of half size 1; the plane cuts the cube.
    let mut mesh = Mesh::default();
    mesh.cube(1.0, 0);
    let scene = mesh.scene(SceneParams {
        materials: vec![only(volume([0.0; 3], [0.4; 3], 0.0, 0.0))],
        world: [1.0; 3].into(),
        ..Default::default()
    });
    for projection in [Projection::Perspective, Projection::Orthographic] {
        let camera = CameraParams {
            projection,
            to_world: at(0.05, 0.03, 3.0),
            window: [-0.01, 0.01, -0.01, 0.01],
            clip_start: 2.5,
            clip_end: 100.0,
            ..Default::default()
        };
        let through = mean(&run(&scene, &camera, deep(4, 1), 1).0);
        let expected = (-1.5_f64 * 0.4).exp();
        assert!(
            (through - expected).abs() < 1e-3,
            "{projection:?}: {through}"
        );
    }
}

#[test]
fn neither_the_order_of_triangles_nor_the_threads_change_a_pixel() {
    let mut mesh = Mesh::default();
    mesh.cube(1.0, 0);
    mesh.cube(0.5, 1);
    mesh.floor(3.0, -1.5, 2);
    let picture = |reversed, threads| {
        let params = SceneParams {
            material_index: Some(mesh.materials.clone()),
            materials: vec![
                only(volume([0.5, 0.7, 0.9], [0.1; 3], 0.1, 0.3)),
                only(rising(3.0, 0.5)),
                matte(0.8),
            ],
            lights: vec![light(
                LightKind::Point { radius: 0.2 },
                at(2.0, 0.0, 3.0),
                100.0,
            )],
            world: [0.3; 3].into(),
            ..Default::default()
        };
        let scene = crate::scene::RenderScene::new(mesh.tracer(reversed), params).unwrap();
        run(
            &std::sync::Arc::new(scene),
            &from_above(2.0),
            deep(16, 4),
            threads,
        )
        .0
    };
    let first = picture(false, 1);
    assert!(mean(&first) > 0.1 && first.iter().all(|c| c.is_finite()));
    assert_eq!(first, picture(true, 3));
}

#[test]
fn absurd_volumes_give_a_finite_picture() {
    for (scattering, absorption, emission, g) in [
        (1e9, 0.0, 0.0, 0.0),
        (1e9, 1e9, 1.0, 1.0),
        (f32::NAN, 0.5, 0.0, 0.0),
        (-3.0, -1.0, -1.0, f32::NAN),
        (f32::INFINITY, 1e30, 1e30, -7.0),
        (0.0, 0.0, 0.0, 0.0),
        (1e-30, 1e-30, 1e-30, 0.5),
    ] {
        let medium = volume([scattering; 3], [absorption; 3], emission, g);
        let image = cubes(
            vec![only(medium)],
            Settings {
                volume_bounces: 50,
                ..deep(4, 4)
            },
        );
        assert!(
            image.iter().all(|c| c.is_finite()),
            "{scattering} {absorption} {emission} {g}"
        );
    }
    let image = cubes(vec![only(rising(1e9, 1e9))], deep(4, 2));
    assert!(image.iter().all(|c| c.is_finite()));
}

#[test]
fn paths_scatter_once_more_than_the_limit_of_volume_bounces() {
    // White fog in a white world: each further bounce returns more of the light, all of them everything.
    let bounces = |volume_bounces| {
        let fog = vec![only(volume([2.0; 3], [0.0; 3], 0.0, 0.0))];
        mean(&cubes(
            fog,
            Settings {
                volume_bounces,
                ..deep(16, 64)
            },
        ))
    };
    let found = [0, 1, 4, 16].map(bounces);
    assert!(
        found.is_sorted() && found[3] > 0.97 && found[0] < 0.8,
        "{found:?}"
    );
}
