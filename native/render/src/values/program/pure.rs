// SPDX-License-Identifier: GPL-3.0-or-later
//! Operations whose result depends on their arguments only.

use crate::math::vector::{Vec3, vec3};
use crate::values::math_nodes::{from_hsv, to_hsv};
use crate::values::program::textures::texture;
use crate::values::program::{Ease, Gradient, Op, Value, number, rgb, vector};

/// Evaluates a pure operation. `arg`: returns an argument.
pub fn pure(op: &Op, arg: impl Fn(usize) -> Value) -> Value {
    let x = |k: usize| arg(k)[0];
    let v = |k: usize| rgb(arg(k));
    match op {
        Op::Alpha => number(arg(0)[3]),
        Op::Channel(c) => number(arg(0)[usize::from(*c).min(3)]),
        Op::Combine => [x(0), x(1), x(2), 1.0],
        // Weights of Rec. 709.
        Op::Luminance => {
            let c = v(0);
            number(0.212_639 * c.x + 0.715_169 * c.y + 0.072_192 * c.z)
        }
        Op::Mean => number(v(0).mean()),
        Op::Math(math, clamp) => {
            let value = math.eval(x(0), x(1), x(2));
            number(if *clamp { clamp_unit(value) } else { value })
        }
        Op::VectorMath(math) => vector(math.eval(v(0), v(1), v(2))),
        Op::Mix(blend, clamp_factor, clamp_result) => {
            let t = x(0);
            let t = if *clamp_factor { clamp_unit(t) } else { t };
            let out = blend.eval(t, v(1), v(2));
            vector(if *clamp_result {
                out.map(clamp_unit)
            } else {
                out
            })
        }
        Op::Matrix(rows) => transform(rows, v(0)),
        Op::Unit => vector(v(0).normalized_or(Vec3::ZERO)),
        Op::Ramp(table, smooth) => lookup(table, x(0), *smooth),
        Op::Curves(table) => vector(curves(table, v(0), x(1))),
        Op::Checker(as_number) => {
            // Either the factor or one of the two colours.
            let first = on_first_square(v(0) * x(3));
            if *as_number {
                number(f32::from(u8::from(first)))
            } else {
                arg(if first { 1 } else { 2 })
            }
        }
        Op::Noise(_)
        | Op::WhiteNoise(_)
        | Op::Voronoi(_)
        | Op::Wave(..)
        | Op::Magic(_)
        | Op::Brick(..) => texture(op, arg),
        Op::Gradient(kind) => number(gradient(*kind, v(0)).clamp(0.0, 1.0)),
        Op::Invert => {
            let (t, c) = (x(0), v(1));
            vector(c * (1.0 - t) + (Vec3::ONE - c) * t)
        }
        Op::Gamma => {
            let g = x(1);
            vector(v(0).map(|c| if c > 0.0 { c.powf(g) } else { c }))
        }
        Op::BrightContrast => {
            let (b, c) = (x(1), x(2));
            vector(v(0).map(|x| ((1.0 + c) * x + b - 0.5 * c).max(0.0)))
        }
        Op::HueSaturation => vector(hue_saturation(v(0), [x(1), x(2), x(3)], x(4))),
        Op::MapRange(ease, clamp) => {
            let ranges = [x(1), x(2), x(3), x(4)];
            number(map_range(*ease, *clamp, x(0), ranges))
        }
        Op::Clamp => number(x(0).max(x(1)).min(x(2))),
        // All other operations depend on the point and are handled by `Program::run`.
        _ => [0.0; 4],
    }
}

/// Clamps a number to 0..1.
#[inline(always)]
fn clamp_unit(x: f32) -> f32 {
    x.clamp(0.0, 1.0)
}

/// Transforms a point by an affine map.
#[inline(always)]
fn transform(rows: &[[f32; 4]; 3], p: Vec3) -> Value {
    let [a, b, c] = rows.map(|r| r[0] * p.x + r[1] * p.y + r[2] * p.z + r[3]);
    [a, b, c, 1.0]
}

/// Maps each channel through its curve and blends with the original by `t`.
#[inline(always)]
fn curves(table: &[Value], c: Vec3, t: f32) -> Vec3 {
    let r = lookup(table, c.x, true)[0];
    let g = lookup(table, c.y, true)[1];
    let b = lookup(table, c.z, true)[2];
    c * (1.0 - t) + vec3(r, g, b) * t
}

/// Whether a position lies in a cell of the checker's first colour.
#[inline(always)]
fn on_first_square(p: Vec3) -> bool {
    // Shift and scale slightly, so that positions on cell boundaries do not flicker.
    let cell = p.map(|c| ((c + 1e-6) * 0.999_999).floor().abs() % 2.0);
    (cell.x == cell.y) == (cell.z == 1.0)
}

/// Shifts the hue, scales saturation and value, and blends with the original by `t`.
#[inline(always)]
fn hue_saturation(c: Vec3, [hue, saturation, value]: [f32; 3], t: f32) -> Vec3 {
    // The hue input is centred at 0.5, as in Blender.
    let [h, s, v] = to_hsv(c);
    let hsv = [h + hue + 0.5, (s * saturation).clamp(0.0, 1.0), v * value];
    (c * (1.0 - t) + from_hsv(hsv) * t).map(|c| c.max(0.0))
}

/// Maps `x` from one interval to another, optionally clamped to the second. `ranges`: ends of the first, then of
/// the second.
#[inline(always)]
fn map_range(ease: Ease, clamp: bool, x: f32, ranges: [f32; 4]) -> f32 {
    let [from, from_end, to, to_end] = ranges;
    if from == from_end {
        return 0.0;
    }
    // Position in the first interval, eased, then mapped to the second.
    let t = (x - from) / (from_end - from);
    let t = match ease {
        Ease::Linear => t,
        Ease::Smooth => {
            let t = t.clamp(0.0, 1.0);
            t * t * (3.0 - 2.0 * t)
        }
        Ease::Smoother => {
            let t = t.clamp(0.0, 1.0);
            t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
        }
    };
    let value = to + t * (to_end - to);
    if clamp {
        value.max(to.min(to_end)).min(to.max(to_end))
    } else {
        value
    }
}

/// Returns a table's value at a position in 0..1, interpolated if `smooth`.
fn lookup(table: &[Value], at: f32, smooth: bool) -> Value {
    let Some(last) = table.len().checked_sub(1) else {
        return [0.0; 4];
    };
    // Linear interpolation between entries, or the entry below.
    let x = at.clamp(0.0, 1.0) * last as f32;
    let i = (x as usize).min(last);
    let f = x - i as f32;
    if !smooth || i == last {
        return table[i];
    }
    std::array::from_fn(|k| table[i][k] + f * (table[i + 1][k] - table[i][k]))
}

/// Returns the gradient texture at a position, before clamping.
fn gradient(kind: Gradient, p: Vec3) -> f32 {
    let sphere = || (0.999_999 - p.length()).max(0.0);
    match kind {
        Gradient::Linear => p.x,
        Gradient::Quadratic => p.x.max(0.0) * p.x.max(0.0),
        Gradient::Easing => {
            let r = p.x.clamp(0.0, 1.0);
            r * r * (3.0 - 2.0 * r)
        }
        Gradient::Diagonal => 0.5 * (p.x + p.y),
        Gradient::Radial => p.y.atan2(p.x) / std::f32::consts::TAU + 0.5,
        Gradient::QuadraticSphere => sphere() * sphere(),
        Gradient::Spherical => sphere(),
    }
}
