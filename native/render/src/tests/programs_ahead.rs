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

/// A material of this kind whose colour is noise of the position and of the ray's length, and which is transparent by
/// the angle of the view.
fn clouded(kind: ClosureKind, scale: f32) -> MaterialParams {
    let noise = Noise {
        spread: Spread {
            dimensions: 4,
            color: true,
        },
        kind: NoiseKind::Sum,
        normalize: true,
    };
    let coordinate = |which| Step {
        op: Op::Coordinate(which, Shift::None),
        args: vec![],
    };
    let facing = Step {
        op: Op::LayerFacing,
        args: vec![Operand::number(0.4)],
    };
    let mut args = vec![Operand::Register(0), Operand::Register(1)];
    args.extend([scale, 2.5, 0.5, 2.0, 0.0, 0.0, 0.3].map(Operand::number));
    // The step 3 is the noise.
    let closure = |kind, weight, color| {
        let mut closure = ClosureParams::new(kind);
        closure.inputs[Input::Weight as usize] = Operand::number(weight);
        closure.inputs[Input::Color as usize] = Operand::Register(color);
        closure
    };
    MaterialParams {
        closures: vec![
            closure(kind, 0.7, 3),
            closure(ClosureKind::Transparent, 0.3, 2),
        ],
        program: vec![
            coordinate(Coordinate::Position),
            coordinate(Coordinate::RayLength),
            facing,
            Step {
                op: Op::Noise(noise),
                args,
            },
        ],
        ..Default::default()
    }
}

/// Compares the picture of a sphere on a floor with its pixels, rendered one by one: a wavefront of one path has too few
/// hits for lanes.
fn compare(floor: MaterialParams, sphere: MaterialParams) {
    let mut mesh = Mesh::default();
    let mut normals = mesh.sphere(2, 1);
    mesh.floor(3.0, -1.0, 0);
    normals.extend([[[0.0, 0.0, 1.0]; 3]; 2]);
    let lamp = light(LightKind::Point { radius: 0.1 }, at(1.0, -2.0, 3.0), 200.0);
    let params = SceneParams {
        materials: vec![floor, sphere],
        corner_normals: Some(normals),
        lights: vec![lamp],
        world: [0.1, 0.2, 0.3].into(),
        ..Default::default()
    };
    let scene = mesh.scene(params);
    assert!(scene.features().programs_ahead);
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

#[test]
fn a_picture_is_that_of_its_pixels_one_by_one() {
    let diffuse = |scale| clouded(ClosureKind::Diffuse, scale);
    compare(diffuse(3.0), diffuse(7.0));
}

#[test]
fn a_picture_with_walks_and_catchers_is_that_of_its_pixels() {
    let catcher = MaterialParams {
        catcher: true,
        ..clouded(ClosureKind::Diffuse, 3.0)
    };
    compare(catcher, clouded(ClosureKind::Subsurface, 7.0));
}
