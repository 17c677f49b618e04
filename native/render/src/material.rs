// SPDX-License-Identifier: GPL-3.0-or-later
//! Materials: closures whose inputs come from a program, compiled for shading.

use crate::albedo::Grids;
use crate::check::{Result, finite, within};
use crate::closure::{Closure, ClosureParams, Input, Kind, Look};
use crate::image::Image;
use crate::place::Place;
use crate::program::{Op, Operand, Program, Step, Value, read, rgb};
use crate::vector::Vec3;
use crate::visibility::Visibility;

/// Parameters of a material; all colours are linear. The constants describe one Principled BSDF and are used only
/// if there are no `closures`.
#[derive(Debug, Clone)]
pub struct MaterialParams {
    /// Name, for messages.
    pub name: String,
    /// Colour of the base and of the metal, and of the glass (its square root per boundary); at least 0.
    pub base_color: [f32; 3],
    /// Share of metal, 0..1.
    pub metallic: f32,
    /// 0 = mirror, 1 = fully rough.
    pub roughness: f32,
    /// Index of refraction, above 0.
    pub ior: f32,
    /// Share of glass in what is not metal, 0..1.
    pub transmission: f32,
    /// Principled's "IOR level": 0.5 leaves the layer's reflectance as `ior` gives it; 0 = no layer.
    pub specular: f32,
    /// Emitted radiance, on both sides.
    pub emission: [f32; 3],
    /// 1 = opaque, 0 = invisible.
    pub alpha: f32,
    /// Closures of the surface.
    pub closures: Vec<ClosureParams>,
    /// Program that computes the closures' inputs.
    pub program: Vec<Step>,
    /// The kinds of rays that can hit the material; others pass through it.
    pub visible: Visibility,
}

impl Default for MaterialParams {
    /// Blender's default Principled BSDF.
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color: [0.8; 3],
            metallic: 0.0,
            roughness: 0.5,
            ior: 1.5,
            transmission: 0.0,
            specular: 0.5,
            emission: [0.0; 3],
            alpha: 1.0,
            closures: Vec::new(),
            program: Vec::new(),
            visible: Visibility::ALL,
        }
    }
}

impl MaterialParams {
    /// Returns the constants as a Principled closure.
    fn constants(&self) -> ClosureParams {
        // Inputs not listed here keep Blender's defaults.
        let mut closure = ClosureParams::new(Kind::Principled);
        let mut set = |input: Input, value: Operand| closure.inputs[input as usize] = value;
        set(Input::Color, Operand::color(self.base_color));
        set(Input::Metallic, Operand::number(self.metallic));
        set(Input::Roughness, Operand::number(self.roughness));
        set(Input::Ior, Operand::number(self.ior));
        set(Input::Transmission, Operand::number(self.transmission));
        set(Input::Specular, Operand::number(self.specular));
        set(Input::Emission, Operand::color(self.emission));
        set(Input::Alpha, Operand::number(self.alpha));
        closure
    }

    /// Checks the constants.
    fn check(&self, index: usize) -> Result<()> {
        // The message names the material and the key.
        let name = |key: &str| format!("materials[{index}]['{key}'] of '{}'", self.name);
        finite(&self.base_color, || name("base_color"))?;
        finite(&self.emission, || name("emission"))?;
        for (key, value) in [
            ("metallic", self.metallic),
            ("roughness", self.roughness),
            ("transmission", self.transmission),
            ("alpha", self.alpha),
        ] {
            finite(&[value], || name(key))?;
        }
        for &c in &self.base_color {
            within(c.into(), 0.0, 1e6, || name("base_color"))?;
        }
        for &c in &self.emission {
            within(c.into(), 0.0, 1e30, || name("emission"))?;
        }
        within(self.ior.into(), 1e-3, 1e3, || name("ior"))?;
        within(self.specular.into(), 0.0, 1e3, || name("specular"))
    }
}

/// Largest number of closures of a material; more are an error.
pub const MOST_CLOSURES: usize = 8;

/// Largest number of Principled closures among them, which have several lobes each.
pub const MOST_PRINCIPLED: usize = 4;

/// A material prepared for shading.
#[derive(Debug, Clone)]
pub struct Material {
    /// The closures.
    pub closures: Vec<Closure>,
    /// Computes the closures' inputs; empty if nothing varies.
    pub program: Program,
    /// The part of the program that emission and transparency depend on.
    look_program: Program,
    /// The closures with the inputs that emission and transparency do not need set to constants.
    look_closures: Vec<Closure>,
    /// Emission and transparency, if they are constant.
    fixed_look: Option<Look>,
    /// Shading normal, if the material computes one.
    normal: Option<Operand>,
    /// The kinds of rays that can hit the material.
    pub visible: Visibility,
    /// Whether light can pass straight through.
    pub transparent: bool,
    /// Whether it can emit.
    pub emits: bool,
    /// Whether some emission passes through a coat and so depends on the direction.
    pub dims_emission: bool,
    /// Whether a closure can have reflecting lobes.
    pub reflects: bool,
    /// Whether a closure can have refracting lobes.
    pub refracts: bool,
}

impl Material {
    /// Checks and compiles a material. Weights and roughness outside 0..1 are clamped as in Blender. `index`:
    /// position in the list, for messages; `grids`: albedos shared by all materials.
    ///
    /// # Errors
    /// If a constant is not finite, a colour is negative, `ior` is out of range, there are too many closures, or
    /// the program is invalid.
    pub fn new(params: &MaterialParams, index: usize, grids: &mut Grids) -> Result<Self> {
        // Check the constants and the number of closures.
        params.check(index)?;
        let name = format!("materials[{index}]");
        let mut closures = params.closures.clone();
        if closures.is_empty() {
            closures.push(params.constants());
        }
        if closures.len() > MOST_CLOSURES {
            return Err(crate::check::Error::Spec(format!(
                "{name}['closures']: more than {MOST_CLOSURES}, got {}",
                closures.len()
            )));
        }
        // Principled closures have several lobes each, so fewer of them are allowed.
        let principled = closures
            .iter()
            .filter(|c| c.kind == Kind::Principled)
            .count();
        if principled > MOST_PRINCIPLED {
            return Err(crate::check::Error::Spec(format!(
                "{name}['closures']: more than {MOST_PRINCIPLED} of kind principled, got {principled}"
            )));
        }
        // Compile the program for all inputs and the normal.
        let normal = closures.iter().find_map(|c| c.normal);
        let mut roots: Vec<Operand> = closures.iter().flat_map(|c| c.inputs).collect();
        roots.extend(normal);
        let program = Program::compile(&params.program, &mut roots, &name)?;
        let compiled = compile(&closures, &roots, grids);
        let normal = normal.and_then(|_| roots.last().copied());

        // Compile it again for what emission and transparency need: far fewer nodes, which shadow rays run often. A
        // coat counts only if it dims emission.
        let asks = [Input::Weight, Input::Color, Input::Emission, Input::Alpha];
        let coat = [
            Input::CoatWeight,
            Input::CoatRoughness,
            Input::CoatIor,
            Input::CoatTint,
        ];
        let mut looks = closures.clone();
        for (closure, compiled) in looks.iter_mut().zip(&compiled) {
            // Replace every input that emission and transparency do not depend on by a constant.
            let dims = compiled.dims_emission();
            for (i, operand) in closure.inputs.iter_mut().enumerate() {
                let color = i != Input::Color as usize || closure.kind == Kind::Transparent;
                let among = |inputs: &[Input]| inputs.iter().any(|&a| a as usize == i);
                let asked = (among(&asks) && color) || (among(&coat) && dims);
                if !asked {
                    *operand = Operand::number(0.0);
                }
            }
        }
        let mut roots: Vec<Operand> = looks.iter().flat_map(|c| c.inputs).collect();
        let look_program = Program::compile(&params.program, &mut roots, &name)?;
        let look_closures = compile(&looks, &roots, grids);

        // Determine what the material can do from all closures.
        let any = |f: fn(&Closure) -> bool| compiled.iter().any(f);
        let mut material = Self {
            visible: params.visible,
            transparent: any(Closure::may_be_transparent),
            emits: any(Closure::may_emit),
            dims_emission: any(Closure::dims_emission),
            reflects: any(Closure::may_reflect),
            refracts: any(Closure::may_refract),
            closures: compiled,
            program,
            look_program,
            look_closures,
            fixed_look: None,
            normal,
        };
        // Without varying inputs, compute emission and transparency once.
        if roots.iter().all(|r| matches!(r, Operand::Value(_))) {
            material.fixed_look = Some(sum(&material.look_closures, &[]));
        }
        Ok(material)
    }

    /// Returns emission and transparency at a place, without the absorption of coats. `registers`: scratch memory.
    #[inline(always)]
    pub fn look<'a>(
        &self,
        images: &[Image],
        place: impl FnOnce() -> Place<'a>,
        registers: &mut Vec<Value>,
    ) -> Look {
        match self.fixed_look {
            Some(look) => look,
            None => {
                self.look_program.run(images, &place(), registers);
                sum(&self.look_closures, registers)
            }
        }
    }

    /// Whether emission and transparency are the same everywhere.
    pub fn has_fixed_look(&self) -> bool {
        self.fixed_look.is_some()
    }

    /// Like [`Self::look`], for registers that the material's own program has filled.
    #[inline(always)]
    pub fn look_here(&self, registers: &[Value]) -> Look {
        self.fixed_look
            .unwrap_or_else(|| sum(&self.closures, registers))
    }

    /// Returns the part of `emission` that the coats transmit towards a viewer at this cosine, for registers that
    /// the material's own program has filled.
    #[inline(always)]
    pub fn dimmed_here(
        &self,
        emission: Vec3,
        registers: &[Value],
        cos: impl FnOnce() -> f32,
    ) -> Vec3 {
        if self.dims_emission {
            through_coats(&self.closures, registers, cos())
        } else {
            emission
        }
    }

    /// Like [`Self::dimmed_here`], for registers that [`Self::look`] has filled.
    #[inline(always)]
    pub fn dimmed(&self, emission: Vec3, registers: &[Value], cos: impl FnOnce() -> f32) -> Vec3 {
        if self.dims_emission {
            through_coats(&self.look_closures, registers, cos())
        } else {
            emission
        }
    }

    /// Returns the shading normal, if the material computes one, for registers that its program has filled.
    pub fn normal(&self, registers: &[Value]) -> Option<Vec3> {
        self.normal.map(|operand| rgb(read(operand, registers)))
    }

    /// Returns all operations of the material's programs.
    pub fn ops(&self) -> impl Iterator<Item = &Op> {
        self.program.ops().chain(self.look_program.ops())
    }
}

/// Prepares closures whose inputs were replaced by `roots`, the operands of the compiled program.
fn compile(params: &[ClosureParams], roots: &[Operand], grids: &mut Grids) -> Vec<Closure> {
    params
        .iter()
        .zip(roots.chunks_exact(crate::closure::INPUTS))
        .map(|(params, inputs)| {
            // The compiled program renumbered the registers of the inputs.
            let mut resolved = params.clone();
            resolved.inputs.copy_from_slice(inputs);
            Closure::new(&resolved, grids)
        })
        .collect()
}

/// Returns the sum of all emission, each dimmed by the coat above it. Cold: coats over emission are rare.
#[cold]
fn through_coats(closures: &[Closure], registers: &[Value], cos: f32) -> Vec3 {
    let mut total = Vec3::ZERO;
    for closure in closures {
        // Only closures that emit need the albedo of their coat.
        let emission = closure.look(registers).emission;
        if emission != Vec3::ZERO {
            total += emission * closure.through_coat(registers, cos);
        }
    }
    total
}

/// Returns the sum of the closures' emission, transparency and weight.
fn sum(closures: &[Closure], registers: &[Value]) -> Look {
    let mut total = Look {
        emission: Vec3::ZERO,
        transparent: Vec3::ZERO,
        solid: 0.0,
    };
    for closure in closures {
        let look = closure.look(registers);
        total.emission += look.emission;
        total.transparent += look.transparent;
        total.solid += look.solid;
    }
    total
}

#[cfg(test)]
mod tests {
    use super::*;

    fn new(params: &MaterialParams) -> Result<Material> {
        Material::new(params, 3, &mut Grids::default())
    }

    #[test]
    fn lobes_appear_only_where_they_weigh_something() {
        let parts = |params: &MaterialParams| new(params).unwrap().closures[0].parts(&[]);
        let default = parts(&MaterialParams::default());
        assert!(default.metal.is_none() && default.glass.is_none() && default.layer.is_some());
        let matte = MaterialParams {
            specular: 0.0,
            ..Default::default()
        };
        assert!(parts(&matte).layer.is_none() && !new(&matte).unwrap().reflects);
        let metal = MaterialParams {
            metallic: 1.0,
            ..Default::default()
        };
        let metal = parts(&metal);
        assert!(metal.metal.is_some() && metal.layer.is_none());
        assert_eq!(metal.diffuse, Vec3::ZERO);
    }

    #[test]
    fn a_bad_value_is_named_with_its_material() {
        let bad = MaterialParams {
            name: "Glass".into(),
            ior: -1.0,
            ..Default::default()
        };
        let message = new(&bad).unwrap_err().to_string();
        assert!(
            message.contains("materials[3]['ior'] of 'Glass'"),
            "{message}"
        );
        let nan = MaterialParams {
            roughness: f32::NAN,
            ..Default::default()
        };
        assert!(new(&nan).unwrap_err().to_string().contains("roughness"));
    }
}
