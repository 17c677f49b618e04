// SPDX-License-Identifier: GPL-3.0-or-later
//! Conversion of dictionaries of materials that vary over a surface: programs, images, layers.
//!
//! An operand is an integer, the index of the step that computes it, or a constant: a float or a sequence of three
//! or four floats.

use crate::args::arrays::{check_copy, converted, describe, elements};
use crate::args::keys::{Keys, list};
use crate::args::steps::{self, COORDINATES};
use crate::args::textures;
use halfspace_base::error::{Error, Result};
use halfspace_render::values::image::projection::Projection;
use halfspace_render::values::image::texels::{Format, Memory, Texels};
use halfspace_render::values::image::{Extension, Image, Interpolation};
use halfspace_render::values::math_nodes::{Blend, Math, VectorMath};
use halfspace_render::values::program::{Bump, Gradient, Op, Operand, Shift, Step, Value};
use halfspace_render::values::varying::{Layer, ObjectFrame, Varying};
use numpy::{PyReadonlyArray1, PyReadonlyArray3, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::{PyBool, PyFloat, PyInt};
use std::sync::Arc;

/// Gradient textures by Blender's names.
const GRADIENTS: &[(&str, Gradient)] = &[
    ("LINEAR", Gradient::Linear),
    ("QUADRATIC", Gradient::Quadratic),
    ("EASING", Gradient::Easing),
    ("DIAGONAL", Gradient::Diagonal),
    ("RADIAL", Gradient::Radial),
    ("QUADRATIC_SPHERE", Gradient::QuadraticSphere),
    ("SPHERICAL", Gradient::Spherical),
];

/// Interpolations of images by their names in dictionaries.
const INTERPOLATIONS: &[(&str, Interpolation)] = &[
    ("linear", Interpolation::Linear),
    ("closest", Interpolation::Closest),
    ("cubic", Interpolation::Cubic),
];

/// Continuations of images beyond their edges by their names in dictionaries.
const EXTENSIONS: &[(&str, Extension)] = &[
    ("repeat", Extension::Repeat),
    ("extend", Extension::Extend),
    ("clip", Extension::Clip),
    ("mirror", Extension::Mirror),
];

/// The keys of steps; which of them a step uses depends on its `op`.
const STEP_KEYS: &[&str] = &[
    "op",
    "args",
    "kind",
    "clamp",
    "clamp_factor",
    "image",
    "interpolation",
    "extension",
    "unassociate",
    "projection",
    "blend",
    "layer",
    "channel",
    "matrix",
    "table",
    "smooth",
    "color",
    "normalize",
    "object",
    "invert",
    "shift",
    "width",
];

/// Reads an operand: a constant or the index of a step.
pub fn operand(keys: &Keys<'_, '_>, key: &str, value: &Bound<'_, PyAny>) -> Result<Operand> {
    let wrong = || {
        keys.wrong(
            key,
            "a step's number, a float, or three or four floats",
            value,
        )
    };
    // Reject a bool, which is an int in Python.
    if value.is_instance_of::<PyInt>() && !value.is_instance_of::<PyBool>() {
        return value.extract().map(Operand::Register).map_err(|_| wrong());
    }
    if value.is_instance_of::<PyFloat>() {
        return value.extract().map(Operand::number).map_err(|_| wrong());
    }
    let numbers: Vec<f32> = value.extract().map_err(|_| wrong())?;
    match numbers[..] {
        [a, b, c] => Ok(Operand::color([a, b, c])),
        [a, b, c, d] => Ok(Operand::Value([a, b, c, d])),
        _ => Err(wrong()),
    }
}

/// Reads the program of a material or background.
pub fn program(keys: &Keys<'_, '_>) -> Result<Vec<Step>> {
    let name = format!("{}['program']", keys.name);
    let known = [STEP_KEYS, steps::KEYS, textures::KEYS].concat();
    list(&name, keys.find("program").as_ref(), |dict, index| {
        let keys = Keys::new(dict, format!("{name}[{index}]"), &known)?;
        // Read the operands from a list, a tuple or any other sequence.
        let args = match keys.find("args") {
            None => Vec::new(),
            Some(value) => value
                .try_iter()
                .map_err(|_| keys.wrong("args", "a sequence", &value))?
                .map(|item| {
                    let item = item.map_err(|_| keys.wrong("args", "a sequence", &value))?;
                    operand(&keys, "args", &item)
                })
                .collect::<Result<_>>()?,
        };
        Ok(Step {
            op: op(&keys)?,
            args,
        })
    })
}

/// Reads an index below 65536.
pub fn index(keys: &Keys<'_, '_>, key: &str) -> Result<u16> {
    let number = keys.count(key)?;
    u16::try_from(number)
        .map_err(|_| Error::Spec(format!("{}['{key}'] must be below 65536", keys.name)))
}

/// Reads the operation of a step.
fn op(keys: &Keys<'_, '_>) -> Result<Op> {
    let name = keys.text("op")?;
    if let Some(op) = textures::texture(keys, &name)? {
        return Ok(op);
    }
    if let Some(op) = steps::step(keys, &name)? {
        return Ok(op);
    }
    Ok(match name.as_str() {
        "image" => Op::Image {
            image: index(keys, "image")?,
            interpolation: keys.choice("interpolation", INTERPOLATIONS)?,
            extension: keys.choice("extension", EXTENSIONS)?,
            unassociate: keys.flag_or("unassociate", false)?,
            projection: projection(keys)?,
        },
        "attribute" => Op::Attribute(index(keys, "layer")?, shift(keys)?),
        "coordinate" => Op::Coordinate(keys.choice("kind", COORDINATES)?, shift(keys)?),
        "alpha" => Op::Alpha,
        "channel" => Op::Channel(index(keys, "channel")?.min(3) as u8),
        "combine" => Op::Combine,
        "luminance" => Op::Luminance,
        "mean" => Op::Mean,
        "math" => Op::Math(
            keys.choice("kind", Math::NAMED)?,
            keys.flag_or("clamp", false)?,
        ),
        "vector_math" => Op::VectorMath(keys.choice("kind", VectorMath::NAMED)?),
        "mix" => Op::Mix(
            keys.choice("kind", Blend::NAMED)?,
            keys.flag_or("clamp_factor", true)?,
            keys.flag_or("clamp", false)?,
        ),
        "matrix" => Op::Matrix(rows(keys, "matrix")?),
        "unit" => Op::Unit,
        "ramp" => Op::Ramp(table(keys)?.into(), keys.flag_or("smooth", true)?),
        "curves" => Op::Curves(table(keys)?.into(), keys.flag_or("extend", false)?),
        "checker" => Op::Checker(!keys.flag_or("color", true)?),
        "gradient" => Op::Gradient(keys.choice("kind", GRADIENTS)?),
        "invert" => Op::Invert,
        "gamma" => Op::Gamma,
        "bright_contrast" => Op::BrightContrast,
        "hue_saturation" => Op::HueSaturation,
        "clamp" => Op::Clamp,
        "fresnel" => Op::Fresnel,
        "layer_fresnel" => Op::LayerFresnel,
        "layer_facing" => Op::LayerFacing,
        "normal_map" => Op::NormalMap(index(keys, "layer")?),
        "bump" => Op::Bump(Bump {
            width: keys.number_or("width", 0.1)?,
            invert: keys.flag_or("invert", false)?,
            object: keys.flag_or("object", false)?,
        }),
        "normal_map_space" => Op::NormalMapSpace(keys.flag_or("object", false)?),
        _ => {
            return Err(Error::Spec(format!(
                "{}['op']: no operation is called '{name}'",
                keys.name
            )));
        }
    })
}

/// Reads where a value is computed: "shift" is an axis, "X" or "Y", and "width" a share of a pixel.
pub fn shift(keys: &Keys<'_, '_>) -> Result<Shift> {
    type ByWidth = fn(f32) -> Shift;
    const AXES: &[(&str, ByWidth)] = &[("X", Shift::X), ("Y", Shift::Y)];
    match keys.find("shift") {
        None => Ok(Shift::None),
        Some(_) => Ok(keys.choice("shift", AXES)?(keys.number_or("width", 0.1)?)),
    }
}

/// Reads an affine map of three rows.
#[expect(
    clippy::cast_possible_truncation,
    reason = "beyond f32 becomes infinite, which a program replaces by 0"
)]
pub fn rows(keys: &Keys<'_, '_>, key: &str) -> Result<[[f32; 4]; 3]> {
    let numbers = keys.numbers(key, &[3, 4])?;
    Ok([0, 1, 2].map(|r| [0, 1, 2, 3].map(|c| numbers[4 * r + c] as f32)))
}

/// Reads a table of rows of four floats.
fn table(keys: &Keys<'_, '_>) -> Result<Vec<Value>> {
    let value = keys.need("table")?;
    let wrong = || keys.wrong("table", "rows of four floats", &value);
    let rows: Vec<Vec<f32>> = value.extract().map_err(|_| wrong())?;
    rows.into_iter()
        .map(|row| Value::try_from(row).map_err(|_| wrong()))
        .collect()
}

/// Reads the values of an object, rows of four floats; none by default.
fn object_values(keys: &Keys<'_, '_>) -> Result<Vec<Value>> {
    let Some(value) = keys.find("values") else {
        return Ok(Vec::new());
    };
    value
        .extract()
        .map_err(|_| keys.wrong("values", "rows of four floats", &value))
}

/// Reads images: dictionaries of `name`, `pixels`, (h, w, 1 to 4) float32, float16, uint16 or uint8, rows from the
/// bottom up, and `srgb`, whether colours are encoded; or `tiles`, such dictionaries with a `number`.
pub fn images(value: Option<&Bound<'_, PyAny>>) -> Result<Vec<Image>> {
    list("images", value, |dict, index| {
        let name = format!("images[{index}]");
        let keys = Keys::new(dict, name, &["name", "pixels", "srgb", "tiles"])?;
        let Some(tiles) = keys.find("tiles") else {
            return image(&keys);
        };
        let name = format!("{}['tiles']", keys.name);
        let tiles = list(&name, Some(&tiles), |dict, index| {
            let known = &["name", "pixels", "srgb", "number"];
            let keys = Keys::new(dict, format!("{name}[{index}]"), known)?;
            Ok((keys.count("number")?, image(&keys)?))
        })?;
        Ok(Image::from_tiles(tiles))
    })
}

/// Reads one image, whose memory is shared if the array views a `bytes` object.
fn image(keys: &Keys<'_, '_>) -> Result<Image> {
    let pixels = keys.need("pixels")?;
    let expected = "an (h, w, 1 to 4) array of float32, float16, uint16 or uint8";
    let wrong = || keys.wrong("pixels", expected, &pixels);
    // Read shape and type.
    let array = pixels.cast::<PyUntypedArray>().map_err(|_| wrong())?;
    let [height, width, channels] = *array.shape() else {
        return Err(wrong());
    };
    let format = (array.dtype().getattr("name"))
        .and_then(|name| name.extract::<String>())
        .map_err(|_| wrong())?;
    let named = Format::NAMED.iter().find(|(name, _)| *name == format);
    let Some(&(_, format)) = named.filter(|_| (1..=4).contains(&channels)) else {
        return Err(wrong());
    };
    // Share the memory, or copy it if that fits.
    let shared: Option<PyBackedBytes> = pixels
        .getattr("base")
        .and_then(|base| base.extract().map_err(PyErr::from))
        .ok()
        .filter(|bytes: &PyBackedBytes| {
            array.is_c_contiguous() && bytes.len() == array.len() * format.size()
        });
    let memory = match shared {
        Some(bytes) => Memory::new(bytes),
        None => {
            check_copy("pixels", array, format.size())?;
            Memory::new(bytes(&pixels).map_err(|_| wrong())?)
        }
    };
    let texels = Texels {
        format,
        channels,
        memory,
    };
    Image::new(
        width,
        height,
        texels,
        keys.flag_or("srgb", false)?,
        &keys.name,
    )
}

/// Copies the bytes of an array in the order of its axes, without the GIL.
fn bytes(array: &Bound<'_, PyAny>) -> PyResult<Vec<u8>> {
    // NumPy makes arrays contiguous without the GIL.
    let numpy = array.py().import("numpy")?;
    let flat = numpy.call_method1("ravel", (array,))?;
    let viewed = flat.call_method1("view", ("uint8",))?;
    Ok(elements(&viewed.extract::<PyReadonlyArray1<'_, u8>>()?))
}

/// Reads how a vector becomes a place on an image.
fn projection(keys: &Keys<'_, '_>) -> Result<Projection> {
    match keys.find("projection") {
        None => Ok(Projection::Flat),
        Some(_) => match keys.choice("projection", Projection::NAMED)? {
            Projection::Box(_) => Ok(Projection::Box(keys.number_or("blend", 0.0)?)),
            other => Ok(other),
        },
    }
}

/// Reads layers: (m, 3, 2 to 4) float32 arrays, or None for a missing one.
pub fn layers(value: Option<&Bound<'_, PyAny>>) -> Result<Vec<Layer>> {
    let Some(value) = value.filter(|v| !v.is_none()) else {
        return Ok(Vec::new());
    };
    let wrong = |value: &Bound<'_, PyAny>| {
        Error::Shape(format!(
            "layers: expected a list of (m, 3, 2 to 4) float32 arrays, got {}",
            describe(value)
        ))
    };
    let mut out = Vec::new();
    for item in value.try_iter().map_err(|_| wrong(value))? {
        let item = item.map_err(|_| wrong(value))?;
        // Represent a missing layer by one without values.
        if item.is_none() {
            out.push(Layer {
                width: 2,
                values: Arc::default(),
            });
            continue;
        }
        let array: PyReadonlyArray3<'_, f32> = item.extract().map_err(|_| wrong(&item))?;
        let (3, width @ 2..=4) = (array.shape()[1], array.shape()[2]) else {
            return Err(wrong(&item));
        };
        check_copy("layers", &*array, size_of::<f32>())?;
        let flat = array.as_slice().map_err(|_| wrong(&item))?;
        let values = Arc::new(converted(item.py(), flat.len(), || flat.to_vec()));
        out.push(Layer { width, values });
    }
    Ok(out)
}

/// Reads objects with their texture spaces. `name`: for messages.
pub fn frames(name: &str, value: Option<&Bound<'_, PyAny>>) -> Result<Vec<ObjectFrame>> {
    list(name, value, |dict, index| {
        let keys = Keys::new(
            dict,
            format!("{name}[{index}]"),
            &["to_object", "generated", "values"],
        )?;
        let generated = keys.numbers("generated", &[2, 3])?;
        #[expect(clippy::cast_possible_truncation, reason = "infinite is refused")]
        let generated = [0, 1].map(|r| [0, 1, 2].map(|c| generated[3 * r + c] as f32));
        Ok(ObjectFrame {
            to_object: rows(&keys, "to_object")?,
            generated,
            values: object_values(&keys)?,
        })
    })
}

/// Reads layers, objects (dictionaries of `to_object`, (3, 4), and `generated`, (2, 3): offset and factor), the
/// object of each triangle and the origin.
pub fn varying(
    layer_arrays: Option<&Bound<'_, PyAny>>,
    objects: Option<&Bound<'_, PyAny>>,
    object_index: Option<&Bound<'_, PyAny>>,
    origin: Option<[f64; 3]>,
) -> Result<Varying> {
    let frames = frames("objects", objects)?;
    let object_index = match object_index.filter(|v| !v.is_none()) {
        None => Vec::new(),
        Some(value) => {
            let wrong = || {
                Error::Shape(format!(
                    "object_index: expected an (m,) uint32 array, got {}",
                    describe(value)
                ))
            };
            let array: PyReadonlyArray1<'_, u32> = value.extract().map_err(|_| wrong())?;
            check_copy("object_index", &*array, size_of::<u32>())?;
            elements(&array)
        }
    };
    #[expect(clippy::cast_possible_truncation, reason = "infinite is refused")]
    let origin = origin.unwrap_or_default().map(|x| x as f32);
    Ok(Varying {
        layers: layers(layer_arrays)?,
        objects: frames,
        object_index,
        origin,
        grids: Vec::new(),
    })
}
