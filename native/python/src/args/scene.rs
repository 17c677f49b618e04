// SPDX-License-Identifier: GPL-3.0-or-later
//! Conversion of the dictionaries of materials, lights and background, with checks. Every message names the key.

use crate::args::keys::{Keys, list};
use crate::args::{closures, shader, volume};
use halfspace_base::error::Result;
use halfspace_render::light::world::WorldParams;
use halfspace_render::light::{AreaShape, LampProgram, LightKind, LightParams};
use halfspace_render::material::MaterialParams;
use halfspace_render::settings::Pass;
use halfspace_render::values::linking::{LightSets, ObjectSets, SETS};
use halfspace_render::values::program::Operand;
use halfspace_render::values::visibility::{RayKind, Visibility};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Reads the materials.
pub fn materials(value: Option<&Bound<'_, PyAny>>) -> Result<Vec<MaterialParams>> {
    let known = [
        "name",
        "base_color",
        "metallic",
        "roughness",
        "ior",
        "transmission",
        "specular",
        "emission",
        "alpha",
        "closures",
        "program",
        "volume",
        "hidden_from",
        "receives",
        "blocks",
        "receivers",
        "blockers",
        "hole",
        "catcher",
        "opaque_shadow",
        "terminator",
        "outputs",
        "portals",
        "strands",
        "tube",
    ];
    list("materials", value, |dict, index| {
        // Use the values of Blender's default material for missing keys.
        let keys = Keys::new(dict, format!("materials[{index}]"), &known)?;
        let default = MaterialParams::default();
        let color = |key: &str, default| match keys.find(key) {
            None => Ok(default),
            Some(_) => keys.color(key),
        };
        Ok(MaterialParams {
            name: keys
                .find("name")
                .map_or(Ok(String::new()), |_| keys.text("name"))?,
            base_color: color("base_color", default.base_color)?,
            metallic: keys.number_or("metallic", default.metallic)?,
            roughness: keys.number_or("roughness", default.roughness)?,
            ior: keys.number_or("ior", default.ior)?,
            transmission: keys.number_or("transmission", default.transmission)?,
            specular: keys.number_or("specular", default.specular)?,
            emission: color("emission", default.emission)?,
            alpha: keys.number_or("alpha", default.alpha)?,
            closures: closures::closures(&keys)?,
            program: shader::program(&keys)?,
            volume: volume::volume(&keys)?,
            visible: visibility(&keys, default.visible)?,
            sets: ObjectSets {
                receives: bits(&keys, "receives")?,
                blocks: bits(&keys, "blocks")?,
            },
            emits_to: LightSets {
                receivers: set(&keys, "receivers")?,
                blockers: set(&keys, "blockers")?,
            },
            hole: keys.flag_or("hole", false)?,
            catcher: keys.flag_or("catcher", false)?,
            opaque_shadow: keys.flag_or("opaque_shadow", false)?,
            terminator: keys.number_or("terminator", default.terminator)?,
            outputs: outputs(&keys)?,
            portals: portals(&keys)?,
            strands: strands(&keys)?,
            tube: keys.flag_or("tube", false)?,
        })
    })
}

/// Reads the number of a set of linked objects; 0 by default.
fn set(keys: &Keys<'_, '_>, key: &str) -> Result<u8> {
    let Some(value) = keys.find(key) else {
        return Ok(0);
    };
    let number = keys.count(key)?;
    let small = u8::try_from(number).ok().filter(|&set| set < SETS);
    small.ok_or_else(|| keys.wrong(key, "a number from 0 to 31", &value))
}

/// Reads a bit for each set of linked objects; all by default.
fn bits(keys: &Keys<'_, '_>, key: &str) -> Result<u32> {
    keys.find(key).map_or(Ok(u32::MAX), |_| keys.count(key))
}

/// Reads the layer that is 1 on tubes around hairs.
fn strands(keys: &Keys<'_, '_>) -> Result<Option<u16>> {
    let Some(value) = keys.find("strands") else {
        return Ok(None);
    };
    let layer = u16::try_from(keys.count("strands")?);
    layer
        .map(Some)
        .map_err(|_| keys.wrong("strands", "the number of a layer", &value))
}

/// Reads the values for passes: pairs of a number and an operand.
fn outputs(keys: &Keys<'_, '_>) -> Result<Vec<(u8, Operand)>> {
    let Some(value) = keys.find("outputs") else {
        return Ok(Vec::new());
    };
    let wrong = || {
        keys.wrong(
            "outputs",
            "pairs of a number below 64 and an operand",
            &value,
        )
    };
    let items: Vec<(u8, Bound<'_, PyAny>)> = value.extract().map_err(|_| wrong())?;
    items
        .iter()
        .map(|(number, operand)| {
            if *number >= Pass::OUTPUTS {
                return Err(wrong());
            }
            Ok((*number, shader::operand(keys, "outputs", operand)?))
        })
        .collect()
}

/// Reads portals: triples of operands, colour, position and direction.
fn portals(keys: &Keys<'_, '_>) -> Result<Vec<[Operand; 3]>> {
    let Some(value) = keys.find("portals") else {
        return Ok(Vec::new());
    };
    let items: Vec<[Bound<'_, PyAny>; 3]> = value
        .extract()
        .map_err(|_| keys.wrong("portals", "triples of operands", &value))?;
    let operand = |item: &Bound<'_, PyAny>| shader::operand(keys, "portals", item);
    items
        .iter()
        .map(|[color, position, direction]| {
            Ok([operand(color)?, operand(position)?, operand(direction)?])
        })
        .collect()
}

/// Reads the visibility: all kinds of rays except those in "hidden_from".
fn visibility(keys: &Keys<'_, '_>, default: Visibility) -> Result<Visibility> {
    let Some(value) = keys.find("hidden_from") else {
        return Ok(default);
    };
    let kinds = [
        ("camera", RayKind::Camera),
        ("shadow", RayKind::Shadow),
        ("diffuse", RayKind::Diffuse),
        ("glossy", RayKind::Glossy),
        ("transmission", RayKind::Transmission),
        ("volume", RayKind::Volume),
        ("raycast", RayKind::Plain),
    ];
    let wrong = || {
        let expected =
            "a sequence of camera, shadow, diffuse, glossy, transmission, volume, raycast";
        keys.wrong("hidden_from", expected, &value)
    };
    let names: Vec<String> = value.extract().map_err(|_| wrong())?;
    // Remove the named kinds from the full set.
    let mut visible = Visibility::ALL;
    for name in names {
        let kind = kinds.iter().find(|(known, _)| *known == name);
        visible = visible.without(kind.ok_or_else(wrong)?.1);
    }
    Ok(visible)
}

/// Reads the lights.
pub fn lights(value: Option<&Bound<'_, PyAny>>) -> Result<Vec<LightParams>> {
    #[derive(Clone, Copy)]
    enum Kind {
        Point,
        Spot,
        Sun,
        Area,
    }
    let known = [
        "name",
        "kind",
        "to_world",
        "power",
        "radius",
        "angle",
        "spot_size",
        "spot_blend",
        "shape",
        "size",
        "size_y",
        "spread",
        "sphere",
        "casts_shadow",
        "hidden_from",
        "receivers",
        "blockers",
        "group",
        "max_bounces",
        "program",
        "radiance",
        "frame",
    ];
    let kinds = [
        ("point", Kind::Point),
        ("sun", Kind::Sun),
        ("spot", Kind::Spot),
        ("area", Kind::Area),
    ];
    let shapes = [
        ("SQUARE", AreaShape::Square),
        ("RECTANGLE", AreaShape::Rectangle),
        ("DISK", AreaShape::Disk),
        ("ELLIPSE", AreaShape::Ellipse),
    ];
    // Read the keys that each kind of light needs; the defaults are Blender's.
    list("lights", value, |dict, index| {
        let keys = Keys::new(dict, format!("lights[{index}]"), &known)?;
        let radius = || keys.number_or("radius", 0.0);
        let kind = match keys.choice("kind", &kinds)? {
            Kind::Point => LightKind::Point { radius: radius()? },
            Kind::Spot => LightKind::Spot {
                radius: radius()?,
                size: keys.number_or("spot_size", std::f32::consts::FRAC_PI_4)?,
                blend: keys.number_or("spot_blend", 0.15)?,
            },
            Kind::Sun => LightKind::Sun {
                angle: keys.number_or("angle", 0.0)?,
            },
            Kind::Area => {
                let size = keys.number_or("size", 1.0)?;
                LightKind::Area {
                    shape: keys.choice("shape", &shapes)?,
                    size,
                    size_y: keys.number_or("size_y", size)?,
                    spread: keys.number_or("spread", std::f32::consts::PI)?,
                }
            }
        };
        Ok(LightParams {
            kind,
            to_world: keys.matrix("to_world")?,
            power: keys.color("power")?,
            sphere: keys.flag_or("sphere", false)?,
            casts_shadow: keys.flag_or("casts_shadow", true)?,
            visible: visibility(&keys, Visibility::NOT_BY_CAMERA)?,
            sets: sets(&keys)?,
            group: group(&keys)?,
            max_bounces: bounces(&keys)?,
            program: lamp_program(&keys)?,
        })
    })
}

/// Reads which objects a light lights, and which block it.
fn sets(keys: &Keys<'_, '_>) -> Result<LightSets> {
    Ok(LightSets {
        receivers: set(keys, "receivers")?,
        blockers: set(keys, "blockers")?,
    })
}

/// Reads the program of a light, its result and the light's own space; `None` without a result.
fn lamp_program(keys: &Keys<'_, '_>) -> Result<Option<LampProgram>> {
    let Some(radiance) = keys.find("radiance") else {
        return Ok(None);
    };
    let frames = shader::frames(&keys.name, keys.find("frame").as_ref())?;
    Ok(Some(LampProgram {
        steps: shader::program(keys)?,
        radiance: shader::operand(keys, "radiance", &radiance)?,
        frame: frames.into_iter().next().unwrap_or_default(),
    }))
}

/// Reads a light group, counted from 1; 0 = none.
fn group(keys: &Keys<'_, '_>) -> Result<u8> {
    let Some(value) = keys.find("group") else {
        return Ok(0);
    };
    let found = value.extract().ok().filter(|&group| group <= Pass::GROUPS);
    found.ok_or_else(|| keys.wrong("group", "a number from 0 to 64", &value))
}

/// Reads the largest number of bounces before light samples see a light; any number by default.
fn bounces(keys: &Keys<'_, '_>) -> Result<u32> {
    let key = "max_bounces";
    keys.find(key).map_or(Ok(u32::MAX), |_| keys.count(key))
}

/// Reads the background: a colour, or a program and its result.
pub fn world(dict: Option<&Bound<'_, PyDict>>) -> Result<WorldParams> {
    let Some(dict) = dict else {
        return Ok(WorldParams::default());
    };
    let known = [
        "color",
        "program",
        "radiance",
        "volume",
        "hidden_from",
        "group",
        "outputs",
        "max_bounces",
        "casts_shadow",
    ];
    let keys = Keys::new(dict, "world".into(), &known)?;
    Ok(WorldParams {
        color: keys.color("color")?,
        program: shader::program(&keys)?,
        radiance: keys
            .find("radiance")
            .map(|value| shader::operand(&keys, "radiance", &value))
            .transpose()?,
        volume: volume::volume(&keys)?,
        visible: visibility(&keys, Visibility::ALL)?,
        group: group(&keys)?,
        outputs: outputs(&keys)?,
        max_bounces: bounces(&keys)?,
        casts_shadow: keys.flag_or("casts_shadow", true)?,
    })
}
