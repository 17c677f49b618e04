// SPDX-License-Identifier: GPL-3.0-or-later
//! Loops over rays that are traced one by one.

use crate::batch::{Launch, Write, baseline};
use crate::late::Late;
use fearless_simd::Simd;
use halfspace_leaf::Job;
use halfspace_ray::columns::{Columns, TOGETHER};
use halfspace_ray::path::Path;
use halfspace_ray::query::{Best, Count, Counters, Log, Query};
use halfspace_ray::replay::{CHUNK, Record};
use halfspace_ray::selection::{HitFilter, Sieve};
use halfspace_ray::{FrameRay, Hit, RayCounters, RayRef};
use std::time::{Duration, Instant};

/// A traversal of a tree by single rays.
pub trait SingleTraversal: Sync {
    /// Memory that rays use one after another, such as a stack.
    type Scratch;

    /// Counts nothing: [`halfspace_ray::query::NoCountLate`] where it pays to defer the verdict on a hit.
    type Uncounted: Counters + Default;

    /// Allocates this memory.
    fn scratch(&self) -> Self::Scratch;

    /// Traces one ray. With [`Counters::LATE`] the verdict on its hit may be deferred.
    fn cast<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        job: Job<'_>,
        ray: RayRef<'_>,
        scratch: &mut Self::Scratch,
        counters: &mut C,
    ) -> Best;
}

impl<'a> Launch<'a> {
    /// Fills `frames` with the rays from `first` on, in the frame of the structure: regular ones by vectors, the others
    /// one by one.
    #[inline(always)]
    fn frame_ahead<S: Simd>(
        &self,
        simd: S,
        first: usize,
        columns: &mut Columns,
        frames: &mut [Option<FrameRay<'a>>; TOGETHER],
    ) {
        let rays = &self.rays[first..];
        let together = self.placed.is_none() && self.frame.is_unscaled();
        if together {
            columns.fill(simd, self.frame, rays);
        }
        for (i, framed) in frames.iter_mut().enumerate().take(rays.len()) {
            *framed = if together && columns.is_regular(i) {
                columns.ray(i)
            } else {
                self.framed_alone(first + i)
            };
        }
    }

    /// [`Self::framed`], compiled once for all traversals.
    #[inline(never)]
    fn framed_alone(&self, i: usize) -> Option<FrameRay<'a>> {
        self.framed(i)
    }

    /// Traces the rays one by one; passes each hit to `write`. `counters`: one per ray, or none.
    pub fn trace<T: SingleTraversal, Q: Query>(
        &self,
        traversal: &T,
        write: Write<'_>,
        counters: Option<&mut [RayCounters]>,
    ) {
        match counters {
            None => self.uncounted::<_, Q>(traversal, write),
            Some(counters) => {
                let mut counters = counters.iter_mut();
                self.counted::<_, Q>(traversal, write, &mut |_| {
                    Count::new(counters.next().expect("one set of counters per ray"))
                });
            }
        }
    }

    /// Traces the rays one by one without counting. On x86-64 it is compiled for AVX2 and AVX-512, whose masks make
    /// leaf tests 3 to 8 % faster (Xeon with AVX-512, Sponza and Conference); processors with neither take the
    /// counting version, which exists for SSE 4.2 already.
    fn uncounted<T: SingleTraversal, Q: Query>(&self, traversal: &T, write: Write<'_>) {
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = self.level.as_avx512() {
            simd.vectorize(
                #[inline(always)]
                || self.each::<_, _, Q, _>(simd, traversal, write, |_| T::Uncounted::default()),
            );
        } else if let Some(simd) = self.level.as_avx2() {
            simd.vectorize(
                #[inline(always)]
                || self.each::<_, _, Q, _>(simd, traversal, write, |_| T::Uncounted::default()),
            );
        } else {
            let mut unused = vec![RayCounters::default(); self.rays.len()];
            self.trace::<_, Q>(traversal, write, Some(&mut unused));
        }
        #[cfg(not(target_arch = "x86_64"))]
        fearless_simd::dispatch!(self.level, simd => {
            self.each::<_, _, Q, _>(simd, traversal, write, |_| T::Uncounted::default());
        });
    }

    /// Traces the rays one by one, and passes the nearest hit of each that the filter keeps to `write`. Returns `false`, and
    /// does nothing, on processors without AVX2: rays that are counted answer the same, see [`Log::Filtered`].
    pub fn sifted<T: SingleTraversal, Q: Query>(
        &self,
        traversal: &T,
        write: Write<'_>,
        filter: HitFilter<'_>,
    ) -> bool {
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = self.level.as_avx2() {
            simd.vectorize(
                #[inline(always)]
                || self.each::<_, _, Q, _>(simd, traversal, write, |ray| Sieve { filter, ray }),
            );
            return true;
        }
        let _ = (traversal, write, filter);
        false
    }

    /// Traces the rays one by one, counts the work of each and records the answers of its leaves.
    pub fn record<T: SingleTraversal, Q: Query>(
        &self,
        traversal: &T,
        counters: &mut [RayCounters],
        record: &mut Record,
    ) {
        // Launch each ray separately, because the counters of all rays share the record.
        for (ray, counters) in self.rays.iter().zip(counters) {
            if self.is_cancelled() {
                return;
            }
            record.begin();
            let mut count = Some(Count::with(counters, Log::Answers(record)));
            let one = Launch {
                rays: std::slice::from_ref(ray),
                ..*self
            };
            one.counted::<_, Q>(traversal, &mut |_, _| (), &mut |_| {
                count.take().expect("one ray")
            });
        }
    }

    /// Traces the only ray and returns its hit, with the path of its traversal.
    ///
    /// # Panics
    /// When there is not exactly one ray.
    pub fn path<T: SingleTraversal, Q: Query>(&self, traversal: &T) -> (Hit, Path) {
        assert_eq!(self.rays.len(), 1, "one ray");
        let (mut found, mut path) = (Hit::MISS, Path::default());
        let mut count = Some(path.count());
        self.counted::<_, Q>(traversal, &mut |_, hit| found = hit, &mut |_| {
            count.take().expect("one ray")
        });
        (found, path)
    }

    /// Traces the rays one by one; `count` returns the counters of each. It is out of line and its callers differ in
    /// values only, so one compiled traversal serves them all.
    #[inline(never)]
    pub fn counted<'c, T: SingleTraversal, Q: Query>(
        &self,
        traversal: &T,
        write: Write<'_>,
        count: &mut dyn FnMut(usize) -> Count<'c>,
    ) {
        baseline!(simd => self.each::<_, _, Q, _>(simd, traversal, write, count));
    }

    /// Traces recorded rays again without testing triangles. Passes to `took` the time of each [`CHUNK`] of rays, without
    /// that of their transform into the frame; returns the number of rays that did not visit the recorded leaves.
    pub fn replay<T: SingleTraversal, Q: Query>(
        &self,
        traversal: &T,
        record: &Record,
        mut took: impl FnMut(Duration),
    ) -> usize {
        baseline!(simd => {
            self.replay_each::<_, _, Q>(simd, traversal, record, &mut took)
        })
    }

    /// [`Self::replay`] for one instruction set.
    #[inline(always)]
    fn replay_each<S: Simd, T: SingleTraversal, Q: Query>(
        &self,
        simd: S,
        traversal: &T,
        record: &Record,
        took: &mut impl FnMut(Duration),
    ) -> usize {
        let mut scratch = traversal.scratch();
        let mut framed = Vec::with_capacity(CHUNK);
        let mut strayed = 0;
        // Transform each chunk into the frame before its time starts.
        for (chunk, rays) in self.rays.chunks(CHUNK).enumerate() {
            framed.clear();
            framed.extend(rays.iter().map(|ray| self.frame.ray(ray)));
            let start = Instant::now();
            for (i, (ray, framed)) in rays.iter().zip(&framed).enumerate() {
                let mut replay = record.replay(chunk * CHUNK + i);
                if let Some(frame) = framed {
                    let ray = RayRef { ray, frame };
                    let (job, scratch) = (self.job(), &mut scratch);
                    traversal.cast::<S, Q, _>(simd, job, ray, scratch, &mut replay);
                }
                strayed += usize::from(!replay.is_over());
            }
            took(start.elapsed());
        }
        strayed
    }

    /// Traces the rays one by one with one instruction set; `counter` returns the counters of a ray.
    #[inline(always)]
    fn each<S: Simd, T: SingleTraversal, Q: Query, C: Counters>(
        &self,
        simd: S,
        traversal: &T,
        write: Write<'_>,
        mut counter: impl FnMut(usize) -> C,
    ) {
        let mut scratch = traversal.scratch();
        let mut cache = self.cache::<Q>();
        let mut columns = Columns::default();
        let mut frames = [None; TOGETHER];
        let mut late = Late::default();
        for (chunk, rays) in self.rays.chunks(TOGETHER).enumerate() {
            if C::COUNTS && self.is_cancelled() {
                return;
            }
            let first = chunk * TOGETHER;
            self.frame_ahead(simd, first, &mut columns, &mut frames);
            for (i, (ray, framed)) in (first..).zip(rays.iter().zip(&frames)) {
                let mut counters = counter(i);
                let Some(frame) = framed else {
                    write(i, Hit::MISS);
                    continue;
                };
                // Test the last blocker of a shadow ray's light before the tree.
                let ray = RayRef { ray, frame };
                if Q::ANY
                    && let Some(hit) = self.cached(&cache, ray, &mut counters)
                {
                    write(i, hit);
                    continue;
                }
                let (job, scratch) = (self.job(), &mut scratch);
                let mut best = traversal.cast::<S, Q, C>(simd, job, ray, scratch, &mut counters);
                // Batch the exact tests of proven hits; answer all other rays at once.
                match best.held() {
                    Some(held) if C::LATE && self.frame.is_unscaled() => {
                        late.push(simd, i, self.rays, frame, held, write);
                        continue;
                    }
                    _ => {}
                }
                let hit = best.answer(ray);
                if Q::ANY
                    && let Some(cache) = &mut cache
                {
                    cache.remember(cache.entry(ray.ray), &hit);
                }
                write(i, hit);
            }
        }
        if C::LATE {
            late.settle(simd, self.rays, write);
        }
    }
}
