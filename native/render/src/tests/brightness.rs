// SPDX-License-Identifier: GPL-3.0-or-later
//! Brightness of whole renders, against closed forms and against Cycles.

use std::f64::consts::PI;

use crate::camera::CameraParams;
use crate::light::{AreaShape, LightKind, LightParams};
use crate::material::MaterialParams;
use crate::material::closure::{ClosureKind, ClosureParams, Input};
use crate::scene::SceneParams;
use crate::settings::{Integrator, Settings};
use crate::tests::setup::{Mesh, at, from_above, light, matte, mean, run, scaled, square, tilted};
use crate::values::program::Operand;

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

/// Half angle of the cone of all spot lights, radians.
const HALF_CONE: f64 = 0.5;

/// A light, the radiance of the floor in Cycles, and in closed form if there is one.
struct Reference {
    name: &'static str,
    light: LightParams,
    cycles: f64,
    closed: Option<f64>,
}

/// A light above the floor, with its brightness in Cycles.
fn cycles(name: &'static str, kind: LightKind, to_world: [[f64; 4]; 4], cycles: f64) -> Reference {
    // Suns have 1 W/m², all others 100 W.
    let power = match kind {
        LightKind::Sun { .. } => 1.0,
        _ => 100.0,
    };
    Reference {
        name,
        light: light(kind, to_world, power),
        cycles,
        closed: None,
    }
}

impl Reference {
    /// Adds the irradiance in closed form.
    fn closed(self, irradiance: f64) -> Self {
        Self {
            closed: Some(0.8 / PI * irradiance),
            ..self
        }
    }
}

/// Radiant intensity of a point light of 100 W.
const INTENSITY: f64 = 100.0 / (4.0 * PI);

fn spot(radius: f32, blend: f32) -> LightKind {
    LightKind::Spot {
        radius,
        size: 2.0 * HALF_CONE as f32,
        blend,
    }
}

/// Point and spot lights.
fn point_lights() -> Vec<Reference> {
    // Blender's smoothstep of the spot cone at 0.4 rad, for blend 0.5.
    let edge = HALF_CONE.cos();
    let x = ((0.4_f64.cos() - edge) / ((1.0 - edge) * 0.5)).min(1.0);
    let fade = x * x * (3.0 - 2.0 * x);
    let point = |radius| LightKind::Point { radius };
    let above = at(0.0, 0.0, 2.0);
    let stretched = scaled(tilted(0.4), 2.0, 3.0);
    vec![
        cycles("point", point(0.0), above, 0.506_593_3).closed(INTENSITY / 4.0),
        cycles("soft point", point(0.5), above, 0.476_795_6).closed(INTENSITY / 4.25),
        cycles(
            "soft point aside",
            point(1.0),
            at(2.0, 0.0, 2.0),
            0.159_212_3,
        ),
        cycles("spot", spot(0.0, 0.15), above, 0.506_593_3).closed(INTENSITY / 4.0),
        cycles("spot tilted", spot(0.0, 0.5), tilted(0.4), 0.403_400_8)
            .closed(INTENSITY / 4.0 * fade),
        cycles("spot scaled", spot(0.0, 0.5), stretched, 0.506_593_3).closed(INTENSITY / 4.0),
        cycles("soft spot", spot(0.5, 0.5), tilted(0.4), 0.248_739_0),
    ]
}

/// Suns.
fn suns() -> Vec<Reference> {
    let sun = |degrees: f32| LightKind::Sun {
        angle: degrees.to_radians(),
    };
    let above = at(0.0, 0.0, 2.0);
    vec![
        cycles("sun", sun(0.0), above, 0.254_646_9).closed(1.0),
        cycles("wide sun", sun(60.0), above, 0.254_647_9).closed(1.0),
        cycles("sun tilted", sun(0.0), tilted(0.7), 0.194_765_1).closed(0.7_f64.cos()),
    ]
}

/// Area lights.
fn area_lights() -> Vec<Reference> {
    // Irradiance below the centre of a rectangle of half sizes a, b and radiance 1 at height 2.
    let rectangle = |a: f64, b: f64| {
        let h = 2.0_f64;
        2.0 * (a / (a * a + h * h).sqrt() * (b / (a * a + h * h).sqrt()).atan()
            + b / (b * b + h * h).sqrt() * (a / (b * b + h * h).sqrt()).atan())
    };
    let area = |shape, size, size_y| LightKind::Area {
        shape,
        size,
        size_y,
        spread: std::f32::consts::PI,
    };
    let square = area(AreaShape::Square, 1.0, 0.0);
    let above = at(0.0, 0.0, 2.0);
    vec![
        cycles("square", square, above, 1.871_048_2).closed(100.0 / PI * rectangle(0.5, 0.5)),
        cycles(
            "rectangle",
            area(AreaShape::Rectangle, 2.0, 1.0),
            above,
            1.685_311_1,
        )
        .closed(50.0 / PI * rectangle(1.0, 0.5)),
        cycles("disk", area(AreaShape::Disk, 1.0, 0.0), above, 1.907_169_6)
            .closed(100.0 / PI / 4.25),
        cycles(
            "ellipse",
            area(AreaShape::Ellipse, 2.0, 1.0),
            above,
            1.758_349_4,
        ),
        cycles("square tilted", square, tilted(0.6), 1.617_975_7),
    ]
}

/// Reference values: Cycles of Blender 5.2.3 with 512 samples; a grey (0.8) diffuse plane seen from above at the
/// origin; light at (0, 0, 2) unless stated, 100 W or 1 W/m². Where a closed form exists, it is checked too.
#[test]
fn lights_are_as_bright_as_in_cycles() {
    for reference in [point_lights(), suns(), area_lights()]
        .into_iter()
        .flatten()
    {
        let Reference {
            name,
            light,
            cycles,
            closed,
        } = reference;
        let ours = lit_floor(vec![light], 256);
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
            spread: std::f32::consts::PI,
        },
        LightKind::Area {
            shape: AreaShape::Ellipse,
            size: 1.0,
            size_y: 2.0,
            spread: std::f32::consts::PI,
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
                    sphere: false,
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
fn radiance_in_a_closed_room_is_a_geometric_series() {
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
fn whitted_integrates_a_constant_background_like_paths() {
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
fn a_coat_dims_the_emission_below_it() {
    let emissive = |coat: f32| {
        let mut closure = ClosureParams::new(ClosureKind::Principled);
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
    let radiance = |coat: f32, emitter_above: bool| {
        let mut mesh = Mesh::default();
        mesh.floor(9.0, 0.0, i32::from(emitter_above));
        if emitter_above {
            mesh.floor(4000.0, 20.0, 0);
        }
        let scene = mesh.scene(SceneParams {
            materials: vec![emissive(coat), matte(0.5)],
            ..Default::default()
        });
        mean(&run(&scene, &from_above(0.01), square(8, 256, 0), 1).0)
    };
    assert!((radiance(1.0, false) - 0.25).abs() < 1e-6);
    assert!((radiance(0.5, false) - 0.625).abs() < 1e-6);
    assert_eq!(radiance(0.0, false), 1.0);
    // Below an emissive plane the light from the side takes a longer path through the coat: 1 / cosine, because its
    // index is 1.
    let n = 10_000;
    let sky: f64 = (0..n)
        .map(|i| (f64::from(i) + 0.5) / f64::from(n))
        .map(|c| 2.0 * c * 0.25_f64.powf(1.0 / c) / f64::from(n))
        .sum();
    for (coat, want) in [(0.0, 0.5), (1.0, 0.5 * sky)] {
        let got = radiance(coat, true);
        assert!((got / want - 1.0).abs() < 0.01, "{coat}: {got} {want}");
    }
}
