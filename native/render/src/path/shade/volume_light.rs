// SPDX-License-Identifier: GPL-3.0-or-later
//! Light samples within media, and their shadow rays.

use crate::film::Shares;
use crate::light::{Arrival, Emitter, Receiver, Segment, power_heuristic};
use crate::math::vector::Vec3;
use crate::medium::distance::{self, LitPoint};
use crate::path::random::VertexSamples;
use crate::path::shade::light_samples::{before_light, emitter_group, emitter_radiance};
use crate::path::shade::output::Output;
use crate::path::shadow_rays::Aim;
use crate::path::state::Path;
use crate::path::wavefront::Context;
use crate::scene::media::MediumRay;
use crate::values::linking::ObjectSets;
use crate::values::visibility::RayKind;
use halfspace_ray::Ray;

/// Returns a point in a medium as a receiver of light: from all directions, and of all lights, also linked ones.
pub(super) fn receiver(point: Vec3, path: &Path) -> Receiver {
    Receiver {
        point,
        normal: Vec3::ZERO,
        sets: ObjectSets::ALL.receives,
        each: false,
        bounce: path.bounce,
    }
}

/// Adds the light that a segment in uniform media scatters towards its start, whether the path scatters there or not.
pub(super) fn light_segment<const EXTRA: bool>(
    context: &Context<'_>,
    ray: &MediumRay<'_>,
    [start, end]: [f32; 2],
    random: VertexSamples,
    path: &Path,
    out: &mut Output<'_, EXTRA>,
) {
    // Choose a light for the segment, then a point near it, with numbers that the next event has, too.
    let ([_, channel], [choose_light, u]) = (random.survival(), random.choices());
    let lights = &context.scene.lights;
    let mixture = &out.scratch.mixture;
    let segment = Segment {
        origin: ray.origin + ray.direction * start,
        direction: ray.direction,
        length: end - start,
        extinction: mixture.extinction.mean(),
    };
    let Some(chosen) = lights.choose_along(&segment, choose_light) else {
        return;
    };
    let lit = distance::sample_lit(
        mixture,
        path.throughput,
        chosen.span,
        chosen.angles,
        [channel, u],
    );
    let Some(LitPoint { distance, weight }) = lit else {
        return;
    };
    // Scatter light from there.
    let mut path = *path;
    path.throughput = path.throughput * weight;
    path.receiver = receiver(segment.origin + ray.direction * distance, &path);
    let light = lights.sample_chosen(path.receiver, chosen, random.light());
    receive(context, ray.direction, light, &path, out);
}

/// Adds a shadow ray from the receiver of a path to a light if the light could contribute. `d`: direction before.
pub(super) fn receive<const EXTRA: bool>(
    context: &Context<'_>,
    d: Vec3,
    light: Option<Arrival>,
    path: &Path,
    out: &mut Output<'_, EXTRA>,
) {
    let (scene, settings) = (context.scene, context.settings);
    let Some(light) = light else {
        return;
    };
    if !light.visible.to(RayKind::Volume) {
        return;
    }
    // Evaluate the phase function; lights that no ray can hit get the full weight.
    let (f, pdf) = out.scratch.mixture.phase(d.dot(light.direction));
    let weight = if light.pdf.is_finite() {
        power_heuristic(light.pdf, pdf)
    } else {
        1.0
    };
    let mut value = path.throughput * f * light.radiance * weight;
    if value.max_abs() > 0.0 && !matches!(light.emitter, Emitter::Lamp) {
        value = value * emitter_radiance(context, &light, path, out.light_registers);
    }
    if !(value.max_abs() > 0.0 && value.is_finite()) {
        return;
    }
    let value = settings.clamped(value, path.bounce > 0);
    let group = || emitter_group(scene, &light);
    let scattered = out.scattered(path, || Shares::VOLUME, group);
    if !light.casts_shadow {
        out.add_unoccluded(value, scattered);
        return;
    }
    let d = if light.distance.is_finite() {
        light.direction * light.distance
    } else {
        light.direction
    };
    let ray = Ray {
        o: path.receiver.point.array(),
        d: d.array(),
        t_min: 0.0,
        t_max: f32::INFINITY,
    };
    let ray = before_light(scene, &light, ray);
    out.cast(ray, path, value, scattered, None, Aim::at(&light));
}
