// SPDX-License-Identifier: GPL-3.0-or-later
//! Conversion of the steps of a program that are procedural textures.

use crate::args::keys::Keys;
use halfspace_base::error::{Error, Result};
use halfspace_render::values::program::{CellOutput, Cells, Noise, Op, Spread};
use halfspace_render::values::texture::fractal::NoiseKind;
use halfspace_render::values::texture::gabor::GaborOutput;
use halfspace_render::values::texture::pattern::{Profile, Rows, WaveShape};
use halfspace_render::values::texture::radial::RadialOutput;
use halfspace_render::values::texture::voronoi::{Feature, Metric};

/// The keys that a texture may have in addition to those of other steps.
pub const KEYS: &[&str] = &[
    "dimensions",
    "feature",
    "metric",
    "output",
    "profile",
    "depth",
    "earlier",
    "offset",
    "offset_frequency",
    "squash",
    "squash_frequency",
];

/// Reads the operation of a step; `None` if it is not a procedural texture.
pub fn texture(keys: &Keys<'_, '_>, name: &str) -> Result<Option<Op>> {
    Ok(Some(match name {
        "noise" => Op::Noise(Noise {
            spread: spread(keys)?,
            kind: keys.choice("kind", NoiseKind::NAMED)?,
            normalize: keys.flag_or("normalize", true)?,
        }),
        "white_noise" => Op::WhiteNoise(spread(keys)?),
        "voronoi" => Op::Voronoi(Cells {
            dimensions: dimensions(keys)?,
            feature: keys.choice("feature", Feature::NAMED)?,
            metric: keys.choice("metric", Metric::NAMED)?,
            normalize: keys.flag_or("normalize", false)?,
            output: keys.choice("output", CellOutput::NAMED)?,
            earlier: keys.flag_or("earlier", false)?,
        }),
        "gabor" => Op::Gabor(
            keys.choice("output", GaborOutput::NAMED)?,
            match dimensions(keys)? {
                2 => false,
                3 => true,
                n => {
                    return Err(Error::Spec(format!(
                        "{}['dimensions'] must be 2 or 3, got {n}",
                        keys.name
                    )));
                }
            },
        ),
        "wave" => Op::Wave(
            keys.choice("kind", WaveShape::NAMED)?,
            keys.choice("profile", Profile::NAMED)?,
        ),
        "magic" => Op::Magic(count(keys, "depth")?),
        "radial_tiling" => Op::RadialTiling(
            keys.choice("output", RadialOutput::NAMED)?,
            keys.flag_or("normalize", false)?,
        ),
        "brick" => Op::Brick(rows(keys)?, !keys.flag_or("color", true)?),
        _ => return Ok(None),
    }))
}

/// Reads the rows of bricks.
#[expect(
    clippy::cast_possible_truncation,
    reason = "beyond f32 becomes infinite, which a program replaces by 0"
)]
fn rows(keys: &Keys<'_, '_>) -> Result<Rows> {
    Ok(Rows {
        offset: keys.number("offset")? as f32,
        offset_frequency: count(keys, "offset_frequency")?,
        squash: keys.number("squash")? as f32,
        squash_frequency: count(keys, "squash_frequency")?,
    })
}

/// Reads the number of coordinates and the kind of result.
fn spread(keys: &Keys<'_, '_>) -> Result<Spread> {
    Ok(Spread {
        dimensions: dimensions(keys)?,
        color: keys.flag_or("color", false)?,
    })
}

/// Reads the number of coordinates, 1 to 4.
fn dimensions(keys: &Keys<'_, '_>) -> Result<u8> {
    match keys.count("dimensions")? {
        n @ 1..=4 => Ok(n as u8),
        n => Err(Error::Spec(format!(
            "{}['dimensions'] must be 1 to 4, got {n}",
            keys.name
        ))),
    }
}

/// Reads a number of at most 65535.
fn count(keys: &Keys<'_, '_>, key: &str) -> Result<u32> {
    u16::try_from(keys.count(key)?)
        .map(u32::from)
        .map_err(|_| Error::Spec(format!("{}['{key}'] must be below 65536", keys.name)))
}
