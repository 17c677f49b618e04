// SPDX-License-Identifier: GPL-3.0-or-later
//! Light that a path asks for with shadow rays: that of a light, of an even world, of open surroundings.

use super::super::bsdf::{Bsdf, Scatter, cosine_direction};
use super::super::lights::{Arrival, Emitter, power_heuristic};
use super::super::path::{Numbers, Path};
use super::super::place::RayKind;
use super::super::program::Value;
use super::super::scene::RenderScene;
use super::super::settings::Integrator;
use super::super::surface::Surface;
use super::super::vector::{Frame, Vec3};
use super::{Out, Shader};
use crate::traverse::{Hit, Ray};

/// Shadow rays end a little before the light, in units of the way to it.
const BEFORE_LIGHT: f32 = 1.0 - 1e-5;

impl<const LIGHTS: bool, const GLOSSY: bool, const GLASS: bool, const SMOOTH: bool>
    Shader<'_, LIGHTS, GLOSSY, GLASS, SMOOTH>
{
    /// Sends a shadow ray to a light, if one could bring something.
    #[inline(always)]
    pub(super) fn sample_light(
        &self,
        surface: &Surface<'_>,
        (frame, bsdf): (&Frame, &Bsdf<GLOSSY, GLASS>),
        (choice, u): (f32, [f32; 2]),
        path: &Path,
        out: &mut Out<'_>,
    ) {
        let (scene, settings) = (self.scene, self.settings);
        let Some(light) = scene.lights.sample(path.receiver, choice, u) else {
            return;
        };
        let (f, pdf) = bsdf.eval_lit(frame.to_local(light.direction), light.visible);
        // Whitted's rays follow mirrors only: nothing else would find the light.
        let weight = if light.pdf.is_finite() && !self.is(Integrator::Whitted) {
            power_heuristic(light.pdf, pdf)
        } else {
            1.0
        };
        let mut value = path.throughput * f * light.radiance * weight;
        if value.max_component() > 0.0 && !matches!(light.emitter, Emitter::Lamp) {
            value = value * sent(scene, &light, out.light_registers);
        }
        if !(value.max_component() > 0.0 && value.is_finite()) {
            return;
        }
        let value = settings.clamped(value, path.bounce > 0);
        if !light.casts_shadow {
            out.sample.add(value);
            return;
        }
        let o = surface.leave_to_light::<SMOOTH>(light.direction);
        let (d, t_max) = if light.distance.is_finite() {
            let to = surface.point + light.direction * light.distance;
            (to - o, BEFORE_LIGHT)
        } else {
            (light.direction, f32::INFINITY)
        };
        let ray = Ray {
            o: o.array(),
            d: d.array(),
            t_min: 0.0,
            t_max,
        };
        out.shadows.push(ray, path.slot, value);
    }

    /// Asks whether a direction that Whitted's rays do not follow is open to a world of one colour, of which no light
    /// sample is taken.
    #[inline(always)]
    pub(super) fn meet_even_world(
        &self,
        surface: &Surface<'_>,
        direction: Vec3,
        scatter: &Scatter,
        path: &Path,
        out: &mut Out<'_>,
    ) {
        let world = &self.scene.world;
        let Some(color) = world.constant().filter(|_| world.visible.to(scatter.kind)) else {
            return;
        };
        let value = path.throughput * scatter.weight * color;
        if !(value.max_component() > 0.0 && value.is_finite()) {
            return;
        }
        let ray = Ray {
            o: surface.leave(direction).array(),
            d: direction.array(),
            t_min: 0.0,
            t_max: f32::INFINITY,
        };
        let value = self.settings.clamped(value, path.bounce > 0);
        out.shadows.push(ray, path.slot, value);
    }

    /// Ambient occlusion: light arrives from everywhere unless something near is in its way.
    #[inline(always)]
    pub(super) fn look_around(
        &self,
        surface: &Surface<'_>,
        frame: &Frame,
        random: Numbers,
        path: &Path,
        out: &mut Out<'_>,
    ) {
        let direction = frame.to_world(cosine_direction(random.direction()));
        if direction.dot(surface.geometric) > 0.0 {
            let ray = Ray {
                o: surface.leave_to_light::<SMOOTH>(direction).array(),
                d: direction.array(),
                t_min: 0.0,
                t_max: self.settings.ambient_distance,
            };
            out.shadows.push(ray, path.slot, path.throughput);
        }
    }
}

/// What the emitter of an arrival that is no lamp sends towards the receiver.
fn sent(scene: &RenderScene, light: &Arrival, registers: &mut Vec<Value>) -> Vec3 {
    match light.emitter {
        Emitter::Lamp => Vec3::ONE,
        Emitter::World => scene.world.radiance(
            &scene.images,
            &scene.varying,
            light.direction,
            RayKind::Diffuse,
            registers,
        ),
        Emitter::Triangle(triangle, [u, v]) => {
            let hit = Hit {
                t: light.distance,
                triangle,
                u,
                v,
            };
            let surface = Surface::of(scene, &hit, light.direction);
            let place = || surface.place(scene, light.direction, RayKind::Diffuse);
            let material = surface.material;
            let look = material.look(&scene.images, place, registers);
            material.dimmed(look.emission, registers, || surface.cosine(light.direction))
        }
    }
}
