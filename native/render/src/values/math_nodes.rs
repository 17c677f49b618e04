// SPDX-License-Identifier: GPL-3.0-or-later
//! The arithmetic of Blender's Math, Vector Math and Mix nodes, with Blender's names. Operations without a value,
//! such as a division by zero or the root of a negative number, return 0.

use crate::math::vector::Vec3;

macro_rules! named {
    ($(#[$doc:meta])* $name:ident { $($variant:ident = $text:literal,)* }) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[allow(missing_docs, reason = "the names are Blender's")]
        pub enum $name { $($variant,)* }

        impl $name {
            /// All variants, each with its name in Blender.
            pub const NAMED: &'static [(&'static str, Self)] = &[$(($text, Self::$variant),)*];
        }
    };
}

pub(crate) use named;

named! {
    /// Operations of the Math node.
    Math {
        Add = "ADD", Subtract = "SUBTRACT", Multiply = "MULTIPLY", Divide = "DIVIDE",
        MultiplyAdd = "MULTIPLY_ADD", Power = "POWER", Logarithm = "LOGARITHM", Sqrt = "SQRT",
        InverseSqrt = "INVERSE_SQRT", Absolute = "ABSOLUTE", Exponent = "EXPONENT",
        Minimum = "MINIMUM", Maximum = "MAXIMUM", LessThan = "LESS_THAN",
        GreaterThan = "GREATER_THAN", Sign = "SIGN", Compare = "COMPARE",
        SmoothMin = "SMOOTH_MIN", SmoothMax = "SMOOTH_MAX", Round = "ROUND", Floor = "FLOOR",
        Ceil = "CEIL", Trunc = "TRUNC", Fract = "FRACT", Modulo = "MODULO",
        FlooredModulo = "FLOORED_MODULO", Wrap = "WRAP", Snap = "SNAP", Pingpong = "PINGPONG",
        Sine = "SINE", Cosine = "COSINE", Tangent = "TANGENT", Arcsine = "ARCSINE",
        Arccosine = "ARCCOSINE", Arctangent = "ARCTANGENT", Arctan2 = "ARCTAN2", Sinh = "SINH",
        Cosh = "COSH", Tanh = "TANH", Radians = "RADIANS", Degrees = "DEGREES",
    }
}

named! {
    /// Operations of the Vector Math node.
    VectorMath {
        Add = "ADD", Subtract = "SUBTRACT", Multiply = "MULTIPLY", Divide = "DIVIDE",
        MultiplyAdd = "MULTIPLY_ADD", Cross = "CROSS_PRODUCT", Project = "PROJECT",
        Reflect = "REFLECT", Dot = "DOT_PRODUCT", Distance = "DISTANCE", Length = "LENGTH",
        Scale = "SCALE", Normalize = "NORMALIZE", Absolute = "ABSOLUTE", Minimum = "MINIMUM",
        Maximum = "MAXIMUM", Floor = "FLOOR", Ceil = "CEIL", Fraction = "FRACTION",
        Modulo = "MODULO", Sine = "SINE", Cosine = "COSINE", Tangent = "TANGENT",
        Refract = "REFRACT", Faceforward = "FACEFORWARD", Power = "POWER", Sign = "SIGN",
        Round = "ROUND", Wrap = "WRAP", Snap = "SNAP",
    }
}

named! {
    /// Blend modes of the Mix node.
    Blend {
        Mix = "MIX", Darken = "DARKEN", Multiply = "MULTIPLY", Burn = "BURN", Lighten = "LIGHTEN",
        Screen = "SCREEN", Dodge = "DODGE", Add = "ADD", Overlay = "OVERLAY",
        SoftLight = "SOFT_LIGHT", LinearLight = "LINEAR_LIGHT", Difference = "DIFFERENCE",
        Exclusion = "EXCLUSION", Subtract = "SUBTRACT", Divide = "DIVIDE", Hue = "HUE",
        Saturation = "SATURATION", Color = "COLOR", Value = "VALUE",
    }
}

/// Division that returns 0 for a divisor of 0.
fn divide(a: f32, b: f32) -> f32 {
    if b == 0.0 { 0.0 } else { a / b }
}

/// Power that returns 0 where the result is not finite.
fn power(a: f32, b: f32) -> f32 {
    let p = a.powf(b);
    if p.is_finite() { p } else { 0.0 }
}

/// Logarithm to base `b`; 0 unless both operands are positive.
fn logarithm(a: f32, b: f32) -> f32 {
    if a > 0.0 && b > 0.0 {
        divide(a.ln(), b.ln())
    } else {
        0.0
    }
}

/// Reciprocal square root; 0 unless the operand is positive.
fn inverse_sqrt(a: f32) -> f32 {
    if a > 0.0 { 1.0 / a.sqrt() } else { 0.0 }
}

/// Sign of a number; 0 for 0.
fn sign(a: f32) -> f32 {
    if a == 0.0 { 0.0 } else { a.signum() }
}

/// Remainder with the sign of `a`; 0 for a divisor of 0.
fn modulo(a: f32, b: f32) -> f32 {
    if b == 0.0 { 0.0 } else { a % b }
}

/// Repeats the range from `low` to `high`.
fn wrap(a: f32, high: f32, low: f32) -> f32 {
    let range = high - low;
    if range == 0.0 {
        low
    } else {
        a - range * ((a - low) / range).floor()
    }
}

/// Moves back and forth between 0 and `scale`.
fn ping_pong(a: f32, scale: f32) -> f32 {
    if scale == 0.0 {
        return 0.0;
    }
    let t = (a - scale) / (scale * 2.0);
    ((t - t.floor()) * scale * 2.0 - scale).abs()
}

/// Remainder with the sign of `b`; 0 for a divisor of 0.
fn floored_modulo(a: f32, b: f32) -> f32 {
    if b == 0.0 {
        0.0
    } else {
        a - b * (a / b).floor()
    }
}

/// Minimum with a cubic transition of width `c`.
fn smooth_min(a: f32, b: f32, c: f32) -> f32 {
    if c == 0.0 {
        return a.min(b);
    }
    // The transition is active where the operands differ by less than c.
    let h = (c - (a - b).abs()).max(0.0) / c;
    a.min(b) - h * h * h * c * (1.0 / 6.0)
}

impl Math {
    /// Evaluates the operation for the node's three inputs.
    #[inline(always)]
    pub fn eval(self, a: f32, b: f32, c: f32) -> f32 {
        // Comparisons return 1 or 0.
        let truth = |x: bool| f32::from(u8::from(x));
        match self {
            Self::Add => a + b,
            Self::Subtract => a - b,
            Self::Multiply => a * b,
            Self::Divide => divide(a, b),
            Self::MultiplyAdd => a * b + c,
            Self::Power => power(a, b),
            Self::Logarithm => logarithm(a, b),
            Self::Sqrt => a.max(0.0).sqrt(),
            Self::InverseSqrt => inverse_sqrt(a),
            Self::Absolute => a.abs(),
            Self::Exponent => a.exp(),
            Self::Minimum => a.min(b),
            Self::Maximum => a.max(b),
            Self::LessThan => truth(a < b),
            Self::GreaterThan => truth(a > b),
            Self::Sign => sign(a),
            Self::Compare => truth(a == b || (a - b).abs() <= c.max(f32::EPSILON)),
            Self::SmoothMin => smooth_min(a, b, c),
            Self::SmoothMax => -smooth_min(-a, -b, c),
            Self::Round => (a + 0.5).floor(),
            Self::Floor => a.floor(),
            Self::Ceil => a.ceil(),
            Self::Trunc => a.trunc(),
            Self::Fract => a - a.floor(),
            Self::Modulo => modulo(a, b),
            Self::FlooredModulo => floored_modulo(a, b),
            Self::Wrap => wrap(a, b, c),
            Self::Snap => divide(a, b).floor() * b,
            Self::Pingpong => ping_pong(a, b),
            Self::Sine => a.sin(),
            Self::Cosine => a.cos(),
            Self::Tangent => a.tan(),
            Self::Arcsine => a.clamp(-1.0, 1.0).asin(),
            Self::Arccosine => a.clamp(-1.0, 1.0).acos(),
            Self::Arctangent => a.atan(),
            Self::Arctan2 => a.atan2(b),
            Self::Sinh => a.sinh(),
            Self::Cosh => a.cosh(),
            Self::Tanh => a.tanh(),
            Self::Radians => a.to_radians(),
            Self::Degrees => a.to_degrees(),
        }
    }
}

/// Applies a function to each pair of components.
fn zip(a: Vec3, b: Vec3, f: impl Fn(f32, f32) -> f32) -> Vec3 {
    Vec3 {
        x: f(a.x, b.x),
        y: f(a.y, b.y),
        z: f(a.z, b.z),
    }
}

/// Refracts the direction `a` at a surface with unit normal `n` and this ratio of indices; 0 if it is reflected totally.
fn refract(a: Vec3, n: Vec3, eta: f32) -> Vec3 {
    let cosine = n.dot(a);
    let k = 1.0 - eta * eta * (1.0 - cosine * cosine);
    if k < 0.0 {
        Vec3::ZERO
    } else {
        a * eta - n * (eta * cosine + k.sqrt())
    }
}

impl VectorMath {
    /// Evaluates the operation for the node's inputs; a scalar result is returned in all three components.
    #[inline(always)]
    pub fn eval(self, a: Vec3, b: Vec3, c: Vec3) -> Vec3 {
        match self {
            Self::Add => a + b,
            Self::Subtract => a - b,
            Self::Multiply => a * b,
            Self::Divide => zip(a, b, divide),
            Self::MultiplyAdd => a * b + c,
            Self::Cross => a.cross(b),
            Self::Project => b * divide(a.dot(b), b.length2()),
            Self::Reflect => {
                let n = b.normalized_or(Vec3::ZERO);
                a - n * (2.0 * a.dot(n))
            }
            Self::Dot => Vec3::splat(a.dot(b)),
            Self::Distance => Vec3::splat((a - b).length()),
            Self::Length => Vec3::splat(a.length()),
            Self::Scale => a * b.x,
            Self::Normalize => a.normalized_or(Vec3::ZERO),
            Self::Absolute => a.map(f32::abs),
            Self::Minimum => zip(a, b, f32::min),
            Self::Maximum => zip(a, b, f32::max),
            Self::Floor => a.map(f32::floor),
            Self::Ceil => a.map(f32::ceil),
            Self::Fraction => a.map(|x| x - x.floor()),
            Self::Modulo => zip(a, b, modulo),
            Self::Sine => a.map(f32::sin),
            Self::Cosine => a.map(f32::cos),
            Self::Tangent => a.map(f32::tan),
            Self::Refract => refract(a, b.normalized_or(Vec3::ZERO), c.x),
            Self::Faceforward => {
                if c.dot(b) < 0.0 {
                    a
                } else {
                    -a
                }
            }
            Self::Power => zip(a, b, power),
            Self::Sign => a.map(sign),
            Self::Round => a.map(|x| (x + 0.5).floor()),
            Self::Wrap => Vec3 {
                x: wrap(a.x, b.x, c.x),
                y: wrap(a.y, b.y, c.y),
                z: wrap(a.z, b.z, c.z),
            },
            Self::Snap => zip(a, b, |a, b| divide(a, b).floor() * b),
        }
    }
}

impl Blend {
    /// Blends `a` with `b` by the factor `t`.
    #[inline(always)]
    pub fn eval(self, t: f32, a: Vec3, b: Vec3) -> Vec3 {
        // Most modes interpolate between `a` and their result.
        let s = 1.0 - t;
        let towards = |target: Vec3| a * s + target * t;
        match self {
            Self::Mix => towards(b),
            Self::Darken => towards(zip(a, b, f32::min)),
            Self::Lighten => towards(zip(a, b, f32::max)),
            Self::Multiply => towards(a * b),
            Self::Add => a + b * t,
            Self::Subtract => a - b * t,
            Self::Screen => zip(a, b, |a, b| 1.0 - (s + t * (1.0 - b)) * (1.0 - a)),
            Self::Difference => towards(zip(a, b, |a, b| (a - b).abs())),
            Self::Exclusion => zip(a, b, |a, b| (a * s + t * (a + b - 2.0 * a * b)).max(0.0)),
            Self::Divide => zip(a, b, |a, b| if b == 0.0 { a } else { a * s + t * a / b }),
            Self::Overlay => zip(a, b, |a, b| {
                if a < 0.5 {
                    a * (s + 2.0 * t * b)
                } else {
                    1.0 - (s + 2.0 * t * (1.0 - b)) * (1.0 - a)
                }
            }),
            Self::SoftLight => zip(a, b, |a, b| {
                let screen = 1.0 - (1.0 - b) * (1.0 - a);
                a * s + t * ((1.0 - a) * b * a + a * screen)
            }),
            Self::LinearLight => a + (b * 2.0 - Vec3::ONE) * t,
            Self::Dodge => zip(a, b, |a, b| {
                if a == 0.0 {
                    return a;
                }
                let low = 1.0 - t * b;
                if low <= 0.0 { 1.0 } else { (a / low).min(1.0) }
            }),
            Self::Burn => zip(a, b, |a, b| {
                let low = s + t * b;
                if low <= 0.0 {
                    0.0
                } else {
                    (1.0 - (1.0 - a) / low).clamp(0.0, 1.0)
                }
            }),
            Self::Hue | Self::Saturation | Self::Color | Self::Value => {
                // Modes in HSV; a grey operand has no hue to give.
                let ([ha, sa, va], [hb, sb, vb]) = (to_hsv(a), to_hsv(b));
                match self {
                    Self::Hue if sb > 0.0 => towards(from_hsv([hb, sa, va])),
                    Self::Color if sb > 0.0 => towards(from_hsv([hb, sb, va])),
                    Self::Saturation if sa > 0.0 => from_hsv([ha, s * sa + t * sb, va]),
                    Self::Value => from_hsv([ha, sa, s * va + t * vb]),
                    _ => a,
                }
            }
        }
    }
}

/// Converts a colour to hue (0..1), saturation and value.
pub fn to_hsv(c: Vec3) -> [f32; 3] {
    // Value and saturation from the extreme channels, hue from the position between them.
    let (high, low) = (c.max_component(), c.x.min(c.y).min(c.z));
    let range = high - low;
    let s = if high == 0.0 { 0.0 } else { range / high };
    if range == 0.0 {
        return [0.0, s, high];
    }
    let h = if c.x == high {
        (c.y - c.z) / range
    } else if c.y == high {
        2.0 + (c.z - c.x) / range
    } else {
        4.0 + (c.x - c.y) / range
    } / 6.0;
    [h - h.floor(), s, high]
}

/// Converts hue, saturation and value to a colour.
pub fn from_hsv([h, s, v]: [f32; 3]) -> Vec3 {
    // Each channel is a trapezoid over the hue, shifted by a third of a turn.
    let h = (h - h.floor()) * 6.0;
    let channel = |shift: f32| {
        let k = (shift + h) % 6.0;
        v - v * s * k.min(4.0 - k).clamp(0.0, 1.0)
    };
    Vec3 {
        x: channel(5.0),
        y: channel(3.0),
        z: channel(1.0),
    }
}

/// Converts a colour to hue (0..1), saturation and lightness.
pub fn to_hsl(c: Vec3) -> [f32; 3] {
    let [h, _, high] = to_hsv(c);
    let low = c.x.min(c.y).min(c.z);
    let (range, sum) = (high - low, high + low);
    let l = 0.5 * sum;
    let s = divide(range, if l > 0.5 { 2.0 - sum } else { sum });
    [h, s, l]
}

/// Converts hue, saturation and lightness to a colour.
pub fn from_hsl([h, s, l]: [f32; 3]) -> Vec3 {
    let chroma = (1.0 - (2.0 * l - 1.0).abs()) * s;
    (from_hsv([h, 1.0, 1.0]) - Vec3::splat(0.5)) * chroma + Vec3::splat(l)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vector::vec3;

    #[test]
    fn undefined_operations_return_zero() {
        for (op, a, b) in [
            (Math::Divide, 1.0, 0.0),
            (Math::Modulo, 1.0, 0.0),
            (Math::Sqrt, -1.0, 0.0),
            (Math::Power, -2.0, 0.5),
            (Math::Power, 0.0, -1.0),
            (Math::Logarithm, -1.0, 2.0),
            (Math::Pingpong, 1.0, 0.0),
        ] {
            assert_eq!(op.eval(a, b, 0.0), 0.0, "{op:?}");
        }
        assert_eq!(Math::Pingpong.eval(3.0, 2.0, 0.0), 1.0);
        assert_eq!(Math::Wrap.eval(5.5, 4.0, 1.0), 2.5);
        assert_eq!(Math::Compare.eval(1.0, 1.1, 0.2), 1.0);
    }

    #[test]
    fn a_factor_of_zero_keeps_the_first_colour_and_hsv_round_trips() {
        let (a, b) = (vec3(0.2, 0.5, 0.7), vec3(0.9, 0.3, 0.1));
        for (name, blend) in Blend::NAMED {
            let same = blend.eval(0.0, a, b);
            assert!((same - a).length() < 1e-6, "{name}: {same:?}");
        }
        assert!((from_hsv(to_hsv(a)) - a).length() < 1e-6);
        assert!((from_hsl(to_hsl(a)) - a).length() < 1e-6);
        assert_eq!(to_hsl(vec3(0.0, 1.0, 0.0)), [1.0 / 3.0, 1.0, 0.5]);
        assert_eq!(to_hsv(vec3(0.0, 1.0, 0.0)), [1.0 / 3.0, 1.0, 1.0]);
    }
}
