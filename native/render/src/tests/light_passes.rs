// SPDX-License-Identifier: GPL-3.0-or-later
//! The light passes add up to the combined pass.

use std::sync::Arc;
use std::time::Duration;

use crate::film::Unsampled;
use crate::job::Job;
use crate::light::LightKind;
use crate::light::world::WorldParams;
use crate::material::MaterialParams;
use crate::medium::{VolumeClosure, VolumeParams};
use crate::scene::{RenderScene, SceneParams};
use crate::settings::{Integrator, LightPass, LobeKind, Pass, Settings};
use crate::tests::setup::{Mesh, at, from_above, light, matte, square};
use crate::values::program::Operand;
use crate::values::visibility::Visibility;

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

/// A glowing fog, denser in blue, over a glossy floor in a bright world, with a lamp of a light group in it.
fn fog() -> Arc<RenderScene> {
    let mut mesh = Mesh::default();
    mesh.floor(4.0, 0.0, 0);
    let mut lamp = light(LightKind::Point { radius: 0.5 }, at(-2.0, -2.0, 3.0), 90.0);
    lamp.group = 1;
    lamp.visible = Visibility::ALL;
    let mut world = WorldParams::from([0.2, 0.3, 0.4]);
    world.volume = VolumeParams {
        closures: vec![VolumeClosure {
            scattering: Operand::color([0.1, 0.15, 0.2]),
            absorption: Operand::number(0.02),
            emission: Operand::number(0.01),
            ..Default::default()
        }],
        program: Vec::new(),
    };
    let material = MaterialParams {
        base_color: [0.8, 0.5, 0.2],
        metallic: 0.5,
        ..Default::default()
    };
    mesh.scene(SceneParams {
        materials: vec![material],
        lights: vec![lamp],
        world,
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
            // Whitted's rays do not go through rough glass, and openness is white and matte.
            let there = match integrator {
                Integrator::Path => true,
                Integrator::Whitted => kind != LobeKind::Transmission,
                Integrator::Ambient => kind == LobeKind::Diffuse,
            };
            assert_eq!(seen, there, "{integrator:?} {kind:?}");
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

#[test]
fn light_passes_and_groups_of_a_fog_add_up() {
    let scene = fog();
    // Clamping tells groups that are limited together from groups limited one by one.
    for clamp_indirect in [0.0, 0.05] {
        let settings = Settings {
            passes: Pass::all().chain([Pass::Group(0)]).collect(),
            volume_bounces: 4,
            clamp_indirect,
            ..square(12, 4, 4)
        };
        let job = Job::start(Arc::clone(&scene), &from_above(5.0), settings, 1).unwrap();
        assert!(job.wait(Duration::from_secs(600)) && job.samples_done() == 4);
        let light = |pass| read(&job, Pass::Light(pass));
        let mut sums = vec![0.0; 144 * 3];
        for pass in [
            LightPass::Emission,
            LightPass::Environment,
            LightPass::VolumeDirect,
            LightPass::VolumeIndirect,
        ] {
            let part = light(pass);
            // The floor lies below the whole picture.
            let seen = part.iter().any(|&v| v > 0.0);
            assert_eq!(seen, pass != LightPass::Environment, "{pass:?}");
            for (sum, value) in sums.iter_mut().zip(part) {
                *sum += value;
            }
        }
        for kind in [LobeKind::Diffuse, LobeKind::Glossy, LobeKind::Transmission] {
            let color = light(LightPass::Color(kind));
            for part in [LightPass::Direct(kind), LightPass::Indirect(kind)].map(light) {
                for (i, sum) in sums.iter_mut().enumerate() {
                    *sum += part[i] * color[i];
                }
            }
        }
        let combined = read(&job, Pass::Combined);
        for (pixel, sum) in combined.chunks_exact(4).zip(sums.chunks_exact(3)) {
            for (c, s) in pixel.iter().zip(sum) {
                assert!((c - s).abs() < 1e-5 + 1e-4 * c, "{c} {s}");
            }
        }
        // The light of the lamp is part of each pixel, in the fog too.
        let group = read(&job, Pass::Group(0));
        for (pixel, lamp) in combined.chunks_exact(4).zip(group.chunks_exact(3)) {
            for (c, l) in pixel.iter().zip(lamp) {
                assert!(*l > 0.0 && *l < *c, "{l} of {c}");
            }
        }
    }
}

#[test]
fn a_lamp_alone_in_a_fog_is_the_whole_picture() {
    let mut mesh = Mesh::default();
    mesh.floor(4.0, 0.0, 0);
    let mut lamp = light(LightKind::Point { radius: 0.5 }, at(-2.0, -2.0, 3.0), 90.0);
    lamp.group = 2;
    lamp.visible = Visibility::ALL;
    let volume = VolumeParams {
        closures: vec![VolumeClosure {
            scattering: Operand::number(0.2),
            ..Default::default()
        }],
        program: Vec::new(),
    };
    let world = WorldParams {
        volume,
        ..Default::default()
    };
    let scene = mesh.scene(SceneParams {
        materials: vec![matte(0.5)],
        lights: vec![lamp],
        world,
        ..Default::default()
    });
    let settings = Settings {
        passes: vec![Pass::Combined, Pass::Group(0), Pass::Group(1)],
        volume_bounces: 4,
        ..square(12, 4, 4)
    };
    let job = Job::start(scene, &from_above(5.0), settings, 1).unwrap();
    assert!(job.wait(Duration::from_secs(600)));
    let (other, group) = (read(&job, Pass::Group(0)), read(&job, Pass::Group(1)));
    assert!(other.iter().all(|&v| v == 0.0));
    let combined = read(&job, Pass::Combined);
    for (pixel, lamp) in combined.chunks_exact(4).zip(group.chunks_exact(3)) {
        for (c, l) in pixel.iter().zip(lamp) {
            assert!(*c > 0.0 && (c - l).abs() < 1e-6 + 1e-5 * c, "{l} of {c}");
        }
    }
}

#[test]
fn light_from_a_mirror_is_glossy() {
    let mut mesh = Mesh::default();
    mesh.floor(4.0, 0.0, 0);
    mesh.floor(9.0, 9.0, 1);
    // The ceiling also gets light of a matte floor around the mirror.
    mesh.floor(9.0, -0.5, 1);
    let mirror = MaterialParams {
        metallic: 1.0,
        roughness: 0.0,
        ..Default::default()
    };
    let lamp = light(LightKind::Point { radius: 0.5 }, at(-2.0, -2.0, 6.0), 90.0);
    let scene = mesh.scene(SceneParams {
        materials: vec![mirror, matte(0.5)],
        lights: vec![lamp],
        ..Default::default()
    });
    let settings = Settings {
        passes: Pass::all().collect(),
        ..square(12, 4, 4)
    };
    let job = Job::start(scene, &from_above(3.0), settings, 1).unwrap();
    assert!(job.wait(Duration::from_secs(600)));
    let light = |pass| read(&job, Pass::Light(pass));
    // The light of the matte ceiling is glossy light of the floor, whatever lobe scattered it at the ceiling.
    let [direct, indirect, color] = [LightPass::Direct, LightPass::Indirect, LightPass::Color]
        .map(|part| light(part(LobeKind::Glossy)));
    let combined = read(&job, Pass::Combined);
    for (i, pixel) in combined.chunks_exact(4).enumerate() {
        for k in 0..3 {
            let glossy = (direct[3 * i + k] + indirect[3 * i + k]) * color[3 * i + k];
            assert!(glossy > 0.0 && (pixel[k] - glossy).abs() < 1e-5 + 1e-4 * glossy);
        }
    }
}

#[test]
fn lamps_that_the_camera_sees_are_in_their_own_group() {
    let lamp = |group: u8, x: f64| {
        let mut lamp = light(LightKind::Point { radius: 0.5 }, at(x, 0.0, 2.0), 90.0);
        lamp.group = group;
        lamp.visible = Visibility::ALL;
        lamp
    };
    let mut mesh = Mesh::default();
    mesh.floor(4.0, 0.0, 0);
    let scene = mesh.scene(SceneParams {
        materials: vec![matte(0.0)],
        lights: vec![lamp(1, -1.0), lamp(2, 1.0)],
        ..Default::default()
    });
    let settings = Settings {
        passes: vec![Pass::Combined, Pass::Group(0), Pass::Group(1)],
        ..square(12, 4, 4)
    };
    let job = Job::start(scene, &from_above(5.0), settings, 1).unwrap();
    assert!(job.wait(Duration::from_secs(600)));
    let groups = [0, 1].map(|group| read(&job, Pass::Group(group)));
    let combined = read(&job, Pass::Combined);
    for (i, pixel) in combined.chunks_exact(4).enumerate() {
        for k in 0..3 {
            let sum = groups[0][3 * i + k] + groups[1][3 * i + k];
            assert!(
                (pixel[k] - sum).abs() < 1e-6 + 1e-5 * sum,
                "{sum} of {}",
                pixel[k]
            );
        }
    }
    // Each is seen, on its own side.
    for group in groups {
        assert!(group.iter().any(|&v| v > 0.0));
    }
}
