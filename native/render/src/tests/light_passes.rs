// SPDX-License-Identifier: GPL-3.0-or-later
//! The light passes add up to the combined pass.

use std::sync::Arc;
use std::time::Duration;

use crate::film::Unsampled;
use crate::job::Job;
use crate::light::LightKind;
use crate::material::MaterialParams;
use crate::scene::{RenderScene, SceneParams};
use crate::settings::{Integrator, LightPass, LobeKind, Pass, Settings};
use crate::tests::setup::{Mesh, at, from_above, light, matte, square};

/// A matt floor, and above it a glossy plate, glass, and a lamp that the camera sees.
fn plates() -> Arc<RenderScene> {
    let mut mesh = Mesh::default();
    mesh.floor(4.0, 0.0, 0);
    mesh.quad(
        [
            [-3.0, 0.0, 1.0],
            [0.0, 0.0, 1.0],
            [0.0, 3.0, 2.0],
            [-3.0, 3.0, 2.0],
        ],
        1,
    );
    mesh.quad(
        [
            [0.0, 0.0, 1.0],
            [3.0, 0.0, 1.0],
            [3.0, 3.0, 1.5],
            [0.0, 3.0, 1.5],
        ],
        2,
    );
    mesh.quad(
        [
            [0.0, -3.0, 1.0],
            [2.0, -3.0, 1.0],
            [2.0, -1.0, 1.0],
            [0.0, -1.0, 1.0],
        ],
        3,
    );
    let material = |metallic, transmission, emission| MaterialParams {
        base_color: [0.8, 0.5, 0.2],
        metallic,
        transmission,
        emission: [emission; 3],
        ..Default::default()
    };
    mesh.scene(SceneParams {
        materials: vec![
            matte(0.5),
            material(1.0, 0.0, 0.0),
            material(0.0, 1.0, 0.0),
            material(0.5, 0.0, 2.0),
        ],
        lights: vec![light(
            LightKind::Point { radius: 0.5 },
            at(-2.0, -2.0, 3.0),
            90.0,
        )],
        world: [0.2, 0.3, 0.4].into(),
        ..Default::default()
    })
}

/// Returns the values of a pass of 12 × 12 pixels.
fn read(job: &Job, pass: Pass) -> Vec<f32> {
    let mut out = vec![-1.0; 144 * pass.channels()];
    job.copy_into(pass, Unsampled::Zero, &mut out).unwrap();
    out
}

#[test]
fn light_passes_add_up_to_combined() {
    let scene = plates();
    for integrator in [Integrator::Path, Integrator::Whitted, Integrator::Ambient] {
        let settings = Settings {
            passes: Pass::all().collect(),
            integrator,
            exposure: 1.5,
            ..square(12, 4, 2)
        };
        let job = Job::start(Arc::clone(&scene), &from_above(5.0), settings, 1).unwrap();
        assert!(job.wait(Duration::from_secs(600)) && job.samples_done() == 4);
        let light = |pass| read(&job, Pass::Light(pass));
        // Add up the passes, and see that each kind of lobe has a part.
        let mut sums = light(LightPass::Emission);
        for (sum, more) in sums.iter_mut().zip(light(LightPass::Environment)) {
            *sum += more;
        }
        for kind in [LobeKind::Diffuse, LobeKind::Glossy, LobeKind::Transmission] {
            let color = light(LightPass::Color(kind));
            let scattered = [LightPass::Direct(kind), LightPass::Indirect(kind)].map(light);
            let seen = scattered.iter().flatten().any(|&v| v > 0.0);
            assert_eq!(
                seen,
                integrator != Integrator::Ambient || kind == LobeKind::Diffuse
            );
            for (i, sum) in sums.iter_mut().enumerate() {
                *sum += (scattered[0][i] + scattered[1][i]) * color[i];
            }
        }
        for (pixel, sum) in read(&job, Pass::Combined)
            .chunks_exact(4)
            .zip(sums.chunks_exact(3))
        {
            for (c, s) in pixel.iter().zip(sum) {
                assert!((c - s).abs() < 1e-5 + 1e-4 * c, "{integrator:?}: {c} {s}");
            }
        }
    }
}
