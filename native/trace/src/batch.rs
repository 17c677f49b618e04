// SPDX-License-Identifier: GPL-3.0-or-later
//! Batches of rays: the instruction set, the question and the counting are chosen once here, outside
//! all loops.

use crate::shadow_cache::ShadowCache;
use fearless_simd::{Level, Simd, dispatch};
use halfspace_leaf::blocks::{Blocks, LANES};
use halfspace_leaf::{Job, Leaf};
use halfspace_ray::frame::Frame;
use halfspace_ray::path::Path;
use halfspace_ray::query::{Any, Best, Closest, Count, Counters, Log, NoCount, Query};
use halfspace_ray::replay::{CHUNK, Record};
use halfspace_ray::{FrameRay, Hit, Ray, RayCounters, RayRef, RaySlice};
use halfspace_scene::Triangles;
use std::time::{Duration, Instant};

/// Runs the block with the instruction set that every build has: for traversals that count or record, whose speed is
/// not reported. Compiling them for every set takes most of the build time of this crate.
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
            dispatch!(fearless_simd::Level::new(), $simd => $block)
        }
    }};
}
pub(crate) use baseline;

/// Number of rays transformed into the frame before the first of them is traced, so that their divisions overlap.
pub const AHEAD: usize = 8;

/// A traversal of a tree by single rays.
pub trait Walk: Sync {
    /// Buffers that rays can share one after another, such as a stack.
    type Scratch;

    /// New buffers.
    fn scratch(&self) -> Self::Scratch;

    /// Answers one ray.
    fn cast<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        triangles: Job<'_>,
        ray: RayRef<'_>,
        scratch: &mut Self::Scratch,
        counters: &mut C,
    ) -> Hit;
}

/// A traversal of a tree by tiles of rays.
pub trait TileWalk: Sync {
    /// Rays of a tile at most.
    const RAYS: usize;

    /// Buffers that tiles can share one after another.
    type Scratch;

    /// New buffers.
    fn scratch(&self) -> Self::Scratch;

    /// Finds the nearest hits of up to [`Self::RAYS`] rays, at least one, and hands each to `write`
    /// with the ray's place, the last time with its answer.
    fn cast_tile<S: Simd, C: Counters>(
        &self,
        simd: S,
        triangles: Job<'_>,
        rays: RaySlice<'_>,
        scratch: &mut Self::Scratch,
        write: &mut impl FnMut(usize, Hit),
        counters: &mut [C],
    );
}

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
}

impl<'a> Batch<'a> {
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
        }
    }
}

/// A [`Batch`] on the leaves of one tree: what kernels are made of.
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
}

/// Takes the answer of the ray with this index in the batch. It is not a generic parameter, so a traversal is compiled
/// once for all callers.
pub type Write<'a> = &'a mut dyn FnMut(usize, Hit);

impl<'a> Launch<'a> {
    /// A ray in the frame of the structure.
    #[inline(always)]
    pub fn framed(&self, i: usize) -> Option<FrameRay<'a>> {
        match self.placed {
            None => self.frame.ray(&self.rays[i]),
            Some(placed) => Some(placed[i]),
        }
    }

    /// The rays from `first` on in the frame of the structure, until `frames` is full.
    #[inline(always)]
    fn frame_ahead(&self, first: usize, frames: &mut [Option<FrameRay<'a>>; AHEAD]) {
        let left = self.rays.len() - first;
        for (i, framed) in frames.iter_mut().enumerate().take(left) {
            *framed = self.framed(first + i);
        }
    }

    /// Walks the rays one by one and hands each answer to `write` with the ray's place.
    pub fn walk<W: Walk, Q: Query>(
        &self,
        walk: &W,
        write: Write<'_>,
        counters: Option<&mut [RayCounters]>,
    ) {
        match counters {
            None => self.uncounted::<_, Q>(walk, write),
            Some(counters) => {
                let mut counters = counters.iter_mut();
                self.counted::<_, Q>(walk, write, &mut |_| {
                    Count::new(counters.next().expect("one set of counters per ray"))
                });
            }
        }
    }

    /// Traverses the rays one by one without counting. On x86-64 it is compiled for AVX2 and AVX-512, whose masks make
    /// leaf tests 3 to 8 % faster (Xeon with AVX-512, Sponza and Conference); processors with neither take the
    /// counting version, which exists for SSE 4.2 anyway.
    fn uncounted<W: Walk, Q: Query>(&self, walk: &W, write: Write<'_>) {
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = self.level.as_avx512() {
            simd.vectorize(
                #[inline(always)]
                || self.each::<_, _, Q, _>(simd, walk, write, |_| NoCount),
            );
        } else if let Some(simd) = self.level.as_avx2() {
            simd.vectorize(
                #[inline(always)]
                || self.each::<_, _, Q, _>(simd, walk, write, |_| NoCount),
            );
        } else {
            let mut unused = vec![RayCounters::default(); self.rays.len()];
            self.walk::<_, Q>(walk, write, Some(&mut unused));
        }
        #[cfg(not(target_arch = "x86_64"))]
        dispatch!(self.level, simd => {
            self.each::<_, _, Q, _>(simd, walk, write, |_| NoCount);
        });
    }

    /// Walks the rays one by one, counts what each costs and records what its leaves answer.
    pub fn record<W: Walk, Q: Query>(
        &self,
        walk: &W,
        counters: &mut [RayCounters],
        record: &mut Record,
    ) {
        // One at a time: the counters of all rays share the record.
        for (ray, counters) in self.rays.iter().zip(counters) {
            record.begin();
            let mut count = Some(Count::with(counters, Log::Answers(record)));
            let one = Launch {
                rays: std::slice::from_ref(ray),
                ..*self
            };
            one.counted::<_, Q>(walk, &mut |_, _| (), &mut |_| {
                count.take().expect("one ray")
            });
        }
    }

    /// Traces the only ray to its nearest hit and returns the path of its traversal.
    ///
    /// # Panics
    /// When there is not one ray.
    pub fn path<W: Walk>(&self, walk: &W) -> (Hit, Path) {
        assert_eq!(self.rays.len(), 1, "one ray");
        let (mut nearest, mut path) = (Hit::MISS, Path::default());
        let mut count = Some(path.count());
        self.counted::<_, Closest>(walk, &mut |_, hit| nearest = hit, &mut |_| {
            count.take().expect("one ray")
        });
        (nearest, path)
    }

    /// Traces the rays one by one; `count` returns the counters of each. Out of line, and its callers differ in values
    /// only, so one compiled traversal serves them all.
    #[inline(never)]
    fn counted<'c, W: Walk, Q: Query>(
        &self,
        walk: &W,
        write: Write<'_>,
        count: &mut dyn FnMut(usize) -> Count<'c>,
    ) {
        baseline!(simd => self.each::<_, _, Q, _>(simd, walk, write, count));
    }

    /// Walks recorded rays again without testing triangles. Tells how long each [`CHUNK`] of them
    /// took, without the time of bringing them into the frame, and returns how many did not visit
    /// the leaves that were recorded.
    pub fn replay<W: Walk, Q: Query>(
        &self,
        walk: &W,
        record: &Record,
        mut took: impl FnMut(Duration),
    ) -> usize {
        baseline!(simd => {
            self.replay_each::<_, _, Q>(simd, walk, record, &mut took)
        })
    }

    #[inline(always)]
    fn replay_each<S: Simd, W: Walk, Q: Query>(
        &self,
        simd: S,
        walk: &W,
        record: &Record,
        took: &mut impl FnMut(Duration),
    ) -> usize {
        let mut scratch = walk.scratch();
        let mut framed = Vec::with_capacity(CHUNK);
        let mut strayed = 0;
        for (chunk, rays) in self.rays.chunks(CHUNK).enumerate() {
            framed.clear();
            framed.extend(rays.iter().map(|ray| self.frame.ray(ray)));
            let start = Instant::now();
            for (i, (ray, framed)) in rays.iter().zip(&framed).enumerate() {
                let mut replay = record.replay(chunk * CHUNK + i);
                if let Some(framed) = framed {
                    walk.cast::<S, Q, _>(
                        simd,
                        Job {
                            scene: self.scene,
                            blocks: self.blocks,
                        },
                        RayRef { ray, frame: framed },
                        &mut scratch,
                        &mut replay,
                    );
                }
                strayed += usize::from(!replay.is_over());
            }
            took(start.elapsed());
        }
        strayed
    }

    #[inline(always)]
    fn each<S: Simd, W: Walk, Q: Query, C: Counters>(
        &self,
        simd: S,
        walk: &W,
        write: Write<'_>,
        mut counter: impl FnMut(usize) -> C,
    ) {
        let mut scratch = walk.scratch();
        let mut cache = self.cache::<Q>();
        let mut frames = [None; AHEAD];
        for (chunk, rays) in self.rays.chunks(AHEAD).enumerate() {
            let first = chunk * AHEAD;
            self.frame_ahead(first, &mut frames);
            for (i, (ray, framed)) in (first..).zip(rays.iter().zip(&frames)) {
                let mut counters = counter(i);
                let Some(framed) = framed else {
                    write(i, Hit::MISS);
                    continue;
                };
                if Q::ANY
                    && let Some(hit) =
                        self.cached(&cache, RayRef { ray, frame: framed }, &mut counters)
                {
                    write(i, hit);
                    continue;
                }
                let hit = walk.cast::<S, Q, C>(
                    simd,
                    Job {
                        scene: self.scene,
                        blocks: self.blocks,
                    },
                    RayRef { ray, frame: framed },
                    &mut scratch,
                    &mut counters,
                );
                if Q::ANY
                    && let Some(cache) = &mut cache
                {
                    cache.remember(cache.entry(ray), &hit);
                }
                write(i, hit);
            }
        }
    }

    /// An empty shadow cache, where one is wanted.
    pub fn cache<Q: Query>(&self) -> Option<ShadowCache> {
        (Q::ANY && self.shadow_cache).then(|| ShadowCache::new(self.scene.bounds()))
    }

    /// The hit with the triangle that blocked this ray's light last, if that blocks it again.
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

    /// The hit with this triangle, if it blocks the ray.
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

    /// Walks the rays tile by tile, without counting.
    pub fn quick_tiles<W: TileWalk>(&self, walk: &W, mut write: impl FnMut(usize, Hit)) {
        dispatch!(self.level, simd => self.each_tile(simd, walk, &mut write, |_| NoCount));
    }

    /// Walks the rays tile by tile.
    pub fn tiles<W: TileWalk>(
        &self,
        walk: &W,
        mut write: impl FnMut(usize, Hit),
        counters: Option<&mut [RayCounters]>,
    ) {
        match counters {
            None => self.quick_tiles(walk, write),
            Some(counters) => {
                let mut counters = counters.iter_mut();
                baseline!(simd => {
                    self.each_tile(simd, walk, &mut write, |_| {
                        Count::new(counters.next().expect("one set of counters per ray"))
                    });
                });
            }
        }
    }

    #[inline(always)]
    fn each_tile<S: Simd, W: TileWalk, C: Counters>(
        &self,
        simd: S,
        walk: &W,
        write: &mut impl FnMut(usize, Hit),
        mut counter: impl FnMut(usize) -> C,
    ) {
        let mut counters = Vec::with_capacity(W::RAYS);
        let mut scratch = walk.scratch();
        for (tile, rays) in self.rays.chunks(W::RAYS).enumerate() {
            let first = tile * W::RAYS;
            counters.clear();
            counters.extend((first..first + rays.len()).map(&mut counter));
            walk.cast_tile(
                simd,
                Job {
                    scene: self.scene,
                    blocks: self.blocks,
                },
                RaySlice {
                    frame: self.frame,
                    rays,
                },
                &mut scratch,
                &mut |i, hit| write(first + i, hit),
                &mut counters,
            );
        }
    }

    /// Tests every ray against all `count` triangles; both are taken in groups that stay in cache.
    pub fn brute<Q: Query>(
        &self,
        count: usize,
        write: Write<'_>,
        counters: Option<&mut [RayCounters]>,
    ) {
        const RAYS: usize = 64;
        let mut none = vec![RayCounters::default(); self.rays.len()];
        let counters = counters.unwrap_or(&mut none);
        let groups = self.rays.chunks(RAYS).zip(counters.chunks_mut(RAYS));
        let mut cache = self.cache::<Q>();
        for (group, (rays, counters)) in groups.enumerate() {
            let mut open: Vec<_> = rays
                .iter()
                .zip(counters)
                .enumerate()
                .map(|(i, (ray, counters))| {
                    let framed = self.framed(group * RAYS + i)?;
                    // Rays of a group go together, so the blockers are those of the group before.
                    let known = self.cached(
                        &cache,
                        RayRef {
                            ray,
                            frame: &framed,
                        },
                        &mut Count::new(counters),
                    );
                    let best = known.map_or_else(|| Best::new(&framed), Best::known);
                    Some((framed, best, counters, known.is_some()))
                })
                .collect();
            dispatch!(self.level, simd => self.all_triangles::<_, Q>(simd, count, rays, &mut open));
            if let Some(cache) = &mut cache {
                for (ray, state) in rays.iter().zip(&open) {
                    if let Some((_, best, ..)) = state {
                        cache.remember(cache.entry(ray), &best.hit());
                    }
                }
            }
            for (i, state) in open.iter().enumerate() {
                write(
                    group * RAYS + i,
                    state.as_ref().map_or(Hit::MISS, |s| s.1.hit()),
                );
            }
        }
    }

    #[inline(always)]
    fn all_triangles<S: Simd, Q: Query>(
        &self,
        simd: S,
        count: usize,
        rays: &[Ray],
        open: &mut [Option<(FrameRay<'_>, Best, &mut RayCounters, bool)>],
    ) {
        const TRIANGLES: usize = 32 * LANES;
        for first in (0..count).step_by(TRIANGLES) {
            let part = Leaf {
                first: Blocks::offset(first),
                count: TRIANGLES.min(count - first),
            };
            for (ray, state) in rays.iter().zip(open.iter_mut()) {
                let Some((framed, best, counters, done)) = state else {
                    continue;
                };
                if !*done {
                    let mut count = Count::new(counters);
                    let blocks = self.blocks;
                    *done = Job {
                        scene: self.scene,
                        blocks,
                    }
                    .test::<S, Q, _>(
                        simd,
                        part,
                        RayRef { ray, frame: framed },
                        framed.t_max,
                        best,
                        &mut count,
                    );
                }
            }
        }
    }
}
