// SPDX-License-Identifier: GPL-3.0-or-later
//! Settings that reduce noise at the price of bias: Filter Glossy, and caustics that are switched off.

use std::sync::Arc;

use crate::light::LightKind;
use crate::material::MaterialParams;
use crate::material::closure::{ClosureKind, ClosureParams, Input};
use crate::scene::{RenderScene, SceneParams};
use crate::settings::Settings;
use crate::tests::setup::{Mesh, at, from_above, light, matte, mean, run, square, tilted};
use crate::values::program::Operand;

/// A white material of one node.
fn node(kind: ClosureKind, roughness: f32) -> MaterialParams {
    let mut closure = ClosureParams::new(kind);
    closure.inputs[Input::Color as usize] = Operand::number(1.0);
    closure.inputs[Input::Roughness as usize] = Operand::number(roughness);
    MaterialParams {
        closures: vec![closure],
        ..Default::default()
    }
}

/// A matte floor below a mirror that stands upright next to it, lit by a lamp.
fn mirror_beside_floor() -> Arc<RenderScene> {
    let mut mesh = Mesh::default();
    mesh.floor(4.0, 0.0, 0);
    mesh.quad(
        [
            [1.0, -4.0, 0.0],
            [1.0, 4.0, 0.0],
            [1.0, 4.0, 6.0],
            [1.0, -4.0, 6.0],
        ],
        1,
    );
    mesh.scene(SceneParams {
        materials: vec![matte(0.8), node(ClosureKind::Glossy, 0.05)],
        lights: vec![light(
            LightKind::Point { radius: 0.3 },
            at(-1.0, 0.0, 2.0),
            100.0,
        )],
        ..Default::default()
    })
}

fn rendered(scene: &Arc<RenderScene>, more: impl FnOnce(&mut Settings)) -> Vec<f32> {
    let mut settings = square(16, 64, 4);
    more(&mut settings);
    run(scene, &from_above(0.5), settings, 1).0
}

fn spread(image: &[f32]) -> f64 {
    let mean = mean(image);
    let squares = image
        .chunks_exact(4)
        .map(|p| (f64::from(p[0]) - mean).powi(2));
    squares.sum::<f64>() / (image.len() / 4) as f64
}

#[test]
fn filtered_caustics_have_less_noise_and_about_the_same_light() {
    let scene = mirror_beside_floor();
    let plain = rendered(&scene, |_| ());
    let soft = rendered(&scene, |s| s.filter_glossy = 1.0);
    assert!(
        spread(&soft) < 0.5 * spread(&plain),
        "{} {}",
        spread(&soft),
        spread(&plain)
    );
    let ratio = mean(&soft) / mean(&plain);
    assert!((0.8..1.1).contains(&ratio), "{ratio}");
}

#[test]
fn a_small_filter_changes_nothing_of_probable_bounces() {
    // Diffuse bounces have densities of at most 1 / pi; this filter is far below those of nearly all.
    let scene = mirror_beside_floor();
    assert_eq!(
        rendered(&scene, |s| s.filter_glossy = 1e-9),
        rendered(&scene, |_| ())
    );
}

#[test]
fn mirror_images_that_the_camera_sees_are_never_blurred() {
    // A mirror seen directly, over which the lamp is.
    let mut mesh = Mesh::default();
    mesh.floor(4.0, 0.0, 0);
    let scene = mesh.scene(SceneParams {
        materials: vec![node(ClosureKind::Glossy, 0.2)],
        lights: vec![light(LightKind::Point { radius: 0.3 }, tilted(0.0), 100.0)],
        ..Default::default()
    });
    let off = rendered(&scene, |_| ());
    assert!(mean(&off) > 0.0);
    assert_eq!(
        off,
        rendered(&scene, |s| {
            s.filter_glossy = 10.0;
            (s.caustics_reflective, s.caustics_refractive) = (false, false);
        })
    );
}

#[test]
fn without_caustics_mirrors_bring_no_light_to_matte_surfaces() {
    let scene = mirror_beside_floor();
    let with = mean(&rendered(&scene, |_| ()));
    let without = mean(&rendered(&scene, |s| s.caustics_reflective = false));
    let alone = {
        let mut mesh = Mesh::default();
        mesh.floor(4.0, 0.0, 0);
        // A black wall in place of the mirror.
        mesh.quad(
            [
                [1.0, -4.0, 0.0],
                [1.0, 4.0, 0.0],
                [1.0, 4.0, 6.0],
                [1.0, -4.0, 6.0],
            ],
            1,
        );
        mesh.scene(SceneParams {
            materials: vec![matte(0.8), matte(0.0)],
            lights: vec![light(
                LightKind::Point { radius: 0.3 },
                at(-1.0, 0.0, 2.0),
                100.0,
            )],
            ..Default::default()
        })
    };
    let black = mean(&rendered(&alone, |_| ()));
    assert!(with > 1.05 * black, "{with} {black}");
    assert!((without / black - 1.0).abs() < 1e-3, "{without} {black}");
    // Refraction plays no part here.
    let refractive = rendered(&scene, |s| s.caustics_refractive = false);
    assert_eq!(refractive, rendered(&scene, |_| ()));
}

#[test]
fn exposure_multiplies_colours_alone() {
    let scene = mirror_beside_floor();
    let (plain, twice) = (
        rendered(&scene, |_| ()),
        rendered(&scene, |s| s.exposure = 2.0),
    );
    for (a, b) in plain.chunks_exact(4).zip(twice.chunks_exact(4)) {
        assert_eq!([2.0 * a[0], 2.0 * a[1], 2.0 * a[2], a[3]], *b);
    }
}
