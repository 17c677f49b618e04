// SPDX-License-Identifier: GPL-3.0-or-later
//! Shadow catchers show what the other objects take from their light, and nothing else.

use std::sync::Arc;
use std::time::Duration;

use crate::film::Unsampled;
use crate::job::Job;
use crate::light::LightKind;
use crate::material::MaterialParams;
use crate::scene::{RenderScene, SceneParams};
use crate::settings::{Pass, Settings};
use crate::tests::setup::{Mesh, at, from_above, light, matte, run, square};

/// A catching floor below an object of this material, if any, in the light of a lamp and the background.
fn floor(object: Option<MaterialParams>) -> (Mesh, SceneParams) {
    let mut mesh = Mesh::default();
    mesh.floor(4.0, 0.0, 0);
    let catcher = MaterialParams {
        catcher: true,
        ..matte(0.6)
    };
    let mut materials = vec![catcher];
    if let Some(object) = object {
        mesh.floor(0.7, 1.0, 1);
        materials.push(object);
    }
    let params = SceneParams {
        material_index: Some(mesh.materials.clone()),
        materials,
        lights: vec![light(
            LightKind::Point { radius: 0.3 },
            at(2.0, 1.0, 4.0),
            300.0,
        )],
        world: [0.2, 0.3, 0.4].into(),
        ..Default::default()
    };
    (mesh, params)
}

/// The settings of a picture with a transparent film or not.
fn settings(film_transparent: bool) -> Settings {
    Settings {
        film_transparent,
        ..square(24, 8, 3)
    }
}

/// The scene of a mesh.
fn scene(mesh: &Mesh, params: SceneParams) -> Arc<RenderScene> {
    Arc::new(RenderScene::new(mesh.tracer(false), params).unwrap())
}

#[test]
fn a_catcher_alone_shows_nothing() {
    let (mesh, params) = floor(None);
    let scene = scene(&mesh, params);
    let (picture, _) = run(&scene, &from_above(3.0), settings(true), 2);
    assert!(picture.iter().all(|&value| value == 0.0), "no shadow");
    let (picture, _) = run(&scene, &from_above(3.0), settings(false), 2);
    for pixel in picture.chunks_exact(4) {
        for (value, background) in pixel.iter().zip([0.2, 0.3, 0.4, 1.0]) {
            assert!((value - background).abs() < 1e-6, "the background");
        }
    }
}

#[test]
fn alpha_or_a_pass_holds_the_shadow_of_an_object() {
    let (mesh, params) = floor(Some(matte(0.0)));
    let scene = scene(&mesh, params);
    let (picture, _) = run(&scene, &from_above(3.0), settings(true), 2);
    let pixels: Vec<_> = picture.chunks_exact(4).collect();
    assert!(pixels.iter().all(|p| p[..3] == [0.0; 3]), "black object");
    let shaded = pixels.iter().filter(|p| p[3] > 0.3).count();
    let open = pixels.iter().filter(|p| p[3] < 0.05).count();
    assert!(shaded > 40 && open > 200, "{shaded} {open}");
    // In a pass of its own the same shadow dims what the object leaves open.
    let apart = Settings {
        passes: vec![Pass::ShadowCatcher, Pass::Combined],
        ..settings(true)
    };
    let job = Job::start(scene, &from_above(3.0), apart, 2).unwrap();
    assert!(job.wait(Duration::from_secs(60)));
    let mut shadow = vec![0.0; 24 * 24 * 3];
    let mut object = vec![0.0; 24 * 24 * 4];
    job.copy_into(Pass::ShadowCatcher, Unsampled::Zero, &mut shadow)
        .unwrap();
    job.copy_into(Pass::Combined, Unsampled::Zero, &mut object)
        .unwrap();
    let both = shadow.chunks_exact(3).zip(object.chunks_exact(4));
    for ((shadow, object), whole) in both.zip(pixels) {
        let light = (1.0 - object[3]) * shadow.iter().sum::<f32>() / 3.0;
        assert!((1.0 - light - whole[3]).abs() < 1e-5);
    }
}

#[test]
fn the_shadow_does_not_depend_on_threads_or_tracers() {
    let object = MaterialParams {
        alpha: 0.5,
        ..Default::default()
    };
    let (mesh, params) = floor(Some(object));
    let pictures = [(false, 1), (true, 3)].map(|(reversed, threads)| {
        let scene = Arc::new(RenderScene::new(mesh.tracer(reversed), params.clone()).unwrap());
        run(&scene, &from_above(3.0), settings(false), threads).0
    });
    assert_eq!(pictures[0], pictures[1]);
}

#[test]
fn other_rays_see_catchers_as_they_are() {
    // A mirror above the floor shows it lit, although the camera sees only its shadow.
    let mirror = MaterialParams {
        metallic: 1.0,
        roughness: 0.0,
        base_color: [1.0; 3],
        ..Default::default()
    };
    let (mut mesh, mut params) = floor(None);
    mesh.quad(
        [
            [-3.0, 0.0, 0.1],
            [3.0, 0.0, 0.1],
            [3.0, 1.0, 3.1],
            [-3.0, 1.0, 3.1],
        ],
        1,
    );
    params.materials.push(mirror);
    params.material_index = Some(mesh.materials.clone());
    params.world = [0.0; 3].into();
    let scene = scene(&mesh, params);
    let (picture, _) = run(&scene, &from_above(3.0), settings(true), 2);
    let lit = picture.chunks_exact(4).filter(|p| p[0] > 0.1).count();
    assert!(lit > 20, "{lit} pixels reflect the floor");
}
