// SPDX-License-Identifier: GPL-3.0-or-later
//! Features that a scene does not need are not computed.

use crate::lights::LightKind;
use crate::material::MaterialParams;
use crate::scene::SceneParams;
use crate::tests::setup::{Mesh, at, from_above, light, matte, run, square};

#[test]
fn what_a_scene_lacks_costs_nothing() {
    let mut mesh = Mesh::default();
    mesh.cube(1.0, 0);
    let world = [1.0; 3];
    let bare = mesh.scene(SceneParams {
        materials: vec![matte(0.5)],
        world: world.into(),
        ..Default::default()
    });
    let left_out = bare.features().left_out().join("\n");
    for words in [
        "shadow rays: no lights",
        "refraction: no material transmits",
        "mirror rays",
        "smooth normals: none given",
        "transparent shadows",
        "emission",
    ] {
        assert!(left_out.contains(words), "{words} in {left_out}");
    }
    assert!(
        !left_out.contains("meet lights"),
        "there are none: {left_out}"
    );
    let settings = square(16, 4, 3);
    let work = run(&bare, &from_above(2.0), settings.clone(), 1).1.work;
    assert!(work.rays_primary == 16 * 16 * 4 && work.rays_secondary > 0);
    assert_eq!(
        (work.rays_shadow, work.shaded_glass, work.shaded_glossy),
        (0, 0, 0),
        "no light, glass or mirror"
    );
    assert_eq!((work.normals_fetched, work.lights_asked), (0, 0));
    // Each feature adds its own work, and its line disappears from the list.
    let gloss = MaterialParams::default();
    let glass = MaterialParams {
        transmission: 1.0,
        ..matte(0.5)
    };
    let sun = vec![light(LightKind::Sun { angle: 0.2 }, at(0.0, 0.0, 1.0), 1.0)];
    let normals = Some(vec![[[0.0, 0.0, 1.0]; 3]; mesh.triangles.len()]);
    let with = |params: SceneParams| {
        let scene = mesh.scene(SceneParams {
            world: world.into(),
            ..params
        });
        (
            run(&scene, &from_above(2.0), settings.clone(), 1).1.work,
            scene.features().left_out(),
        )
    };
    let (work, lines) = with(SceneParams {
        materials: vec![gloss],
        ..Default::default()
    });
    assert!(work.shaded_glossy > 0 && !lines.iter().any(|l| l.starts_with("mirror")));
    let (work, lines) = with(SceneParams {
        materials: vec![glass],
        ..Default::default()
    });
    assert!(work.shaded_glass > 0 && !lines.iter().any(|l| l.starts_with("refraction")));
    let (work, lines) = with(SceneParams {
        materials: vec![matte(0.5)],
        lights: sun,
        ..Default::default()
    });
    assert!(work.rays_shadow > 0 && work.lights_asked > 0);
    assert!(
        !lines
            .iter()
            .any(|l| l.starts_with("shadow rays") || l.contains("meet lights"))
    );
    // A light without a size cannot be hit.
    let point = vec![light(
        LightKind::Point { radius: 0.0 },
        at(0.0, 0.0, 4.0),
        9.0,
    )];
    let (_, lines) = with(SceneParams {
        materials: vec![matte(0.5)],
        lights: point.clone(),
        ..Default::default()
    });
    assert!(lines.iter().any(|l| l.starts_with("rays that meet lights")));
    let (work, lines) = with(SceneParams {
        materials: vec![matte(0.5)],
        corner_normals: normals,
        ..Default::default()
    });
    assert!(work.normals_fetched > 0 && !lines.iter().any(|l| l.starts_with("smooth")));
    // A material that no triangle uses does not count.
    let unused = mesh.scene(SceneParams {
        materials: vec![
            matte(0.5),
            MaterialParams {
                transmission: 1.0,
                ..Default::default()
            },
        ],
        ..Default::default()
    });
    assert!(!unused.features().glass);
    // With a black background and point lights the ray after the last bounce is not traced.
    let scene = mesh.scene(SceneParams {
        materials: vec![matte(0.5)],
        lights: point,
        ..Default::default()
    });
    assert_eq!(
        run(&scene, &from_above(2.0), square(16, 4, 0), 1)
            .1
            .work
            .rays_secondary,
        0
    );
}
