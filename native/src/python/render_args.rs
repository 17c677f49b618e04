// SPDX-License-Identifier: GPL-3.0-or-later
//! Dictionaries that describe a scene and a render, checked. Every message names the key.

use super::arrays::{check_copy, describe};
use super::keys::{Keys, list};
use super::shader_args;
use crate::error::{Error, Result};
use crate::instances::Instances;
use crate::render::attributes::{InstanceAttributes, MeshAttributes};
use crate::render::camera::{CameraParams, Projection};
use crate::render::filter::FilterKind;
use crate::render::indices::Indices;
use crate::render::lens::LensParams;
use crate::render::lights::{AreaShape, LightKind, LightParams};
use crate::render::material::MaterialParams;
use crate::render::place::RayKind;
use crate::render::settings::{Falloff, Integrator, Mist, Pass, Settings};
use crate::render::visibility::Visibility;
use crate::render::world::WorldParams;
use numpy::{PyReadonlyArray1, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// The camera.
pub fn camera(dict: &Bound<'_, PyDict>) -> Result<CameraParams> {
    let known = [
        "kind",
        "to_world",
        "window",
        "clip_start",
        "clip_end",
        "aperture_radius",
        "aperture_blades",
        "aperture_rotation",
        "aperture_ratio",
        "focus_distance",
    ];
    let keys = Keys::new(dict, "camera".into(), &known)?;
    let kinds = [
        ("perspective", Projection::Perspective),
        ("orthographic", Projection::Orthographic),
    ];
    let window = keys.numbers("window", &[4])?;
    Ok(CameraParams {
        projection: keys.choice("kind", &kinds)?,
        to_world: keys.matrix("to_world")?,
        window: [window[0], window[1], window[2], window[3]],
        clip_start: keys.number("clip_start")?,
        clip_end: keys.number("clip_end")?,
        lens: lens(&keys)?,
    })
}

fn lens(keys: &Keys<'_, '_>) -> Result<LensParams> {
    let default = LensParams::default();
    let number = |key: &str, default: f64| keys.find(key).map_or(Ok(default), |_| keys.number(key));
    Ok(LensParams {
        radius: number("aperture_radius", default.radius)?,
        blades: match keys.find("aperture_blades") {
            None => default.blades,
            Some(_) => keys.count("aperture_blades")?,
        },
        rotation: number("aperture_rotation", default.rotation)?,
        ratio: number("aperture_ratio", default.ratio)?,
        focus: number("focus_distance", default.focus)?,
    })
}

/// The settings of a render.
pub fn settings(dict: &Bound<'_, PyDict>) -> Result<Settings> {
    let known = [
        "width",
        "height",
        "border",
        "samples",
        "integrator",
        "ambient_distance",
        "max_bounces",
        "clamp_indirect",
        "seed",
        "film_transparent",
        "passes",
        "noise_threshold",
        "min_samples",
        "time_limit",
        "mist",
        "step_samples",
        "filter",
        "filter_width",
    ];
    let keys = Keys::new(dict, "settings".into(), &known)?;
    let default = Settings::default();
    let border = border(&keys)?;
    let passes = passes(&keys)?.unwrap_or(default.passes);
    let filters = [
        ("blackman_harris", FilterKind::BlackmanHarris),
        ("box", FilterKind::Box),
    ];
    let integrators = [
        ("path", Integrator::Path),
        ("whitted", Integrator::Whitted),
        ("ao", Integrator::Ambient),
    ];
    let optional = |key: &str| keys.find(key).map(|_| keys.count(key)).transpose();
    Ok(Settings {
        width: keys.count("width")?,
        height: keys.count("height")?,
        border,
        samples: keys.count("samples")?,
        integrator: match keys.find("integrator") {
            None => default.integrator,
            Some(_) => keys.choice("integrator", &integrators)?,
        },
        ambient_distance: keys.number_or("ambient_distance", default.ambient_distance)?,
        max_bounces: optional("max_bounces")?.unwrap_or(default.max_bounces),
        clamp_indirect: keys.number_or("clamp_indirect", default.clamp_indirect)?,
        seed: optional("seed")?.unwrap_or(default.seed),
        film_transparent: keys.flag_or("film_transparent", false)?,
        passes,
        noise_threshold: keys.number_or("noise_threshold", default.noise_threshold)?,
        min_samples: optional("min_samples")?.unwrap_or(default.min_samples),
        time_limit: keys.number_or("time_limit", default.time_limit)?,
        mist: mist(&keys)?,
        step_samples: optional("step_samples")?,
        filter: match keys.find("filter") {
            None => default.filter,
            Some(_) => keys.choice("filter", &filters)?,
        },
        filter_width: keys.number_or("filter_width", default.filter_width)?,
    })
}

/// The part of the picture to render, as columns and rows from x0, y0 to x1, y1.
fn border(keys: &Keys<'_, '_>) -> Result<Option<[u32; 4]>> {
    let Some(value) = keys.find("border") else {
        return Ok(None);
    };
    let wrong = || keys.wrong("border", "four whole numbers of at least 0", &value);
    let corners: Vec<i64> = value
        .try_iter()
        .and_then(|items| items.map(|i| i.and_then(|i| i.extract())).collect())
        .map_err(|_| wrong())?;
    let corners: Vec<u32> = corners
        .iter()
        .map(|&c| u32::try_from(c).map_err(|_| wrong()))
        .collect::<Result<_>>()?;
    Ok(Some(<[u32; 4]>::try_from(corners).map_err(|_| wrong())?))
}

fn passes(keys: &Keys<'_, '_>) -> Result<Option<Vec<Pass>>> {
    let Some(value) = keys.find("passes") else {
        return Ok(None);
    };
    let names: Vec<String> = value
        .extract()
        .map_err(|_| keys.wrong("passes", "a list of names", &value))?;
    let passes = names.iter().map(|n| Pass::named(n)).collect::<Result<_>>();
    passes.map(Some)
}

fn mist(keys: &Keys<'_, '_>) -> Result<Mist> {
    let Some(value) = keys.find("mist") else {
        return Ok(Mist::default());
    };
    let dict = value
        .cast::<PyDict>()
        .map_err(|_| keys.wrong("mist", "a dictionary", &value))?;
    let known = ["start", "depth", "falloff"];
    let keys = Keys::new(dict, "settings['mist']".into(), &known)?;
    let falloffs = [
        ("QUADRATIC", Falloff::Quadratic),
        ("LINEAR", Falloff::Linear),
        ("INVERSE_QUADRATIC", Falloff::InverseQuadratic),
    ];
    let default = Mist::default();
    Ok(Mist {
        start: keys.number_or("start", default.start)?,
        depth: keys.number_or("depth", default.depth)?,
        falloff: match keys.find("falloff") {
            None => default.falloff,
            Some(_) => keys.choice("falloff", &falloffs)?,
        },
    })
}

/// The numbers of objects and materials.
pub fn indices(dict: Option<&Bound<'_, PyDict>>) -> Result<Indices> {
    let Some(dict) = dict else {
        return Ok(Indices::default());
    };
    let keys = Keys::new(
        dict,
        "indices".into(),
        &["first", "object", "material", "uvs"],
    )?;
    fn array<T: numpy::Element + Copy>(
        keys: &Keys<'_, '_>,
        key: &str,
        what: &str,
    ) -> Result<Vec<T>> {
        let value = keys.need(key)?;
        let array: PyReadonlyArray1<'_, T> =
            value.extract().map_err(|_| keys.wrong(key, what, &value))?;
        Ok(array.as_array().iter().copied().collect())
    }
    let first: Vec<i32> = array(&keys, "first", "an (n,) int32 array")?;
    Ok(Indices {
        // A negative one becomes huge, which does not ascend.
        first: first.into_iter().map(i32::cast_unsigned).collect(),
        object: array(&keys, "object", "an (n,) float32 array")?,
        material: array(&keys, "material", "an (n,) float32 array")?,
        uvs: match keys.find("uvs") {
            None => Vec::new(),
            Some(value) => {
                let wrong = || keys.wrong("uvs", "an (m, 3, 2) float32 array", &value);
                let array: PyReadonlyArray3<'_, f32> = value.extract().map_err(|_| wrong())?;
                if array.shape()[1..] != [3, 2] {
                    return Err(wrong());
                }
                let corner = |t: numpy::ndarray::ArrayView2<'_, f32>| {
                    [0, 1, 2].map(|corner| [0, 1].map(|axis| t[[corner, axis]]))
                };
                array.as_array().outer_iter().map(corner).collect()
            }
        },
    })
}

/// The materials.
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
        "hidden_from",
    ];
    list("materials", value, |dict, index| {
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
            closures: shader_args::closures(&keys)?,
            program: shader_args::program(&keys)?,
            visible: visibility(&keys, default.visible)?,
        })
    })
}

/// Which rays see a thing: all but those that "hidden_from" names.
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
    ];
    let wrong = || {
        let expected = "a sequence of camera, shadow, diffuse, glossy, transmission";
        keys.wrong("hidden_from", expected, &value)
    };
    let names: Vec<String> = value.extract().map_err(|_| wrong())?;
    let mut visible = Visibility::ALL;
    for name in names {
        let kind = kinds.iter().find(|(known, _)| *known == name);
        visible = visible.without(kind.ok_or_else(wrong)?.1);
    }
    Ok(visible)
}

/// The lights.
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
        "casts_shadow",
        "hidden_from",
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
                }
            }
        };
        Ok(LightParams {
            kind,
            to_world: keys.matrix("to_world")?,
            power: keys.color("power")?,
            casts_shadow: keys.flag_or("casts_shadow", true)?,
            visible: visibility(&keys, Visibility::NOT_BY_CAMERA)?,
        })
    })
}

/// The background: a colour, or a program and its result.
pub fn world(dict: Option<&Bound<'_, PyDict>>) -> Result<WorldParams> {
    let Some(dict) = dict else {
        return Ok(WorldParams::default());
    };
    let known = ["color", "program", "radiance", "hidden_from"];
    let keys = Keys::new(dict, "world".into(), &known)?;
    Ok(WorldParams {
        color: keys.color("color")?,
        program: shader_args::program(&keys)?,
        radiance: keys
            .find("radiance")
            .map(|value| shader_args::operand(&keys, "radiance", &value))
            .transpose()?,
        visible: visibility(&keys, Visibility::ALL)?,
    })
}

/// What instances and their meshes carry; `None` = one material and flat.
pub fn surfaces(
    dict: Option<&Bound<'_, PyDict>>,
    instances: &Instances,
) -> Result<(Vec<MeshAttributes>, InstanceAttributes)> {
    let Some(dict) = dict else {
        let count = instances.len();
        let meshes = instances.meshes().iter();
        let one = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        return Ok((
            meshes.map(|_| MeshAttributes::default()).collect(),
            InstanceAttributes {
                materials: vec![0; count],
                first_material: (0..).take(count + 1).collect(),
                normal_matrix: vec![one; count],
                keeps_length: vec![true; count],
            },
        ));
    };
    let known = [
        "meshes",
        "materials",
        "first_material",
        "normal_matrix",
        "keeps_length",
    ];
    let keys = Keys::new(dict, "surfaces".into(), &known)?;
    let meshes = list(
        "surfaces['meshes']",
        keys.find("meshes").as_ref(),
        |dict, i| {
            let known = ["material_index", "corner_normals"];
            let keys = Keys::new(dict, format!("surfaces['meshes'][{i}]"), &known)?;
            let (index, normals) = (keys.find("material_index"), keys.find("corner_normals"));
            Ok(MeshAttributes {
                material_index: index.as_ref().map(material_index).transpose()?,
                corner_normals: normals.as_ref().map(corner_normals).transpose()?,
            })
        },
    )?;
    let flags = keys.need("keeps_length")?;
    let keeps_length: PyReadonlyArray1<'_, bool> =
        (flags.extract()).map_err(|_| keys.wrong("keeps_length", "a (k,) bool array", &flags))?;
    let first: Vec<i32> = material_index(&keys.need("first_material")?)?;
    Ok((
        meshes,
        InstanceAttributes {
            materials: material_index(&keys.need("materials")?)?,
            first_material: first.into_iter().map(i32::cast_unsigned).collect(),
            // Rows of three by three, as the normals of corners are.
            normal_matrix: corner_normals(&keys.need("normal_matrix")?)?,
            keeps_length: keeps_length.as_array().iter().copied().collect(),
        },
    ))
}

/// The material of each triangle: (m,) int32.
pub fn material_index(value: &Bound<'_, PyAny>) -> Result<Vec<i32>> {
    let array: PyReadonlyArray1<'_, i32> = value.extract().map_err(|_| {
        Error::Shape(format!(
            "material_index: expected an (m,) int32 array, got {}",
            describe(value)
        ))
    })?;
    check_copy("material_index", &*array, size_of::<i32>())?;
    Ok(array.as_array().iter().copied().collect())
}

/// Shading normals: (m, 3, 3) float32.
pub fn corner_normals(value: &Bound<'_, PyAny>) -> Result<Vec<[[f32; 3]; 3]>> {
    let wrong = || {
        Error::Shape(format!(
            "corner_normals: expected an (m, 3, 3) float32 array, got {}",
            describe(value)
        ))
    };
    let array: PyReadonlyArray3<'_, f32> = value.extract().map_err(|_| wrong())?;
    if array.shape()[1..] != [3, 3] {
        return Err(wrong());
    }
    check_copy("corner_normals", &*array, size_of::<f32>())?;
    let triangle = |t: numpy::ndarray::ArrayView2<'_, f32>| {
        [0, 1, 2].map(|corner| [0, 1, 2].map(|axis| t[[corner, axis]]))
    };
    Ok(array.as_array().outer_iter().map(triangle).collect())
}
