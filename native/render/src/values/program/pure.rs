// SPDX-License-Identifier: GPL-3.0-or-later
//! Operations whose result depends on their arguments only.

use crate::math::vector::{Vec3, vec3};
use crate::values::math_nodes::{from_hsl, from_hsv, to_hsl, to_hsv};
use crate::values::program::textures::texture;
use crate::values::program::{ColorModel, Ease, Gradient, Op, Value, number, rgb, vector};
use crate::values::spectrum;

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
        Op::Curves(table, extend) => vector(curves(table, *extend, v(0), x(1))),
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
        | Op::Gabor(..)
        | Op::Wave(..)
        | Op::Magic(_)
        | Op::RadialTiling(..)
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
        Op::MapRange(..)
        | Op::MapRangeVector(..)
        | Op::Convert(..)
        | Op::Blackbody
        | Op::Wavelength
        | Op::Ies(_)
        | Op::RotateAxis
        | Op::RotateEuler(_) => mapped(op, arg),
        Op::Clamp => number(x(0).max(x(1)).min(x(2))),
        // All other operations depend on the point and are handled by `Program::run`.
        _ => [0.0; 4],
    }
}

/// Evaluates an operation that maps ranges, converts colours or rotates vectors; black for any other.
fn mapped(op: &Op, arg: impl Fn(usize) -> Value) -> Value {
    let x = |k: usize| arg(k)[0];
    let v = |k: usize| rgb(arg(k));
    match op {
        Op::MapRange(ease, clamp) => {
            // An empty range maps to 0, except with vectors.
            if x(1) == x(2) {
                return number(0.0);
            }
            let ranges = [x(1), x(2), x(3), x(4)];
            number(map_range(*ease, *clamp, x(0), ranges, x(5)))
        }
        Op::MapRangeVector(ease, clamp) => {
            let [a, b, c] = [0, 1, 2].map(|k| {
                let ranges = [1, 2, 3, 4].map(|i| arg(i)[k]);
                map_range(*ease, *clamp, arg(0)[k], ranges, arg(5)[k])
            });
            [a, b, c, 1.0]
        }
        Op::Convert(model, to) => {
            let c = v(0);
            vector(match (model, to) {
                (ColorModel::Hsv, true) => to_hsv(c).into(),
                (ColorModel::Hsl, true) => to_hsl(c).into(),
                (ColorModel::Hsv, false) => from_hsv(c.array()),
                (ColorModel::Hsl, false) => from_hsl(c.array()),
            })
        }
        Op::Blackbody => vector(spectrum::blackbody(x(0))),
        Op::Wavelength => vector(spectrum::wavelength(x(0))),
        Op::Ies(table) => number(table.at(v(0))),
        Op::RotateAxis => vector(v(1) + around(v(0) - v(1), v(2), x(3))),
        Op::RotateEuler(invert) => vector(v(1) + euler(v(0) - v(1), v(2), *invert)),
        _ => [0.0; 4],
    }
}

/// Clamps a number to 0..1.
#[inline(always)]
pub(super) fn clamp_unit(x: f32) -> f32 {
    x.clamp(0.0, 1.0)
}

/// Transforms a point by an affine map.
#[inline(always)]
pub(super) fn transform(rows: &[[f32; 4]; 3], p: Vec3) -> Value {
    let [a, b, c] = rows.map(|r| r[0] * p.x + r[1] * p.y + r[2] * p.z + r[3]);
    [a, b, c, 1.0]
}

/// Maps each channel through its curve and blends with the original by `t`.
#[inline(always)]
fn curves(table: &[Value], extend: bool, c: Vec3, t: f32) -> Vec3 {
    let at = |x: f32, k: usize| lookup(table, x, true)[k] + beyond(table, x, k, extend);
    let mapped = vec3(at(c.x, 0), at(c.y, 1), at(c.z, 2));
    c * (1.0 - t) + mapped * t
}

/// Returns what a table's last segment adds beyond the end of its range; 0 within, or if it does not `extend`.
#[inline(always)]
fn beyond(table: &[Value], x: f32, k: usize, extend: bool) -> f32 {
    let n = table.len();
    if !extend || n < 2 || (0.0..=1.0).contains(&x) {
        return 0.0;
    }
    let (end, inner, past) = if x < 0.0 {
        (table[0][k], table[1][k], -x)
    } else {
        (table[n - 1][k], table[n - 2][k], x - 1.0)
    };
    (end - inner) * past * (n - 1) as f32
}

/// Rotates a vector around an axis of any length, by an angle in radians (Rodrigues' formula).
fn around(p: Vec3, axis: Vec3, angle: f32) -> Vec3 {
    let k = axis.normalized_or(Vec3::ZERO);
    if k == Vec3::ZERO {
        return p;
    }
    let (sin, cos) = angle.sin_cos();
    p * cos + k.cross(p) * sin + k * (k.dot(p) * (1.0 - cos))
}

/// Rotates a vector around X, then Y, then Z by these angles in radians, or back.
fn euler(p: Vec3, angles: Vec3, invert: bool) -> Vec3 {
    let [x, y, z] = [
        vec3(1.0, 0.0, 0.0),
        vec3(0.0, 1.0, 0.0),
        vec3(0.0, 0.0, 1.0),
    ];
    if invert {
        around(around(around(p, z, -angles.z), y, -angles.y), x, -angles.x)
    } else {
        around(around(around(p, x, angles.x), y, angles.y), z, angles.z)
    }
}

/// Whether a position lies in a cell of the checker's first colour.
#[inline(always)]
pub(super) fn on_first_square(p: Vec3) -> bool {
    // Shift and scale slightly, so that positions on cell boundaries do not flicker.
    // Subtract the even number below: the remainder by 2, which no vector instruction computes.
    let cell = p.map(|c| {
        let cell = ((c + 1e-6) * 0.999_999).floor().abs();
        cell - 2.0 * (0.5 * cell).floor()
    });
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
fn map_range(ease: Ease, clamp: bool, x: f32, ranges: [f32; 4], steps: f32) -> f32 {
    let [from, from_end, to, to_end] = ranges;
    // Position in the first interval, 0 if that is empty, eased, then mapped to the second.
    let t = if from == from_end {
        0.0
    } else {
        (x - from) / (from_end - from)
    };
    let t = match ease {
        Ease::Linear => t,
        Ease::Stepped if steps > 0.0 => (t * (steps + 1.0)).floor() / steps,
        Ease::Stepped => 0.0,
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
