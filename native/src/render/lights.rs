// SPDX-License-Identifier: GPL-3.0-or-later
//! Lights: what they are, how bright, and how a light is chosen for a point.
//!
//! Brightness is that of Cycles in Blender 5.2; every formula was checked against its renders of a
//! grey plane (the numbers are in the tests of [`super::light_shapes`]). With power P in watts:
//! - point, spot: radiant intensity I = P / 4π in the axis; a radius r makes it a disc that faces
//!   the receiver with radiance P / (4 π² r²), Blender's "soft falloff";
//! - area: radiance P / (π A) on one side, A the area in the scene;
//! - sun: irradiance E = P in W/m² on a surface facing it; radiance E / (π sin²(angle / 2)).
//!
//! A light with a size is met by every ray that scattered off a surface, with multiple importance
//! sampling, but never by camera rays: this is what Cycles does with Blender's default ray
//! visibility of lights. Lights do not block light. A light that casts no shadow is only sampled,
//! never met.

use super::camera::matrix_column;
use super::check::{Error, Result, finite, within};
use super::light_shapes::{Area, Disc, LightRay, Sun};
use super::vector::Vec3;

/// Outline of an area light.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AreaShape {
    /// `size` × `size`.
    Square,
    /// `size` × `size_y`.
    Rectangle,
    /// A circle of diameter `size`.
    Disk,
    /// An ellipse with diameters `size` and `size_y`.
    Ellipse,
}

/// What kind of light, with its own numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LightKind {
    /// Shines in all directions.
    Point {
        /// Soft size, scene units; 0 allowed.
        radius: f32,
    },
    /// A point light with a cone.
    Spot {
        /// Soft size, scene units; 0 allowed.
        radius: f32,
        /// Full angle of the cone, radians.
        size: f32,
        /// Share of the cone over which it fades, 0..1.
        blend: f32,
    },
    /// Infinitely far.
    Sun {
        /// Full angle of its disc, radians.
        angle: f32,
    },
    /// A flat emitter.
    Area {
        /// Outline.
        shape: AreaShape,
        /// Extent along the light's X before `to_world`.
        size: f32,
        /// Extent along the light's Y before `to_world`.
        size_y: f32,
    },
}

/// A light as its user describes it. It shines along its own -Z.
#[derive(Debug, Clone, PartialEq)]
pub struct LightParams {
    /// Kind and shape.
    pub kind: LightKind,
    /// Light to scene frame; rows, column vectors.
    pub to_world: [[f64; 4]; 4],
    /// Watts (sun: W/m²) per colour, linear.
    pub power: [f32; 3],
    /// Whether surfaces block it.
    pub casts_shadow: bool,
}

/// A sample of the light arriving at a point.
#[derive(Debug, Clone, Copy)]
pub struct Arrival {
    /// Unit direction towards the light.
    pub direction: Vec3,
    /// Distance to it; infinite for a sun.
    pub distance: f32,
    /// Radiance ÷ density, the choice of the light included.
    pub radiance: Vec3,
    /// Density per solid angle, the choice included; infinite when no ray can meet the light.
    pub pdf: f32,
    /// Whether the shadow ray decides.
    pub casts_shadow: bool,
}

/// A point that is lit.
#[derive(Debug, Clone, Copy)]
pub struct Receiver {
    /// Where.
    pub point: Vec3,
    /// Geometric normal towards the viewer; zero when light from behind counts as well.
    pub normal: Vec3,
}

enum Shape {
    Disc(Disc),
    Sun(Sun),
    Area(Area),
}

struct Light {
    shape: Shape,
    /// Radiance of a light with a size, intensity or irradiance of one without.
    strength: Vec3,
    /// Mean of power-like strength, for choosing.
    brightness: f32,
    casts_shadow: bool,
}

/// All lights of a scene.
pub struct Lights {
    lights: Vec<Light>,
    /// Running sum of the choice probabilities when there are too many to weigh at each point.
    cumulative: Vec<f32>,
    any_met: bool,
}

/// Up to this many lights each is weighed at every point; beyond, by power alone.
const WEIGHED: usize = 32;

impl Lights {
    /// Checks and compiles. Lights without power are left out.
    ///
    /// # Errors
    /// When a number is not finite or out of range, or a matrix flattens a light.
    pub fn new(params: &[LightParams]) -> Result<Self> {
        let mut lights = Vec::new();
        for (index, light) in params.iter().enumerate() {
            if let Some(light) = compile(light, index)? {
                lights.push(light);
            }
        }
        let total: f64 = lights.iter().map(|l| f64::from(l.brightness)).sum();
        let mut sum = 0.0;
        let cumulative = lights
            .iter()
            .map(|l| {
                sum += f64::from(l.brightness) / total;
                sum as f32
            })
            .collect();
        let any_met = lights.iter().any(Light::can_be_met);
        Ok(Self {
            lights,
            cumulative,
            any_met,
        })
    }

    /// Whether there is no light at all.
    pub fn is_empty(&self) -> bool {
        self.lights.is_empty()
    }

    /// Whether a ray can meet a light.
    pub fn any_met(&self) -> bool {
        self.any_met
    }

    /// Chooses a light and a point on it. `choice` and `u` lie in [0, 1).
    #[inline]
    pub fn sample(&self, receiver: Receiver, choice: f32, u: [f32; 2]) -> Option<Arrival> {
        let (index, probability) = self.choose(receiver, choice)?;
        let light = &self.lights[index];
        let ray = match &light.shape {
            Shape::Disc(disc) => disc.sample(receiver.point, u),
            Shape::Sun(sun) => sun.sample(u),
            Shape::Area(area) => area.sample(receiver.point, u),
        }?;
        let LightRay {
            direction,
            distance,
            factor,
            pdf,
        } = ray;
        let met = light.can_be_met();
        let density = if met { pdf } else { 1.0 };
        let scale = if light.has_size() {
            factor / pdf
        } else {
            factor
        };
        let radiance = light.strength * (scale / probability);
        let pdf = if met {
            density * probability
        } else {
            f32::INFINITY
        };
        (radiance.max_component() > 0.0 && radiance.is_finite()).then_some(Arrival {
            direction,
            distance,
            radiance,
            pdf,
            casts_shadow: light.casts_shadow,
        })
    }

    /// Adds up the light that a ray from `receiver` meets at distances in `span`, each weighted
    /// against the density `pdf` with which its direction was chosen there (infinite: no light
    /// sample could have found it).
    pub fn met(&self, receiver: Receiver, direction: Vec3, span: [f32; 2], pdf: f32) -> Vec3 {
        let [t_min, t_max] = span;
        let mut sum = Vec3::ZERO;
        for (index, light) in self.lights.iter().enumerate() {
            if !light.can_be_met() {
                continue;
            }
            let found = match &light.shape {
                Shape::Disc(disc) => disc.intersect(receiver.point, direction, t_max),
                Shape::Sun(sun) => sun.intersect(direction, t_max),
                Shape::Area(area) => area.intersect(receiver.point, direction, t_max),
            };
            let Some(LightRay {
                factor,
                pdf: density,
                distance,
                ..
            }) = found
            else {
                continue;
            };
            if distance < t_min {
                continue;
            }
            let weight = if pdf.is_finite() {
                power_heuristic(pdf, density * self.probability(receiver, index))
            } else {
                1.0
            };
            sum += light.strength * (factor * weight);
        }
        sum
    }

    fn choose(&self, receiver: Receiver, choice: f32) -> Option<(usize, f32)> {
        let n = self.lights.len();
        if n == 1 {
            return Some((0, 1.0));
        }
        if n > WEIGHED {
            let index = self.cumulative.partition_point(|&c| c <= choice).min(n - 1);
            return Some((index, self.by_power(index)));
        }
        let mut weights = [0.0; WEIGHED];
        let mut total = 0.0;
        for (weight, light) in weights.iter_mut().zip(&self.lights) {
            *weight = light.importance(receiver);
            total += *weight;
        }
        if total.is_nan() || total <= 0.0 {
            return None;
        }
        let mut left = choice * total;
        let mut chosen = None;
        for (index, &weight) in weights[..n].iter().enumerate() {
            if weight > 0.0 {
                chosen = Some((index, weight / total));
                if left < weight {
                    break;
                }
                left -= weight;
            }
        }
        chosen
    }

    /// The probability with which [`Self::choose`] takes a light.
    fn probability(&self, receiver: Receiver, index: usize) -> f32 {
        let n = self.lights.len();
        if n == 1 {
            return 1.0;
        }
        if n > WEIGHED {
            return self.by_power(index);
        }
        let total: f32 = self.lights.iter().map(|l| l.importance(receiver)).sum();
        if total > 0.0 {
            self.lights[index].importance(receiver) / total
        } else {
            0.0
        }
    }

    fn by_power(&self, index: usize) -> f32 {
        self.cumulative[index]
            - if index > 0 {
                self.cumulative[index - 1]
            } else {
                0.0
            }
    }
}

impl Light {
    fn has_size(&self) -> bool {
        match &self.shape {
            Shape::Disc(disc) => disc.radius > 0.0,
            Shape::Sun(sun) => sun.has_size(),
            Shape::Area(_) => true,
        }
    }

    fn can_be_met(&self) -> bool {
        self.has_size() && self.casts_shadow
    }

    /// Roughly the irradiance the light could give; zero only where it gives none.
    fn importance(&self, receiver: Receiver) -> f32 {
        self.brightness
            * match &self.shape {
                Shape::Disc(disc) => disc.importance(receiver.point, receiver.normal),
                Shape::Sun(sun) => sun.importance(receiver.normal),
                Shape::Area(area) => area.importance(receiver.point, receiver.normal),
            }
    }
}

/// Veach and Guibas 1995, §3.2, exponent 2: the weight of the technique with density `a`.
#[inline(always)]
pub fn power_heuristic(a: f32, b: f32) -> f32 {
    // Divided by the larger one, so that squares neither overflow nor vanish.
    if a >= b {
        let r = b / a;
        1.0 / (1.0 + r * r)
    } else {
        let r = a / b;
        r * r / (1.0 + r * r)
    }
}

fn compile(params: &LightParams, index: usize) -> Result<Option<Light>> {
    let name = |key: &str| format!("lights[{index}]['{key}']");
    for (row, values) in params.to_world.iter().enumerate() {
        finite(values, || format!("{}[{row}]", name("to_world")))?;
    }
    finite(&params.power, || name("power"))?;
    for &p in &params.power {
        within(p.into(), 0.0, 1e30, || name("power"))?;
    }
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
    let (shape, strength, brightness) = match params.kind {
        LightKind::Point { radius } => {
            size(radius, "radius")?;
            let disc = Disc::new(position, radius, None);
            (
                Shape::Disc(disc),
                power * disc_strength(radius),
                power.mean() / (4.0 * pi),
            )
        }
        LightKind::Spot {
            radius,
            size: cone,
            blend,
        } => {
            size(radius, "radius")?;
            angle(cone, "spot_size")?;
            finite(&[blend], || name("spot_blend"))?;
            let cone = super::light_shapes::Cone::new(&params.to_world, cone, blend);
            let disc = Disc::new(position, radius, Some(cone.ok_or_else(flat)?));
            (
                Shape::Disc(disc),
                power * disc_strength(radius),
                power.mean() / (4.0 * pi),
            )
        }
        LightKind::Sun { angle: full } => {
            angle(full, "angle")?;
            let axis = matrix_column(&params.to_world, 2);
            if axis == Vec3::ZERO {
                return Err(flat());
            }
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
            let v = match shape {
                AreaShape::Square | AreaShape::Disk => u,
                AreaShape::Rectangle | AreaShape::Ellipse => size_y,
            };
            size(v, "size_y")?;
            let round = matches!(shape, AreaShape::Disk | AreaShape::Ellipse);
            let [x, y, z] = [0, 1, 2].map(|k| matrix_column(&params.to_world, k));
            let Some(area) = Area::new(position, x * u, y * v, -z, round) else {
                // A light without area has no radiance to give.
                return Ok(None);
            };
            let strength = power * (1.0 / (pi * area.area()));
            (Shape::Area(area), strength, power.mean() / pi)
        }
    };
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
    };
    Ok((brightness > 0.0 && strength.max_component() > 0.0).then_some(light))
}

/// Radiance of a disc light per watt, or intensity of a point without size.
fn disc_strength(radius: f32) -> f32 {
    let intensity = 0.25 * std::f32::consts::FRAC_1_PI;
    if radius > 0.0 {
        intensity / (std::f32::consts::PI * radius * radius)
    } else {
        intensity
    }
}
