// SPDX-License-Identifier: GPL-3.0-or-later
//! Conversion of the closures of materials.

use crate::args::keys::{Keys, list};
use crate::args::shader::operand;
use halfspace_base::error::Result;
use halfspace_render::material::closure::{ClosureKind, ClosureParams, Input};
use halfspace_render::material::microfacets::Distribution;
use halfspace_render::medium::inversion::Inversion;

/// Closures by their names in dictionaries.
const KINDS: &[(&str, ClosureKind)] = &[
    ("principled", ClosureKind::Principled),
    ("diffuse", ClosureKind::Diffuse),
    ("translucent", ClosureKind::Translucent),
    ("glossy", ClosureKind::Glossy),
    ("glass", ClosureKind::Glass),
    ("refraction", ClosureKind::Refraction),
    ("transparent", ClosureKind::Transparent),
    ("emission", ClosureKind::Emission),
    ("conductor", ClosureKind::Conductor),
    ("sheen", ClosureKind::Sheen),
    ("velvet", ClosureKind::Velvet),
    ("toon_diffuse", ClosureKind::ToonDiffuse),
    ("toon_glossy", ClosureKind::ToonGlossy),
    ("subsurface", ClosureKind::Subsurface),
    ("hair", ClosureKind::Hair),
    ("hair_reflection", ClosureKind::HairReflection),
    ("hair_transmission", ClosureKind::HairTransmission),
    ("holdout", ClosureKind::Holdout),
];

/// Distributions of facets by their names in dictionaries.
const DISTRIBUTIONS: &[(&str, Distribution)] = &[
    ("ggx", Distribution::Ggx),
    ("beckmann", Distribution::Beckmann),
    ("ashikhmin_shirley", Distribution::AshikhminShirley),
];

/// Methods of subsurface scattering by their names in dictionaries.
const METHODS: &[(&str, Inversion)] = &[
    ("random_walk", Inversion::RandomWalk),
    ("random_walk_skin", Inversion::Skin),
    ("random_walk_legacy", Inversion::Legacy),
];

/// Inputs of closures by their keys.
const INPUTS: &[(&str, Input)] = &[
    ("weight", Input::Weight),
    ("color", Input::Color),
    ("metallic", Input::Metallic),
    ("roughness", Input::Roughness),
    ("ior", Input::Ior),
    ("transmission", Input::Transmission),
    ("specular", Input::Specular),
    ("specular_tint", Input::SpecularTint),
    ("emission", Input::Emission),
    ("alpha", Input::Alpha),
    ("coat_weight", Input::CoatWeight),
    ("coat_roughness", Input::CoatRoughness),
    ("coat_ior", Input::CoatIor),
    ("coat_tint", Input::CoatTint),
    ("diffuse_roughness", Input::DiffuseRoughness),
    ("anisotropy", Input::Anisotropy),
    ("rotation", Input::Rotation),
    ("tangent", Input::Tangent),
    ("coat_normal", Input::CoatNormal),
    ("sheen_weight", Input::SheenWeight),
    ("sheen_roughness", Input::SheenRoughness),
    ("sheen_tint", Input::SheenTint),
    ("smooth", Input::Smooth),
    ("extinction", Input::Extinction),
    ("film_thickness", Input::FilmThickness),
    ("film_ior", Input::FilmIor),
    ("subsurface_weight", Input::SubsurfaceWeight),
    ("subsurface_radius", Input::SubsurfaceRadius),
    ("subsurface_scale", Input::SubsurfaceScale),
    ("subsurface_ior", Input::SubsurfaceIor),
    ("subsurface_anisotropy", Input::SubsurfaceAnisotropy),
    ("radial_roughness", Input::RadialRoughness),
    ("offset", Input::Offset),
    ("melanin", Input::Melanin),
    ("redness", Input::Redness),
    ("absorption", Input::Absorption),
    ("translucency", Input::Translucency),
];

/// Reads the closures of a material.
pub fn closures(keys: &Keys<'_, '_>) -> Result<Vec<ClosureParams>> {
    let mut known = vec!["kind", "normal", "multiscatter", "distribution", "method"];
    known.extend(INPUTS.iter().map(|(name, _)| *name));
    let name = format!("{}['closures']", keys.name);
    list(&name, keys.find("closures").as_ref(), |dict, index| {
        let keys = Keys::new(dict, format!("{name}[{index}]"), &known)?;
        // Replace Blender's defaults by the given inputs.
        let mut closure = ClosureParams::new(keys.choice("kind", KINDS)?);
        for (key, input) in INPUTS {
            if let Some(value) = keys.find(key) {
                closure.inputs[*input as usize] = operand(&keys, key, &value)?;
            }
        }
        closure.normal = keys
            .find("normal")
            .map(|value| operand(&keys, "normal", &value))
            .transpose()?;
        closure.multiscatter = keys.flag_or("multiscatter", true)?;
        if keys.find("distribution").is_some() {
            closure.distribution = keys.choice("distribution", DISTRIBUTIONS)?;
        }
        if keys.find("method").is_some() {
            closure.method = keys.choice("method", METHODS)?;
        }
        Ok(closure)
    })
}
