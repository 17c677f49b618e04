// SPDX-License-Identifier: GPL-3.0-or-later
//! Tests of [`super`].

use super::*;
use crate::values::image::projection::direction_to_uv;
use crate::values::math_nodes::{Blend, Math};

fn step(op: Op, args: &[Operand]) -> Step {
    Step {
        op,
        args: args.to_vec(),
    }
}

#[test]
fn constants_are_folded_and_unused_steps_removed() {
    let steps = [
        step(
            Op::Math(Math::Add, false),
            &[
                Operand::number(1.0),
                Operand::number(2.0),
                Operand::number(0.0),
            ],
        ),
        step(Op::Attribute(0, Shift::None), &[]),
        step(Op::Coordinate(Coordinate::Position, Shift::None), &[]),
        step(
            Op::Mix(Blend::Multiply, true, false),
            &[
                Operand::number(1.0),
                Operand::Register(1),
                Operand::Register(0),
            ],
        ),
    ];
    let mut roots = [Operand::Register(0), Operand::Register(3)];
    let program = Program::compile(&steps, &mut roots, "test").unwrap();
    assert_eq!(roots, [Operand::number(3.0), Operand::Register(1)]);
    assert_eq!(program.steps.len(), 2);
    assert!(matches!(program.steps[0].op, Op::Attribute(0, _)));
}

#[test]
fn invalid_steps_are_named() {
    let later = [step(Op::Alpha, &[Operand::Register(1)])];
    let error = Program::compile(&later, &mut [], "materials[2]").unwrap_err();
    assert!(error.to_string().contains("materials[2]['program'][0]"));
    let short = [step(Op::Gamma, &[Operand::number(1.0)])];
    assert!(Program::compile(&short, &mut [], "x").is_err());
    assert!(Program::compile(&[], &mut [Operand::Register(0)], "x").is_err());
}

#[test]
fn numbers_that_are_not_finite_become_zero() {
    let steps = [step(
        Op::Math(Math::Multiply, false),
        &[
            Operand::number(f32::MAX),
            Operand::number(f32::MAX),
            Operand::number(f32::NAN),
        ],
    )];
    let mut roots = [Operand::Register(0)];
    Program::compile(&steps, &mut roots, "x").unwrap();
    assert_eq!(roots[0].constant(), Some(Vec3::ZERO));
}

#[test]
fn equirectangular_coordinates_are_those_of_blender() {
    for (d, want) in [
        (vec3(1.0, 0.0, 0.0), [0.5, 0.5]),
        (vec3(0.0, -1.0, 0.0), [0.75, 0.5]),
        (vec3(0.0, 0.0, 1.0), [0.5, 1.0]),
    ] {
        let [u, v] = direction_to_uv(d);
        assert!((u - want[0]).abs() < 1e-6 && (v - want[1]).abs() < 1e-6);
    }
}
