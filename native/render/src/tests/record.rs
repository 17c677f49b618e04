// SPDX-License-Identifier: GPL-3.0-or-later
//! Recorded rays: every ray counts once, and the choice among them depends on nothing but the rays.

use std::sync::Arc;
use std::time::Duration;

use crate::job::Job;
use crate::light::LightKind;
use crate::material::MaterialParams;
use crate::path::record::Recorded;
use crate::path::work::Work;
use crate::scene::{RenderScene, SceneParams};
use crate::settings::Settings;
use crate::tests::setup::{Mesh, at, from_above, light, matte, square};
use halfspace_ray::Ray;

/// Largest number of rays of a kind that the settings permit.
const ALL: u32 = 1 << 16;

/// A cube on a floor below a sheet of this opacity, in the light of a sun and a white background.
fn scene(alpha: f32) -> Arc<RenderScene> {
    let mut mesh = Mesh::default();
    mesh.cube(1.0, 0);
    mesh.floor(9.0, -1.0, 0);
    mesh.floor(9.0, 2.0, 1);
    let sheet = MaterialParams {
        alpha,
        ..matte(0.5)
    };
    let sun = light(LightKind::Sun { angle: 0.1 }, at(0.0, 0.0, 1.0), 1.0);
    mesh.scene(SceneParams {
        materials: vec![matte(0.8), sheet],
        lights: vec![sun],
        world: [1.0; 3].into(),
        ..Default::default()
    })
}

/// Renders with at most `limit` recorded rays of a kind. Returns them, and the counts of all.
fn recorded(scene: &Arc<RenderScene>, limit: u32, threads: usize) -> (Vec<Recorded>, Work) {
    let settings = Settings {
        record_rays: limit,
        ..square(80, 2, 3)
    };
    let job = Job::start(Arc::clone(scene), &from_above(3.0), settings, threads).unwrap();
    assert!(job.wait(Duration::from_secs(600)), "the render did not end");
    assert_eq!(job.error(), None);
    (job.recorded(), job.statistics().work)
}

/// Returns the names of the kinds.
fn names(kinds: &[Recorded]) -> Vec<&str> {
    kinds.iter().map(|kind| kind.name.as_str()).collect()
}

/// Returns the number of rays of all kinds whose names begin with this word.
fn traced(kinds: &[Recorded], word: &str) -> u64 {
    let named = |kind: &&Recorded| kind.name.starts_with(word);
    kinds.iter().filter(named).map(|kind| kind.traced).sum()
}

#[test]
fn each_ray_is_recorded_once() {
    for (alpha, first) in [
        (0.5, ["camera", "camera continued", "shadow 0 nearest"]),
        (1.0, ["camera", "shadow 0", "diffuse 1"]),
    ] {
        let (kinds, work) = recorded(&scene(alpha), ALL, 2);
        assert_eq!(names(&kinds)[..3], first);
        let shadow = traced(&kinds, "shadow");
        assert_eq!(shadow, work.rays_shadow);
        let all = traced(&kinds, "");
        assert_eq!(all, work.rays());
        assert_eq!(kinds[0].traced, work.rays_primary);
        for kind in &kinds {
            assert_eq!(kind.rays.len() as u64, kind.traced, "{}", kind.name);
            let any = kind.name.starts_with("shadow") && !kind.name.contains("nearest");
            assert_eq!(kind.any, any, "{}", kind.name);
        }
    }
}

#[test]
fn the_choice_is_uniform_and_independent_of_threads() {
    let scene = scene(0.5);
    let (all, _) = recorded(&scene, ALL, 1);
    let (one, _) = recorded(&scene, 600, 1);
    let (three, _) = recorded(&scene, 600, 3);
    assert!(names(&all) == names(&one) && names(&one) == names(&three));
    for ((all, one), three) in all.iter().zip(&one).zip(&three) {
        assert_eq!(one.rays, three.rays, "{}", one.name);
        assert_eq!((one.traced, three.traced), (all.traced, all.traced));
        // All rays come in the order of their priorities.
        assert_eq!(one.rays, all.rays[..all.rays.len().min(600)]);
    }
    // Camera rays of a uniform choice have their mean origin on the camera's axis; its deviation is √3 / √600 = 0.07.
    let [camera, ..] = &one[..] else {
        panic!("camera rays come first")
    };
    let mean = |of: fn(&Ray) -> f32| camera.rays.iter().map(of).sum::<f32>() / 600.0;
    let (x, y) = (mean(|ray| ray.o[0]), mean(|ray| ray.o[1]));
    assert!(x.abs() < 0.3 && y.abs() < 0.3, "{x} {y}");
}

#[test]
fn nothing_is_recorded_unless_requested() {
    assert!(recorded(&scene(0.5), 0, 2).0.is_empty());
}
