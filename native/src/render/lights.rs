// SPDX-License-Identifier: GPL-3.0-or-later
//! Lights: what they are, how bright, and how a light is chosen for a point.
//!
//! Brightness is that of Cycles in Blender 5.2; every formula was checked against its renders of a
//! grey plane (the numbers are in the tests of whole renders, under `brightness`). With power P in watts:
//! - point, spot: radiant intensity I = P / 4π in the axis; a radius r makes it a disc that faces
//!   the receiver with radiance P / (4 π² r²), Blender's "soft falloff";
//! - area: radiance P / (π A) on one side, A the area in the scene;
//! - sun: irradiance E = P in W/m² on a surface facing it; radiance E / (π sin²(angle / 2)).
//!
//! A light with a size is met by every ray that sees it, those that scattered off a surface with
//! multiple importance sampling; Blender hides new lights from the camera. Light samples reach the
//! lobes whose rays see the light. Lights do not block light. A light that casts no shadow is only sampled,
//! never met.

use std::collections::HashMap;
use std::sync::Arc;

use super::check::Result;
use super::light_shapes::{LightRay, Triangle};
use super::place::RayKind;
use super::vector::Vec3;
use super::visibility::Visibility;
use super::world::DirectionMap;

mod compile;
mod light;
mod many;
mod params;

use self::compile::compile;
use self::light::{Light, Shape};
use self::many::Many;
pub use self::params::{AreaShape, LightKind, LightParams};

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
    /// Which lobes it lights.
    pub visible: Visibility,
    /// What shines: for all but lamps `radiance` is still to be multiplied by its own.
    pub emitter: Emitter,
}

/// Who sends the light of an [`Arrival`].
#[derive(Debug, Clone, Copy)]
pub enum Emitter {
    /// A lamp; its radiance is known.
    Lamp,
    /// A triangle of a glowing material, at these weights of its second and third corner.
    Triangle(u32, [f32; 2]),
    /// The background.
    World,
}

/// A triangle that glows.
#[derive(Debug, Clone, Copy)]
pub struct Glowing {
    /// Its number.
    pub triangle: u32,
    /// Which rays see it.
    pub visible: Visibility,
    /// Its corners.
    pub corners: [Vec3; 3],
    /// About what it emits, mean of the channels.
    pub radiance: f32,
}

/// A point that is lit.
#[derive(Debug, Clone, Copy)]
pub struct Receiver {
    /// Where.
    pub point: Vec3,
    /// Geometric normal towards the viewer; zero when light from behind counts as well.
    pub normal: Vec3,
}

/// All lights of a scene: lamps first, then glowing triangles, then the background.
pub struct Lights {
    lights: Vec<Light>,
    /// How many of them are lamps.
    lamps: usize,
    /// The light of each glowing triangle.
    of_triangle: HashMap<u32, u32>,
    /// The background, where it is sampled.
    map: Option<Arc<DirectionMap>>,
    many: Option<Many>,
    any_met: bool,
    any_seen: bool,
}

/// Up to this many lights each is weighed at every point; beyond, a tree is walked.
const WEIGHED: usize = 32;

impl Lights {
    /// Checks and compiles. Lights without power are left out.
    ///
    /// # Errors
    /// When a number is not finite or out of range, or a matrix flattens a light.
    pub fn new(
        params: &[LightParams],
        glowing: &[Glowing],
        map: Option<Arc<DirectionMap>>,
        map_visible: Visibility,
    ) -> Result<Self> {
        let mut lights = Vec::new();
        for (index, light) in params.iter().enumerate() {
            if let Some(light) = compile(light, index)? {
                lights.push(light);
            }
        }
        let lamps = lights.len();
        let mut of_triangle = HashMap::new();
        for glowing in glowing {
            let Some(shape) = Triangle::new(glowing.corners) else {
                continue;
            };
            let brightness = glowing.radiance * shape.area();
            if brightness > 0.0 && brightness.is_finite() {
                of_triangle.insert(glowing.triangle, lights.len() as u32);
                lights.push(Light {
                    shape: Shape::Triangle(glowing.triangle, shape),
                    strength: Vec3::ONE,
                    brightness,
                    casts_shadow: true,
                    visible: glowing.visible,
                });
            }
        }
        if let Some(map) = &map {
            lights.push(Light {
                shape: Shape::World,
                strength: Vec3::ONE,
                brightness: map.mean * std::f32::consts::PI,
                casts_shadow: true,
                visible: map_visible,
            });
        }
        let any_met = lights[..lamps].iter().any(Light::can_be_met);
        let seen = |light: &Light| light.can_be_met() && light.visible.to(RayKind::Camera);
        let any_seen = lights[..lamps].iter().any(seen);
        let many = (lights.len() > WEIGHED).then(|| Many::new(&lights, lamps));
        Ok(Self {
            lights,
            lamps,
            of_triangle,
            map,
            many,
            any_met,
            any_seen,
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

    /// Whether a camera ray can.
    pub fn any_seen(&self) -> bool {
        self.any_seen
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
            Shape::Triangle(_, triangle) => triangle.sample(receiver.point, u),
            Shape::World => self.map.as_ref().map(|map| {
                let (direction, pdf) = map.sample(u);
                LightRay {
                    direction,
                    distance: f32::INFINITY,
                    factor: 1.0,
                    pdf,
                }
            }),
        }?;
        let emitter = match &light.shape {
            Shape::Triangle(number, _) => Emitter::Triangle(*number, Triangle::weights(u)),
            Shape::World => Emitter::World,
            _ => Emitter::Lamp,
        };
        let LightRay {
            direction,
            distance,
            factor,
            pdf,
        } = ray;
        let met = light.can_be_met();
        let scale = if light.has_size() {
            factor / pdf
        } else {
            factor
        };
        let radiance = light.strength * (scale / probability);
        let pdf = if met {
            pdf * probability
        } else {
            f32::INFINITY
        };
        (radiance.max_component() > 0.0 && radiance.is_finite()).then_some(Arrival {
            direction,
            distance,
            radiance,
            pdf,
            casts_shadow: light.casts_shadow,
            visible: light.visible,
            emitter,
        })
    }

    /// The density per solid angle with which [`Self::sample`] finds a point of a triangle, seen
    /// from `receiver` at a distance and under a cosine; 0 where it never does.
    pub fn triangle_pdf(&self, receiver: Receiver, triangle: u32, distance: f32, cos: f32) -> f32 {
        let Some(&index) = self.of_triangle.get(&triangle) else {
            return 0.0;
        };
        match &self.lights[index as usize].shape {
            Shape::Triangle(_, shape) => {
                let pdf = distance * distance / (shape.area() * cos).max(1e-30);
                pdf * self.probability(receiver, index as usize)
            }
            _ => 0.0,
        }
    }

    /// The density per solid angle with which [`Self::sample`] finds the background.
    pub fn world_pdf(&self, receiver: Receiver, direction: Vec3) -> f32 {
        match &self.map {
            Some(map) => map.pdf(direction) * self.probability(receiver, self.lights.len() - 1),
            None => 0.0,
        }
    }

    /// Adds up the light that a ray of this kind from `receiver` meets at distances in `span`, each weighted
    /// against the density `pdf` with which its direction was chosen there (infinite: no light
    /// sample could have found it).
    pub fn met(
        &self,
        receiver: Receiver,
        direction: Vec3,
        span: [f32; 2],
        pdf: f32,
        kind: RayKind,
    ) -> Vec3 {
        let [t_min, t_max] = span;
        let mut sum = Vec3::ZERO;
        let mut add = |index: usize| {
            let light = &self.lights[index];
            if !light.can_be_met() || !light.visible.to(kind) {
                return;
            }
            let found = match &light.shape {
                Shape::Disc(disc) => disc.intersect(receiver.point, direction, t_max),
                Shape::Sun(sun) => sun.intersect(direction, t_max),
                Shape::Area(area) => area.intersect(receiver.point, direction, t_max),
                Shape::Triangle(..) | Shape::World => None,
            };
            let Some(LightRay {
                factor,
                pdf: density,
                distance,
                ..
            }) = found
            else {
                return;
            };
            if distance < t_min {
                return;
            }
            let weight = if pdf.is_finite() {
                power_heuristic(pdf, density * self.probability(receiver, index))
            } else {
                1.0
            };
            sum += light.strength * (factor * weight);
        };
        match &self.many {
            None => (0..self.lamps).for_each(add),
            Some(many) => {
                many.met.along(receiver.point, direction, &mut add);
                let suns = many.far.iter().map(|&f| f as usize);
                suns.filter(|&f| f < self.lamps).for_each(add);
            }
        }
        sum
    }

    fn choose(&self, receiver: Receiver, choice: f32) -> Option<(usize, f32)> {
        let n = self.lights.len();
        if n == 1 {
            return Some((0, 1.0));
        }
        if let Some(many) = &self.many {
            return many.choose(&self.lights, receiver, choice);
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
        if let Some(many) = &self.many {
            return many.probability(&self.lights, receiver, index);
        }
        let total: f32 = self.lights.iter().map(|l| l.importance(receiver)).sum();
        if total > 0.0 {
            self.lights[index].importance(receiver) / total
        } else {
            0.0
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
