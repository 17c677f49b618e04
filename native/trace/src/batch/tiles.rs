// SPDX-License-Identifier: GPL-3.0-or-later
//! Loops over tiles, packets and beams: groups of consecutive rays that are traced together.

use crate::batch::{Launch, baseline};
use fearless_simd::Simd;
use halfspace_leaf::Job;
use halfspace_ray::query::{Count, Counters, NoCount};
use halfspace_ray::{Hit, RayCounters, RaySlice};

/// A traversal of a tree by tiles of rays.
pub trait TileTraversal: Sync {
    /// Largest number of rays of a tile.
    const RAYS: usize;

    /// Memory that tiles use one after another.
    type Scratch;

    /// Allocates this memory.
    fn scratch(&self) -> Self::Scratch;

    /// Traces one to [`Self::RAYS`] rays. Passes each hit to `write` with the ray's index in the tile; the last hit
    /// passed for a ray is its answer.
    fn cast_tile<S: Simd, C: Counters>(
        &self,
        simd: S,
        job: Job<'_>,
        rays: RaySlice<'_>,
        scratch: &mut Self::Scratch,
        write: &mut impl FnMut(usize, Hit),
        counters: &mut [C],
    );
}

impl Launch<'_> {
    /// Traces the rays tile by tile without counting; passes each hit to `write`.
    pub fn quick_tiles<T: TileTraversal>(&self, traversal: &T, mut write: impl FnMut(usize, Hit)) {
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = self.level.as_avx512() {
            simd.vectorize(
                #[inline(always)]
                || self.each_tile(simd, traversal, &mut write, |_| NoCount),
            );
        } else if let Some(simd) = self.level.as_avx2() {
            simd.vectorize(
                #[inline(always)]
                || self.each_tile(simd, traversal, &mut write, |_| NoCount),
            );
        } else {
            // Processors with neither take the counting version, which is compiled for them anyway.
            let mut unused = vec![RayCounters::default(); self.rays.len()];
            self.tiles(traversal, write, Some(&mut unused));
        }
        #[cfg(not(target_arch = "x86_64"))]
        fearless_simd::dispatch!(self.level, simd => {
            self.each_tile(simd, traversal, &mut write, |_| NoCount);
        });
    }

    /// Traces the rays tile by tile; passes each hit to `write`. `counters`: one per ray, or none.
    pub fn tiles<T: TileTraversal>(
        &self,
        traversal: &T,
        mut write: impl FnMut(usize, Hit),
        counters: Option<&mut [RayCounters]>,
    ) {
        match counters {
            None => self.quick_tiles(traversal, write),
            Some(counters) => {
                let mut counters = counters.iter_mut();
                baseline!(simd => {
                    self.each_tile(simd, traversal, &mut write, |_| {
                        Count::new(counters.next().expect("one set of counters per ray"))
                    });
                });
            }
        }
    }

    /// Traces the rays tile by tile with one instruction set; `counter` returns the counters of a ray.
    #[inline(always)]
    fn each_tile<S: Simd, T: TileTraversal, C: Counters>(
        &self,
        simd: S,
        traversal: &T,
        write: &mut impl FnMut(usize, Hit),
        mut counter: impl FnMut(usize) -> C,
    ) {
        let mut counters = Vec::with_capacity(T::RAYS);
        let mut scratch = traversal.scratch();
        for (tile, rays) in self.rays.chunks(T::RAYS).enumerate() {
            if C::COUNTS && self.is_cancelled() {
                return;
            }
            let first = tile * T::RAYS;
            counters.clear();
            counters.extend((first..first + rays.len()).map(&mut counter));
            traversal.cast_tile(
                simd,
                self.job(),
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
}
