// SPDX-License-Identifier: GPL-3.0-or-later
//! Conversion of a light's parameters to a light prepared for sampling.

use std::f32::consts::PI;

use crate::check::{Error, Result, finite, within};
use crate::light::params::{AreaShape, LightKind, LightParams};
use crate::light::prepared::{Light, Shape};
use crate::light::programs::Shader;
use crate::light::shapes::{Area, Cone, Disc, Sun};
use crate::math::vector::{Vec3, matrix_column};

/// Parameters of a kind of light in addition to those that all share.
struct Emission {
    shape: Shape,
    /// Radiance of a light with a size; intensity or irradiance of one without.
    strength: Vec3,
    /// Estimate of the intensity or irradiance, for choosing lights.
    brightness: f32,
}

/// Converts a light; `None` if it emits nothing. `index`: its position in the list, for messages.
pub(super) fn compile(params: &LightParams, index: usize) -> Result<Option<Light>> {
    // Check what all kinds share, then the parameters of the kind.
    let light = Source { params, index };
    light.check()?;
    let emission = match params.kind {
        LightKind::Point { radius } => light.point(radius)?,
        LightKind::Spot {
            radius,
            size,
            blend,
        } => light.spot(radius, size, blend)?,
        LightKind::Sun { angle } => light.sun(angle)?,
        LightKind::Area {
            shape,
            size,
            size_y,
            spread,
        } => match light.area(shape, [size, size_y], spread)? {
            Some(emission) => emission,
            // A light without area has no finite radiance.
            None => return Ok(None),
        },
    };
    let Emission {
        shape,
        strength,
        brightness,
    } = emission;
    // A power that overflows on a small light is an error; no power is no light.
    if !strength.is_finite() {
        return Err(Error::Spec(format!(
            "{} is too large for the light's size",
            light.name("power")
        )));
    }
    // A program whose result is known changes the strength once.
    let name = format!("lights[{index}]");
    let program = params.program.as_ref();
    let shader = program.map(|program| Shader::new(program, params.kind, &name));
    let shader = shader.transpose()?;
    let constant = shader.as_ref().and_then(Shader::constant);
    let (strength, brightness) = match constant {
        Some(factor) => (strength * factor, brightness * factor.mean_abs()),
        None => (strength, brightness),
    };
    let light = Light {
        shape,
        strength,
        brightness,
        casts_shadow: params.casts_shadow,
        visible: params.visible,
        sets: params.sets,
        group: params.group,
        max_bounces: params.max_bounces,
        shader: shader.filter(|_| constant.is_none()).map(Box::new),
    };
    Ok((brightness > 0.0 && strength.max_abs() > 0.0).then_some(light))
}

/// The parameters of a light, with the names that messages use.
struct Source<'a> {
    params: &'a LightParams,
    index: usize,
}

impl Source<'_> {
    /// Returns the name of a key for messages.
    fn name(&self, key: &str) -> String {
        format!("lights[{}]['{key}']", self.index)
    }

    /// Checks that matrix and power are finite and within range.
    fn check(&self) -> Result<()> {
        for (row, values) in self.params.to_world.iter().enumerate() {
            finite(values, || format!("{}[{row}]", self.name("to_world")))?;
        }
        finite(&self.params.power, || self.name("power"))?;
        for &p in &self.params.power {
            within(p.into(), -1e30, 1e30, || self.name("power"))?;
        }
        Ok(())
    }

    /// Checks a length.
    fn check_size(&self, value: f32, key: &str) -> Result<()> {
        within(value.into(), 0.0, 1e18, || self.name(key))
    }

    /// Checks an angle.
    fn check_angle(&self, value: f32, key: &str) -> Result<()> {
        let half_turn = std::f64::consts::PI * 1.000_001;
        within(value.into(), 0.0, half_turn, || self.name(key))
    }

    /// The error for a matrix that cannot be inverted.
    fn singular(&self) -> Error {
        Error::Spec(format!(
            "{} has an axis of length zero",
            self.name("to_world")
        ))
    }

    fn power(&self) -> Vec3 {
        Vec3::from(self.params.power)
    }

    fn position(&self) -> Vec3 {
        matrix_column(&self.params.to_world, 3)
    }

    /// A point light.
    fn point(&self, radius: f32) -> Result<Emission> {
        self.check_size(radius, "radius")?;
        Ok(self.disc(radius, None))
    }

    /// A spot light with a cone of full angle `size`.
    fn spot(&self, radius: f32, size: f32, blend: f32) -> Result<Emission> {
        self.check_size(radius, "radius")?;
        self.check_angle(size, "spot_size")?;
        finite(&[blend], || self.name("spot_blend"))?;
        let cone = Cone::new(&self.params.to_world, size, blend);
        let cone = cone.ok_or_else(|| self.singular())?;
        Ok(self.disc(radius, Some(cone)))
    }

    /// A sun of full angle `angle`, which shines along -Z: +Z points towards it.
    fn sun(&self, angle: f32) -> Result<Emission> {
        self.check_angle(angle, "angle")?;
        let axis = matrix_column(&self.params.to_world, 2);
        if axis == Vec3::ZERO {
            return Err(self.singular());
        }
        let sun = Sun::new(axis.normalized(), angle);
        Ok(Emission {
            shape: Shape::Sun(sun),
            strength: self.power() * sun.radiance_of_one(),
            brightness: self.power().mean_abs(),
        })
    }

    /// An area light, or `None` if it has no area.
    fn area(
        &self,
        outline: AreaShape,
        [size, size_y]: [f32; 2],
        spread: f32,
    ) -> Result<Option<Emission>> {
        self.check_size(size, "size")?;
        self.check_angle(spread, "spread")?;
        // Squares and disks use one size for both extents.
        let size_y = match outline {
            AreaShape::Square | AreaShape::Disk => size,
            AreaShape::Rectangle | AreaShape::Ellipse => size_y,
        };
        self.check_size(size_y, "size_y")?;
        let round = matches!(outline, AreaShape::Disk | AreaShape::Ellipse);
        let [x, y, z] = [0, 1, 2].map(|k| matrix_column(&self.params.to_world, k));
        let area = Area::new(self.position(), x * size, y * size_y, -z, round);
        let area = area.map(|area| area.with_spread(spread));
        Ok(area.map(|area| Emission {
            strength: self.power() * (1.0 / (PI * area.area())),
            shape: Shape::Area(area),
            brightness: self.power().mean_abs() / PI,
        }))
    }

    /// A disc that faces the receiver, or a sphere, with the cone of a spot light.
    fn disc(&self, radius: f32, cone: Option<Cone>) -> Emission {
        Emission {
            shape: Shape::Disc(Disc::new(self.position(), radius, cone, self.params.sphere)),
            strength: self.power() * disc_strength(radius),
            brightness: self.power().mean_abs() / (4.0 * PI),
        }
    }
}

/// Radiance of a disc light per watt, or intensity of a point light without size.
fn disc_strength(radius: f32) -> f32 {
    let intensity = 0.25 * std::f32::consts::FRAC_1_PI;
    if radius > 0.0 {
        intensity / (PI * radius * radius)
    } else {
        intensity
    }
}
