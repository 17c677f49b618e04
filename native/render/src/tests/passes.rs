// SPDX-License-Identifier: GPL-3.0-or-later
//! Contents of the passes.

use std::time::Duration;

use crate::film::Unsampled;
use crate::job::Job;
use crate::scene::SceneParams;
use crate::settings::{Pass, Settings};
use crate::tests::setup::{Mesh, from_above, square};

#[test]
fn passes_contain_the_values_of_the_first_surface() {
    let mut mesh = Mesh::default();
    mesh.floor(1.0, 3.0, 0);
    let scene = mesh.scene(SceneParams {
        world: [0.5; 3].into(),
        ..Default::default()
    });
    let settings = Settings {
        passes: Pass::all()
            .chain([Pass::Output(0), Pass::Group(0)])
            .collect(),
        film_transparent: true,
        ..square(8, 3, 1)
    };
    let job = Job::start(scene, &from_above(2.0), settings, 1).unwrap();
    assert!(job.wait(Duration::from_secs(600)) && job.samples_done() == 3);
    let get = |pass: Pass| {
        let mut out = vec![-1.0; 64 * pass.channels()];
        job.copy_into(pass, Unsampled::Zero, &mut out).unwrap();
        out
    };
    // Compare the pixel in the middle, on the floor, with the one in the corner, next to the floor.
    let (middle, corner) = (3 * 8 + 3, 0);
    let depth = get(Pass::Depth);
    assert!((depth[middle] - 5.0).abs() < 1e-5 && depth[corner] == 1e10);
    let normal = get(Pass::Normal);
    assert_eq!(normal[middle * 3..middle * 3 + 3], [0.0, 0.0, 1.0]);
    let position = get(Pass::Position);
    assert!((position[middle * 3 + 2] - 3.0).abs() < 1e-6);
    assert!(
        (position[middle * 3] + 0.25).abs() < 0.75 * 0.5,
        "half a pixel is 0.25"
    );
    let combined = get(Pass::Combined);
    assert_eq!(
        (
            combined[corner * 4],
            combined[corner * 4 + 3],
            combined[middle * 4 + 3]
        ),
        (0.0, 0.0, 1.0)
    );
    assert_eq!(
        (get(Pass::TraversalSteps)[0], get(Pass::TriangleTests)[0]),
        (3.0, 5.0)
    );
    assert_eq!(get(Pass::SampleCount)[middle], 3.0);
    let work = job.statistics().work;
    assert_eq!((work.steps, work.tests), (3 * 64 * 3, 5 * 64 * 3));
}
