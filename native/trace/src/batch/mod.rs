// SPDX-License-Identifier: GPL-3.0-or-later
//! Batches of rays. The instruction set, the query and the counting are chosen once per batch, outside all loops.

mod single;
mod tiles;

pub use single::SingleTraversal;
pub use tiles::TileTraversal;

use crate::shadow_cache::ShadowCache;
use fearless_simd::Level;
use halfspace_base::Monitor;
use halfspace_leaf::Job;
use halfspace_leaf::blocks::Blocks;
use halfspace_ray::frame::Frame;
use halfspace_ray::query::{Any, Best, Counters, Query};
use halfspace_ray::{FrameRay, Hit, Ray, RayRef};
use halfspace_scene::Triangles;

/// Runs the block with the instruction set that every build has, for traversals that count, record or replay. Compiling
/// them for every set takes most of the build time of this crate. Only replays are timed, and only against each other.
#[macro_export]
macro_rules! baseline {
    ($simd:ident => $block:expr) => {{
        #[cfg(target_arch = "x86_64")]
        {
            let $simd = fearless_simd::Level::new()
                .as_sse4_2()
                .expect("the build's own target has SSE 4.2");
            $block
        }
        #[cfg(not(target_arch = "x86_64"))]
        {
            fearless_simd::dispatch!(fearless_simd::Level::new(), $simd => $block)
        }
    }};
}
pub use baseline;

/// Number of rays in the batches that callers cut large ones into.
pub const USUAL: usize = 8192;

/// Rays for one structure.
#[derive(Clone, Copy)]
pub struct Batch<'a> {
    /// The triangles.
    pub scene: &'a Triangles,
    /// The frame of the structure.
    pub frame: &'a Frame,
    /// The rays.
    pub rays: &'a [Ray],
    /// The instruction set.
    pub level: Level,
    /// Whether any-hit rays first test the triangle that blocked their light last.
    pub shadow_cache: bool,
    /// The rays in the space of the instance that the structure is visited for; `None` for rays of the structure's own
    /// scene.
    pub placed: Option<&'a [FrameRay<'a>]>,
    /// Cancels the batch, whose answers then mean nothing. Kernels read it where they count; batches that are not counted
    /// are small.
    pub monitor: Option<&'a Monitor>,
}

impl<'a> Batch<'a> {
    /// Returns whether the monitor was cancelled.
    #[inline(always)]
    pub fn is_cancelled(&self) -> bool {
        self.monitor.is_some_and(Monitor::is_cancelled)
    }

    /// The batch on the leaves of one tree.
    #[inline(always)]
    pub fn on(&self, blocks: &'a Blocks) -> Launch<'a> {
        Launch {
            scene: self.scene,
            frame: self.frame,
            blocks,
            rays: self.rays,
            level: self.level,
            shadow_cache: self.shadow_cache,
            placed: self.placed,
            monitor: self.monitor,
        }
    }
}

/// A [`Batch`] on the leaves of one tree. Its methods are the loops over rays that kernels are made of.
pub struct Launch<'a> {
    /// The triangles.
    pub scene: &'a Triangles,
    /// The frame of the structure.
    pub frame: &'a Frame,
    /// The leaves.
    pub blocks: &'a Blocks,
    /// The rays.
    pub rays: &'a [Ray],
    /// The instruction set.
    pub level: Level,
    /// As [`Batch::shadow_cache`].
    pub shadow_cache: bool,
    /// As [`Batch::placed`].
    pub placed: Option<&'a [FrameRay<'a>]>,
    /// As [`Batch::monitor`].
    pub monitor: Option<&'a Monitor>,
}

/// Receives the hit of the ray with this index in the batch. It is not a generic parameter, so a traversal is compiled
/// once for all callers.
pub type Write<'a> = &'a mut dyn FnMut(usize, Hit);

impl<'a> Launch<'a> {
    /// As [`Batch::is_cancelled`].
    #[inline(always)]
    pub fn is_cancelled(&self) -> bool {
        self.monitor.is_some_and(Monitor::is_cancelled)
    }

    /// The triangles that the rays are tested against.
    #[inline(always)]
    pub fn job(&self) -> Job<'a> {
        Job {
            scene: self.scene,
            blocks: self.blocks,
        }
    }

    /// Ray `i` in the frame of the structure; `None` if it certainly misses the scene.
    #[inline(always)]
    pub fn framed(&self, i: usize) -> Option<FrameRay<'a>> {
        match self.placed {
            None => self.frame.ray(&self.rays[i]),
            Some(placed) => Some(placed[i]),
        }
    }

    /// An empty shadow cache, if the query and the batch use one.
    pub fn cache<Q: Query>(&self) -> Option<ShadowCache> {
        (Q::ANY && self.shadow_cache).then(|| ShadowCache::new(self.frame))
    }

    /// The hit with the triangle that last blocked this ray's light, if it blocks this ray too.
    #[inline(always)]
    pub fn cached<C: Counters>(
        &self,
        cache: &Option<ShadowCache>,
        ray: RayRef<'_>,
        counters: &mut C,
    ) -> Option<Hit> {
        let cache = cache.as_ref()?;
        self.blocked(cache.blocker(cache.entry(ray.ray)), ray, counters)
    }

    /// The hit with triangle `id`, if it blocks the ray. [`Hit::NONE`] blocks no ray.
    #[inline(always)]
    pub fn blocked<C: Counters>(&self, id: u32, ray: RayRef<'_>, counters: &mut C) -> Option<Hit> {
        if id == Hit::NONE {
            return None;
        }
        let mut best = Best::new(ray.frame);
        counters.test_alone();
        let blocked = best.offer::<Any, C>(
            ray,
            id,
            #[inline(always)]
            || self.scene.corners(id),
            counters,
        );
        if blocked {
            counters.spared();
        }
        blocked.then(|| best.hit())
    }
}
