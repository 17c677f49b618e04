// SPDX-License-Identifier: GPL-3.0-or-later
//! Prefetching of the triangles that are shaded next: rays hit them in no order of memory.

use crate::scene::RenderScene;
use halfspace_ray::Hit;
use halfspace_scene::Triangles;
use prefetch_index::prefetch_index;

/// Number of hits between the prefetch of a triangle's indices, that of its vertices, and its shading (chosen: a hit
/// takes longer than an eighth of an access to memory).
const AHEAD: usize = 8;

/// The triangles of a scene that is not instanced.
pub struct Ahead<'a> {
    scene: &'a RenderScene,
    triangles: Option<&'a Triangles>,
}

impl<'a> Ahead<'a> {
    /// The triangles of a scene; of an instanced one nothing is prefetched.
    pub fn new(scene: &'a RenderScene) -> Self {
        let triangles = scene.tracer.triangles();
        Self { scene, triangles }
    }

    /// Prefetches what the hits after hit `i` need.
    #[inline(always)]
    pub fn fetch(&self, hits: &[Hit], i: usize) {
        let Some(triangles) = self.triangles else {
            return;
        };
        // First the indices, then, once they are there, the vertices. Misses have no triangle.
        if let Some(hit) = hits.get(i + 2 * AHEAD).filter(|hit| hit.is_hit()) {
            prefetch_index(triangles.indices(), hit.triangle as usize);
            self.scene.attributes.prefetch(hit.triangle);
        }
        if let Some(hit) = hits.get(i + AHEAD).filter(|hit| hit.is_hit())
            && let Some(corners) = triangles.indices().get(hit.triangle as usize)
        {
            for &corner in corners {
                prefetch_index(triangles.vertices(), corner as usize);
            }
        }
    }
}
