// SPDX-License-Identifier: GPL-3.0-or-later
//! Parameters of materials.

use crate::check::{Result, finite, within};
use crate::material::closure::{ClosureKind, ClosureParams, Input};
use crate::medium::VolumeParams;
use crate::values::linking::{LightSets, ObjectSets};
use crate::values::program::{Operand, Step};
use crate::values::visibility::Visibility;

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
    /// Emitted radiance, on both sides; may be negative.
    pub emission: [f32; 3],
    /// 1 = opaque, 0 = invisible.
    pub alpha: f32,
    /// Closures of the surface.
    pub closures: Vec<ClosureParams>,
    /// Program that computes the closures' inputs.
    pub program: Vec<Step>,
    /// The inside of closed meshes.
    pub volume: VolumeParams,
    /// The kinds of rays that can hit the material; others pass through it.
    pub visible: Visibility,
    /// Layer that is 1 on tubes around hairs.
    pub strands: Option<u16>,
    /// Whether its surfaces are tubes around hairs, see [`crate::scene::tube`].
    pub tube: bool,
    /// The lights that shine on it, and those that it shades.
    pub sets: ObjectSets,
    /// The sets of the objects that its emission shines on, and that shade it.
    pub emits_to: LightSets,
    /// Whether it is a hole in the picture for camera rays, except where it is transparent.
    pub hole: bool,
    /// Whether its objects are shadow catchers; holes are none.
    pub catcher: bool,
    /// Whether its shadow is that of an opaque surface.
    pub opaque_shadow: bool,
    /// Cosine towards the light below which shadow rays start on the curved surface that the corner normals describe.
    pub terminator: f32,
    /// Values for passes: the number of each and the operand.
    pub outputs: Vec<(u8, Operand)>,
    /// Portals: colour multiplied by weight, position in world space, direction of each.
    pub portals: Vec<[Operand; 3]>,
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
            volume: VolumeParams::default(),
            visible: Visibility::ALL,
            strands: None,
            tube: false,
            sets: ObjectSets::ALL,
            emits_to: LightSets::default(),
            hole: false,
            catcher: false,
            opaque_shadow: false,
            terminator: 0.1,
            outputs: Vec::new(),
            portals: Vec::new(),
        }
    }
}

impl MaterialParams {
    /// Returns the constants as a Principled closure.
    pub(super) fn constants(&self) -> ClosureParams {
        // Inputs not listed here keep Blender's defaults.
        let mut closure = ClosureParams::new(ClosureKind::Principled);
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
    pub(super) fn check(&self, index: usize) -> Result<()> {
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
            within(c.into(), -1e30, 1e30, || name("emission"))?;
        }
        within(self.ior.into(), 1e-3, 1e3, || name("ior"))?;
        within(self.specular.into(), 0.0, 1e3, || name("specular"))
    }
}
