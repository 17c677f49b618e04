// SPDX-License-Identifier: GPL-3.0-or-later
//! The media that points lie in: those whose objects a ray from there leaves without having entered them.

use std::sync::atomic::AtomicBool;

use crate::math::vector::{Vec3, vec3};
use crate::medium::stack::{Inside, Stack};
use crate::path::calls::{Calls, Cancelled};
use crate::path::state::MAX_INVISIBLE;
use crate::scene::RenderScene;
use crate::scene::surface::Surface;
use crate::values::visibility::RayKind;
use halfspace_ray::{Hit, Ray};

/// Direction of the rays: upwards, along no axis, because edges of boxes would be hit twice or not at all.
const UPWARDS: Vec3 = vec3(0.131_3, 0.088_7, 0.987_3);

/// A ray that looks for the media of a point.
struct Search {
    point: usize,
    ray: Ray,
    /// The media entered on the way.
    entered: Stack,
    surfaces: u16,
    /// The surface passed last.
    left: u32,
}

/// Returns the media of each point, those of the background included.
///
/// # Errors
/// [`Cancelled`] if `stop` is set.
pub fn media_at(
    scene: &RenderScene,
    points: &[[f32; 3]],
    calls: &mut Calls,
    stop: &AtomicBool,
) -> Result<Vec<Stack>, Cancelled> {
    let mut outside = Stack::default();
    if scene.world.volume.is_some() {
        outside.enter(Inside::WORLD);
    }
    let mut found = vec![outside; points.len()];
    // Without volumes of materials, only the background's is there.
    if scene.materials.iter().all(|m| m.volume.is_none()) {
        return Ok(found);
    }
    let mut searches: Vec<Search> = points
        .iter()
        .enumerate()
        .map(|(point, &o)| Search {
            point,
            ray: Ray {
                o,
                d: UPWARDS.normalized().array(),
                t_min: 0.0,
                t_max: f32::INFINITY,
            },
            entered: Stack::default(),
            surfaces: 0,
            left: Hit::NONE,
        })
        .collect();
    // Trace all rays from surface to surface until they leave the scene.
    while !searches.is_empty() {
        let rays: Vec<Ray> = searches.iter().map(|s| s.ray).collect();
        let mut hits = vec![Hit::MISS; rays.len()];
        calls.cover(rays.len(), stop, |range| {
            let (rays, hits) = (&rays[range.clone()], &mut hits[range]);
            scene.tracer.closest(rays, hits, None);
        })?;
        let mut hits = hits.iter();
        searches.retain_mut(|search| {
            let hit = hits.next().copied().unwrap_or(Hit::MISS);
            let hit = scene.first(&search.ray, hit, search.left);
            search.pass(scene, &hit, &mut found)
        });
    }
    Ok(found)
}

impl Search {
    /// Passes a surface. Returns whether the search goes on.
    fn pass(&mut self, scene: &RenderScene, hit: &Hit, found: &mut [Stack]) -> bool {
        if !hit.is_hit() {
            return false;
        }
        let surface = Surface::of(scene, hit, Vec3::from(self.ray.d), Some(&self.ray));
        // Camera rays do not meet what is invisible to them.
        if let Some(medium) = surface.medium_behind()
            && surface.material.visible.to(RayKind::Camera)
        {
            if !surface.inside {
                self.entered.enter(medium);
            } else if !self.entered.leave(&medium) {
                found[self.point].enter(medium);
            }
        }
        self.ray = surface.continued(&self.ray, hit);
        self.left = hit.triangle;
        self.surfaces += 1;
        self.surfaces < MAX_INVISIBLE
    }
}
