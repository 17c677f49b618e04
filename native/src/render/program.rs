// SPDX-License-Identifier: GPL-3.0-or-later
//! Values that vary over a surface, as a flat program: a node graph in the order in which it is
//! computed. Each step writes one register of four numbers; what does not vary is computed once,
//! and what nobody uses is left out, when the program is compiled.

use super::fresnel;
use super::image::Image;
use super::place::Place;
use super::vector::{Vec3, vec3};

mod compile;
mod op;
mod pure;

pub use self::op::{Coordinate, Ease, Gradient, Op};
use self::pure::pure;

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

/// One step.
#[derive(Debug, Clone)]
pub struct Step {
    /// What.
    pub op: Op,
    /// Of what: as many as [`Op::arity`].
    pub args: Vec<Operand>,
}

/// A compiled program.
#[derive(Debug, Clone, Default)]
pub struct Program {
    steps: Vec<Step>,
}

impl Program {
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

#[cfg(test)]
mod tests;
