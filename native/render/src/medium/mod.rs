// SPDX-License-Identifier: GPL-3.0-or-later
//! Participating media: what a volume absorbs, scatters and emits per unit of length.
//!
//! A volume is a sum of closures whose coefficients come from a program over the position, or are constant: then it
//! is homogeneous. Several volumes that overlap add up to one [`Mixture`].

use crate::check::{Error, Result};
use crate::medium::mixture::{Lobe, Mixture};
use crate::values::image::Image;
use crate::values::program::{Op, Operand, Program, Step, Value, read, rgb};
use crate::values::shading_point::ShadingPoint;

pub mod distance;
pub mod inversion;
pub mod mixture;
pub mod phase;
pub mod stack;

/// Largest number of closures of a volume.
pub const MAX_CLOSURES: usize = 16;

/// Largest coefficient, per unit of length: larger ones are clamped, far beyond the point where a volume is opaque
/// within the rounding error of a position.
const MAX_COEFFICIENT: f32 = 1e12;

/// A part of a volume. Coefficients are per scene unit; negative ones count as 0, except emission.
#[derive(Debug, Clone, Copy)]
pub struct VolumeClosure {
    /// Scattering coefficient.
    pub scattering: Operand,
    /// Absorption coefficient.
    pub absorption: Operand,
    /// Radiance emitted per unit of length.
    pub emission: Operand,
    /// Mean cosine of the scattering angle, -1 to 1: Henyey and Greenstein's phase function.
    pub anisotropy: Operand,
}

impl Default for VolumeClosure {
    /// Vacuum.
    fn default() -> Self {
        let zero = Operand::number(0.0);
        Self {
            scattering: zero,
            absorption: zero,
            emission: zero,
            anisotropy: zero,
        }
    }
}

/// Parameters of a volume; without closures there is none.
#[derive(Debug, Clone, Default)]
pub struct VolumeParams {
    /// The parts, which add up.
    pub closures: Vec<VolumeClosure>,
    /// Program that computes their coefficients.
    pub program: Vec<Step>,
}

/// A volume prepared for rendering.
#[derive(Debug, Clone)]
pub struct Volume {
    closures: Vec<VolumeClosure>,
    program: Program,
    uniform: bool,
}

impl Volume {
    /// Compiles a volume; `None` if it has no closures. `name`: for messages.
    ///
    /// # Errors
    /// If there are too many closures, or the program is invalid.
    pub fn new(params: &VolumeParams, name: &str) -> Result<Option<Self>> {
        if params.closures.is_empty() {
            return Ok(None);
        }
        if params.closures.len() > MAX_CLOSURES {
            return Err(Error::Spec(format!(
                "{name}['closures']: more than {MAX_CLOSURES}, got {}",
                params.closures.len()
            )));
        }
        // Compile the program for all coefficients; constants that are not finite become 0.
        let mut roots: Vec<Operand> = (params.closures.iter())
            .flat_map(|c| [c.scattering, c.absorption, c.emission, c.anisotropy])
            .collect();
        let program = Program::compile(&params.program, &mut roots, name)?;
        let closures = roots
            .chunks_exact(4)
            .map(|c| VolumeClosure {
                scattering: c[0],
                absorption: c[1],
                emission: c[2],
                anisotropy: c[3],
            })
            .collect();
        Ok(Some(Self {
            closures,
            uniform: roots.iter().all(|r| matches!(r, Operand::Value(_))),
            program,
        }))
    }

    /// Whether the coefficients are the same everywhere.
    pub fn is_uniform(&self) -> bool {
        self.uniform
    }

    /// Returns all operations of the program.
    pub fn ops(&self) -> impl Iterator<Item = &Op> {
        self.program.ops()
    }

    /// Adds the coefficients at a point to `mixture`. `registers`: scratch memory.
    pub fn add_to<'a>(
        &self,
        images: &[Image],
        point: impl FnOnce() -> ShadingPoint<'a>,
        registers: &mut Vec<Value>,
        mixture: &mut Mixture,
    ) {
        if !self.uniform {
            self.program.run(images, &point(), registers);
        }
        for closure in &self.closures {
            let value = |operand: Operand| rgb(read(operand, registers));
            let [scattering, absorption] = [closure.scattering, closure.absorption]
                .map(|c| value(c).map(|x| x.clamp(0.0, MAX_COEFFICIENT)));
            // Coefficients add up; each closure keeps its own phase function.
            mixture.extinction += scattering + absorption;
            mixture.emission += value(closure.emission);
            mixture.scatter(Lobe {
                scattering,
                anisotropy: phase::clamped(value(closure.anisotropy).x),
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn uniform(closures: Vec<VolumeClosure>) -> Mixture {
        let params = VolumeParams {
            closures,
            program: Vec::new(),
        };
        let volume = Volume::new(&params, "volume").unwrap().unwrap();
        assert!(volume.is_uniform());
        let mut mixture = Mixture::default();
        let point = || unreachable!("a uniform volume needs no point");
        volume.add_to(&[], point, &mut Vec::new(), &mut mixture);
        mixture
    }

    #[test]
    fn absurd_coefficients_become_finite() {
        let number = Operand::number;
        let mixture = uniform(vec![
            VolumeClosure {
                scattering: Operand::color([f32::NAN, -1.0, f32::INFINITY]),
                absorption: Operand::color([1e30, 1.0, -5.0]),
                emission: number(-2.0),
                anisotropy: number(f32::NAN),
            },
            VolumeClosure {
                scattering: number(1.0),
                anisotropy: number(-9.0),
                ..Default::default()
            },
        ]);
        assert_eq!(
            mixture.extinction.array(),
            [MAX_COEFFICIENT + 1.0, 2.0, 1.0]
        );
        assert_eq!(mixture.emission.array(), [-2.0; 3]);
        assert_eq!(mixture.scattering().array(), [1.0; 3]);
    }

    #[test]
    fn a_volume_without_closures_is_none_and_too_many_are_an_error() {
        let params = |count| VolumeParams {
            closures: vec![VolumeClosure::default(); count],
            program: Vec::new(),
        };
        assert!(Volume::new(&params(0), "v").unwrap().is_none());
        assert!(Volume::new(&params(MAX_CLOSURES), "v").unwrap().is_some());
        let error = Volume::new(&params(MAX_CLOSURES + 1), "v").unwrap_err();
        assert!(error.to_string().contains("v['closures']"), "{error}");
    }
}
