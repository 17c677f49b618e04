// SPDX-License-Identifier: GPL-3.0-or-later
//! Lamps whose brightness a program computes from the direction and the point of the lamp.

use std::f32::consts::{PI, TAU};

use crate::check::{Error, Result};
use crate::light::params::{LampProgram, LightKind};
use crate::light::prepared::Shape;
use crate::light::shapes::{Area, Disc};
use crate::math::trig::sin_cos_turns;
use crate::math::vector::{Vec3, vec3};
use crate::values::image::Image;
use crate::values::program::{Op, Operand, Program, Value, read, rgb};
use crate::values::shading_point::ShadingPoint;
use crate::values::varying::{ObjectFrame, Varying};
use crate::values::view::History;
use crate::values::visibility::RayKind;

/// Directions in which a program is probed for the mean brightness of its lamp.
const PROBES: u8 = 64;

/// Share of the brightness that a lamp keeps for the choice of lights, however dark its program is where it is probed.
const DARKEST: f32 = 1e-3;

/// Inputs of the programs of lamps, and their scratch memory.
pub struct Lit<'a> {
    /// The images of the scene.
    pub images: &'a [Image],
    /// Data of the scene.
    pub varying: &'a Varying,
    /// The path that arrives at the lamp. Its length is added to the distance to the lamp.
    pub history: History,
    /// Registers of programs.
    pub registers: &'a mut Vec<Value>,
}

/// A ray that arrives at a lamp.
#[derive(Debug, Clone, Copy)]
pub struct Towards {
    /// Origin of the ray.
    pub from: Vec3,
    /// Unit direction.
    pub direction: Vec3,
    /// Distance to the lamp; infinite for a sun.
    pub distance: f32,
}

/// The program of a lamp, compiled.
#[derive(Debug, Clone)]
pub(super) struct Shader {
    program: Program,
    radiance: Operand,
    frame: ObjectFrame,
    kind: LightKind,
}

impl Shader {
    /// Compiles the program of a lamp. `name`: for messages.
    ///
    /// # Errors
    /// [`Error::Spec`] for a wrong program, or one that reads the corners of triangles.
    pub(super) fn new(params: &LampProgram, kind: LightKind, name: &str) -> Result<Self> {
        let mut roots = [params.radiance];
        let program = Program::compile(&params.steps, &mut roots, name)?;
        let corners = |op: &Op| matches!(op, Op::Attribute(..) | Op::NormalMap(_));
        if program.ops().any(corners) {
            return Err(Error::Spec(format!(
                "{name}['program']: a light has no corners"
            )));
        }
        Ok(Self {
            program,
            radiance: roots[0],
            frame: params.frame.clone(),
            kind,
        })
    }

    /// Returns the factor on the lamp's strength if it is the same everywhere.
    pub(super) fn constant(&self) -> Option<Vec3> {
        self.radiance.constant()
    }

    /// Checks the references to images.
    pub(super) fn check(&self, images: usize, name: &str) -> Result<()> {
        for op in self.program.ops() {
            if let Op::Image { image, .. } = op
                && usize::from(*image) >= images
            {
                return Err(Error::Shape(format!(
                    "{name}['program']: image {image} is out of range for {images}"
                )));
            }
        }
        Ok(())
    }

    /// Returns the factor on the lamp's strength along a ray.
    pub(super) fn factor(&self, shape: &Shape, ray: Towards, lit: &mut Lit<'_>) -> Vec3 {
        let Towards {
            from,
            direction,
            distance,
        } = ray;
        // Suns have the direction from them as their position in the world.
        let position = if distance.is_finite() {
            from + direction * distance
        } else {
            -direction - Vec3::from(lit.varying.origin)
        };
        let normal = match shape {
            Shape::Disc(disc) if disc.is_sphere() => {
                (position - disc.centre()).normalized_or(-direction)
            }
            Shape::Area(area) => area.normal(),
            _ => -direction,
        };
        let [u, v] = self.parametric(shape, position, direction, normal);
        let mut history = lit.history;
        history.length += if distance.is_finite() { distance } else { 0.0 };
        let point = ShadingPoint {
            position,
            normal,
            geometric: normal,
            incoming: -direction,
            weights: [u, v, 1.0 - u - v],
            lamp: Some(&self.frame),
            history,
            ..ShadingPoint::background(lit.varying, direction, RayKind::Plain)
        };
        self.program.run(lit.images, &point, lit.registers);
        rgb(read(self.radiance, lit.registers))
    }

    /// Returns the coordinates of a point on the lamp, 0..1 over what it shines through, as in Cycles: around the
    /// sphere of a point light, in the plane across a spot light's axis, over an area light, over a sun's disc.
    fn parametric(&self, shape: &Shape, position: Vec3, direction: Vec3, normal: Vec3) -> [f32; 2] {
        let local = |v: Vec3| {
            let [x, y, z] = self.frame.to_object;
            let [x, y, z] = [x, y, z].map(|r| r[0] * v.x + r[1] * v.y + r[2] * v.z);
            vec3(x, y, z)
        };
        match (self.kind, shape) {
            (LightKind::Spot { size, .. }, _) => {
                let ray = local(-direction).normalized_or(Vec3::ZERO);
                let factor = 0.5 / (0.5 * size).tan() / -ray.z;
                [0.5 + ray.x * factor, 0.5 + ray.y * factor]
            }
            (LightKind::Sun { angle }, Shape::Sun(sun)) => {
                let apart = (direction - sun.towards()).length();
                let factor = 0.5 / (0.5 * angle).sin() / apart;
                let d = local(direction);
                let disc = [0.5 + d.x * factor, 0.5 + d.y * factor];
                disc.map(|x| if x.is_finite() { x } else { 0.5 })
            }
            (_, Shape::Area(area)) => area.parametric(position),
            _ => {
                let n = local(normal).normalized_or(Vec3::ZERO);
                if n.x == 0.0 && n.y == 0.0 {
                    return [0.0, 1.0 - n.z.clamp(-1.0, 1.0).acos() / PI];
                }
                let around = 0.5 - n.x.atan2(n.y) / TAU;
                [around, 1.0 - n.z.clamp(-1.0, 1.0).acos() / PI]
            }
        }
    }

    /// Returns the mean factor on the lamp's strength, for choosing among lights.
    pub(super) fn mean(&self, shape: &Shape, images: &[Image], varying: &Varying) -> f32 {
        let mut registers = Vec::new();
        let mut lit = Lit {
            images,
            varying,
            history: History::default(),
            registers: &mut registers,
        };
        let mut sum = 0.0;
        for index in 0..PROBES {
            // Spread over the sphere of directions by the golden ratio.
            let share = (f32::from(index) + 0.5) / f32::from(PROBES);
            let z = 1.0 - 2.0 * share;
            let (sin, cos) = sin_cos_turns((f32::from(index) * 0.618_034).fract());
            let r = (1.0 - z * z).max(0.0).sqrt();
            let direction = vec3(r * cos, r * sin, z);
            sum += self
                .factor(shape, probe(shape, direction, share), &mut lit)
                .mean_abs();
        }
        (sum / f32::from(PROBES)).max(DARKEST)
    }
}

/// Returns a ray that arrives at a lamp from a distance of 1, in about this direction; `share`: 0..1.
fn probe(shape: &Shape, direction: Vec3, share: f32) -> Towards {
    let away = |centre: Vec3, direction: Vec3| Towards {
        from: centre - direction,
        direction,
        distance: 1.0,
    };
    let centre = |disc: &Disc| disc.centre() - direction * disc.radius;
    let over = |area: &Area| {
        let below = direction.dot(area.normal()) > 0.0;
        let direction = if below { -direction } else { direction };
        away(area.point([share, (share * 7.0).fract()]), direction)
    };
    match shape {
        Shape::Disc(disc) => away(centre(disc), direction),
        Shape::Area(area) => over(area),
        Shape::Sun(sun) => Towards {
            from: Vec3::ZERO,
            direction: sun.towards(),
            distance: f32::INFINITY,
        },
        Shape::Triangle(..) | Shape::World => away(Vec3::ZERO, direction),
    }
}
