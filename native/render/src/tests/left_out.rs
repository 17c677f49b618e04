// SPDX-License-Identifier: GPL-3.0-or-later
//! Features that a scene does not need are not computed.

use crate::light::{LightKind, LightParams};
use crate::material::MaterialParams;
use crate::material::closure::{ClosureKind, ClosureParams};
use crate::path::work::Work;
use crate::scene::SceneParams;
use crate::settings::Settings;
use crate::tests::setup::{Mesh, at, from_above, light, matte, run, square};

/// Renders a cube against a white background. Returns the counts and the lines of the features left out.
fn cube(params: SceneParams, settings: Settings) -> (Work, Vec<String>) {
    let mut mesh = Mesh::default();
    mesh.cube(1.0, 0);
    let scene = mesh.scene(SceneParams {
        world: [1.0; 3].into(),
        ..params
    });
    let work = run(&scene, &from_above(2.0), settings, 1).1.work;
    (work, scene.features().left_out())
}

/// A scene of one material without lights.
fn with_material(material: MaterialParams) -> SceneParams {
    SceneParams {
        materials: vec![material],
        ..Default::default()
    }
}

/// A sun with a visible disc.
fn sun() -> Vec<LightParams> {
    vec![light(LightKind::Sun { angle: 0.2 }, at(0.0, 0.0, 1.0), 1.0)]
}

#[test]
fn a_diffuse_scene_computes_nothing_else() {
    let (work, lines) = cube(with_material(matte(0.5)), square(16, 4, 3));
    let lines = lines.join("\n");
    for words in [
        "shadow rays: no lights",
        "refraction: no material transmits",
        "further lobes",
        "mirror rays",
        "smooth normals: none given",
        "transparent shadows",
        "emission",
    ] {
        assert!(lines.contains(words), "{words} in {lines}");
    }
    assert!(!lines.contains("meet lights"), "there are none: {lines}");
    assert!(work.rays_primary == 16 * 16 * 4 && work.rays_secondary > 0);
    assert_eq!(
        (work.rays_shadow, work.shaded_glass, work.shaded_glossy),
        (0, 0, 0),
        "no light, glass or mirror"
    );
    assert_eq!((work.normals_fetched, work.lights_tested), (0, 0));
}

#[test]
fn each_feature_adds_its_work_and_removes_its_line() {
    let missing = |lines: &[String], word: &str| !lines.iter().any(|l| l.starts_with(word));
    let settings = square(16, 4, 3);
    let (work, lines) = cube(with_material(MaterialParams::default()), settings.clone());
    assert!(work.shaded_glossy > 0 && missing(&lines, "mirror"));
    let glass = MaterialParams {
        transmission: 1.0,
        ..matte(0.5)
    };
    let (work, lines) = cube(with_material(glass), settings.clone());
    assert!(work.shaded_glass > 0 && missing(&lines, "refraction"));
    let lit = SceneParams {
        lights: sun(),
        ..with_material(matte(0.5))
    };
    let (work, lines) = cube(lit, settings.clone());
    assert!(work.rays_shadow > 0 && work.lights_tested > 0);
    assert!(missing(&lines, "shadow rays") && missing(&lines, "rays that meet lights"));
    // A light without size cannot be hit.
    let point = SceneParams {
        lights: vec![light(
            LightKind::Point { radius: 0.0 },
            at(0.0, 0.0, 4.0),
            9.0,
        )],
        ..with_material(matte(0.5))
    };
    let (_, lines) = cube(point, settings.clone());
    assert!(!missing(&lines, "rays that meet lights"));
    let smooth = SceneParams {
        corner_normals: Some(vec![[[0.0, 0.0, 1.0]; 3]; 12]),
        ..with_material(matte(0.5))
    };
    let (work, lines) = cube(smooth, settings.clone());
    assert!(work.normals_fetched > 0 && missing(&lines, "smooth"));
    assert!(!missing(&lines, "further lobes"));
    let velvet = MaterialParams {
        closures: vec![ClosureParams::new(ClosureKind::Velvet)],
        ..Default::default()
    };
    let (_, lines) = cube(with_material(velvet), settings);
    assert!(missing(&lines, "further lobes"));
}

#[test]
fn a_material_without_triangles_adds_no_feature() {
    let mut mesh = Mesh::default();
    mesh.cube(1.0, 0);
    let glass = MaterialParams {
        transmission: 1.0,
        ..Default::default()
    };
    let scene = mesh.scene(SceneParams {
        materials: vec![matte(0.5), glass],
        ..Default::default()
    });
    assert!(!scene.features().glass);
}

#[test]
fn the_ray_after_the_last_bounce_needs_light_that_it_can_hit() {
    // A black background and a light without size cannot be hit.
    let mut mesh = Mesh::default();
    mesh.cube(1.0, 0);
    let lamp = light(LightKind::Point { radius: 0.0 }, at(0.0, 0.0, 4.0), 9.0);
    let scene = mesh.scene(SceneParams {
        lights: vec![lamp],
        ..with_material(matte(0.5))
    });
    let work = run(&scene, &from_above(2.0), square(16, 4, 0), 1).1.work;
    assert_eq!(work.rays_secondary, 0);
}
