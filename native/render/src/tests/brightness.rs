// SPDX-License-Identifier: GPL-3.0-or-later
//! Brightness of whole renders, against closed forms and against Cycles.

use crate::camera::CameraParams;
use crate::closure::{ClosureParams, Input, Kind};
use crate::lights::{AreaShape, LightKind, LightParams};
use crate::material::MaterialParams;
use crate::program::Operand;
use crate::scene::SceneParams;
use crate::settings::{Integrator, Settings};
use crate::tests::setup::{Mesh, at, from_above, light, matte, mean, run, scaled, square, tilted};

/// Mean brightness of a grey (0.8) floor at the origin, seen from above.
fn lit_floor(lights: Vec<LightParams>, samples: u32) -> f64 {
    let mut mesh = Mesh::default();
    mesh.floor(9.0, 0.0, 0);
    let scene = mesh.scene(SceneParams {
        materials: vec![matte(0.8)],
        lights,
        ..Default::default()
    });
    mean(&run(&scene, &from_above(0.01), square(8, samples, 0), 1).0)
}

/// Reference values: Cycles of Blender 5.2.3 with 512 samples; a grey (0.8) diffuse plane seen from above at the
/// origin; light at (0, 0, 2) unless stated, 100 W or 1 W/m². Where a closed form exists, it is checked too.
#[test]
fn lights_are_as_bright_as_in_cycles() {
    use std::f64::consts::PI;
    let g = 0.8 / PI;
    let intensity = 100.0 / (4.0 * PI);
    let spot = |radius, blend| LightKind::Spot {
        radius,
        size: 1.0,
        blend,
    };
    let area = |shape, size, size_y| LightKind::Area {
        shape,
        size,
        size_y,
    };
    let sun = |degrees: f32| LightKind::Sun {
        angle: degrees.to_radians(),
    };
    let above = at(0.0, 0.0, 2.0);
    // Irradiance below the centre of a rectangle of half sizes a, b and radiance 1 at distance h.
    let rectangle = |a: f64, b: f64| {
        let h = 2.0_f64;
        2.0 * (a / (a * a + h * h).sqrt() * (b / (a * a + h * h).sqrt()).atan()
            + b / (b * b + h * h).sqrt() * (a / (b * b + h * h).sqrt()).atan())
    };
    // Blender's smoothstep of the spot cone at 0.4 rad, for half angle 0.5 rad and blend 0.5.
    let fade = {
        let x = ((0.4_f64.cos() - 0.5_f64.cos()) / ((1.0 - 0.5_f64.cos()) * 0.5)).min(1.0);
        x * x * (3.0 - 2.0 * x)
    };
    let cases: [(&str, LightParams, f64, Option<f64>); 15] = [
        (
            "point",
            light(LightKind::Point { radius: 0.0 }, above, 100.0),
            0.506_593_3,
            Some(g * intensity / 4.0),
        ),
        (
            "soft point",
            light(LightKind::Point { radius: 0.5 }, above, 100.0),
            0.476_795_6,
            Some(g * intensity / 4.25),
        ),
        (
            "soft point aside",
            light(LightKind::Point { radius: 1.0 }, at(2.0, 0.0, 2.0), 100.0),
            0.159_212_3,
            None,
        ),
        (
            "spot",
            light(spot(0.0, 0.15), above, 100.0),
            0.506_593_3,
            Some(g * intensity / 4.0),
        ),
        (
            "spot tilted",
            light(spot(0.0, 0.5), tilted(0.4), 100.0),
            0.403_400_8,
            Some(g * intensity / 4.0 * fade),
        ),
        (
            "spot scaled",
            light(spot(0.0, 0.5), scaled(tilted(0.4), 2.0, 3.0), 100.0),
            0.506_593_3,
            Some(g * intensity / 4.0),
        ),
        (
            "soft spot",
            light(spot(0.5, 0.5), tilted(0.4), 100.0),
            0.248_739_0,
            None,
        ),
        ("sun", light(sun(0.0), above, 1.0), 0.254_646_9, Some(g)),
        (
            "wide sun",
            light(sun(60.0), above, 1.0),
            0.254_647_9,
            Some(g),
        ),
        (
            "sun tilted",
            light(sun(0.0), tilted(0.7), 1.0),
            0.194_765_1,
            Some(g * 0.7_f64.cos()),
        ),
        (
            "square",
            light(area(AreaShape::Square, 1.0, 0.0), above, 100.0),
            1.871_048_2,
            Some(g * 100.0 / PI * rectangle(0.5, 0.5)),
        ),
        (
            "rectangle",
            light(area(AreaShape::Rectangle, 2.0, 1.0), above, 100.0),
            1.685_311_1,
            Some(g * 50.0 / PI * rectangle(1.0, 0.5)),
        ),
        (
            "disk",
            light(area(AreaShape::Disk, 1.0, 0.0), above, 100.0),
            1.907_169_6,
            Some(g * 100.0 / PI / 4.25),
        ),
        (
            "ellipse",
            light(area(AreaShape::Ellipse, 2.0, 1.0), above, 100.0),
            1.758_349_4,
            None,
        ),
        (
            "square tilted",
            light(area(AreaShape::Square, 1.0, 0.0), tilted(0.6), 100.0),
            1.617_975_7,
            None,
        ),
    ];
    for (name, light, cycles, closed) in cases {
        let ours = lit_floor(vec![light.clone()], 256);
        assert!(
            (ours / cycles - 1.0).abs() < 3e-3,
            "{name}: {ours}, Cycles {cycles}"
        );
        if let Some(closed) = closed {
            assert!(
                (ours / closed - 1.0).abs() < 2e-3,
                "{name}: {ours}, closed form {closed}"
            );
        }
    }
}

#[test]
fn light_samples_and_scattered_rays_agree() {
    // A light without shadows is only sampled; one with shadows is hit by scattered rays too. Without occluders
    // both have the same mean, but only if all densities are right.
    let mut mesh = Mesh::default();
    mesh.floor(9.0, 0.0, 0);
    let above = at(0.3, -0.4, 1.0);
    let kinds = [
        LightKind::Point { radius: 0.6 },
        LightKind::Spot {
            radius: 0.6,
            size: 1.5,
            blend: 0.3,
        },
        LightKind::Sun { angle: 0.7 },
        LightKind::Area {
            shape: AreaShape::Rectangle,
            size: 1.0,
            size_y: 2.0,
        },
        LightKind::Area {
            shape: AreaShape::Ellipse,
            size: 1.0,
            size_y: 2.0,
        },
    ];
    for roughness in [0.3, 0.9] {
        for kind in kinds {
            let both = [true, false].map(|casts_shadow| {
                let light = LightParams {
                    casts_shadow,
                    ..light(kind, above, 10.0)
                };
                // The second light makes the probability of choosing a light part of the densities.
                let other = LightParams {
                    casts_shadow,
                    ..self::light(LightKind::Point { radius: 0.2 }, at(1.0, 1.0, 1.0), 3.0)
                };
                let material = MaterialParams {
                    roughness,
                    ..Default::default()
                };
                let params = SceneParams {
                    materials: vec![material],
                    lights: vec![light, other],
                    ..Default::default()
                };
                mean(
                    &run(
                        &mesh.scene(params),
                        &from_above(0.5),
                        square(16, 1024, 0),
                        2,
                    )
                    .0,
                )
            });
            let difference = (both[0] / both[1] - 1.0).abs();
            assert!(
                difference < 5e-3,
                "{kind:?} roughness {roughness}: {both:?}"
            );
        }
    }
}

#[test]
fn a_closed_room_glows_by_the_geometric_series() {
    // In a closed room whose walls emit 1 and reflect a, the radiance is 1 / (1 - a) everywhere; truncated after b
    // bounces it is (1 - a^(b + 2)) / (1 - a).
    let mut mesh = Mesh::default();
    mesh.cube(1.0, 0);
    let material = MaterialParams {
        emission: [1.0; 3],
        ..matte(0.5)
    };
    let scene = mesh.scene(SceneParams {
        materials: vec![material],
        ..Default::default()
    });
    let camera = CameraParams {
        clip_start: 0.0,
        ..Default::default()
    };
    for (bounces, expected) in [(0, 1.5), (1, 1.75), (30, 2.0)] {
        let value = mean(&run(&scene, &camera, square(8, 256, bounces), 1).0);
        assert!((value - expected).abs() < 0.01, "{bounces}: {value}");
    }
}

#[test]
fn white_furnace_on_solids() {
    // A solid without absorption is invisible against a background of radiance 1.
    let white = [1.0; 3];
    let solids = [
        ("diffuse", matte(1.0), 1e-6),
        (
            "mirror",
            MaterialParams {
                metallic: 1.0,
                roughness: 0.0,
                ..Default::default()
            },
            1e-6,
        ),
        (
            "metal",
            MaterialParams {
                metallic: 1.0,
                roughness: 0.6,
                ..Default::default()
            },
            2e-3,
        ),
        (
            "glass",
            MaterialParams {
                transmission: 1.0,
                roughness: 0.0,
                ..Default::default()
            },
            2e-3,
        ),
        (
            "frosted",
            MaterialParams {
                transmission: 1.0,
                roughness: 0.4,
                ..Default::default()
            },
            6e-3,
        ),
        (
            "coated",
            MaterialParams {
                roughness: 0.3,
                ..Default::default()
            },
            2e-3,
        ),
    ];
    for (name, material, tolerance) in solids {
        let mut mesh = Mesh::default();
        mesh.cube(1.0, 0);
        let material = MaterialParams {
            base_color: white,
            ..material
        };
        let params = SceneParams {
            materials: vec![material],
            world: white.into(),
            ..Default::default()
        };
        let mut camera = from_above(1.4);
        camera.to_world = {
            // Turned, so that three sides are visible.
            let (s, c) = 0.6_f64.sin_cos();
            [
                [c, 0.0, s, 6.0 * s],
                [s * s, c, -s * c, -6.0 * s * c],
                [-s * c, s, c * c, 6.0 * c * c],
                [0.0, 0.0, 0.0, 1.0],
            ]
        };
        let value = mean(&run(&mesh.scene(params), &camera, square(16, 256, 60), 2).0);
        assert!((value - 1.0).abs() < tolerance, "{name}: {value}");
    }
}

#[test]
fn whitted_sees_an_even_world_as_paths_do() {
    let mut mesh = Mesh::default();
    mesh.floor(9.0, 0.0, 0);
    let scene = mesh.scene(SceneParams {
        materials: vec![matte(0.8)],
        world: [1.0; 3].into(),
        ..Default::default()
    });
    for bounces in [0, 3] {
        let settings = Settings {
            integrator: Integrator::Whitted,
            ..square(8, 64, bounces)
        };
        let value = mean(&run(&scene, &from_above(0.01), settings, 1).0);
        assert!((value - 0.8).abs() < 1e-3, "{bounces}: {value}");
    }
}

#[test]
fn what_glows_below_a_coat_is_dimmed_by_it() {
    let glowing = |coat: f32| {
        let mut closure = ClosureParams::new(Kind::Principled);
        let inputs = [
            (Input::Emission, 1.0),
            (Input::Color, 0.0),
            (Input::Specular, 0.0),
            (Input::CoatWeight, coat),
            (Input::CoatIor, 1.0),
            (Input::CoatTint, 0.25),
        ];
        for (input, value) in inputs {
            closure.inputs[input as usize] = Operand::number(value);
        }
        MaterialParams {
            closures: vec![closure],
            ..Default::default()
        }
    };
    let seen = |coat: f32, glows_above: bool| {
        let mut mesh = Mesh::default();
        mesh.floor(9.0, 0.0, i32::from(glows_above));
        if glows_above {
            mesh.floor(4000.0, 20.0, 0);
        }
        let scene = mesh.scene(SceneParams {
            materials: vec![glowing(coat), matte(0.5)],
            ..Default::default()
        });
        mean(&run(&scene, &from_above(0.01), square(8, 256, 0), 1).0)
    };
    assert!((seen(1.0, false) - 0.25).abs() < 1e-6);
    assert!((seen(0.5, false) - 0.625).abs() < 1e-6);
    assert_eq!(seen(0.0, false), 1.0);
    // Below an emissive plane the light from the side takes a longer path through the coat: 1 / cosine, because its
    // index is 1.
    let n = 10_000;
    let sky: f64 = (0..n)
        .map(|i| (f64::from(i) + 0.5) / f64::from(n))
        .map(|c| 2.0 * c * 0.25_f64.powf(1.0 / c) / f64::from(n))
        .sum();
    for (coat, want) in [(0.0, 0.5), (1.0, 0.5 * sky)] {
        let got = seen(coat, true);
        assert!((got / want - 1.0).abs() < 0.01, "{coat}: {got} {want}");
    }
}
