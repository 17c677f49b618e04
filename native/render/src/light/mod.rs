// SPDX-License-Identifier: GPL-3.0-or-later
//! Lights: shape, brightness, and the choice of one for a point.
//!
//! Brightness is that of Cycles in Blender 5.2; every formula was checked against its renders of a grey plane
//! (`brightness` in the tests of whole renders has the numbers). With power P in watts:
//! - point, spot: radiant intensity I = P / 4π on the axis; a radius r makes it a disc that faces the receiver with
//!   radiance P / (4 π² r²), Blender's "soft falloff";
//! - area: radiance P / (π A) on one side, where A is the area in the scene;
//! - sun: irradiance E = P in W/m² on a surface facing it; radiance E / (π sin²(angle / 2)).
//!
//! Every ray that sees a light with a size can hit it; scattered rays then use multiple importance sampling.
//! Blender hides new lights from the camera. A light sample contributes to the lobes whose rays see the light.
//! Lights do not occlude each other, and a light that casts no shadow is only sampled, never hit.

use std::collections::HashMap;
use std::sync::Arc;

use crate::check::Result;
use crate::light::compile::compile;
use crate::light::direction_map::DirectionMap;
use crate::light::many::Many;
use crate::light::prepared::{Light, Shape};
use crate::light::several::{Weights, pick};
use crate::light::shapes::{LightRay, Triangle};
use crate::math::vector::Vec3;
use crate::values::image::Image;
use crate::values::linking::LightSets;
use crate::values::varying::Varying;
use crate::values::visibility::{RayKind, Visibility};

mod arrival;
mod compile;
pub mod direction_map;
mod division;
mod emission;
mod many;
mod params;
mod prepared;
mod programs;
mod segment;
mod several;
mod shapes;
mod tree;
pub mod world;

pub use crate::light::arrival::{Arrival, EmissiveTriangle, Emitter, Reach, Receiver};
pub use crate::light::params::{AreaShape, LampProgram, LightKind, LightParams};
pub use crate::light::programs::{Lit, Towards};
pub use crate::light::segment::{Angles, Segment};

/// All lights of a scene: lamps first, then emissive triangles, then the background.
pub struct Lights {
    lights: Vec<Light>,
    /// Number of lamps.
    lamps: usize,
    /// The light of each emissive triangle.
    of_triangle: HashMap<u32, u32>,
    /// The background, if it is sampled as a light.
    map: Option<Arc<DirectionMap>>,
    /// Choice by trees, if there are more than [`MAX_COMPARED`] lights.
    many: Option<Many>,
    any_hittable: bool,
    any_camera_visible: bool,
    /// Whether several lights are sampled at a point.
    several: bool,
}

/// Up to this number of lights the importance of each is computed at every point; beyond it, a tree is traversed.
const MAX_COMPARED: usize = 32;

impl Lights {
    /// Checks the lamps and prepares all lights for sampling. Lights without power are left out.
    ///
    /// # Errors
    /// If a number is not finite or out of range, or the matrix of a light is singular.
    pub fn new(
        params: &[LightParams],
        emissive: &[EmissiveTriangle],
        map: Option<Arc<DirectionMap>>,
        map_visible: Visibility,
        images: &[Image],
        varying: &Varying,
    ) -> Result<Self> {
        // Compile the lamps; those without power are left out.
        let mut lights = Vec::new();
        for (index, light) in params.iter().enumerate() {
            let Some(mut light) = compile(light, index)? else {
                continue;
            };
            if let Some(shader) = &light.shader {
                shader.check(images.len(), &format!("lights[{index}]"))?;
                light.brightness *= shader.mean(&light.shape, images, varying);
            }
            lights.push(light);
        }
        // Emissive triangles: their radiance comes from the material, so the strength is 1.
        let lamps = lights.len();
        let mut of_triangle = HashMap::new();
        for emissive in emissive {
            let Some(shape) = Triangle::new(emissive.corners) else {
                continue;
            };
            // Radiance multiplied by area is the intensity along the normal.
            let brightness = emissive.radiance * shape.area();
            if brightness > 0.0 && brightness.is_finite() {
                of_triangle.insert(emissive.triangle, lights.len() as u32);
                lights.push(Light {
                    shape: Shape::Triangle(emissive.triangle, shape),
                    strength: Vec3::ONE,
                    brightness,
                    casts_shadow: true,
                    visible: emissive.visible,
                    sets: emissive.sets,
                    group: 0,
                    max_bounces: u32::MAX,
                    shader: None,
                });
            }
        }
        // The background: its irradiance on a surface is π times its mean radiance.
        if let Some(map) = &map {
            lights.push(Light {
                shape: Shape::World,
                strength: Vec3::ONE,
                brightness: map.mean * std::f32::consts::PI,
                casts_shadow: true,
                visible: map_visible,
                sets: LightSets::default(),
                group: 0,
                max_bounces: u32::MAX,
                shader: None,
            });
        }
        // Only lamps are hit here; triangles and background are hit as surfaces and as misses.
        let any_hittable = lights[..lamps].iter().any(Light::is_hittable);
        let seen = |light: &Light| light.is_hittable() && light.visible.to(RayKind::Camera);
        let any_camera_visible = lights[..lamps].iter().any(seen);
        // Few lights are compared one by one, many through trees.
        let many = (lights.len() > MAX_COMPARED).then(|| Many::new(&lights, lamps));
        let mut made = Self {
            lights,
            lamps,
            of_triangle,
            map,
            many,
            any_hittable,
            any_camera_visible,
            several: false,
        };
        made.several = made.are_several();
        Ok(made)
    }

    /// Limits the number of bounces before light samples see the background, and what blocks them.
    pub fn limit_background(&mut self, max_bounces: u32, casts_shadow: bool) {
        if self.map.is_some()
            && let Some(background) = self.lights.last_mut()
        {
            background.max_bounces = max_bounces;
            background.casts_shadow = casts_shadow;
        }
    }

    /// Whether [`Self::sample_several`] is worth its time.
    pub fn several(&self) -> bool {
        self.several
    }

    /// Whether there are no lights.
    pub fn is_empty(&self) -> bool {
        self.lights.is_empty()
    }

    /// Whether rays can hit a lamp.
    pub fn any_hittable(&self) -> bool {
        self.any_hittable
    }

    /// Whether only some objects shade a light.
    pub fn any_blockers(&self) -> bool {
        self.lights.iter().any(|light| light.sets.blockers != 0)
    }

    /// Whether camera rays can hit a lamp.
    pub fn any_camera_visible(&self) -> bool {
        self.any_camera_visible
    }

    /// Chooses a light and a point on it. `choice` and `u`: random numbers in [0, 1). Returns `None` if no light
    /// arrives.
    #[inline]
    pub fn sample(&self, receiver: Receiver, choice: f32, u: [f32; 2]) -> Option<Arrival> {
        // Choose a light, then a point on it or a direction towards it.
        let (index, probability) = self.choose(receiver, choice)?;
        self.arrive(receiver, index, probability, u)
    }

    /// Samples a point on a light that was chosen with this probability.
    #[inline]
    fn arrive(
        &self,
        receiver: Receiver,
        index: usize,
        probability: f32,
        u: [f32; 2],
    ) -> Option<Arrival> {
        let light = &self.lights[index];
        if !light.shines_on(receiver) || u32::from(receiver.bounce) > light.max_bounces {
            return None;
        }
        let mut weights = [0.0; 2];
        let ray = match &light.shape {
            Shape::Disc(disc) => disc.sample(receiver.point, u),
            Shape::Sun(sun) => sun.sample(u),
            Shape::Area(area) => area.sample(receiver.point, u),
            Shape::Triangle(_, triangle) => {
                let (ray, at) = triangle.sample(receiver.point, u)?;
                weights = at;
                Some(ray)
            }
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
        // The radiance of triangles and background is left to the caller, who has their programs.
        let emitter = match &light.shape {
            Shape::Triangle(number, _) => Emitter::Triangle(*number, weights),
            Shape::World => Emitter::World,
            _ if light.shader.is_some() => Emitter::Shaded(index as u32),
            _ => Emitter::Lamp,
        };
        // Divide by the density and the probability; a light that cannot be hit gets an infinite density, which
        // gives its sample the full weight.
        let LightRay {
            direction,
            distance,
            factor,
            pdf,
        } = ray;
        // Only a light that rays can hit competes with scattered rays.
        let hittable = light.is_hittable();
        let scale = if light.has_size() {
            factor / pdf
        } else {
            factor
        };
        let radiance = light.strength * (scale / probability);
        let pdf = if hittable {
            pdf * probability
        } else {
            f32::INFINITY
        };
        (radiance.max_abs() > 0.0 && radiance.is_finite()).then_some(Arrival {
            direction,
            distance,
            radiance,
            pdf,
            casts_shadow: light.casts_shadow,
            visible: light.visible,
            blockers: light.sets.blockers,
            group: light.group,
            emitter,
        })
    }

    /// Returns the factor that the program of a lamp computes for a ray that arrives there; 1 without a program.
    pub fn factor(&self, lamp: u32, ray: Towards, lit: &mut Lit<'_>) -> Vec3 {
        let light = &self.lights[lamp as usize];
        match &light.shader {
            Some(shader) => shader.factor(&light.shape, ray, lit),
            None => Vec3::ONE,
        }
    }

    /// Returns the density per solid angle with which [`Self::sample`] finds a point of a triangle, at this
    /// distance and cosine from `receiver`; 0 if the triangle is not a light.
    pub fn triangle_pdf(&self, receiver: Receiver, triangle: u32, distance: f32, cos: f32) -> f32 {
        let Some(&index) = self.of_triangle.get(&triangle) else {
            return 0.0;
        };
        match &self.lights[index as usize].shape {
            Shape::Triangle(_, shape) => {
                let pdf = shape.density(receiver.point, distance, cos);
                pdf * self.probability(receiver, index as usize)
            }
            _ => 0.0,
        }
    }

    /// Returns the factor on the emission of a triangle that a ray from `receiver` hits; `pdf`: the density of the ray,
    /// infinite if light samples cannot find it; `distance`, `cos`: as for [`Self::triangle_pdf`].
    pub fn triangle_weight(
        &self,
        receiver: Receiver,
        pdf: f32,
        triangle: u32,
        distance: f32,
        cos: f32,
    ) -> f32 {
        let index = self.of_triangle.get(&triangle);
        let Some(light) = index.map(|&index| &self.lights[index as usize]) else {
            return 1.0;
        };
        if !light.shines_on(receiver) {
            return 0.0;
        }
        if !pdf.is_finite() {
            return 1.0;
        }
        if !light.is_hittable() {
            // Light samples alone find what only some objects shade.
            return 0.0;
        }
        power_heuristic(pdf, self.triangle_pdf(receiver, triangle, distance, cos))
    }

    /// Returns the density per solid angle with which [`Self::sample`] finds this direction of the background.
    pub fn world_pdf(&self, receiver: Receiver, direction: Vec3) -> f32 {
        match &self.map {
            Some(map) => map.pdf(direction) * self.probability(receiver, self.lights.len() - 1),
            None => 0.0,
        }
    }

    /// Like [`Self::radiance_through`], through vacuum.
    pub fn radiance_along(
        &self,
        reach: Reach,
        pdf: f32,
        kind: RayKind,
        group: Option<u8>,
        lit: &mut Lit<'_>,
    ) -> Vec3 {
        self.radiance_through(reach, pdf, kind, group, lit, |_| Vec3::ONE)
    }

    /// Adds up the light of all lamps that a ray of this kind hits within its reach.
    /// `pdf`: density of the ray's direction, against which each light is weighted by multiple importance sampling;
    /// infinite if light samples cannot find it. `group`: the light group of the lamps that count; `None` = all.
    /// `transmittance`: of the way to a lamp at this distance.
    #[inline(always)]
    pub fn radiance_through(
        &self,
        reach: Reach,
        pdf: f32,
        kind: RayKind,
        group: Option<u8>,
        lit: &mut Lit<'_>,
        mut transmittance: impl FnMut(f32) -> Vec3,
    ) -> Vec3 {
        let Reach {
            receiver,
            direction,
            span: [t_min, t_max],
        } = reach;
        let mut sum = Vec3::ZERO;
        let mut add = |index: usize| {
            let light = &self.lights[index];
            let other = group.is_some_and(|group| group != light.group);
            let shines = light.visible.to(kind) && light.shines_on(receiver);
            if !light.is_hittable() || !shines || other {
                return;
            }
            // Triangles and background are hit by the scene's rays, not here.
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
            // The ray may start past this light.
            if distance < t_min {
                return;
            }
            // Weigh against the density with which a light sample finds this point.
            let weight = if pdf.is_finite() {
                power_heuristic(pdf, density * self.probability(receiver, index))
            } else {
                1.0
            };
            let mut radiance = light.strength * (factor * weight);
            if light.shader.is_some() {
                let ray = Towards {
                    from: receiver.point,
                    direction,
                    distance,
                };
                radiance = radiance * self.factor(index as u32, ray, lit);
            }
            sum += radiance * transmittance(distance);
        };
        // Test all lamps, or those that the tree finds plus the suns.
        match &self.many {
            None => (0..self.lamps).for_each(add),
            Some(many) => {
                many.hittable.along(receiver.point, direction, &mut add);
                let suns = many.far.iter().map(|&f| f as usize);
                suns.filter(|&f| f < self.lamps).for_each(add);
            }
        }
        sum
    }

    /// Chooses a light for a receiver. Returns its index and its probability.
    fn choose(&self, receiver: Receiver, choice: f32) -> Option<(usize, f32)> {
        // One light needs no choice, many lights a tree.
        let n = self.lights.len();
        if n == 1 {
            return Some((0, 1.0));
        }
        if let Some(many) = &self.many {
            return many.choose(&self.lights, receiver, choice);
        }
        // Sample in proportion to the importance of each light.
        let Weights { each, total } = self.weights(receiver)?;
        let index = pick(&each[..n], choice * total)?;
        Some((index, each[index] / total))
    }

    /// Returns the probability with which [`Self::choose`] chooses a light.
    fn probability(&self, receiver: Receiver, index: usize) -> f32 {
        // The same three cases as in `choose`.
        let n = self.lights.len();
        if n == 1 {
            return 1.0;
        }
        if let Some(many) = &self.many {
            return many.probability(&self.lights, receiver, index);
        }
        if receiver.each {
            return self.several_probability(receiver, index);
        }
        let total: f32 = self.lights.iter().map(|l| l.importance(receiver)).sum();
        if total > 0.0 {
            self.lights[index].importance(receiver) / total
        } else {
            0.0
        }
    }
}

/// Weight of the technique with density `a` against one with density `b`: power heuristic with exponent 2, Veach
/// and Guibas 1995, §3.2.
#[inline(always)]
pub fn power_heuristic(a: f32, b: f32) -> f32 {
    // Divide by the larger density, so that the squares neither overflow nor underflow.
    if a >= b {
        let r = b / a;
        1.0 / (1.0 + r * r)
    } else {
        let r = a / b;
        r * r / (1.0 + r * r)
    }
}
