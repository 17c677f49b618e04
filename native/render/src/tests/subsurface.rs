// SPDX-License-Identifier: GPL-3.0-or-later
//! Pictures of light that scatters below surfaces.

use std::sync::Arc;

use crate::light::LightKind;
use crate::material::MaterialParams;
use crate::material::closure::{ClosureKind, ClosureParams, Input};
use crate::medium::inversion::Inversion;
use crate::scene::{RenderScene, SceneParams};
use crate::settings::{Integrator, Settings};
use crate::tests::setup::{Mesh, at, from_above, light, matte, mean, run, square};
use crate::values::program::Operand;
use crate::values::varying::{ObjectFrame, Varying};

/// A material of subsurface scattering.
fn skin(color: [f32; 3], radius: f32, anisotropy: f32, method: Inversion) -> MaterialParams {
    let mut closure = ClosureParams::new(ClosureKind::Subsurface);
    let mut set = |input: Input, value: Operand| closure.inputs[input as usize] = value;
    set(Input::Color, Operand::color(color));
    set(Input::SubsurfaceRadius, Operand::color([1.0, 0.7, 0.5]));
    set(Input::SubsurfaceScale, Operand::number(radius));
    set(Input::SubsurfaceAnisotropy, Operand::number(anisotropy));
    closure.method = method;
    MaterialParams {
        closures: vec![closure],
        ..Default::default()
    }
}

/// Spheres around the origin in a white world, one for each material, each smaller than the one before.
fn spheres(materials: Vec<MaterialParams>) -> Arc<RenderScene> {
    let (mut mesh, mut objects) = (Mesh::default(), Vec::new());
    for m in 0..materials.len() {
        let before = mesh.vertices.len();
        mesh.sphere(2, m as i32);
        let scale = 1.0 - 0.3 * m as f32;
        for vertex in &mut mesh.vertices[before..] {
            vertex.iter_mut().for_each(|c| *c *= scale);
        }
        objects.resize(mesh.triangles.len(), m as u32);
    }
    let varying = Varying {
        objects: vec![ObjectFrame::default(); materials.len()],
        object_index: objects,
        ..Default::default()
    };
    mesh.scene(SceneParams {
        materials,
        varying,
        world: [1.0; 3].into(),
        ..Default::default()
    })
}

/// The mean brightness of the middle of the outermost sphere.
fn brightness(materials: Vec<MaterialParams>, settings: Settings) -> f64 {
    mean(&run(&spheres(materials), &from_above(0.6), settings, 2).0)
}

#[test]
fn a_white_sphere_neither_gains_nor_loses_light() {
    for method in [Inversion::RandomWalk, Inversion::Skin, Inversion::Legacy] {
        for (radius, g) in [(0.5, 0.0), (0.5, 0.6), (20.0, -0.5), (0.0, 0.0)] {
            // Skin of this colour has a mean free path of 0.0017 radii, legacy radii are divided by 4π.
            let radius = radius
                * match method {
                    Inversion::RandomWalk => 1.0,
                    Inversion::Skin => 600.0,
                    Inversion::Legacy => 12.0,
                };
            let white = skin([1.0; 3], radius, g, method);
            // Guided walks have weights: one sample has a standard deviation of up to 0.6. With 4096 samples for each of
            // 256 pixels all are within 0.003 of 1.
            let found = brightness(vec![white], square(8, 512, 20));
            assert!(
                (found - 1.0).abs() < 1.5e-2,
                "{method:?} {radius} {g}: {found}"
            );
        }
    }
}

#[test]
fn a_large_sphere_has_the_colour_of_its_surface() {
    // The fit's case is light that enters diffusely. Light that is refracted enters deeper, and less of it returns.
    let found = brightness(
        vec![skin([0.5; 3], 0.02, 0.0, Inversion::RandomWalk)],
        square(16, 256, 0),
    );
    assert!((0.45..0.5).contains(&found), "{found}");
}

#[test]
fn walks_end_at_their_own_object() {
    let settings = || square(8, 256, 4);
    let outer = || skin([0.8; 3], 0.5, 0.0, Inversion::RandomWalk);
    let alone = brightness(vec![outer()], settings());
    let around_another = brightness(vec![outer(), matte(0.0)], settings());
    assert!(
        (alone - around_another).abs() < 0.01,
        "{alone} {around_another}"
    );
}

#[test]
fn pictures_do_not_depend_on_structure_or_threads() {
    let mut mesh = Mesh::default();
    mesh.sphere(2, 0);
    mesh.floor(4.0, -1.0, 1);
    let pictures = [(false, 1), (true, 3)].map(|(reversed, threads)| {
        let params = SceneParams {
            material_index: Some(mesh.materials.clone()),
            materials: vec![
                skin([0.9, 0.6, 0.3], 0.3, 0.3, Inversion::RandomWalk),
                matte(0.5),
            ],
            lights: vec![light(
                LightKind::Point { radius: 0.2 },
                at(1.0, 1.0, 4.0),
                100.0,
            )],
            ..Default::default()
        };
        let scene = Arc::new(RenderScene::new(mesh.tracer(reversed), params).unwrap());
        run(&scene, &from_above(1.5), square(32, 4, 3), threads).0
    });
    assert_eq!(pictures[0], pictures[1]);
    let mean = mean(&pictures[0]);
    assert!(mean > 0.01, "{mean}");
}

#[test]
fn absurd_values_give_a_picture() {
    for (radius, color) in [
        (f32::MAX, 1.0),
        (f32::MIN_POSITIVE, 1.0),
        (-1.0, 0.5),
        (1e-6, 0.9),
        (1.0, 1e6),
        (1.0, 0.0),
    ] {
        let material = skin([color; 3], radius, 5.0, Inversion::RandomWalk);
        let found = brightness(vec![material], square(4, 8, 4));
        assert!((0.0..=1.2).contains(&found), "{radius} {color}: {found}");
    }
    // A sheet, below which walks turn back or are dropped, and Whitted's rays, which do not walk.
    let mut floor = Mesh::default();
    floor.floor(2.0, 0.0, 0);
    let scene = floor.scene(SceneParams {
        materials: vec![skin([0.8; 3], 1.0, 0.0, Inversion::RandomWalk)],
        world: [1.0; 3].into(),
        ..Default::default()
    });
    let found = mean(&run(&scene, &from_above(1.0), square(4, 64, 4), 1).0);
    assert!((0.0..0.9).contains(&found), "{found}");
    let whitted = Settings {
        integrator: Integrator::Whitted,
        ..square(4, 64, 4)
    };
    let found = mean(&run(&scene, &from_above(1.0), whitted, 1).0);
    assert!((found - 0.8).abs() < 0.01, "{found}");
}
