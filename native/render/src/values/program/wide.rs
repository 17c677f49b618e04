// SPDX-License-Identifier: GPL-3.0-or-later
//! Programs at eight points at once: each step is selected once for all of them, and most are computed in the lanes of
//! registers. Every result is the same to the bit as at a single point, because each lane takes the same operations in
//! the same order.

use fearless_simd::{Level, Simd, SimdBase, dispatch, f32x8};

use crate::math::vector::vec3;
use crate::values::image::Image;
use crate::values::math_nodes::{Blend, Math, VectorMath};
use crate::values::program::pure::{clamp_unit, on_first_square, transform};
use crate::values::program::textures::fractal_of;
use crate::values::program::{Noise, Op, Operand, Program, Step, Value, finite_or_zero};
use crate::values::shading_point::ShadingPoint;
use crate::values::texture::fractal::NoiseKind;
use crate::values::texture::fractal_lanes::FractalLanes;

/// Number of points that are evaluated together.
pub const LANES: usize = 8;

/// One number of each point.
type Lanes = [f32; LANES];

/// The values of a step at all points, by component.
pub type Wide = [Lanes; 4];

impl Program {
    /// Whether lanes save more time than collecting their points takes.
    pub fn gains_in_lanes(&self) -> bool {
        // The number of octaves must be the same at all points.
        self.steps.iter().any(|step| {
            matches!(&step.op, Op::Noise(noise) if noise.kind == NoiseKind::Sum)
                && step.args[3].constant().is_some()
        })
    }

    /// Evaluates all steps at eight points and writes their results to `registers`.
    pub fn run_wide(
        &self,
        level: Level,
        images: &[Image],
        points: &[ShadingPoint<'_>; LANES],
        registers: &mut Vec<Wide>,
    ) {
        dispatch!(level, simd => simd.vectorize(
            #[inline(always)]
            || self.run_in(simd, images, points, registers),
        ));
    }

    /// [`Self::run_wide`] in the instruction set of the caller.
    #[inline(always)]
    fn run_in<S: Simd>(
        &self,
        simd: S,
        images: &[Image],
        points: &[ShadingPoint<'_>; LANES],
        registers: &mut Vec<Wide>,
    ) {
        registers.clear();
        // Steps without a form for lanes are evaluated point by point.
        for step in &self.steps {
            let arg = |k: usize| read_all(step.args[k], registers);
            let wide = in_lanes(simd, &step.op, arg)
                .unwrap_or_else(|| one_by_one(step, images, points, registers));
            registers.push(wide.map(|lanes| lanes.map(finite_or_zero)));
        }
    }
}

/// Returns the values of an operand.
#[inline(always)]
fn read_all(operand: Operand, registers: &[Wide]) -> Wide {
    match operand {
        Operand::Value(v) => v.map(|x| [x; LANES]),
        Operand::Register(r) => registers[usize::from(r)],
    }
}

/// Returns the value of an operand at one point after [`Program::run_wide`].
pub fn read_one(operand: Operand, registers: &[Wide], lane: usize) -> Value {
    match operand {
        Operand::Value(v) => v,
        Operand::Register(r) => registers[usize::from(r)].map(|lanes| lanes[lane]),
    }
}

/// Evaluates a step point by point.
#[inline(never)]
fn one_by_one(
    step: &Step,
    images: &[Image],
    points: &[ShadingPoint<'_>; LANES],
    registers: &[Wide],
) -> Wide {
    let mut wide = [[0.0; LANES]; 4];
    for (lane, point) in points.iter().enumerate() {
        let arg = |k: usize| read_one(step.args[k], registers, lane);
        let value = step.evaluate(images, point, arg);
        for (lanes, x) in wide.iter_mut().zip(value) {
            lanes[lane] = x;
        }
    }
    wide
}

/// Numbers as values.
#[inline(always)]
fn wide_number(x: Lanes) -> Wide {
    [x, x, x, [1.0; LANES]]
}

/// The values that a function returns for each lane.
#[inline(always)]
fn each(f: impl Fn(usize) -> [f32; 3]) -> Wide {
    let all: [[f32; 3]; LANES] = std::array::from_fn(f);
    let component = |k: usize| all.map(|one| one[k]);
    [component(0), component(1), component(2), [1.0; LANES]]
}

/// Evaluates an operation in lanes; `None` if it has no form for them. Operations with minima or maxima have none,
/// since which of two zeros these return may differ between instructions; a clamp consists of comparisons.
#[inline(always)]
fn in_lanes<S: Simd>(simd: S, op: &Op, arg: impl Fn(usize) -> Wide) -> Option<Wide> {
    let vector = |wide: &Wide, lane: usize| vec3(wide[0][lane], wide[1][lane], wide[2][lane]);
    // Select the operation before the loop over the lanes, so that the compiler computes them together.
    macro_rules! select {
        ($chosen:expr, $kind:ident: $($name:ident)*; $lane:expr) => {
            match $chosen {
                $($kind::$name => {
                    #[allow(clippy::redundant_closure_call, reason = "the operation is a constant in each arm")]
                    Some(($lane)($kind::$name))
                })*
                _ => None,
            }
        };
    }
    match op {
        Op::Alpha => Some(wide_number(arg(0)[3])),
        Op::Channel(c) => Some(wide_number(arg(0)[usize::from(*c).min(3)])),
        Op::Combine => Some([arg(0)[0], arg(1)[0], arg(2)[0], [1.0; LANES]]),
        Op::Math(math, clamp) => {
            let [a, b, c] = [0, 1, 2].map(|k| arg(k)[0]);
            let found = select!(math, Math: Add Subtract Multiply Divide MultiplyAdd LessThan GreaterThan Absolute Floor
                Fract; |math: Math| -> Lanes { std::array::from_fn(|i| math.eval(a[i], b[i], c[i])) });
            found.map(|x| wide_number(if *clamp { x.map(clamp_unit) } else { x }))
        }
        Op::VectorMath(math) => {
            let [a, b, c] = [0, 1, 2].map(&arg);
            select!(math, VectorMath: Add Subtract Multiply MultiplyAdd Scale Dot; |math: VectorMath| {
                each(|i| math.eval(vector(&a, i), vector(&b, i), vector(&c, i)).array())
            })
        }
        Op::Mix(blend, clamp_factor, clamp_result) => {
            let [t, a, b] = [0, 1, 2].map(&arg);
            let t = if *clamp_factor {
                t[0].map(clamp_unit)
            } else {
                t[0]
            };
            let found = select!(blend, Blend: Mix Multiply Add Subtract LinearLight; |blend: Blend| {
                each(|i| blend.eval(t[i], vector(&a, i), vector(&b, i)).array())
            });
            let [x, y, z, w] = found?;
            let clamped = |x: Lanes| if *clamp_result { x.map(clamp_unit) } else { x };
            Some([clamped(x), clamped(y), clamped(z), w])
        }
        Op::Matrix(rows) => {
            let p = arg(0);
            Some(each(|i| {
                let [x, y, z, _] = transform(rows, vector(&p, i));
                [x, y, z]
            }))
        }
        Op::Checker(as_number) => {
            let (p, scale) = (arg(0), arg(3)[0]);
            let first: [bool; LANES] =
                std::array::from_fn(|i| on_first_square(vector(&p, i) * scale[i]));
            if *as_number {
                return Some(wide_number(first.map(|first| f32::from(u8::from(first)))));
            }
            let (a, b) = (arg(1), arg(2));
            let pick = |k: usize| std::array::from_fn(|i| if first[i] { a[k][i] } else { b[k][i] });
            Some([0, 1, 2, 3].map(pick))
        }
        Op::Noise(settings) => noise(simd, settings, arg),
        _ => None,
    }
}

/// The Noise Texture; `None` if its noise has no form for lanes.
#[inline(always)]
fn noise<S: Simd>(simd: S, settings: &Noise, arg: impl Fn(usize) -> Wide) -> Option<Wide> {
    let inputs: [Lanes; 9] = std::array::from_fn(|k| arg(k)[0]);
    let parameters = std::array::from_fn(|lane| fractal_of(settings, |k| inputs[k][lane]));
    let fractal = FractalLanes::new(simd, &parameters)?;
    // Scale position and fourth coordinate.
    let position = arg(0);
    let scale = f32x8::from_slice(simd, &inputs[2]);
    let x = f32x8::from_slice(simd, &position[0]) * scale;
    let y = f32x8::from_slice(simd, &position[1]) * scale;
    let z = f32x8::from_slice(simd, &position[2]) * scale;
    let w = f32x8::from_slice(simd, &inputs[1]) * scale;
    let color = settings.spread.color;
    let [r, g, b] = match settings.spread.dimensions {
        1 => fractal.at(simd, [w], color),
        2 => fractal.at(simd, [x, y], color),
        3 => fractal.at(simd, [x, y, z], color),
        _ => fractal.at(simd, [x, y, z, w], color),
    };
    let mut wide = wide_number([1.0; LANES]);
    r.store_slice(&mut wide[0]);
    g.store_slice(&mut wide[1]);
    b.store_slice(&mut wide[2]);
    Some(wide)
}

#[cfg(test)]
mod tests;
