// SPDX-License-Identifier: GPL-3.0-or-later
//! Light samples and their shadow rays: of lights, of a constant background, and for ambient occlusion.

use crate::film::Shares;
use crate::light::{Arrival, Emitter, Lit, Towards, power_heuristic};
use crate::material::bsdf::{Scatter, cosine_direction};
use crate::math::vector::{Frame, Vec3};
use crate::path::random::VertexSamples;
use crate::path::shade::Shader;
use crate::path::shade::output::Output;
use crate::path::shade::scatter::FramedBsdf;
use crate::path::shadow_rays::Aim;
use crate::path::state::Path;
use crate::path::wavefront::Context;
use crate::scene::RenderScene;
use crate::scene::facet::Facet;
use crate::scene::surface::Surface;
use crate::settings::Integrator;
use crate::values::program::Value;
use crate::values::visibility::RayKind;
use halfspace_ray::{Hit, Ray};

/// Rounding errors of a point of a lamp, and of the way there: units in the last place of their coordinates (chosen).
const ROUNDING: f32 = 4.0 * f32::EPSILON;

/// Lets a shadow ray end before its light, whose direction is the way to the sampled point: an emissive triangle does
/// not shadow itself, nor does what lies behind it or, up to rounding, at a lamp; a sheet before it does.
#[inline(always)]
pub(super) fn before_light(scene: &RenderScene, light: &Arrival, ray: Ray) -> Ray {
    if !light.distance.is_finite() {
        return ray;
    }
    if let Emitter::Triangle(triangle, _) = light.emitter {
        let facet = Facet::new(scene.tracer.corners(triangle), [0.0; 3], None);
        let [t, bound] = facet.crossing(ray.o, ray.d);
        let t_max = ((t - bound) as f32).next_down();
        // A triangle along the ray is crossed anywhere.
        let t_max = if t_max > 0.5 {
            t_max.min(1.0)
        } else {
            1.0 - ROUNDING
        };
        return Ray { t_max, ..ray };
    }
    let (o, d) = (Vec3::from(ray.o), Vec3::from(ray.d));
    let rounding = ROUNDING * (1.0 + o.max_abs() / d.max_abs());
    Ray {
        t_max: 1.0 - rounding.min(0.5),
        ..ray
    }
}

impl<
    const GLOSSY: bool,
    const GLASS: bool,
    const SMOOTH: bool,
    const LOBES: usize,
    const EXTRA: bool,
> Shader<'_, GLOSSY, GLASS, SMOOTH, LOBES, EXTRA>
{
    /// Adds a shadow ray to a sample of a light if it could contribute.
    #[inline]
    pub(super) fn receive(
        &self,
        surface: &Surface<'_>,
        FramedBsdf { frame, bsdf }: FramedBsdf<'_, GLOSSY, GLASS, LOBES>,
        light: &Arrival,
        path: &Path,
        out: &mut Output<'_, EXTRA>,
    ) {
        let (scene, settings) = (self.scene, self.settings);
        // Evaluate the lobes that this light illuminates.
        let (f, pdf) = bsdf.eval_lit(frame.to_local(light.direction), light.visible);
        // Whitted's rays do not sample rough lobes, so light samples get the full weight.
        let weight = if light.pdf.is_finite() && !self.is(Integrator::Whitted) {
            power_heuristic(light.pdf, pdf)
        } else {
            1.0
        };
        let mut value = path.throughput * f * light.radiance * weight;
        if value.max_abs() > 0.0 && !matches!(light.emitter, Emitter::Lamp) {
            // Programs of triangles, background and lamps are run only if the rest contributes.
            value = value * emitter_radiance(self.context, light, path, out.light_registers);
        }
        if !(value.max_abs() > 0.0 && value.is_finite()) {
            return;
        }
        let value = settings.clamped(value, path.bounce > 0);
        let shares = || bsdf.shares(frame.to_local(light.direction), light.visible);
        let group = || emitter_group(scene, light);
        let scattered = out.scattered(path, shares, group);
        if !light.casts_shadow {
            out.add_unoccluded(value, scattered);
            return;
        }
        // Towards a light at a finite distance the direction is the vector to it, so that t_max is a fraction.
        let near = light.distance.is_finite();
        let target = near.then(|| surface.point + light.direction * light.distance);
        let ray = surface.shadow_ray::<SMOOTH>(light.direction, target, f32::INFINITY);
        let ray = before_light(scene, light, ray);
        out.cast(ray, path, value, scattered, Some(surface), Aim::at(light));
    }

    /// Adds a shadow ray towards a constant background in a direction that Whitted's rays do not follow; no light
    /// sample covers such a background.
    #[inline(always)]
    pub(super) fn sample_constant_background(
        &self,
        surface: &Surface<'_>,
        FramedBsdf { frame, bsdf }: FramedBsdf<'_, GLOSSY, GLASS, LOBES>,
        scatter: &Scatter,
        path: &Path,
        out: &mut Output<'_, EXTRA>,
    ) {
        // Only a constant, visible background is handled here; others are sampled as lights.
        let world = &self.scene.world;
        let Some(color) = world.constant().filter(|_| world.visible.to(scatter.kind)) else {
            return;
        };
        let value = path.throughput * scatter.weight * color;
        if !(value.max_abs() > 0.0 && value.is_finite()) {
            return;
        }
        let direction = frame.to_world(scatter.wo).normalized_or(surface.geometric);
        let ray = surface.ray(direction, f32::INFINITY);
        let value = self.settings.clamped(value, path.bounce > 0);
        let scattered = out.scattered(path, || bsdf.shares_of(scatter), || world.group);
        out.cast(ray, path, value, scattered, Some(surface), Aim::FREE);
    }

    /// Ambient occlusion: adds a shadow ray in a cosine-distributed direction, limited to the given range.
    #[inline(always)]
    pub(super) fn sample_occlusion(
        &self,
        surface: &Surface<'_>,
        frame: &Frame,
        random: VertexSamples,
        path: &Path,
        out: &mut Output<'_, EXTRA>,
    ) {
        // Directions below the triangle would be occluded by it.
        let direction = frame.to_world(cosine_direction(random.direction()));
        if direction.dot(surface.geometric) > 0.0 {
            let reach = self.settings.ambient_distance;
            let ray = surface.shadow_ray::<SMOOTH>(direction, None, reach);
            let scattered = out.scattered(path, || Shares::DIFFUSE, || 0);
            out.cast(
                ray,
                path,
                path.throughput,
                scattered,
                Some(surface),
                Aim::FREE,
            );
        }
    }
}

/// Returns the light group of the emitter of a light sample; 0 = none.
pub(super) fn emitter_group(scene: &RenderScene, light: &Arrival) -> u8 {
    match light.emitter {
        Emitter::Lamp | Emitter::Shaded(_) => light.group,
        Emitter::Triangle(triangle, _) => scene.indices.group(triangle as usize),
        Emitter::World => scene.world.group,
    }
}

/// Returns the radiance that the emitter of a light sample, other than a plain lamp, sends to the receiver.
/// Of a lamp with a program it is the factor on its strength.
pub(super) fn emitter_radiance(
    context: &Context<'_>,
    light: &Arrival,
    path: &Path,
    registers: &mut Vec<Value>,
) -> Vec3 {
    let scene = context.scene;
    match light.emitter {
        Emitter::Lamp => Vec3::ONE,
        Emitter::Shaded(lamp) => {
            let ray = Towards {
                from: path.receiver.point,
                direction: light.direction,
                distance: light.distance,
            };
            let lit = &mut Lit {
                images: &scene.images,
                varying: &scene.varying,
                history: path.history_after(RayKind::Diffuse, 0.0),
                registers,
            };
            scene.lights.factor(lamp, ray, lit)
        }
        Emitter::World => scene.world.radiance(
            &scene.images,
            &scene.varying,
            light.direction,
            RayKind::Diffuse,
            path.history_after(RayKind::Diffuse, 0.0),
            registers,
        ),
        Emitter::Triangle(triangle, [u, v]) => {
            // Shade the sampled point as if a diffuse ray had hit it.
            let hit = Hit {
                t: light.distance,
                triangle,
                u,
                v,
            };
            let surface = Surface::of(scene, &hit, light.direction, None);
            let point = || {
                let mut point = surface.shading_point(scene, light.direction, RayKind::Diffuse);
                point.view = Some(context.camera.view());
                point.history = path.history_after(RayKind::Diffuse, light.distance);
                point
            };
            let material = surface.material;
            let unscattered = material.unscattered_reduced(&scene.images, point, registers);
            material.coated_emission_reduced(unscattered.emission, registers, || {
                surface.cosine(light.direction)
            })
        }
    }
}
