// SPDX-License-Identifier: GPL-3.0-or-later
//! Conversion of a light's parameters to a light prepared for sampling.

use crate::camera::matrix_column;
use crate::check::{Error, Result, finite, within};
use crate::light_shapes::{Area, Cone, Disc, Sun};
use crate::lights::light::{Light, Shape};
use crate::lights::params::{AreaShape, LightKind, LightParams};
use crate::vector::Vec3;

/// Converts a light; `None` if it emits nothing. `index`: its position in the list, for messages.
pub(super) fn compile(params: &LightParams, index: usize) -> Result<Option<Light>> {
    // Check what all kinds share, and make names for the messages.
    check(params, index)?;
    let name = |key: &str| format!("lights[{index}]['{key}']");
    let size = |value: f32, key: &str| within(value.into(), 0.0, 1e18, || name(key));
    let angle = |value: f32, key: &str| {
        within(value.into(), 0.0, std::f64::consts::PI * 1.000_001, || {
            name(key)
        })
    };
    let flat = || Error::Spec(format!("{} has an axis of length zero", name("to_world")));
    let power = Vec3::from(params.power);
    let position = matrix_column(&params.to_world, 3);
    let pi = std::f32::consts::PI;
    // Each kind yields its shape, its strength and its brightness, the estimate for choosing lights.
    let (shape, strength, brightness) = match params.kind {
        LightKind::Point { radius } => {
            size(radius, "radius")?;
            disc(Disc::new(position, radius, None), radius, power)
        }
        LightKind::Spot {
            radius,
            size: cone,
            blend,
        } => {
            size(radius, "radius")?;
            angle(cone, "spot_size")?;
            finite(&[blend], || name("spot_blend"))?;
            let cone = Cone::new(&params.to_world, cone, blend);
            let cone = cone.ok_or_else(flat)?;
            disc(Disc::new(position, radius, Some(cone)), radius, power)
        }
        LightKind::Sun { angle: full } => {
            angle(full, "angle")?;
            let axis = matrix_column(&params.to_world, 2);
            if axis == Vec3::ZERO {
                return Err(flat());
            }
            // A sun shines along -Z, so +Z points towards it.
            let sun = Sun::new(axis.normalized(), full);
            let strength = power * sun.radiance_of_one();
            (Shape::Sun(sun), strength, power.mean())
        }
        LightKind::Area {
            shape,
            size: u,
            size_y,
        } => {
            size(u, "size")?;
            // Squares and disks use one size for both extents.
            let v = match shape {
                AreaShape::Square | AreaShape::Disk => u,
                AreaShape::Rectangle | AreaShape::Ellipse => size_y,
            };
            size(v, "size_y")?;
            let round = matches!(shape, AreaShape::Disk | AreaShape::Ellipse);
            let [x, y, z] = [0, 1, 2].map(|k| matrix_column(&params.to_world, k));
            let Some(area) = Area::new(position, x * u, y * v, -z, round) else {
                // A light without area has no finite radiance.
                return Ok(None);
            };
            let strength = power * (1.0 / (pi * area.area()));
            (Shape::Area(area), strength, power.mean() / pi)
        }
    };
    // A power that overflows on a small light is an error; no power is no light.
    if !strength.is_finite() {
        return Err(Error::Spec(format!(
            "{} is too large for the light's size",
            name("power")
        )));
    }
    let light = Light {
        shape,
        strength,
        brightness,
        casts_shadow: params.casts_shadow,
        visible: params.visible,
    };
    Ok((brightness > 0.0 && strength.max_component() > 0.0).then_some(light))
}

/// Checks that matrix and power are finite and within range.
fn check(params: &LightParams, index: usize) -> Result<()> {
    let name = |key: &str| format!("lights[{index}]['{key}']");
    for (row, values) in params.to_world.iter().enumerate() {
        finite(values, || format!("{}[{row}]", name("to_world")))?;
    }
    finite(&params.power, || name("power"))?;
    for &p in &params.power {
        within(p.into(), 0.0, 1e30, || name("power"))?;
    }
    Ok(())
}

/// Shape, strength and brightness of a disc light of this power.
fn disc(disc: Disc, radius: f32, power: Vec3) -> (Shape, Vec3, f32) {
    let brightness = power.mean() / (4.0 * std::f32::consts::PI);
    (Shape::Disc(disc), power * disc_strength(radius), brightness)
}

/// Radiance of a disc light per watt, or intensity of a point light without size.
fn disc_strength(radius: f32) -> f32 {
    let intensity = 0.25 * std::f32::consts::FRAC_1_PI;
    if radius > 0.0 {
        intensity / (std::f32::consts::PI * radius * radius)
    } else {
        intensity
    }
}
