// SPDX-License-Identifier: GPL-3.0-or-later
//! The surfaces that shadow rays pass, found in one traversal, which meets them in any order.
//!
//! Rays do not begin again behind each surface: the traversal asks here at each hit whether light passes, and ends at the
//! first that is opaque. The transparencies of the others are multiplied in the order of the ray, so that no bit of the
//! picture depends on the structure. It needs surfaces whose transparency does not depend on those before them: scenes
//! with media, with surfaces that lie on each other, and with programs that count surfaces go from surface to surface.

use std::cell::RefCell;

use crate::math::vector::Vec3;
use crate::path::shadow_rays::Light;
use crate::path::state::MAX_INVISIBLE;
use crate::path::wavefront::Context;
use crate::scene::surface::Surface;
use crate::values::program::Value;
use crate::values::visibility::RayKind;
use halfspace_ray::selection::Filtered;
use halfspace_ray::{Hit, HitKey, Ray};

/// The end of a list.
const NONE: u32 = u32::MAX;

/// In place of a list: an opaque surface.
const BLOCKED: u32 = NONE - 1;

/// A surface that a ray passes.
#[derive(Clone, Copy)]
struct Passed {
    key: HitKey,
    /// Its transparency; `None` if it is none for the ray.
    transparent: Option<Vec3>,
    /// Index of the ray's surface found before.
    before: u32,
}

/// The surfaces that the rays of a call pass.
#[derive(Default)]
pub struct PassedSurfaces {
    all: Vec<Passed>,
    /// Index of the last surface found of each ray, [`NONE`] or [`BLOCKED`].
    last: Vec<u32>,
    /// The surfaces of one ray.
    own: Vec<Passed>,
    hits: Vec<Hit>,
    registers: Vec<Value>,
}

impl PassedSurfaces {
    /// Traces rays to their lights.
    pub(super) fn trace(&mut self, context: &Context<'_>, rays: &[Ray], light: &[Light]) {
        self.all.clear();
        self.last.clear();
        self.last.resize(rays.len(), NONE);
        let mut hits = std::mem::take(&mut self.hits);
        hits.clear();
        hits.resize(rays.len(), Hit::MISS);
        let state = RefCell::new(&mut *self);
        let filter = |i: usize, hit: &Hit| {
            let mut state = state.borrow_mut();
            state.meet(context, (i, &rays[i]), &light[i], hit)
        };
        context.scene.tracer.sift(rays, &mut hits, &filter);
        self.hits = hits;
    }

    /// Notes what light passes at a hit. No hit is an answer.
    fn meet(
        &mut self,
        context: &Context<'_>,
        (i, ray): (usize, &Ray),
        light: &Light,
        hit: &Hit,
    ) -> Filtered {
        if self.last[i] == BLOCKED {
            return Filtered::Ended;
        }
        // A triangle in several leaves is met in each.
        let (mut at, mut seen) = (self.last[i], 0);
        while let Some(passed) = self.all.get(at as usize) {
            if passed.key.triangle == hit.triangle {
                return Filtered::Passed;
            }
            seen += u32::from(passed.transparent.is_some());
            at = passed.before;
        }
        if hit.triangle == light.aim.emitter {
            return Filtered::Passed;
        }
        let transparent = match light.through(context, ray, hit, &mut self.registers) {
            None => None,
            Some(transparent)
                if transparent.max_abs() > 0.0
                    && u32::from(light.passed) + seen < context.settings.transparent_bounces =>
            {
                Some(transparent)
            }
            _ => {
                self.last[i] = BLOCKED;
                return Filtered::Ended;
            }
        };
        self.all.push(Passed {
            key: HitKey::new(hit.t, hit.triangle),
            transparent,
            before: self.last[i],
        });
        self.last[i] = self.all.len() as u32 - 1;
        Filtered::Passed
    }

    /// Returns the light that arrives along a ray, which brings `value` without surfaces; `None` if it is blocked.
    pub(super) fn arriving(&mut self, i: usize, value: Vec3) -> Option<Vec3> {
        let mut at = self.last[i];
        if at == BLOCKED {
            return None;
        }
        self.own.clear();
        while let Some(passed) = self.all.get(at as usize) {
            self.own.push(*passed);
            at = passed.before;
        }
        self.own.sort_unstable_by(|a, b| a.key.order(b.key));
        let seen = self.own.iter().filter_map(|passed| passed.transparent);
        let value = seen.fold(value, |value, transparent| value * transparent);
        let unseen = self.own.iter().filter(|p| p.transparent.is_none()).count();
        (unseen < usize::from(MAX_INVISIBLE) && value.max_abs() > 0.0).then_some(value)
    }
}

impl Light {
    /// Returns the transparency of the surface of a hit; `None` if it is none for the ray.
    fn through(
        &self,
        context: &Context<'_>,
        ray: &Ray,
        hit: &Hit,
        registers: &mut Vec<Value>,
    ) -> Option<Vec3> {
        let scene = context.scene;
        let material = &scene.materials[scene.attributes.at(hit.triangle).material()];
        let meets = material.visible.to(RayKind::Shadow)
            && (material.catcher || !self.catchers_alone)
            && material.sets.shades(self.aim.blockers);
        if !meets {
            return None;
        }
        // Most surfaces are opaque everywhere.
        let opaque = material.opaque_shadow || !material.transparent && material.portals.is_empty();
        if opaque && material.strands.is_none() {
            return Some(Vec3::ZERO);
        }
        let way = Vec3::from(ray.d);
        let d = way.normalized();
        let surface = Surface::of(scene, hit, d, Some(ray));
        if surface.is_passed(scene, RayKind::Shadow) {
            return None;
        }
        if material.opaque_shadow {
            return Some(Vec3::ZERO);
        }
        let mut history = self.history;
        history.length += hit.t * way.length();
        Some(self.transparency(context, &surface, d, history, registers))
    }
}
