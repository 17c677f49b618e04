// SPDX-License-Identifier: GPL-3.0-or-later
//! Paths through the portals of a surface.

use crate::light::Receiver;
use crate::material::closure::Unscattered;
use crate::math::vector::Vec3;
use crate::path::beams::source::Source;
use crate::path::shade::output::Output;
use crate::path::state::Path;
use crate::scene::RenderScene;
use crate::scene::surface::Surface;
use halfspace_ray::Ray;

/// Squared distance within which a portal is at the surface itself, as in Cycles.
const HERE: f32 = 1e-9;

/// Passes a portal of the surface with the probability of their part, seen along the unit direction `d`. `choice`: a
/// random number in [0, 1). Returns what is left of it if the path stays at the surface; otherwise the next ray, unless
/// the path has passed too many surfaces. Never inlined, because few scenes have portals.
#[cold]
#[inline(never)]
pub(super) fn pass<const EXTRA: bool>(
    scene: &RenderScene,
    surface: &Surface<'_>,
    unscattered: &Unscattered,
    d: Vec3,
    choice: f32,
    path: &mut Path,
    out: &mut Output<'_, EXTRA>,
) -> Result<f32, Option<Ray>> {
    let portals = &surface.material.portals;
    let weights = |k: usize| portals[k].color(out.registers).mean();
    let passing: f32 = (0..portals.len()).map(weights).sum();
    let staying = unscattered.transparent.mean() + unscattered.scattering + unscattered.holdout;
    let total = passing + staying;
    if !(passing > 0.0 && total.is_finite()) {
        return Ok(choice);
    }
    // Choose a portal, or the remainder, by their weights; rounding at the end keeps the last portal.
    let mut left = choice * total;
    let mut chosen = None;
    for (k, portal) in portals.iter().enumerate() {
        let weight = weights(k);
        if weight > 0.0 {
            chosen = Some((portal, weight / total));
            if left < weight {
                break;
            }
        }
        left -= weight;
        if k + 1 == portals.len() && staying > 0.0 {
            path.throughput *= total / staying;
            return Ok((left / staying).clamp(0.0, 1.0 - f32::EPSILON));
        }
    }
    let Some((portal, probability)) = chosen else {
        return Ok(choice);
    };
    path.throughput = path.throughput * portal.color(out.registers) * (1.0 / probability);
    let [position, direction] = portal.exit(out.registers);
    let direction = direction.normalized_or(d);
    let position = position - Vec3::from(scene.varying.origin);
    let next = if (position - surface.point).length2() > HERE {
        Ray {
            o: position.array(),
            d: direction.array(),
            t_min: 0.0,
            t_max: f32::INFINITY,
        }
    } else {
        surface.ray(direction, f32::INFINITY)
    };
    out.cross(surface);
    out.next = Source::None;
    path.receiver = Receiver {
        point: Vec3::from(next.o),
        ..path.receiver
    };
    path.go_through();
    Err(Some(next))
}
