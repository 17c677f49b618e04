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
//! A light with a size is met by every ray that sees it, those that scattered off a surface with
//! multiple importance sampling; Blender hides new lights from the camera. Light samples reach the
//! lobes whose rays see the light. Lights do not block light. A light that casts no shadow is only sampled,
//! never met.

use std::collections::HashMap;
use std::sync::Arc;

use super::camera::matrix_column;
use super::check::{Error, Result, finite, within};
use super::light_shapes::{Area, Disc, LightRay, Sun, Triangle};
use super::light_tree::{Ball, LightTree};
use super::place::RayKind;
use super::vector::Vec3;
use super::visibility::Visibility;
use super::world::DirectionMap;

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
    /// Which rays see it.
    pub visible: Visibility,
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

enum Shape {
    Disc(Disc),
    Sun(Sun),
    Area(Area),
    Triangle(u32, Triangle),
    World,
}

struct Light {
    shape: Shape,
    /// Radiance of a light with a size, intensity or irradiance of one without.
    strength: Vec3,
    /// Mean of power-like strength, for choosing.
    brightness: f32,
    casts_shadow: bool,
    visible: Visibility,
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

/// What chooses among more lights than can be weighed one by one.
struct Many {
    /// Everything that has a place.
    tree: LightTree,
    /// Lamps that a ray can meet and that have a place.
    met: LightTree,
    /// Suns and the background.
    far: Vec<u32>,
    /// Running sum of their brightness, 0 to 1, for when they are many as well.
    far_running: Vec<f32>,
    far_brightness: f32,
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

impl Many {
    fn new(lights: &[Light], lamps: usize) -> Self {
        let ball = |(i, light): (usize, &Light)| light.ball(i as u32);
        let all = lights.iter().enumerate();
        let near: Vec<Ball> = all.clone().filter_map(ball).collect();
        let met = all
            .clone()
            .take(lamps)
            .filter(|(_, light)| light.can_be_met())
            .filter_map(ball)
            .collect();
        let far: Vec<u32> = all
            .filter(|(_, light)| light.is_far())
            .map(|(i, _)| i as u32)
            .collect();
        let mut sum = 0.0_f64;
        let mut running: Vec<f64> = far
            .iter()
            .map(|&f| {
                sum += f64::from(lights[f as usize].brightness);
                sum
            })
            .collect();
        running.iter_mut().for_each(|r| *r /= sum);
        Self {
            tree: LightTree::new(near, lights.len()),
            met: LightTree::new(met, lights.len()),
            far,
            far_running: running.into_iter().map(|r| r as f32).collect(),
            far_brightness: sum as f32,
        }
    }

    /// The share of the choices that go to suns and the background.
    fn share_of_far(&self, receiver: Receiver) -> Option<f32> {
        let (near, far) = (self.tree.importance(receiver), self.far_brightness);
        match (near > 0.0, far > 0.0) {
            // A bound says little about what really arrives, so neither is starved.
            (true, true) => Some((far / (near + far)).clamp(0.1, 0.9)),
            (true, false) => Some(0.0),
            (false, true) => Some(1.0),
            (false, false) => None,
        }
    }

    fn far_probability(&self, position: usize) -> f32 {
        let before = position.checked_sub(1).map_or(0.0, |p| self.far_running[p]);
        self.far_running[position] - before
    }

    fn choose(&self, lights: &[Light], receiver: Receiver, choice: f32) -> Option<(usize, f32)> {
        let share = self.share_of_far(receiver)?;
        if choice < share {
            let left = choice / share;
            let position = self.far_running.partition_point(|&c| c <= left);
            let position = position.min(self.far.len() - 1);
            let index = self.far[position] as usize;
            let probability = self.far_probability(position) * share;
            return (lights[index].importance(receiver) > 0.0).then_some((index, probability));
        }
        let left = ((choice - share) / (1.0 - share)).min(1.0 - f32::EPSILON);
        let (index, probability) = self.tree.choose(receiver, left)?;
        Some((index, probability * (1.0 - share)))
    }

    fn probability(&self, lights: &[Light], receiver: Receiver, index: usize) -> f32 {
        let Some(share) = self.share_of_far(receiver) else {
            return 0.0;
        };
        if lights[index].is_far() {
            let position = self.far.partition_point(|&f| (f as usize) < index);
            self.far_probability(position) * share
        } else {
            self.tree.probability(receiver, index) * (1.0 - share)
        }
    }
}

impl Light {
    fn has_size(&self) -> bool {
        match &self.shape {
            Shape::Disc(disc) => disc.radius > 0.0,
            Shape::Sun(sun) => sun.has_size(),
            Shape::Area(_) | Shape::Triangle(..) | Shape::World => true,
        }
    }

    fn is_far(&self) -> bool {
        matches!(self.shape, Shape::Sun(_) | Shape::World)
    }

    /// A ball around a light that has a place.
    fn ball(&self, light: u32) -> Option<Ball> {
        let (centre, radius) = match &self.shape {
            Shape::Disc(disc) => (disc.centre(), disc.radius),
            Shape::Area(area) => area.ball(),
            Shape::Triangle(_, triangle) => triangle.ball(),
            Shape::Sun(_) | Shape::World => return None,
        };
        Some(Ball {
            centre,
            radius,
            brightness: self.brightness,
            light,
        })
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
                Shape::Triangle(_, triangle) => {
                    let (centre, radius) = triangle.ball();
                    let ball = Ball {
                        centre,
                        radius,
                        brightness: 1.0,
                        light: 0,
                    };
                    ball.importance(receiver)
                }
                Shape::World => 1.0,
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
        visible: params.visible,
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
