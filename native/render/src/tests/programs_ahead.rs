// SPDX-License-Identifier: GPL-3.0-or-later
//! Programs that run ahead of shading, for several hits at once, change no picture.

use crate::light::LightKind;
use crate::material::MaterialParams;
use crate::material::closure::{ClosureKind, ClosureParams, Input};
use crate::scene::SceneParams;
use crate::settings::Settings;
use crate::tests::setup::{Mesh, at, light, mean, overview, run};
use crate::values::program::{Coordinate, Noise, Op, Operand, Shift, Spread, Step};
use crate::values::texture::fractal::NoiseKind;

/// A diffuse material whose colour is noise of the position.
fn clouded(scale: f32) -> MaterialParams {
    let noise = Noise {
        spread: Spread {
            dimensions: 3,
            color: true,
        },
        kind: NoiseKind::Sum,
        normalize: true,
    };
    let numbers = [0.0, scale, 2.5, 0.5, 2.0, 0.0, 0.0, 0.3].map(Operand::number);
    let mut args = vec![Operand::Register(0)];
    args.extend(numbers);
    let mut closure = ClosureParams::new(ClosureKind::Diffuse);
    closure.inputs[Input::Color as usize] = Operand::Register(1);
    MaterialParams {
        closures: vec![closure],
        program: vec![
            Step {
                op: Op::Coordinate(Coordinate::Position, Shift::None),
                args: vec![],
            },
            Step {
                op: Op::Noise(noise),
                args,
            },
        ],
        ..Default::default()
    }
}

#[test]
fn a_picture_is_that_of_its_pixels_one_by_one() {
    let mut mesh = Mesh::default();
    mesh.floor(3.0, -1.0, 0);
    mesh.sphere(2, 1);
    let lamp = light(LightKind::Point { radius: 0.1 }, at(1.0, -2.0, 3.0), 200.0);
    let params = SceneParams {
        materials: vec![clouded(3.0), clouded(7.0)],
        lights: vec![lamp],
        world: [0.1, 0.2, 0.3].into(),
        ..Default::default()
    };
    let scene = mesh.scene(params);
    assert!(scene.materials.iter().all(|material| material.runs_ahead));
    let base = Settings {
        width: 23,
        height: 17,
        samples: 3,
        max_bounces: 3,
        ..Default::default()
    };
    let (whole, result) = run(&scene, &overview(), base.clone(), 2);
    assert!(mean(&whole) > 0.05, "the picture is not black");
    assert!(result.work.shaded_textures > 0);
    // A wavefront of one path has too few hits for lanes.
    for pixel in (0..23 * 17).step_by(7) {
        let (x, y) = (pixel % 23, pixel / 23);
        let alone = Settings {
            border: Some([x, y, x + 1, y + 1]),
            step_samples: Some(1),
            ..base.clone()
        };
        let (part, _) = run(&scene, &overview(), alone, 1);
        let place = pixel as usize * 4;
        assert_eq!(part, whole[place..place + 4], "pixel {x}, {y}");
    }
}
