// SPDX-License-Identifier: GPL-3.0-or-later
//! Pictures of what moves while the shutter is open.

use std::sync::Arc;
use std::time::Duration;

use crate::camera::CameraParams;
use crate::camera::filter::FilterKind;
use crate::camera::rolling::RollingParams;
use crate::film::Unsampled;
use crate::job::{Job, Moments};
use crate::material::MaterialParams;
use crate::scene::{RenderScene, SceneParams};
use crate::settings::{Pass, Settings};
use crate::tests::setup::{Mesh, at, from_above, mean, run, square};

/// A glowing square of half size 1 whose centre is at x.
fn glowing(x: f32) -> Arc<RenderScene> {
    let mut mesh = Mesh::default();
    mesh.quad(
        [
            [x - 1.0, -9.0, 0.0],
            [x + 1.0, -9.0, 0.0],
            [x + 1.0, 9.0, 0.0],
            [x - 1.0, 9.0, 0.0],
        ],
        0,
    );
    mesh.scene(SceneParams {
        materials: vec![MaterialParams {
            emission: [1.0; 3],
            base_color: [0.0; 3],
            specular: 0.0,
            ..Default::default()
        }],
        ..Default::default()
    })
}

/// Settings of four by four pixels whose samples do not leave them.
fn boxes(samples: u32) -> Settings {
    Settings {
        filter: FilterKind::Box,
        filter_width: 1.0,
        ..square(4, samples, 0)
    }
}

/// Renders scenes of several times.
fn moving(scenes: Vec<Arc<RenderScene>>, settings: Settings, threads: usize) -> Vec<f32> {
    seen(scenes, &from_above(2.0), settings, threads)
}

/// Renders scenes of several times, seen by a camera.
fn seen(
    scenes: Vec<Arc<RenderScene>>,
    camera: &CameraParams,
    settings: Settings,
    threads: usize,
) -> Vec<f32> {
    let pixels = (settings.width * settings.height) as usize;
    let job = Job::start(Moments(scenes), camera, settings, threads).unwrap();
    assert!(job.wait(Duration::from_secs(600)), "the render did not end");
    assert_eq!(job.error(), None);
    let mut out = vec![0.0; pixels * 4];
    job.copy_into(Pass::Combined, Unsampled::Zero, &mut out)
        .unwrap();
    out
}

#[test]
fn a_moving_camera_blurs_an_edge_evenly() {
    // The window moves by its own width from the middle of the square to beyond its edge at x = 1.
    let camera = CameraParams {
        poses: vec![at(0.5, 0.0, 8.0), at(1.0, 0.0, 8.0), at(1.5, 0.0, 8.0)],
        ..from_above(0.25)
    };
    let settings = square(8, 256, 0);
    let (image, _) = run(&glowing(0.0), &camera, settings.clone(), 2);
    for (i, pixel) in image.chunks_exact(4).enumerate() {
        // A pixel's ray stays on the square while the camera's x is below 1 - its own x.
        let x = (f64::from((i % 8) as u32) + 0.5) / 8.0 * 0.5 - 0.25;
        assert!(
            (f64::from(pixel[0]) - (0.5 - x)).abs() < 0.03,
            "{i}: {}",
            pixel[0]
        );
    }
    assert_eq!(image, run(&glowing(0.0), &camera, settings, 1).0);
}

#[test]
fn a_camera_that_stays_sees_what_a_camera_without_motion_sees() {
    let still = from_above(1.7);
    let held = CameraParams {
        poses: vec![still.to_world; 3],
        ..still.clone()
    };
    let [a, b] = [still, held].map(|c| run(&glowing(0.3), &c, square(16, 4, 0), 1).0);
    let apart = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).sum::<f32>() / a.len() as f32;
    assert!(apart < 0.01, "{apart}");
}

#[test]
fn samples_take_the_scenes_in_turn() {
    let scenes: Vec<_> = [-2.0, -1.0, 0.0, 1.0].map(glowing).into();
    let image = moving(scenes.clone(), boxes(64), 2);
    // The window reaches from -2 to 2; the columns are 1 wide, and each scene lights two of them.
    for (i, pixel) in image.chunks_exact(4).enumerate() {
        let lit = [0.5, 0.5, 0.5, 0.25][i % 4];
        assert!((pixel[0] - lit).abs() < 1e-6, "{i}: {}", pixel[0]);
    }
    // Neither the threads nor the length of the steps change a pixel.
    let steps = Settings {
        step_samples: Some(5),
        ..boxes(64)
    };
    assert_eq!(image, moving(scenes, steps, 1));
}

#[test]
fn the_first_samples_are_spread_over_all_scenes() {
    // Each scene lights the same number of pixels, so that a mean over all is exact as soon as each was taken once.
    let scenes: Vec<_> = [-1.0, 0.0, 1.0, 0.0].map(glowing).into();
    for samples in [4, 8] {
        let brightness = mean(&moving(scenes.clone(), boxes(samples), 1));
        assert!((brightness - 0.5).abs() < 1e-6, "{samples}: {brightness}");
    }
}

#[test]
fn rows_of_a_rolling_shutter_show_their_times() {
    let scenes: Vec<_> = [-2.0, -1.0, 0.0, 1.0].map(glowing).into();
    let rolling = |duration, threads| {
        let rolling = Some(RollingParams {
            duration,
            curve: Vec::new(),
        });
        let camera = CameraParams {
            rolling,
            ..from_above(2.0)
        };
        seen(scenes.clone(), &camera, boxes(64), threads)
    };
    // The scene of each row from the bottom if it is exposed for one moment.
    let short = rolling(0.0, 2);
    for (row, scene) in [3, 3, 2, 1].into_iter().enumerate() {
        let whole = moving(vec![Arc::clone(&scenes[scene])], boxes(64), 1);
        let row = row * 16..(row + 1) * 16;
        assert_eq!(short[row.clone()], whole[row], "{scene}");
    }
    assert_eq!(short, rolling(0.0, 1));
    // Exposed for the whole opening, all rows show all scenes.
    let long = rolling(1.0, 2);
    let all = moving(scenes.clone(), boxes(64), 2);
    assert!(long.iter().zip(&all).all(|(a, b)| (a - b).abs() < 1e-5));
}

#[test]
fn as_many_samples_as_scenes_take_each_once() {
    // The columns of the window are 1 wide, and one of the scenes lights each of them.
    let scenes: Vec<_> = [-2.0, 0.0, 2.0].map(glowing).into();
    for (samples, seed) in [(3, 0), (6, 1), (9, 7)] {
        let settings = Settings {
            seed,
            ..boxes(samples)
        };
        for (i, pixel) in moving(scenes.clone(), settings, 1)
            .chunks_exact(4)
            .enumerate()
        {
            assert!((pixel[0] - 1.0 / 3.0).abs() < 1e-6, "{i}: {}", pixel[0]);
        }
    }
}

#[test]
fn seeds_show_different_scenes_first() {
    let scenes: Vec<_> = [-2.0, 0.0, 2.0, 5.0].map(glowing).into();
    let mut shown: Vec<_> = (0..5)
        .map(|seed| {
            let settings = Settings { seed, ..boxes(1) };
            moving(scenes.clone(), settings, 1)
        })
        .collect();
    shown.sort_by(|a, b| a.partial_cmp(b).unwrap());
    shown.dedup();
    assert!(shown.len() >= 3, "{}", shown.len());
}

#[test]
fn no_scene_is_an_error() {
    let Err(error) = Job::start(Moments(Vec::new()), &from_above(1.0), square(4, 1, 0), 1) else {
        panic!("a render of nothing started");
    };
    assert!(error.to_string().contains("scenes"), "{error}");
}
