// SPDX-License-Identifier: GPL-3.0-or-later
//! Conversion of the dictionaries of camera and settings, with checks. Every message names the key.

use crate::args::keys::Keys;
use halfspace_base::error::Result;
use halfspace_render::camera::filter::FilterKind;
use halfspace_render::camera::lens::LensParams;
use halfspace_render::camera::panorama::Panorama;
use halfspace_render::camera::rolling::RollingParams;
use halfspace_render::camera::{CameraParams, Projection};
use halfspace_render::settings::{Falloff, Integrator, Mist, Pass, Settings};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Reads the camera.
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
        "longitude",
        "latitude",
        "height",
        "fov",
        "focal",
        "sensor",
        "polynomial",
        "motion",
        "poses",
        "rolling_shutter",
        "shutter_curve",
    ];
    // An unknown key is an error.
    let keys = Keys::new(dict, "camera".into(), &known)?;
    let window = keys.numbers("window", &[4])?;
    Ok(CameraParams {
        projection: projection(&keys)?,
        to_world: keys.matrix("to_world")?,
        window: [window[0], window[1], window[2], window[3]],
        clip_start: keys.number("clip_start")?,
        clip_end: keys.number("clip_end")?,
        lens: lens(&keys)?,
        motion: motion(&keys)?,
        poses: poses(&keys)?,
        rolling: rolling(&keys)?,
    })
}

/// Reads the cameras of the pictures before and after.
fn motion(keys: &Keys<'_, '_>) -> Result<Option<Box<[CameraParams; 2]>>> {
    let Some(value) = keys.find("motion") else {
        return Ok(None);
    };
    let wrong = || keys.wrong("motion", "a pair of cameras", &value);
    let [before, after]: [Bound<'_, PyDict>; 2] = value.extract().map_err(|_| wrong())?;
    if [&before, &after]
        .iter()
        .any(|one| one.contains("motion").unwrap_or(true))
    {
        return Err(wrong());
    }
    Ok(Some(Box::new([camera(&before)?, camera(&after)?])))
}

/// Reads the projection and the keys that its kind needs.
fn projection(keys: &Keys<'_, '_>) -> Result<Projection> {
    type Reader = fn(&Keys<'_, '_>) -> Result<Projection>;
    let kinds: [(&str, Reader); 9] = [
        ("perspective", |_| Ok(Projection::Perspective)),
        ("orthographic", |_| Ok(Projection::Orthographic)),
        ("equirectangular", |keys| {
            Ok(Projection::Panoramic(Panorama::Equirectangular {
                longitude: floats(keys, "longitude")?,
                latitude: floats(keys, "latitude")?,
            }))
        }),
        ("equidistant", |keys| {
            let [fov] = floats(keys, "fov")?;
            Ok(Projection::Panoramic(Panorama::Equidistant { fov }))
        }),
        ("equisolid", |keys| {
            let ([fov], [focal]) = (floats(keys, "fov")?, floats(keys, "focal")?);
            let sensor = floats(keys, "sensor")?;
            Ok(Projection::Panoramic(Panorama::Equisolid {
                fov,
                focal,
                sensor,
            }))
        }),
        ("polynomial", |keys| {
            let [fov] = floats(keys, "fov")?;
            Ok(Projection::Panoramic(Panorama::Polynomial {
                fov,
                coefficients: floats(keys, "polynomial")?,
                sensor: floats(keys, "sensor")?,
            }))
        }),
        ("mirror_ball", |_| {
            Ok(Projection::Panoramic(Panorama::MirrorBall))
        }),
        ("central_cylindrical", |keys| {
            Ok(Projection::Panoramic(Panorama::CentralCylindrical {
                longitude: floats(keys, "longitude")?,
                height: floats(keys, "height")?,
            }))
        }),
        ("cube_face", |_| {
            Ok(Projection::Panoramic(Panorama::CubeFace))
        }),
    ];
    keys.choice("kind", &kinds)?(keys)
}

/// Reads numbers, of which there are `N`.
#[expect(clippy::cast_possible_truncation, reason = "infinite is refused")]
fn floats<const N: usize>(keys: &Keys<'_, '_>, key: &str) -> Result<[f32; N]> {
    if N == 1 {
        return Ok([keys.number(key)? as f32; N]);
    }
    let numbers = keys.numbers(key, &[N])?;
    Ok(std::array::from_fn(|k| numbers[k] as f32))
}

/// Reads the transforms of a moving camera; none by default.
fn poses(keys: &Keys<'_, '_>) -> Result<Vec<[[f64; 4]; 4]>> {
    let Some(value) = keys.find("poses") else {
        return Ok(Vec::new());
    };
    let wrong = || keys.wrong("poses", "a list of (4, 4) matrices", &value);
    let matrices: Vec<Vec<Vec<f64>>> = value.extract().map_err(|_| wrong())?;
    let rows = |matrix: Vec<Vec<f64>>| {
        let rows: Option<Vec<[f64; 4]>> = matrix.into_iter().map(|r| r.try_into().ok()).collect();
        rows.and_then(|rows| rows.try_into().ok()).ok_or_else(wrong)
    };
    matrices.into_iter().map(rows).collect()
}

/// Reads the rolling shutter; none by default.
fn rolling(keys: &Keys<'_, '_>) -> Result<Option<RollingParams>> {
    if keys.find("rolling_shutter").is_none() {
        return Ok(None);
    }
    let duration = keys.number("rolling_shutter")?;
    let curve = match keys.find("shutter_curve") {
        None => Vec::new(),
        Some(value) => value
            .extract()
            .map_err(|_| keys.wrong("shutter_curve", "a list of numbers", &value))?,
    };
    Ok(Some(RollingParams { duration, curve }))
}

/// Reads the lens of the camera; missing keys have their default.
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

/// The keys of the settings of a render.
const SETTINGS: [&str; 31] = [
    "width",
    "height",
    "border",
    "samples",
    "integrator",
    "ambient_distance",
    "max_bounces",
    "diffuse_bounces",
    "glossy_bounces",
    "transmission_bounces",
    "volume_bounces",
    "transparent_bounces",
    "clamp_indirect",
    "clamp_direct",
    "filter_glossy",
    "caustics_reflective",
    "caustics_refractive",
    "secondary_beams",
    "seed",
    "film_transparent",
    "transparent_glass",
    "passes",
    "noise_threshold",
    "min_samples",
    "time_limit",
    "mist",
    "step_samples",
    "filter",
    "filter_width",
    "exposure",
    "record_rays",
];

/// Reads the settings of a render.
pub fn settings(dict: &Bound<'_, PyDict>) -> Result<Settings> {
    let keys = Keys::new(dict, "settings".into(), &SETTINGS)?;
    let default = Settings::default();
    let passes = passes(&keys)?.unwrap_or(default.passes);
    // Names of choices.
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
        border: border(&keys)?,
        samples: keys.count("samples")?,
        integrator: match keys.find("integrator") {
            None => default.integrator,
            Some(_) => keys.choice("integrator", &integrators)?,
        },
        ambient_distance: keys.number_or("ambient_distance", default.ambient_distance)?,
        max_bounces: optional("max_bounces")?.unwrap_or(default.max_bounces),
        diffuse_bounces: optional("diffuse_bounces")?.unwrap_or(default.diffuse_bounces),
        glossy_bounces: optional("glossy_bounces")?.unwrap_or(default.glossy_bounces),
        transmission_bounces: optional("transmission_bounces")?
            .unwrap_or(default.transmission_bounces),
        volume_bounces: optional("volume_bounces")?.unwrap_or(default.volume_bounces),
        transparent_bounces: optional("transparent_bounces")?
            .unwrap_or(default.transparent_bounces),
        clamp_indirect: keys.number_or("clamp_indirect", default.clamp_indirect)?,
        clamp_direct: keys.number_or("clamp_direct", default.clamp_direct)?,
        filter_glossy: keys.number_or("filter_glossy", default.filter_glossy)?,
        caustics_reflective: keys.flag_or("caustics_reflective", default.caustics_reflective)?,
        caustics_refractive: keys.flag_or("caustics_refractive", default.caustics_refractive)?,
        secondary_beams: keys.flag_or("secondary_beams", default.secondary_beams)?,
        seed: optional("seed")?.unwrap_or(default.seed),
        film_transparent: keys.flag_or("film_transparent", false)?,
        transparent_glass: keys.number_or("transparent_glass", default.transparent_glass)?,
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
        exposure: keys.number_or("exposure", default.exposure)?,
        record_rays: optional("record_rays")?.unwrap_or(default.record_rays),
    })
}

/// Reads the border: x0, y0, x1, y1 in pixels, half open.
fn border(keys: &Keys<'_, '_>) -> Result<Option<[u32; 4]>> {
    let Some(value) = keys.find("border") else {
        return Ok(None);
    };
    let wrong = || keys.wrong("border", "four whole numbers of at least 0", &value);
    // Read integers first, so that negative ones get this message too.
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

/// Reads the names of the passes.
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

/// Reads the mist.
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
