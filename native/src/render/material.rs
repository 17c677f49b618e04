// SPDX-License-Identifier: GPL-3.0-or-later
//! Materials: closures over a program of values, compiled.

use super::albedo::Grids;
use super::check::{Result, finite, within};
use super::closure::{Closure, ClosureParams, Input, Kind, Look};
use super::image::Image;
use super::place::Place;
use super::program::{Op, Operand, Program, Step, Value, read, rgb};
use super::vector::Vec3;
use super::visibility::Visibility;

/// A material as its user describes it. All colours linear. The constants are those of one
/// Principled BSDF; they count when there are no `closures`.
#[derive(Debug, Clone)]
pub struct MaterialParams {
    /// For messages.
    pub name: String,
    /// Colour of the base, the metal and (its square root, per boundary) the glass; at least 0.
    pub base_color: [f32; 3],
    /// Share of metal, 0..1.
    pub metallic: f32,
    /// 0 = mirror, 1 = fully rough.
    pub roughness: f32,
    /// Index of refraction, above 0.
    pub ior: f32,
    /// Share of glass in what is not metal, 0..1.
    pub transmission: f32,
    /// Principled's "IOR level": 0.5 leaves the layer's reflectance as `ior` gives it, 0 = no layer.
    pub specular: f32,
    /// Emitted radiance, both sides.
    pub emission: [f32; 3],
    /// 1 = opaque, 0 = invisible.
    pub alpha: f32,
    /// What the surface consists of.
    pub closures: Vec<ClosureParams>,
    /// How their inputs are computed.
    pub program: Vec<Step>,
    /// Which rays meet surfaces of it; the others go on as if they were not there.
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
    /// The constants as a closure.
    fn constants(&self) -> ClosureParams {
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

    fn check(&self, index: usize) -> Result<()> {
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

/// A material has at most this many closures; further ones are refused.
pub const MOST_CLOSURES: usize = 8;

/// And at most this many of them are Principled, which have several lobes.
pub const MOST_PRINCIPLED: usize = 4;

/// A material ready for shading.
#[derive(Debug, Clone)]
pub struct Material {
    /// Its closures.
    pub closures: Vec<Closure>,
    /// Computes their inputs; empty when nothing varies.
    pub program: Program,
    /// The part of it that tells what is emitted and passes.
    look_program: Program,
    look_closures: Vec<Closure>,
    fixed_look: Option<Look>,
    normal: Option<Operand>,
    /// Which rays meet it.
    pub visible: Visibility,
    /// Whether it can pass light straight.
    pub transparent: bool,
    /// Whether it can emit.
    pub emits: bool,
    /// Whether some of that shines through a coat, so that it varies with the direction.
    pub dims_emission: bool,
    /// Whether it can have reflecting lobes.
    pub reflects: bool,
    /// Whether it can have refracting lobes.
    pub refracts: bool,
}

impl Material {
    /// Checks and compiles. Weights and roughness outside 0..1 are clamped as Blender clamps them.
    ///
    /// # Errors
    /// When a constant is not finite, a colour is negative, `ior` is not positive, or the program
    /// is broken.
    pub fn new(params: &MaterialParams, index: usize, grids: &mut Grids) -> Result<Self> {
        params.check(index)?;
        let name = format!("materials[{index}]");
        let mut closures = params.closures.clone();
        if closures.is_empty() {
            closures.push(params.constants());
        }
        if closures.len() > MOST_CLOSURES {
            return Err(super::check::Error::Spec(format!(
                "{name}['closures']: more than {MOST_CLOSURES}, got {}",
                closures.len()
            )));
        }
        let principled = closures
            .iter()
            .filter(|c| c.kind == Kind::Principled)
            .count();
        if principled > MOST_PRINCIPLED {
            return Err(super::check::Error::Spec(format!(
                "{name}['closures']: more than {MOST_PRINCIPLED} of kind principled, got {principled}"
            )));
        }
        let normal = closures.iter().find_map(|c| c.normal);
        let mut roots: Vec<Operand> = closures.iter().flat_map(|c| c.inputs).collect();
        roots.extend(normal);
        let program = Program::compile(&params.program, &mut roots, &name)?;
        let compiled = compile(&closures, &roots, grids);
        let normal = normal.and_then(|_| roots.last().copied());

        let asks = [Input::Weight, Input::Color, Input::Emission, Input::Alpha];
        let coat = [
            Input::CoatWeight,
            Input::CoatRoughness,
            Input::CoatIor,
            Input::CoatTint,
        ];
        let mut looks = closures.clone();
        for (closure, compiled) in looks.iter_mut().zip(&compiled) {
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
        if roots.iter().all(|r| matches!(r, Operand::Value(_))) {
            material.fixed_look = Some(sum(&material.look_closures, &[]));
        }
        Ok(material)
    }

    /// Light that comes from the surface or passes it, at a place, without what coats take of it. `registers`: scratch.
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

    /// Whether it looks the same everywhere.
    pub fn has_fixed_look(&self) -> bool {
        self.fixed_look.is_some()
    }

    /// The same where the material's own program has run already.
    #[inline(always)]
    pub fn look_here(&self, registers: &[Value]) -> Look {
        self.fixed_look
            .unwrap_or_else(|| sum(&self.closures, registers))
    }

    /// What a surface that emits `emission` without its coats sends out under this cosine, where the material's own
    /// program has run already.
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

    /// The same where [`Self::look`] has run.
    #[inline(always)]
    pub fn dimmed(&self, emission: Vec3, registers: &[Value], cos: impl FnOnce() -> f32) -> Vec3 {
        if self.dims_emission {
            through_coats(&self.look_closures, registers, cos())
        } else {
            emission
        }
    }

    /// Shading normal, where the material has one of its own and the program has run.
    pub fn normal(&self, registers: &[Value]) -> Option<Vec3> {
        self.normal.map(|operand| rgb(read(operand, registers)))
    }

    /// Everything that is computed for it.
    pub fn ops(&self) -> impl Iterator<Item = &Op> {
        self.program.ops().chain(self.look_program.ops())
    }
}

fn compile(params: &[ClosureParams], roots: &[Operand], grids: &mut Grids) -> Vec<Closure> {
    params
        .iter()
        .zip(roots.chunks_exact(super::closure::INPUTS))
        .map(|(params, inputs)| {
            let mut resolved = params.clone();
            resolved.inputs.copy_from_slice(inputs);
            Closure::new(&resolved, grids)
        })
        .collect()
}

#[cold]
fn through_coats(closures: &[Closure], registers: &[Value], cos: f32) -> Vec3 {
    let mut total = Vec3::ZERO;
    for closure in closures {
        let emission = closure.look(registers).emission;
        if emission != Vec3::ZERO {
            total += emission * closure.through_coat(registers, cos);
        }
    }
    total
}

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
