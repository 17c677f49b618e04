// SPDX-License-Identifier: GPL-3.0-or-later
//! Conversion of the steps of a program that read coordinates, transform vectors or map numbers and colours.

use crate::args::keys::Keys;
use crate::args::shader::index;
use halfspace_base::error::Result;
use halfspace_render::values::program::{ColorModel, Coordinate, Ease, Op, Space, VectorKind};

/// The keys that these steps may have in addition to those of others.
pub const KEYS: &[&str] = &[
    "model", "inverse", "from", "to", "vector", "column", "extend", "pixels",
];

/// Coordinates by their names in dictionaries.
pub const COORDINATES: &[(&str, Coordinate)] = &[
    ("generated", Coordinate::Generated),
    ("object", Coordinate::Object),
    ("object_normal", Coordinate::ObjectNormal),
    ("position", Coordinate::Position),
    ("normal", Coordinate::Normal),
    ("true_normal", Coordinate::TrueNormal),
    ("incoming", Coordinate::Incoming),
    ("reflection", Coordinate::Reflection),
    ("backfacing", Coordinate::Backfacing),
    ("camera_ray", Coordinate::CameraRay),
    ("shadow_ray", Coordinate::ShadowRay),
    ("diffuse_ray", Coordinate::DiffuseRay),
    ("glossy_ray", Coordinate::GlossyRay),
    ("transmission_ray", Coordinate::TransmissionRay),
    ("ray_length", Coordinate::RayLength),
    ("ray_depth", Coordinate::RayDepth),
    ("diffuse_depth", Coordinate::DiffuseDepth),
    ("glossy_depth", Coordinate::GlossyDepth),
    ("transmission_depth", Coordinate::TransmissionDepth),
    ("transparent_depth", Coordinate::TransparentDepth),
    ("tangent_x", Coordinate::TangentX),
    ("tangent_y", Coordinate::TangentY),
    ("tangent_z", Coordinate::TangentZ),
    ("edge_u", Coordinate::EdgeU),
    ("edge_v", Coordinate::EdgeV),
    ("parametric", Coordinate::Parametric),
    ("camera", Coordinate::Camera),
    ("view_vector", Coordinate::ViewVector),
    ("view_depth", Coordinate::ViewDepth),
    ("view_distance", Coordinate::ViewDistance),
    ("window", Coordinate::Window),
];

/// Interpolations of Map Range by Blender's names.
const EASES: &[(&str, Ease)] = &[
    ("LINEAR", Ease::Linear),
    ("SMOOTHSTEP", Ease::Smooth),
    ("SMOOTHERSTEP", Ease::Smoother),
    ("STEPPED", Ease::Stepped),
];

/// Models of colours by Blender's names.
const MODELS: &[(&str, ColorModel)] = &[("HSV", ColorModel::Hsv), ("HSL", ColorModel::Hsl)];

/// Spaces by Blender's names.
const SPACES: &[(&str, Space)] = &[
    ("WORLD", Space::World),
    ("OBJECT", Space::Object),
    ("CAMERA", Space::Camera),
];

/// Kinds of vectors by Blender's names.
const VECTORS: &[(&str, VectorKind)] = &[
    ("POINT", VectorKind::Point),
    ("VECTOR", VectorKind::Vector),
    ("NORMAL", VectorKind::Normal),
];

/// Reads the operation of a step; `None` if it is not one of these.
pub fn step(keys: &Keys<'_, '_>, name: &str) -> Result<Option<Op>> {
    let ease = || Ok((keys.choice("kind", EASES)?, keys.flag_or("clamp", true)?));
    Ok(Some(match name {
        "map_range" => {
            let (ease, clamp) = ease()?;
            Op::MapRange(ease, clamp)
        }
        "map_range_vector" => {
            let (ease, clamp) = ease()?;
            Op::MapRangeVector(ease, clamp)
        }
        "convert" => Op::Convert(
            keys.choice("model", MODELS)?,
            !keys.flag_or("inverse", false)?,
        ),
        "wireframe" => Op::Wireframe(keys.flag_or("pixels", false)?),
        "blackbody" => Op::Blackbody,
        "wavelength" => Op::Wavelength,
        "rotate_axis" => Op::RotateAxis,
        "rotate_euler" => Op::RotateEuler(keys.flag_or("inverse", false)?),
        "voxels" => Op::Voxels,
        "object_value" => Op::ObjectValue(index(keys, "column")?),
        "transform" => Op::Transform(
            keys.choice("vector", VECTORS)?,
            keys.choice("from", SPACES)?,
            keys.choice("to", SPACES)?,
        ),
        _ => return Ok(None),
    }))
}
