// SPDX-License-Identifier: GPL-3.0-or-later
//! Tests of [`super`].

use super::*;
use crate::math::vector::vec3;
use crate::values::program::{Coordinate, Ease, Shift, Spread};
use crate::values::shading_point::tests::point;
use crate::values::texture::fractal::NoiseKind;
use crate::values::varying::Varying;
use halfspace_base::simd::levels;
use proptest::prelude::*;

fn number() -> impl Strategy<Value = f32> {
    prop_oneof![
        6 => -4.0_f32..4.0,
        1 => Just(0.0),
        1 => Just(1.0),
        1 => prop::sample::select(vec![-0.0, 0.5, 11.5, 15.0, 3e5, -2e38, 1e-42]),
    ]
}

fn value() -> impl Strategy<Value = Value> {
    prop_oneof![
        [number(), number(), number(), number()],
        number().prop_map(|x| [x, x, x, 1.0]),
    ]
}

fn named<T: Copy + std::fmt::Debug + 'static>(
    all: &'static [(&'static str, T)],
) -> impl Strategy<Value = T> {
    prop::sample::select(all).prop_map(|(_, one)| one)
}

fn spread() -> impl Strategy<Value = Spread> {
    (1_u8..5, any::<bool>()).prop_map(|(dimensions, color)| Spread { dimensions, color })
}

/// Operations with and without a form for lanes.
fn op() -> impl Strategy<Value = Op> {
    let noise = (spread(), named(NoiseKind::NAMED), any::<bool>());
    let noise = noise.prop_map(|(spread, kind, normalize)| {
        Op::Noise(Noise {
            spread,
            kind,
            normalize,
        })
    });
    let flags = || (any::<bool>(), any::<bool>());
    prop_oneof![
        4 => noise,
        3 => (named(Math::NAMED), any::<bool>()).prop_map(|(math, clamp)| Op::Math(math, clamp)),
        3 => named(VectorMath::NAMED).prop_map(Op::VectorMath),
        3 => (named(Blend::NAMED), flags()).prop_map(|(blend, (a, b))| Op::Mix(blend, a, b)),
        1 => Just(Op::Alpha),
        1 => (0_u8..6).prop_map(Op::Channel),
        1 => Just(Op::Combine),
        1 => [[number(), number(), number(), number()], [number(), number(), number(), number()],
            [number(), number(), number(), number()]].prop_map(Op::Matrix),
        1 => any::<bool>().prop_map(Op::Checker),
        1 => spread().prop_map(Op::WhiteNoise),
        1 => any::<bool>().prop_map(|clamp| Op::MapRange(Ease::Smooth, clamp)),
        1 => prop::sample::select(vec![Op::Luminance, Op::Clamp, Op::BrightContrast, Op::HueSaturation, Op::Gamma]),
        1 => Just(Op::LayerFacing),
    ]
}

/// A program whose first two steps vary over the points. Arguments are constants or earlier steps.
fn program() -> impl Strategy<Value = Program> {
    let argument = || prop_oneof![2 => any::<u16>().prop_map(Ok), 1 => value().prop_map(Err)];
    let step = (op(), prop::collection::vec(argument(), 10));
    prop::collection::vec(step, 1..8).prop_map(|steps| {
        let coordinate = |which| Step {
            op: Op::Coordinate(which, Shift::None),
            args: vec![],
        };
        let mut all = vec![
            coordinate(Coordinate::Position),
            coordinate(Coordinate::Normal),
        ];
        for (op, args) in steps {
            let count = all.len() as u16;
            let args = args.into_iter().take(op.arity()).map(|arg| match arg {
                Ok(step) => Operand::Register(step % count),
                Err(value) => Operand::Value(value),
            });
            let args = args.collect();
            all.push(Step { op, args });
        }
        Program { steps: all }
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3_000))]
    #[test]
    fn eight_points_get_the_values_of_each(
        program in program(),
        positions in [(); LANES].map(|()| [number(), number(), number()]),
    ) {
        let varying = Varying::default();
        let points = positions.map(|position| ShadingPoint {
            position: position.into(),
            normal: vec3(0.6, 0.0, 0.8),
            ..point(&varying)
        });
        for (name, level) in levels() {
            let (mut wide, mut single) = (vec![], vec![]);
            program.run_wide(level, &[], &points, &mut wide);
            for (lane, point) in points.iter().enumerate() {
                program.run(&[], point, &mut single);
                prop_assert_eq!(wide.len(), single.len());
                for (k, (wide, single)) in wide.iter().zip(&single).enumerate() {
                    let wide = wide.map(|lanes| lanes[lane].to_bits());
                    prop_assert_eq!(wide, single.map(f32::to_bits), "{}: {:?}", name, &program.steps[k]);
                }
            }
        }
    }
}

/// Whether a program of one operation has a form for lanes.
fn has_form(op: &Op) -> bool {
    let arg = |_: usize| [[0.3; LANES]; 4];
    dispatch!(Level::new(), simd => in_lanes(simd, op, arg).is_some())
}

#[test]
fn noise_and_arithmetic_have_a_form_for_lanes() {
    let noise = |kind| {
        Op::Noise(Noise {
            spread: Spread {
                dimensions: 3,
                color: true,
            },
            kind,
            normalize: true,
        })
    };
    assert!(has_form(&noise(NoiseKind::Sum)));
    assert!(has_form(&Op::Math(Math::MultiplyAdd, true)));
    assert!(has_form(&Op::Mix(Blend::Mix, true, false)));
    assert!(!has_form(&noise(NoiseKind::Ridged)));
    // Lanes pay where the number of octaves is constant.
    let program = |kind, octaves| {
        let mut args = vec![Operand::Register(0); 9];
        args[3] = octaves;
        let step = Step {
            op: noise(kind),
            args,
        };
        Program { steps: vec![step] }
    };
    let (constant, varying) = (Operand::number(2.0), Operand::Register(0));
    assert!(program(NoiseKind::Sum, constant).gains_in_lanes());
    assert!(!program(NoiseKind::Sum, varying).gains_in_lanes());
    assert!(!program(NoiseKind::Ridged, constant).gains_in_lanes());
    assert!(!has_form(&Op::Math(Math::Sine, false)));
}
