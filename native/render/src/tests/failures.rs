// SPDX-License-Identifier: GPL-3.0-or-later
//! Renders that are cancelled, fail or have invalid input.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use crate::film::Unsampled;
use crate::job::Job;
use crate::light::{LightKind, LightParams};
use crate::scene::{RenderScene, SceneParams};
use crate::settings::{Pass, Settings};
use crate::tests::brute_force::BruteForce;
use crate::tests::setup::{Mesh, at, from_above, light, overview, run, square};
use halfspace_ray::{Hit, Ray, RayCounters, Tracer};
use halfspace_scene::Triangles;

/// A tracer that sleeps for each ray and can panic after a number of calls.
struct FaultyTracer {
    inner: Arc<BruteForce>,
    per_ray: Duration,
    fail_after: Option<u64>,
    calls: AtomicU64,
    /// Largest number of rays in a call.
    longest: AtomicU64,
}

impl Tracer for FaultyTracer {
    fn triangles(&self) -> Option<&Triangles> {
        Some(&self.inner.triangles)
    }

    fn count(&self) -> usize {
        self.inner.triangles.len()
    }

    fn corners(&self, id: u32) -> [[f32; 3]; 3] {
        self.inner.triangles.corners(id)
    }

    fn closest(&self, rays: &[Ray], hits: &mut [Hit], counters: Option<&mut [RayCounters]>) {
        let call = self.calls.fetch_add(1, Ordering::Relaxed);
        assert!(self.fail_after.is_none_or(|n| call < n), "planted failure");
        self.longest.fetch_max(rays.len() as u64, Ordering::Relaxed);
        std::thread::sleep(self.per_ray * rays.len() as u32);
        self.inner.closest(rays, hits, counters);
    }

    fn occluded(&self, rays: &[Ray], out: &mut [bool], counters: Option<&mut [RayCounters]>) {
        self.inner.occluded(rays, out, counters);
    }
}

/// A cube traced by a [`FaultyTracer`].
fn faulty_scene(
    per_ray: Duration,
    fail_after: Option<u64>,
) -> (Arc<FaultyTracer>, Arc<RenderScene>) {
    let mut mesh = Mesh::default();
    mesh.cube(1.0, 0);
    let inner = mesh.tracer(false);
    let tracer = Arc::new(FaultyTracer {
        inner,
        per_ray,
        fail_after,
        calls: AtomicU64::new(0),
        longest: AtomicU64::new(0),
    });
    let scene = RenderScene::new(tracer.clone(), SceneParams::default()).unwrap();
    (tracer, Arc::new(scene))
}

#[test]
fn a_cancelled_render_stops_within_a_call_and_keeps_its_samples() {
    let per_ray = Duration::from_micros(200);
    let (tracer, scene) = faulty_scene(per_ray, None);
    let settings = Settings {
        width: 256,
        height: 256,
        samples: 1000,
        ..Default::default()
    };
    let job = Job::start(scene, &from_above(2.0), settings, 2).unwrap();
    assert!(!job.wait(Duration::from_millis(400)));
    job.cancel();
    let started = tracer.calls.load(Ordering::Relaxed);
    assert!(job.wait(Duration::from_secs(600)));
    // Each worker finishes its current call, or one begun meanwhile, and every call is short.
    assert!(tracer.calls.load(Ordering::Relaxed) <= started + 2);
    let longest = tracer.longest.load(Ordering::Relaxed) as u32;
    assert!(
        per_ray * longest <= Duration::from_millis(50),
        "{longest} rays"
    );
    assert!(job.is_cancelled() && job.error().is_none() && job.progress() < 1.0);
    let mut out = vec![0.0; 256 * 256 * 4];
    job.copy_into(Pass::Combined, Unsampled::Zero, &mut out)
        .unwrap();
    assert!(out.iter().all(|v| v.is_finite()));
}

#[test]
fn a_panic_in_a_worker_becomes_an_error_text() {
    let (_, scene) = faulty_scene(Duration::ZERO, Some(20));
    let settings = Settings {
        width: 256,
        height: 256,
        samples: 4,
        ..Default::default()
    };
    let job = Job::start(scene, &from_above(2.0), settings, 2).unwrap();
    assert!(job.wait(Duration::from_secs(600)));
    let error = job.error().expect("an error");
    assert!(error.contains("planted failure"), "{error}");
    assert!(!job.is_cancelled(), "failed, not cancelled");
}

#[test]
fn an_empty_scene_shows_its_background() {
    let mesh = Mesh::default();
    let scene = mesh.scene(SceneParams {
        world: [0.25, 0.5, 1.0].into(),
        ..Default::default()
    });
    let (image, stats) = run(&scene, &overview(), square(9, 2, 4), 2);
    assert!(image.chunks_exact(4).all(|p| p == [0.25, 0.5, 1.0, 1.0]));
    assert_eq!(stats.work.rays_secondary, 0);
    assert_eq!(
        scene.features().left_out(),
        ["shading: no triangles"],
        "without triangles no material or shadow feature is listed"
    );
}

#[test]
fn invalid_scenes_are_errors_that_name_the_key() {
    let mut mesh = Mesh::default();
    mesh.cube(1.0, 0);
    let n = mesh.triangles.len();
    let mut index = vec![0; n];
    index[4] = 7;
    let mut normals = vec![[[0.0, 0.0, 1.0]; 3]; n];
    normals[2][1][0] = f32::NAN;
    let bad_light = LightParams {
        power: [f32::NAN; 3],
        ..light(LightKind::Sun { angle: 0.1 }, at(0.0, 0.0, 0.0), 1.0)
    };
    let wide = light(LightKind::Sun { angle: 9.0 }, at(0.0, 0.0, 0.0), 1.0);
    let cases = [
        (
            "material_index[4]: 7",
            SceneParams {
                material_index: Some(index),
                ..Default::default()
            },
        ),
        (
            "one entry per triangle: 12, got 1",
            SceneParams {
                material_index: Some(vec![0]),
                ..Default::default()
            },
        ),
        (
            "corner_normals[2]",
            SceneParams {
                corner_normals: Some(normals),
                ..Default::default()
            },
        ),
        (
            "lights[0]['power']",
            SceneParams {
                lights: vec![bad_light],
                ..Default::default()
            },
        ),
        (
            "lights[0]['angle']",
            SceneParams {
                lights: vec![wide],
                ..Default::default()
            },
        ),
        (
            "world['color']",
            SceneParams {
                world: [f32::INFINITY, 0.0, 0.0].into(),
                ..Default::default()
            },
        ),
    ];
    for (words, params) in cases {
        let error = RenderScene::new(mesh.tracer(false), params)
            .err()
            .expect(words)
            .to_string();
        assert!(error.contains(words) && !error.contains('\n'), "{error}");
    }
}

#[test]
fn a_step_of_too_many_samples_is_an_error() {
    for step in [0, 65, 1_000_000] {
        let settings = Settings {
            step_samples: Some(step),
            ..square(8, 4, 0)
        };
        let message = settings.check().unwrap_err().to_string();
        assert!(
            message.contains("step_samples'] must be from 1 to 64"),
            "{message}"
        );
    }
}
