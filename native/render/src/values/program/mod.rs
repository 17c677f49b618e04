// SPDX-License-Identifier: GPL-3.0-or-later
//! Shading programs: node graphs flattened to a list of steps in the order of evaluation. Each step writes one
//! register of four numbers; compilation folds constants and removes unused steps.

use crate::math::fresnel;
use crate::math::vector::{Vec3, vec3};
use crate::values::image::Image;
use crate::values::shading_point::ShadingPoint;

mod compile;
mod op;
mod pure;
mod textures;
mod wide;

pub use crate::values::program::op::{
    Bump, CellOutput, Cells, ColorModel, Coordinate, Ease, Gradient, Noise, Op, Shift, Space,
    Spread, VectorKind,
};
use crate::values::program::pure::pure;
pub use crate::values::program::wide::{LANES, Wide, read_one};

/// The value of a step: a colour and its alpha, a vector, or a number repeated three times.
pub type Value = [f32; 4];

/// An input of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Operand {
    /// A constant.
    Value(Value),
    /// The result of the step with this index.
    Register(u16),
}

impl Operand {
    /// A constant number.
    pub const fn number(value: f32) -> Self {
        Self::Value([value, value, value, 1.0])
    }

    /// A constant colour or vector.
    pub const fn color([r, g, b]: [f32; 3]) -> Self {
        Self::Value([r, g, b, 1.0])
    }

    /// Returns the value if it is constant.
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
    /// The operation.
    pub op: Op,
    /// Its arguments, [`Op::arity`] in number.
    pub args: Vec<Operand>,
}

/// A compiled program.
#[derive(Debug, Clone, Default)]
pub struct Program {
    steps: Vec<Step>,
}

impl Program {
    /// Whether there are no steps.
    pub fn is_empty(&self) -> bool {
        self.steps.is_empty()
    }

    /// Returns the operations of all steps.
    pub fn ops(&self) -> impl Iterator<Item = &Op> {
        self.steps.iter().map(|s| &s.op)
    }

    /// Evaluates all steps at a point and writes their results to `registers`.
    pub fn run(&self, images: &[Image], point: &ShadingPoint<'_>, registers: &mut Vec<Value>) {
        registers.clear();
        // Each step appends its register.
        for step in &self.steps {
            let value = step.evaluate(images, point, |k| read(step.args[k], registers));
            registers.push(value.map(finite_or_zero));
        }
    }
}

impl Step {
    /// Evaluates the step at a point. `arg`: returns an argument.
    #[inline(always)]
    fn evaluate(
        &self,
        images: &[Image],
        point: &ShadingPoint<'_>,
        arg: impl Fn(usize) -> Value,
    ) -> Value {
        // Operations that depend on the point are handled here, all others by `pure`.
        match &self.op {
            Op::Image {
                image,
                interpolation,
                extension,
                unassociate,
                projection,
            } => {
                let image = &images[usize::from(*image)];
                let at =
                    |[u, v]: [f32; 2]| image.at(u, v, *interpolation, *extension, *unassociate);
                projection.look_up(rgb(arg(0)), || rgb(arg(1)), at)
            }
            Op::Attribute(layer, shift) => point.attribute_at(*layer, *shift),
            Op::Coordinate(which, shift) => point.coordinate(*which, *shift),
            Op::ObjectValue(column) => point.object_value(*column),
            Op::Voxels => point.voxels(arg(0)[0], rgb(arg(1)), arg(2)),
            Op::Transform(kind, from, to) => {
                vector(point.transformed(rgb(arg(0)), *kind, *from, *to))
            }
            Op::Fresnel => {
                // Inside the surface light leaves, so the relative index is inverted.
                let ior = arg(0)[0].max(1e-5);
                let eta = if point.inside { 1.0 / ior } else { ior };
                number(fresnel::dielectric(point.cosine(), eta).0)
            }
            Op::LayerFresnel => {
                // The blend factor of Layer Weight is one minus the inverse index.
                let eta = (1.0 - arg(0)[0]).max(1e-5);
                let eta = if point.inside { eta } else { 1.0 / eta };
                number(fresnel::dielectric(point.cosine(), eta).0)
            }
            Op::LayerFacing => {
                // Blender's curve from the blend factor to the exponent.
                let blend = arg(0)[0].clamp(0.0, 1.0 - 1e-5);
                let exponent = if blend < 0.5 {
                    2.0 * blend
                } else {
                    0.5 / (1.0 - blend)
                };
                number(1.0 - point.cosine().powf(exponent))
            }
            Op::Wireframe(pixels) => {
                number(f32::from(u8::from(point.is_near_edge(arg(0)[0], *pixels))))
            }
            Op::NormalMap(layer) => vector(point.mapped_normal(*layer, rgb(arg(0)), arg(1)[0])),
            Op::NormalMapSpace(object) => {
                vector(point.normal_from_color(*object, rgb(arg(0)), arg(1)[0]))
            }
            Op::Bump(bump) => {
                let heights = [0, 1, 2].map(|k| arg(k)[0]);
                let [strength, distance] = [3, 4].map(|k| arg(k)[0]);
                vector(point.bumped_normal(*bump, heights, strength, distance, rgb(arg(5))))
            }
            Op::Occlusion(settings) => number(point.unoccluded(*settings, rgb(arg(1)), arg(0)[0])),
            Op::Bevel(samples) => vector(point.bevelled(*samples, arg(0)[0])),
            Op::Raycast(settings) => {
                vector(point.cast(*settings, rgb(arg(0)), rgb(arg(1)), arg(2)[0]))
            }
            op => pure(op, arg),
        }
    }
}

/// Returns the value of an operand after [`Program::run`].
#[inline(always)]
pub fn read(operand: Operand, registers: &[Value]) -> Value {
    match operand {
        Operand::Value(v) => v,
        Operand::Register(r) => registers[usize::from(r)],
    }
}

/// Returns the first three components.
#[inline(always)]
pub fn rgb([r, g, b, _]: Value) -> Vec3 {
    vec3(r, g, b)
}

/// Replaces a number that is not finite by 0, so that it does not spread over the image.
#[inline(always)]
fn finite_or_zero(x: f32) -> f32 {
    if x.is_finite() { x } else { 0.0 }
}

/// A number as a value.
#[inline(always)]
fn number(x: f32) -> Value {
    [x, x, x, 1.0]
}

/// A vector as a value.
#[inline(always)]
fn vector(v: Vec3) -> Value {
    [v.x, v.y, v.z, 1.0]
}

#[cfg(test)]
mod tests;
