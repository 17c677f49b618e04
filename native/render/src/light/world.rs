// SPDX-License-Identifier: GPL-3.0-or-later
//! The background: a colour, or a program of the direction.

use std::sync::Arc;

use crate::check::{Error, Result, finite, within};
use crate::light::direction_map::DirectionMap;
use crate::math::vector::Vec3;
use crate::medium::{Volume, VolumeParams};
use crate::values::image::Image;
use crate::values::program::{Op, Operand, Program, Step, Value, read, rgb};
use crate::values::shading_point::ShadingPoint;
use crate::values::varying::Varying;
use crate::values::view::{Bounces, History};
use crate::values::visibility::RayKind;
use crate::values::visibility::Visibility;

/// Parameters of a background.
#[derive(Debug, Clone)]
pub struct WorldParams {
    /// Radiance if there is no program.
    pub color: [f32; 3],
    /// Program that computes the radiance from the direction.
    pub program: Vec<Step>,
    /// Result of the program.
    pub radiance: Option<Operand>,
    /// Numbers of passes and the values that the program writes to them.
    pub outputs: Vec<(u8, Operand)>,
    /// The medium everywhere outside; its coefficients are constant.
    pub volume: VolumeParams,
    /// The kinds of rays that see the background.
    pub visible: Visibility,
    /// Light group, counted from 1; 0 = none.
    pub group: u8,
    /// Largest number of times that a path has scattered before its light samples see the background. Without effect
    /// on a constant colour, which is not sampled; scattered rays see it in any case, as in Cycles.
    pub max_bounces: u32,
    /// Whether surfaces block light samples of the background; they block scattered rays in any case, as in Cycles.
    pub casts_shadow: bool,
}

impl Default for WorldParams {
    /// Black.
    fn default() -> Self {
        Self {
            color: [0.0; 3],
            program: Vec::new(),
            radiance: None,
            outputs: Vec::new(),
            volume: VolumeParams::default(),
            visible: Visibility::ALL,
            group: 0,
            max_bounces: u32::MAX,
            casts_shadow: true,
        }
    }
}

impl From<[f32; 3]> for WorldParams {
    fn from(color: [f32; 3]) -> Self {
        Self {
            color,
            ..Self::default()
        }
    }
}

/// Largest width and height of the map. In larger panoramas the points of evaluation may miss single bright texels;
/// these are sampled less often than ideal, but without bias.
const MAX_TEXELS: usize = 1024;

/// A background prepared for rendering.
#[derive(Debug)]
pub struct World {
    /// The kinds of rays that see the background.
    pub visible: Visibility,
    /// Light group; 0 = none.
    pub group: u8,
    program: Program,
    radiance: Operand,
    /// Values for passes: the number of each and the operand.
    outputs: Vec<(u8, Operand)>,
    /// Map for importance sampling; none for a constant colour, for which scattered rays suffice.
    map: Option<Arc<DirectionMap>>,
    /// See [`WorldParams::max_bounces`].
    pub max_bounces: u32,
    /// See [`WorldParams::casts_shadow`].
    pub casts_shadow: bool,
    /// The medium everywhere outside.
    pub volume: Option<Volume>,
}

impl World {
    /// Checks and compiles a background.
    ///
    /// # Errors
    /// If a colour is not finite, or the program is invalid.
    pub fn new(params: &WorldParams, images: &[Image], varying: &Varying) -> Result<Self> {
        // Check the colour and compile the program; without one the result is the colour.
        finite(&params.color, || "world['color']".into())?;
        for &c in &params.color {
            within(c.into(), -1e30, 1e30, || "world['color']".into())?;
        }
        let mut results = vec![params.radiance.unwrap_or(Operand::color(params.color))];
        results.extend(params.outputs.iter().map(|&(_, operand)| operand));
        let program = Program::compile(&params.program, &mut results, "world")?;
        let mut world = Self {
            visible: params.visible,
            group: params.group,
            program,
            radiance: results[0],
            outputs: {
                let numbers = params.outputs.iter().map(|&(number, _)| number);
                numbers.zip(results[1..].iter().copied()).collect()
            },
            map: None,
            max_bounces: params.max_bounces,
            casts_shadow: params.casts_shadow,
            volume: world_volume(params)?,
        };
        // Choose the map's resolution: that of the largest image, or a default without images.
        let is_image = |op: &Op| matches!(op, Op::Image { .. });
        let mut size = if world.program.ops().any(is_image) {
            [32, 16]
        } else {
            [256, 128]
        };
        for op in world.program.ops() {
            match op {
                Op::Image { image, .. } => {
                    // An image that does not exist is an error; so is an attribute, which only corners have.
                    let image = images.get(usize::from(*image)).ok_or_else(|| {
                        Error::Shape(format!(
                            "world['program']: image {image} is out of range for {}",
                            images.len()
                        ))
                    })?;
                    size = [size[0].max(image.size()[0]), size[1].max(image.size()[1])];
                }
                Op::Attribute(..) | Op::NormalMap(_) => {
                    return Err(Error::Spec(
                        "world['program']: a background has no corners".into(),
                    ));
                }
                _ => {}
            }
        }
        // Tabulate a background that varies, as diffuse rays see it.
        if world.constant().is_none() {
            let size = size.map(|n| n.min(MAX_TEXELS));
            let mut registers = Vec::new();
            let map = DirectionMap::new(size, |direction| {
                let (kind, history) = (RayKind::Diffuse, History::default());
                world.radiance(images, varying, direction, kind, history, &mut registers)
            });
            world.map = map.map(Arc::new);
        }
        Ok(world)
    }

    /// Returns the radiance if it is the same in all directions.
    pub fn constant(&self) -> Option<Vec3> {
        self.radiance.constant()
    }

    /// Whether the radiance is 0 in all directions.
    pub fn is_black(&self) -> bool {
        self.constant() == Some(Vec3::ZERO)
    }

    /// Returns the radiance of a unit direction for a ray of this kind. `history`: what programs know of the path;
    /// `registers`: scratch memory.
    #[inline]
    pub fn radiance(
        &self,
        images: &[Image],
        varying: &Varying,
        direction: Vec3,
        kind: RayKind,
        history: History,
        registers: &mut Vec<Value>,
    ) -> Vec3 {
        if let Some(constant) = self.constant() {
            return constant;
        }
        self.run(images, varying, direction, kind, history, registers);
        rgb(read(self.radiance, registers))
    }

    /// Runs the program for a unit direction.
    fn run(
        &self,
        images: &[Image],
        varying: &Varying,
        direction: Vec3,
        kind: RayKind,
        history: History,
        registers: &mut Vec<Value>,
    ) {
        let mut point = ShadingPoint::background(varying, direction, kind);
        // The background has no distance and is one bounce farther than the point where the ray starts, as in Cycles.
        point.history = History {
            length: 0.0,
            bounces: Bounces {
                all: history.bounces.all.saturating_add(1),
                ..history.bounces
            },
            ..history
        };
        self.program.run(images, &point, registers);
    }

    /// Writes the values for passes in a unit direction that a camera ray sees, with 1 as the fourth number. Numbers
    /// beyond `out` are ignored.
    #[cold]
    pub fn output(
        &self,
        images: &[Image],
        varying: &Varying,
        direction: Vec3,
        history: History,
        registers: &mut Vec<Value>,
        out: &mut [[f32; 4]],
    ) {
        if self.outputs.is_empty() || out.is_empty() {
            return;
        }
        self.run(
            images,
            varying,
            direction,
            RayKind::Camera,
            history,
            registers,
        );
        for &(number, operand) in &self.outputs {
            if let Some(place) = out.get_mut(usize::from(number)) {
                let [r, g, b, _] = read(operand, registers);
                *place = [r, g, b, 1.0];
            }
        }
    }

    /// Returns the map for sampling.
    pub fn map(&self) -> Option<Arc<DirectionMap>> {
        self.map.clone()
    }
}

/// Compiles the medium of the background. Without an end, it has no box in which its largest extinction could be found.
fn world_volume(params: &WorldParams) -> Result<Option<Volume>> {
    let volume = Volume::new(&params.volume, "world['volume']")?;
    if volume.as_ref().is_some_and(|v| !v.is_uniform()) {
        return Err(Error::Spec(
            "world['volume']: the volume of a background must not vary".into(),
        ));
    }
    Ok(volume)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vector::vec3;

    #[test]
    fn a_background_without_a_program_is_constant() {
        let params = WorldParams {
            color: [1.0, 2.0, 3.0],
            ..Default::default()
        };
        let world = World::new(&params, &[], &Varying::default()).unwrap();
        assert_eq!(world.constant(), Some(vec3(1.0, 2.0, 3.0)));
        assert!(world.map().is_none());
    }
}
