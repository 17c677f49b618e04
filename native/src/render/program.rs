// SPDX-License-Identifier: GPL-3.0-or-later
//! Values that vary over a surface, as a flat program: a node graph in the order in which it is
//! computed. Each step writes one register of four numbers; what does not vary is computed once,
//! and what nobody uses is left out, when the program is compiled.

use std::sync::Arc;

use super::check::{Error, Result};
use super::fresnel;
use super::image::{Extension, Image, Interpolation};
use super::node_math::{Blend, Math, VectorMath, from_hsv, to_hsv};
use super::noise::{Fractal, fractal, fractal_color};
use super::place::Place;
use super::vector::{Vec3, vec3};

/// The value of a step: a colour and its alpha, a vector, or a number three times.
pub type Value = [f32; 4];

/// An input of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Operand {
    /// The same everywhere.
    Value(Value),
    /// The result of the step of this number.
    Register(u16),
}

impl Operand {
    /// A number.
    pub const fn number(value: f32) -> Self {
        Self::Value([value, value, value, 1.0])
    }

    /// A colour or vector.
    pub const fn color([r, g, b]: [f32; 3]) -> Self {
        Self::Value([r, g, b, 1.0])
    }

    /// The value, when it is the same everywhere.
    pub fn constant(self) -> Option<Vec3> {
        match self {
            Self::Value(v) => Some(rgb(v)),
            Self::Register(_) => None,
        }
    }
}

/// Where on the surface, as numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coordinate {
    /// The object's box as 0..1.
    Generated,
    /// The object's own space.
    Object,
    /// The shading normal in the object's own space.
    ObjectNormal,
    /// Position in the world.
    Position,
    /// Shading normal in the world.
    Normal,
    /// The triangle's normal.
    TrueNormal,
    /// Direction to the viewer.
    Incoming,
    /// The viewer's direction mirrored at the surface.
    Reflection,
    /// 1 on the back.
    Backfacing,
    /// 1 for camera rays.
    CameraRay,
    /// 1 for shadow rays.
    ShadowRay,
    /// 1 after a diffuse bounce.
    DiffuseRay,
    /// 1 after a glossy reflection or a mirror.
    GlossyRay,
    /// 1 after a refraction.
    TransmissionRay,
}

/// What a gradient texture looks like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names are Blender's")]
pub enum Gradient {
    Linear,
    Quadratic,
    Easing,
    Diagonal,
    Radial,
    QuadraticSphere,
    Spherical,
}

/// How Map Range goes from one end to the other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ease {
    /// Evenly.
    Linear,
    /// As a cubic.
    Smooth,
    /// As a polynomial of degree five.
    Smoother,
}

/// What a step computes.
#[derive(Debug, Clone)]
pub enum Op {
    /// Colour and alpha of an image at a place (u, v).
    Image {
        /// Which.
        image: u16,
        /// Between texels.
        interpolation: Interpolation,
        /// Outside.
        extension: Extension,
        /// Divide the colour by alpha.
        unassociate: bool,
        /// The place is a direction, the image a map of all directions.
        panorama: bool,
    },
    /// An attribute of the corners: a UV map or a colour.
    Attribute(u16),
    /// See [`Coordinate`].
    Coordinate(Coordinate),
    /// Fourth number of the argument.
    Alpha,
    /// One channel of the argument.
    Channel(u8),
    /// Three numbers as one vector.
    Combine,
    /// Brightness of a colour.
    Luminance,
    /// Mean of a vector.
    Mean,
    /// The Math node.
    Math(Math, bool),
    /// The Vector Math node.
    VectorMath(VectorMath),
    /// The Mix node: factor, a, b; whether factor and result are clamped.
    Mix(Blend, bool, bool),
    /// An affine map, rows.
    Matrix([[f32; 4]; 3]),
    /// The same, for directions: the result has unit length.
    Unit,
    /// A table over 0..1; whether it is interpolated.
    Ramp(Arc<[Value]>, bool),
    /// Three tables, one for each channel, mixed in by the second argument.
    Curves(Arc<[Value]>),
    /// Checker: place, first colour, second colour, scale. With `true`: which of them as a number.
    Checker(bool),
    /// Noise: place, scale, detail, roughness, lacunarity; `true`: as a colour; then normalize.
    Noise(bool, bool),
    /// Gradient at a place.
    Gradient(Gradient),
    /// Factor, colour.
    Invert,
    /// Colour, exponent.
    Gamma,
    /// Colour, brightness, contrast.
    BrightContrast,
    /// Colour, hue, saturation, value, factor.
    HueSaturation,
    /// Value, from min, from max, to min, to max; whether the result is clamped.
    MapRange(Ease, bool),
    /// Value, min, max.
    Clamp,
    /// Index of refraction.
    Fresnel,
    /// Blend.
    LayerFresnel,
    /// Blend.
    LayerFacing,
    /// Colour and strength of a tangent-space normal map, over the tangents of an attribute.
    NormalMap(u16),
    /// Colour and strength of a normal map in object space (`true`) or in the world.
    NormalMapSpace(bool),
}

impl Op {
    /// Whether the value depends on the arguments alone.
    fn is_pure(&self) -> bool {
        !matches!(
            self,
            Self::Image { .. }
                | Self::Attribute(_)
                | Self::Coordinate(_)
                | Self::Fresnel
                | Self::LayerFresnel
                | Self::LayerFacing
                | Self::NormalMap(_)
                | Self::NormalMapSpace(_)
        )
    }

    /// How many arguments it takes.
    pub fn arity(&self) -> usize {
        match self {
            Self::Attribute(_) | Self::Coordinate(_) => 0,
            Self::Image { .. }
            | Self::Alpha
            | Self::Channel(_)
            | Self::Luminance
            | Self::Mean
            | Self::Matrix(_)
            | Self::Unit
            | Self::Ramp(..)
            | Self::Gradient(_)
            | Self::Fresnel
            | Self::LayerFresnel
            | Self::LayerFacing => 1,
            Self::Invert
            | Self::Gamma
            | Self::Curves(_)
            | Self::NormalMap(_)
            | Self::NormalMapSpace(_) => 2,
            Self::Math(..)
            | Self::VectorMath(_)
            | Self::Mix(..)
            | Self::Combine
            | Self::BrightContrast
            | Self::Clamp => 3,
            Self::Checker(_) => 4,
            Self::Noise(..) | Self::HueSaturation | Self::MapRange(..) => 5,
        }
    }
}

/// One step.
#[derive(Debug, Clone)]
pub struct Step {
    /// What.
    pub op: Op,
    /// Of what: as many as [`Op::arity`].
    pub args: Vec<Operand>,
}

/// Longest program: what is longer is a slip.
pub const MOST_STEPS: usize = 4096;

/// A compiled program.
#[derive(Debug, Clone, Default)]
pub struct Program {
    steps: Vec<Step>,
}

impl Program {
    /// Keeps the steps that `roots` need and whose value varies; `roots` are renumbered or become
    /// constants.
    ///
    /// # Errors
    /// When a step has the wrong number of arguments, or takes a result that is not there yet.
    pub fn compile(steps: &[Step], roots: &mut [Operand], name: &str) -> Result<Self> {
        if steps.len() > MOST_STEPS {
            return Err(Error::Spec(format!(
                "{name}: more than {MOST_STEPS} steps, got {}",
                steps.len()
            )));
        }
        let mut known: Vec<Operand> = Vec::with_capacity(steps.len());
        let mut folded: Vec<Option<Step>> = Vec::with_capacity(steps.len());
        let resolve = |operand: Operand, known: &[Operand]| match operand {
            Operand::Register(r) => known.get(usize::from(r)).copied(),
            Operand::Value(v) => Some(Operand::Value(v.map(tame))),
        };
        for (i, step) in steps.iter().enumerate() {
            let wrong = |what: &str| Error::Spec(format!("{name}['program'][{i}]: {what}"));
            if step.args.len() != step.op.arity() {
                return Err(wrong(&format!(
                    "expected {} arguments, got {}",
                    step.op.arity(),
                    step.args.len()
                )));
            }
            let args: Option<Vec<_>> = step.args.iter().map(|&a| resolve(a, &known)).collect();
            let args = args.ok_or_else(|| wrong("takes the result of a later step"))?;
            let constant = step.op.is_pure().then(|| {
                let values: Option<Vec<Value>> = args
                    .iter()
                    .map(|a| match a {
                        Operand::Value(v) => Some(*v),
                        Operand::Register(_) => None,
                    })
                    .collect();
                values
            });
            if let Some(Some(values)) = constant {
                let value = pure(&step.op, |k| values[k]).map(tame);
                known.push(Operand::Value(value));
                folded.push(None);
            } else {
                known.push(Operand::Register(i as u16));
                folded.push(Some(Step {
                    op: step.op.clone(),
                    args,
                }));
            }
        }
        let mut used = vec![false; steps.len()];
        for root in roots.iter_mut() {
            *root = resolve(*root, &known)
                .ok_or_else(|| Error::Spec(format!("{name}: takes a step that is not there")))?;
            mark(*root, &mut used);
        }
        for i in (0..steps.len()).rev() {
            if used[i]
                && let Some(step) = &folded[i]
            {
                step.args.iter().for_each(|&a| mark(a, &mut used));
            }
        }
        let mut numbers = vec![0_u16; steps.len()];
        let mut kept = Vec::new();
        let renumber = |operand: &mut Operand, numbers: &[u16]| {
            if let Operand::Register(r) = operand {
                *r = numbers[usize::from(*r)];
            }
        };
        for (i, step) in folded.into_iter().enumerate() {
            if let (true, Some(mut step)) = (used[i], step) {
                step.args.iter_mut().for_each(|a| renumber(a, &numbers));
                numbers[i] = kept.len() as u16;
                kept.push(step);
            }
        }
        roots.iter_mut().for_each(|r| renumber(r, &numbers));
        Ok(Self { steps: kept })
    }

    /// Whether there is nothing to compute.
    pub fn is_empty(&self) -> bool {
        self.steps.is_empty()
    }

    /// What is computed.
    pub fn ops(&self) -> impl Iterator<Item = &Op> {
        self.steps.iter().map(|s| &s.op)
    }

    /// Computes all steps at a place.
    pub fn run(&self, images: &[Image], place: &Place<'_>, registers: &mut Vec<Value>) {
        registers.clear();
        for step in &self.steps {
            let arg = |k: usize| read(step.args[k], registers);
            let value = match &step.op {
                Op::Image {
                    image,
                    interpolation,
                    extension,
                    unassociate,
                    panorama,
                } => {
                    let [x, y, z, _] = arg(0);
                    let [u, v] = if *panorama {
                        direction_to_uv(vec3(x, y, z))
                    } else {
                        [x, y]
                    };
                    let image = &images[usize::from(*image)];
                    image.at(u, v, *interpolation, *extension, *unassociate)
                }
                Op::Attribute(layer) => place.attribute(*layer),
                Op::Coordinate(which) => place.coordinate(*which),
                Op::Fresnel => {
                    let ior = arg(0)[0].max(1e-5);
                    let eta = if place.inside { 1.0 / ior } else { ior };
                    number(fresnel::dielectric(place.cosine(), eta).0)
                }
                Op::LayerFresnel => {
                    let eta = (1.0 - arg(0)[0]).max(1e-5);
                    let eta = if place.inside { eta } else { 1.0 / eta };
                    number(fresnel::dielectric(place.cosine(), eta).0)
                }
                Op::LayerFacing => {
                    let blend = arg(0)[0].clamp(0.0, 1.0 - 1e-5);
                    let exponent = if blend < 0.5 {
                        2.0 * blend
                    } else {
                        0.5 / (1.0 - blend)
                    };
                    number(1.0 - place.cosine().powf(exponent))
                }
                Op::NormalMap(layer) => vector(place.mapped_normal(*layer, rgb(arg(0)), arg(1)[0])),
                Op::NormalMapSpace(object) => {
                    vector(place.normal_from_color(*object, rgb(arg(0)), arg(1)[0]))
                }
                op => pure(op, arg),
            };
            registers.push(value.map(tame));
        }
    }
}

/// The value of an operand after [`Program::run`].
#[inline(always)]
pub fn read(operand: Operand, registers: &[Value]) -> Value {
    match operand {
        Operand::Value(v) => v,
        Operand::Register(r) => registers[usize::from(r)],
    }
}

/// The first three numbers.
#[inline(always)]
pub fn rgb([r, g, b, _]: Value) -> Vec3 {
    vec3(r, g, b)
}

/// A number that is not finite is 0 from here on: it must not spoil the picture.
#[inline(always)]
fn tame(x: f32) -> f32 {
    if x.is_finite() { x } else { 0.0 }
}

#[inline(always)]
fn number(x: f32) -> Value {
    [x, x, x, 1.0]
}

#[inline(always)]
fn vector(v: Vec3) -> Value {
    [v.x, v.y, v.z, 1.0]
}

fn mark(operand: Operand, used: &mut [bool]) {
    if let Operand::Register(r) = operand {
        used[usize::from(r)] = true;
    }
}

/// Where a map of all directions shows this one, as Blender lays it out.
pub fn direction_to_uv(d: Vec3) -> [f32; 2] {
    use std::f32::consts::{FRAC_1_PI, TAU};
    if d == Vec3::ZERO {
        return [0.0; 2];
    }
    [
        0.5 - d.y.atan2(d.x) / TAU,
        0.5 + d.z.atan2(d.x.hypot(d.y)) * FRAC_1_PI,
    ]
}

/// The step whose value depends on its arguments alone.
fn pure(op: &Op, arg: impl Fn(usize) -> Value) -> Value {
    let x = |k: usize| arg(k)[0];
    let v = |k: usize| rgb(arg(k));
    match op {
        Op::Alpha => number(arg(0)[3]),
        Op::Channel(c) => number(arg(0)[usize::from(*c).min(3)]),
        Op::Combine => [x(0), x(1), x(2), 1.0],
        Op::Luminance => {
            let c = v(0);
            number(0.212_639 * c.x + 0.715_169 * c.y + 0.072_192 * c.z)
        }
        Op::Mean => number(v(0).mean()),
        Op::Math(math, clamp) => {
            let value = math.eval(x(0), x(1), x(2));
            number(if *clamp { value.clamp(0.0, 1.0) } else { value })
        }
        Op::VectorMath(math) => vector(math.eval(v(0), v(1), v(2))),
        Op::Mix(blend, clamp_factor, clamp_result) => {
            let t = x(0);
            let t = if *clamp_factor { t.clamp(0.0, 1.0) } else { t };
            let out = blend.eval(t, v(1), v(2));
            vector(if *clamp_result {
                out.map(|c| c.clamp(0.0, 1.0))
            } else {
                out
            })
        }
        Op::Matrix(rows) => {
            let p = v(0);
            let [a, b, c] = rows.map(|r| r[0] * p.x + r[1] * p.y + r[2] * p.z + r[3]);
            [a, b, c, 1.0]
        }
        Op::Unit => vector(v(0).normalized_or(Vec3::ZERO)),
        Op::Ramp(table, smooth) => lookup(table, x(0), *smooth),
        Op::Curves(table) => {
            let (c, t) = (v(0), x(1));
            let r = lookup(table, c.x, true)[0];
            let g = lookup(table, c.y, true)[1];
            let b = lookup(table, c.z, true)[2];
            vector(c * (1.0 - t) + vec3(r, g, b) * t)
        }
        Op::Checker(as_number) => {
            let cell = (v(0) * x(3)).map(|c| ((c + 1e-6) * 0.999_999).floor().abs() % 2.0);
            let first = (cell.x == cell.y) == (cell.z == 1.0);
            if *as_number {
                number(f32::from(u8::from(first)))
            } else {
                arg(if first { 1 } else { 2 })
            }
        }
        Op::Noise(color, normalize) => {
            let settings = Fractal {
                detail: x(2),
                roughness: x(3),
                lacunarity: x(4),
                normalize: *normalize,
            };
            let p = v(0) * x(1);
            if *color {
                vector(fractal_color(p, settings))
            } else {
                number(fractal(p, settings))
            }
        }
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
        Op::HueSaturation => {
            let c = v(0);
            let [h, s, value] = to_hsv(c);
            let hsv = [h + x(1) + 0.5, (s * x(2)).clamp(0.0, 1.0), value * x(3)];
            let t = x(4);
            vector((c * (1.0 - t) + from_hsv(hsv) * t).map(|c| c.max(0.0)))
        }
        Op::MapRange(ease, clamp) => {
            let [from, from_end, to, to_end] = [x(1), x(2), x(3), x(4)];
            if from == from_end {
                return number(0.0);
            }
            let t = (x(0) - from) / (from_end - from);
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
            number(if *clamp {
                value.max(to.min(to_end)).min(to.max(to_end))
            } else {
                value
            })
        }
        Op::Clamp => number(x(0).max(x(1)).min(x(2))),
        // The rest look at the place; `run` has handled them.
        _ => [0.0; 4],
    }
}

fn lookup(table: &[Value], at: f32, smooth: bool) -> Value {
    let Some(last) = table.len().checked_sub(1) else {
        return [0.0; 4];
    };
    let x = at.clamp(0.0, 1.0) * last as f32;
    let i = (x as usize).min(last);
    let f = x - i as f32;
    if !smooth || i == last {
        return table[i];
    }
    std::array::from_fn(|k| table[i][k] + f * (table[i + 1][k] - table[i][k]))
}

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

#[cfg(test)]
mod tests;
