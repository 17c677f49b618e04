// SPDX-License-Identifier: GPL-3.0-or-later
//! Negative light darkens, as in Cycles (values of Blender 5.2.0: -0.101 305 for the first test at -20 W).

use std::f64::consts::PI;

use crate::camera::CameraParams;
use crate::light::world::WorldParams;
use crate::light::{LightKind, LightParams};
use crate::material::MaterialParams;
use crate::scene::SceneParams;
use crate::tests::setup::{Mesh, at, from_above, light, matte, mean, run, square};

/// Mean radiance of a grey (0.8) floor seen from above at the origin.
fn floor(lights: Vec<LightParams>, world: WorldParams) -> f64 {
    let mut mesh = Mesh::default();
    mesh.floor(9.0, 0.0, 0);
    let scene = mesh.scene(SceneParams {
        materials: vec![matte(0.8)],
        lights,
        world,
        ..Default::default()
    });
    mean(&run(&scene, &from_above(0.01), square(8, 64, 0), 1).0)
}

/// A point light of this power above the origin.
fn lamp(power: f32) -> LightParams {
    let point = LightKind::Point { radius: 0.0 };
    light(point, at(0.0, 0.0, 2.0), power)
}

/// Radiance of the floor below a lamp of 1 W.
const PER_WATT: f64 = 0.8 / PI / (4.0 * PI) / 4.0;

#[test]
fn a_lamp_of_negative_power_darkens() {
    let alone = floor(vec![lamp(-20.0)], WorldParams::default());
    assert!((alone / (-20.0 * PER_WATT) - 1.0).abs() < 1e-4, "{alone}");
    assert!((alone + 0.101_305).abs() < 1e-4, "{alone}");
    // Each of two lights is chosen by the size of its power, whatever the sign.
    let both = floor(vec![lamp(-20.0), lamp(50.0)], WorldParams::default());
    assert!((both / (30.0 * PER_WATT) - 1.0).abs() < 0.05, "{both}");
    // More than 32 lights are chosen through a tree.
    let many = (0..60).map(|i| lamp(if i % 3 == 0 { -20.0 } else { 30.0 }));
    let sum = 20.0 * -20.0 + 40.0 * 30.0;
    let many = floor(many.collect(), WorldParams::default());
    assert!((many / (sum * PER_WATT) - 1.0).abs() < 0.05, "{many}");
}

#[test]
fn negative_light_passes_transparent_surfaces() {
    let mut mesh = Mesh::default();
    mesh.floor(9.0, 0.0, 0);
    mesh.floor(9.0, 1.0, 1);
    let pane = MaterialParams {
        alpha: 0.25,
        ..matte(0.0)
    };
    let scene = mesh.scene(SceneParams {
        materials: vec![matte(0.8), pane],
        lights: vec![lamp(-20.0)],
        ..Default::default()
    });
    let camera = CameraParams {
        clip_start: 7.5,
        ..from_above(0.01)
    };
    let value = mean(&run(&scene, &camera, square(8, 64, 0), 1).0);
    assert!(
        (value / (0.75 * -20.0 * PER_WATT) - 1.0).abs() < 1e-4,
        "{value}"
    );
}

#[test]
fn a_negative_background_darkens() {
    let constant = floor(vec![], WorldParams::from([-1.0; 3]));
    assert!((constant + 0.8).abs() < 1e-3, "{constant}");
    let empty = Mesh::default().scene(SceneParams {
        world: [-1.0; 3].into(),
        ..Default::default()
    });
    let (image, _) = run(&empty, &from_above(1.0), square(8, 1, 0), 1);
    assert_eq!(image[..3], [-1.0; 3]);
}

#[test]
fn a_surface_of_negative_emission_darkens() {
    // A square of side 2 at height 1 above the floor, invisible to the camera because of the near clipping plane.
    let lit = |emission: f32| {
        let mut mesh = Mesh::default();
        mesh.floor(9.0, 0.0, 0);
        mesh.floor(1.0, 1.0, 1);
        let emitter = MaterialParams {
            emission: [emission; 3],
            ..matte(0.0)
        };
        let scene = mesh.scene(SceneParams {
            materials: vec![matte(0.8), emitter],
            ..Default::default()
        });
        let camera = |clip_start: f64| CameraParams {
            clip_start,
            ..from_above(0.01)
        };
        [7.5, 0.1].map(|clip| mean(&run(&scene, &camera(clip), square(8, 256, 0), 1).0))
    };
    let [floor, seen] = lit(-1.0);
    assert!((seen + 1.0).abs() < 1e-6, "{seen}");
    // Irradiance on the axis of a square of half side 1 and radiance 1 at distance 1.
    let irradiance = 4.0 / 2.0_f64.sqrt() * (1.0 / 2.0_f64.sqrt()).atan();
    let expected = -0.8 / PI * irradiance;
    assert!(
        (floor / expected - 1.0).abs() < 0.01,
        "{floor}, expected {expected}"
    );
    // Cycles: 1.273 240 without the emitter, 0.830 065 with it.
    assert!((floor + 0.443_175).abs() < 0.005, "{floor}");
}
