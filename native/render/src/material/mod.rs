// SPDX-License-Identifier: GPL-3.0-or-later
//! Materials: closures whose inputs come from a program, compiled for shading.

use crate::check::{Error, Result};
use crate::material::albedo::Grids;
use crate::material::closure::{
    Closure, ClosureKind, ClosureParams, INPUTS, Input, MAX_CLOSURES, MAX_PRINCIPLED, Unscattered,
};
use crate::math::vector::Vec3;
use crate::medium::Volume;
use crate::values::image::Image;
use crate::values::linking::{LightSets, ObjectSets};
use crate::values::program::{Op, Operand, Program, Value, read, rgb};
use crate::values::shading_point::ShadingPoint;
use crate::values::visibility::Visibility;

pub mod albedo;
pub mod bsdf;
pub mod bump;
pub mod closure;
pub mod film;
pub mod ggx;
pub mod hair;
pub mod microfacets;
mod params;
mod portal;
pub mod sheen;

pub use crate::material::params::MaterialParams;
pub use crate::material::portal::Portal;

/// A material prepared for shading.
#[derive(Debug, Clone)]
pub struct Material {
    /// The closures.
    pub closures: Vec<Closure>,
    /// Computes the closures' inputs; empty if nothing varies.
    pub program: Program,
    /// The part of the program that emission and transparency depend on.
    reduced_program: Program,
    /// The closures with the inputs that emission and transparency do not need set to constants.
    reduced_closures: Vec<Closure>,
    /// Emission and transparency, if they are constant.
    constant: Option<Unscattered>,
    /// Shading normal, if the material computes one.
    normal: Option<Operand>,
    /// Values for passes: the number of each and the operand.
    outputs: Vec<(u8, Operand)>,
    /// Where paths go on elsewhere.
    pub portals: Vec<Portal>,
    /// The kinds of rays that can hit the material.
    pub visible: Visibility,
    /// The inside of the objects, if it is not vacuum.
    pub volume: Option<Volume>,
    /// Whether the surface is nothing but the boundary of a volume, which rays pass unchanged.
    pub boundary: bool,
    /// Whether it is a hole in the picture for camera rays, except where it is transparent.
    pub hole: bool,
    /// Whether its objects are shadow catchers, see [`crate::film::catcher`].
    pub catcher: bool,
    /// Whether its shadow is that of an opaque surface.
    pub opaque_shadow: bool,
    /// Cosine towards the light below which the origin of a shadow ray is moved: Cycles' "geometry offset".
    pub terminator: f32,
    /// Layer that is 1 on tubes around hairs, where rays do not see the inside; `None` if they do.
    pub strands: Option<u16>,
    /// Whether its surfaces are tubes around hairs, see [`crate::scene::tube`].
    pub tube: bool,
    /// The lights that shine on it, and those that it shades.
    pub sets: ObjectSets,
    /// The sets of the objects that its emission shines on, and that shade it.
    pub emits_to: LightSets,
    /// Whether light can pass straight through.
    pub transparent: bool,
    /// Whether its program traces rays.
    pub traces_rays: bool,
    /// Whether its program runs ahead of shading, at several points at once.
    pub runs_ahead: bool,
    /// Whether it can emit.
    pub emits: bool,
    /// Whether some emission passes through a coat and so depends on the direction.
    pub dims_emission: bool,
    /// Whether a closure can have reflecting lobes, or a rough diffuse one.
    pub reflects: bool,
    /// Whether a closure can have refracting or translucent lobes.
    pub refracts: bool,
    /// Whether a closure needs lobes with frames or shapes of their own.
    pub lobes: bool,
    /// Whether light can scatter below the surface.
    pub subsurface: bool,
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
        let mut closures = closures(params, &name)?;
        // Compile the program for all inputs and the normal.
        let normal = closures.iter().find_map(|c| c.normal);
        let apart = normals_apart(&mut closures, normal);
        let mut roots: Vec<Operand> = closures.iter().flat_map(|c| c.inputs).collect();
        roots.extend(normal);
        roots.extend(params.outputs.iter().map(|&(_, operand)| operand));
        roots.extend(params.portals.iter().flatten());
        let program = Program::compile(&params.program, &mut roots, &name)?;
        let mut compiled = compile(&closures, &roots, grids);
        for (closure, [turned, coat_apart]) in compiled.iter_mut().zip(apart) {
            (closure.turned, closure.coat_apart) = (turned, coat_apart);
        }
        // Behind the inputs come the normal, if there is one, and the outputs.
        let mut rest = roots[INPUTS * closures.len()..].iter().copied();
        let normal = normal.and_then(|_| rest.next());
        let outputs = params.outputs.iter().zip(rest.by_ref());
        let outputs = outputs.map(|(&(number, _), root)| (number, root)).collect();
        let rest: Vec<Operand> = rest.collect();
        let portals = rest.as_chunks::<3>().0.iter().map(Portal::new).collect();

        // Compile it again for what emission and transparency need: far fewer nodes, which shadow rays run often.
        let reduced = reduced(&closures, &compiled);
        let mut roots: Vec<Operand> = reduced.iter().flat_map(|c| c.inputs).collect();
        let reduced_program = Program::compile(&params.program, &mut roots, &name)?;
        let reduced_closures = compile(&reduced, &roots, grids);

        // Determine what the material can do from all closures.
        let any = |f: fn(&Closure) -> bool| compiled.iter().any(f);
        let traces_rays = program.ops().any(Op::traces_rays);
        let mut material = Self {
            visible: params.visible,
            volume: Volume::new(&params.volume, &format!("{name}['volume']"))?,
            boundary: false,
            strands: params.strands.filter(|_| any(Closure::is_hair)),
            tube: params.tube,
            sets: params.sets,
            emits_to: params.emits_to,
            hole: params.hole,
            catcher: params.catcher && !params.hole,
            opaque_shadow: params.opaque_shadow,
            terminator: params.terminator,
            transparent: any(Closure::may_be_transparent),
            traces_rays,
            runs_ahead: program.gains_in_lanes() && !traces_rays,
            emits: any(Closure::may_emit),
            dims_emission: any(Closure::dims_emission),
            reflects: any(|c| c.may_reflect() || c.may_be_rough() || c.is_hair()),
            refracts: any(|c| c.may_refract() || c.is_translucent() || c.is_hair()),
            lobes: any(Closure::needs_lobes),
            subsurface: any(Closure::may_walk),
            closures: compiled,
            program,
            reduced_program,
            reduced_closures,
            constant: None,
            normal,
            outputs,
            portals,
        };
        // Without varying inputs, compute emission and transparency once.
        if roots.iter().all(|r| matches!(r, Operand::Value(_))) {
            material.constant = Some(sum(&material.reduced_closures, &[]));
        }
        material.boundary = material.volume.is_some()
            && closures.iter().all(|c| c.kind == ClosureKind::Transparent)
            && material
                .constant
                .is_some_and(|c| c.transparent == Vec3::ONE);
        Ok(material)
    }

    /// Returns emission and transparency at a point, without the absorption of coats. `registers`: scratch memory.
    #[inline(always)]
    pub fn unscattered_reduced<'a>(
        &self,
        images: &[Image],
        point: impl FnOnce() -> ShadingPoint<'a>,
        registers: &mut Vec<Value>,
    ) -> Unscattered {
        match self.constant {
            Some(unscattered) => unscattered,
            None => {
                self.reduced_program.run(images, &point(), registers);
                sum(&self.reduced_closures, registers)
            }
        }
    }

    /// Whether emission and transparency are the same everywhere.
    pub fn has_constant_emission(&self) -> bool {
        self.constant.is_some()
    }

    /// Like [`Self::unscattered_reduced`], for registers that the material's own program has filled.
    #[inline(always)]
    pub fn unscattered(&self, registers: &[Value]) -> Unscattered {
        self.constant
            .unwrap_or_else(|| sum(&self.closures, registers))
    }

    /// Returns the part of `emission` that the coats transmit towards a viewer at this cosine, for registers that
    /// the material's own program has filled.
    #[inline(always)]
    pub fn coated_emission(
        &self,
        emission: Vec3,
        registers: &[Value],
        cos: impl FnOnce() -> f32,
    ) -> Vec3 {
        if self.dims_emission {
            emission_below_coats(&self.closures, registers, cos())
        } else {
            emission
        }
    }

    /// Like [`Self::coated_emission`], for registers that [`Self::unscattered_reduced`] has filled.
    #[inline(always)]
    pub fn coated_emission_reduced(
        &self,
        emission: Vec3,
        registers: &[Value],
        cos: impl FnOnce() -> f32,
    ) -> Vec3 {
        if self.dims_emission {
            emission_below_coats(&self.reduced_closures, registers, cos())
        } else {
            emission
        }
    }

    /// Whether rays pass the surface.
    pub fn is_passable(&self) -> bool {
        self.volume.is_some()
            || self.refracts
            || self.transparent
            || !self.visible.is_all()
            || !self.portals.is_empty()
    }

    /// Whether the material computes a shading normal.
    pub fn maps_normal(&self) -> bool {
        self.normal.is_some()
    }

    /// Returns the shading normal, if the material computes one, for registers that its program has filled.
    pub fn normal(&self, registers: &[Value]) -> Option<Vec3> {
        self.normal.map(|operand| rgb(read(operand, registers)))
    }

    /// Writes the values for passes to their places, with 1 as the fourth number, for registers that the material's program has filled. Numbers
    /// beyond `out` are ignored.
    #[cold]
    pub fn output(&self, registers: &[Value], out: &mut [[f32; 4]]) {
        for &(number, operand) in &self.outputs {
            if let Some(place) = out.get_mut(usize::from(number)) {
                let [r, g, b, _] = read(operand, registers);
                *place = [r, g, b, 1.0];
            }
        }
    }

    /// Returns all operations of the material's programs.
    pub fn ops(&self) -> impl Iterator<Item = &Op> {
        let volume = self.volume.iter().flat_map(Volume::ops);
        let surface = self.program.ops().chain(self.reduced_program.ops());
        surface.chain(volume)
    }
}

/// Returns the closures of a material, of which there is at least one, and checks their number.
fn closures(params: &MaterialParams, name: &str) -> Result<Vec<ClosureParams>> {
    let mut closures = params.closures.clone();
    if closures.is_empty() {
        closures.push(params.constants());
    }
    if closures.len() > MAX_CLOSURES {
        return Err(Error::Spec(format!(
            "{name}['closures']: more than {MAX_CLOSURES}, got {}",
            closures.len()
        )));
    }
    // Principled closures have several lobes each, so fewer of them are allowed.
    let principled = closures
        .iter()
        .filter(|c| c.kind == ClosureKind::Principled)
        .count();
    if principled > MAX_PRINCIPLED {
        return Err(Error::Spec(format!(
            "{name}['closures']: more than {MAX_PRINCIPLED} of kind principled, got {principled}"
        )));
    }
    Ok(closures)
}

/// Writes the normals of closures to their inputs where the material has several. Returns for each closure whether its
/// normal, and that of its coat, differ from `normal`, which the material's facets use.
fn normals_apart(closures: &mut [ClosureParams], normal: Option<Operand>) -> Vec<[bool; 2]> {
    closures
        .iter_mut()
        .map(|closure| {
            let scatters = !matches!(
                closure.kind,
                ClosureKind::Transparent | ClosureKind::Emission | ClosureKind::Holdout
            );
            let turned = scatters && closure.normal != normal;
            if turned && let Some(own) = closure.normal {
                closure.inputs[Input::Normal as usize] = own;
            }
            // Without a normal of its own the coat follows the surface.
            let coat = closure.inputs[Input::CoatNormal as usize];
            let coat_apart = normal.is_some() || coat.constant() != Some(Vec3::ZERO);
            [turned, coat_apart]
        })
        .collect()
}

/// Returns the closures with every input that emission and transparency do not depend on replaced by a constant. A
/// coat counts only if it dims emission.
fn reduced(closures: &[ClosureParams], compiled: &[Closure]) -> Vec<ClosureParams> {
    const ALWAYS: [Input; 4] = [Input::Weight, Input::Color, Input::Emission, Input::Alpha];
    const COAT: [Input; 7] = [
        Input::CoatWeight,
        Input::CoatRoughness,
        Input::CoatIor,
        Input::CoatTint,
        Input::SheenWeight,
        Input::SheenRoughness,
        Input::SheenTint,
    ];
    let mut reduced = closures.to_vec();
    for (closure, compiled) in reduced.iter_mut().zip(compiled) {
        let dims = compiled.dims_emission();
        for (i, operand) in closure.inputs.iter_mut().enumerate() {
            // The colour is that of scattered light, except for a transparent closure.
            let color = i != Input::Color as usize || closure.kind == ClosureKind::Transparent;
            let among = |inputs: &[Input]| inputs.iter().any(|&a| a as usize == i);
            let needed = (among(&ALWAYS) && color) || (among(&COAT) && dims);
            if !needed {
                *operand = Operand::number(0.0);
            }
        }
    }
    reduced
}

/// Prepares closures whose inputs were replaced by `roots`, the operands of the compiled program.
fn compile(params: &[ClosureParams], roots: &[Operand], grids: &mut Grids) -> Vec<Closure> {
    params
        .iter()
        .zip(roots.chunks_exact(INPUTS))
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
fn emission_below_coats(closures: &[Closure], registers: &[Value], cos: f32) -> Vec3 {
    let mut total = Vec3::ZERO;
    for closure in closures {
        // Only closures that emit need the albedo of their coat.
        let emission = closure.unscattered(registers).emission;
        if emission != Vec3::ZERO {
            total += emission * closure.through_coat(registers, cos);
        }
    }
    total
}

/// Returns the sum of the closures' emission, transparency and weight.
fn sum(closures: &[Closure], registers: &[Value]) -> Unscattered {
    let mut total = Unscattered::NONE;
    for closure in closures {
        let unscattered = closure.unscattered(registers);
        total.emission += unscattered.emission;
        total.transparent += unscattered.transparent;
        total.scattering += unscattered.scattering;
        total.holdout += unscattered.holdout;
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
        let lobes = |params: &MaterialParams| new(params).unwrap().closures[0].lobes(&[]);
        let default = lobes(&MaterialParams::default());
        assert!(default.metal.is_none() && default.glass.is_none() && default.layer.is_some());
        let matte = MaterialParams {
            specular: 0.0,
            ..Default::default()
        };
        assert!(lobes(&matte).layer.is_none() && !new(&matte).unwrap().reflects);
        let metal = MaterialParams {
            metallic: 1.0,
            ..Default::default()
        };
        let metal = lobes(&metal);
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
