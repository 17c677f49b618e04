// SPDX-License-Identifier: GPL-3.0-or-later
//! Brute force: every ray against every triangle, without a tree.

use crate::batch::{Batch, Launch, Write};
use crate::kernel::{Kernel, SingleRays, store};
use fearless_simd::{Simd, dispatch};
use halfspace_base::error::{Error, Result};
use halfspace_leaf::Leaf;
use halfspace_leaf::blocks::{Blocks, LANES};
use halfspace_ray::path::Path;
use halfspace_ray::query::{Any, Best, Closest, Count, Query};
use halfspace_ray::replay::{Record, Recording};
use halfspace_ray::{FrameRay, Hit, Ray, RayCounters, RayRef};
use std::sync::Arc;

/// Number of rays that are tested together against each group of triangles, so that both stay in the cache.
const RAYS: usize = 64;

/// Number of triangles of a group.
const TRIANGLES: usize = 32 * LANES;

/// The kernel of brute force.
#[derive(Debug)]
struct Brute {
    /// One leaf of all triangles.
    leaves: Arc<Blocks>,
    /// Number of triangles.
    count: usize,
}

/// The kernel of brute force over a leaf of `count` triangles.
pub fn brute(leaves: &Arc<Blocks>, count: usize) -> Arc<dyn SingleRays> {
    Arc::new(Brute {
        leaves: leaves.clone(),
        count,
    })
}

impl<Q: Query> Kernel<Q> for Brute {
    fn trace(&self, batch: &Batch<'_>, answers: &mut [Q::Answer]) {
        let launch = batch.on(&self.leaves);
        launch.uncounted_brute::<Q>(self.count, &mut store::<Q>(answers));
    }

    fn count(
        &self,
        batch: &Batch<'_>,
        answers: &mut [Q::Answer],
        counters: &mut [RayCounters],
    ) -> bool {
        let launch = batch.on(&self.leaves);
        let mut counters = counters.iter_mut();
        launch.brute::<Q>(self.count, &mut store::<Q>(answers), &mut |_| {
            Count::new(counters.next().expect("one set of counters per ray"))
        });
        true
    }

    fn counts(&self) -> bool {
        true
    }
}

impl SingleRays for Brute {
    fn cast(
        &self,
        batch: &Batch<'_>,
        any: bool,
        write: Write<'_>,
        counters: Option<&mut [RayCounters]>,
    ) {
        let Some(counters) = counters else {
            let launch = batch.on(&self.leaves);
            return if any {
                launch.uncounted_brute::<Any>(self.count, write);
            } else {
                launch.uncounted_brute::<Closest>(self.count, write);
            };
        };
        let mut counters = counters.iter_mut();
        self.observe(batch, any, write, &mut |_| {
            Count::new(counters.next().expect("one set of counters per ray"))
        });
    }

    fn observe<'c>(
        &self,
        batch: &Batch<'_>,
        any: bool,
        write: Write<'_>,
        count: &mut dyn FnMut(usize) -> Count<'c>,
    ) {
        let launch = batch.on(&self.leaves);
        if any {
            launch.brute::<Any>(self.count, write, count);
        } else {
            launch.brute::<Closest>(self.count, write, count);
        }
    }

    fn path(&self, batch: &Batch<'_>, any: bool) -> (Hit, Path) {
        let (mut found, mut path) = (Hit::MISS, Path::default());
        let counters = std::slice::from_mut(&mut path.counters);
        self.cast(batch, any, &mut |_, hit| found = hit, Some(counters));
        (found, path)
    }

    fn record(&self, _: &Batch<'_>, _: bool, _: &mut [RayCounters], _: &mut Record) -> Result<()> {
        Err(Error::Spec("brute has no leaves to record".to_owned()))
    }

    fn replay(&self, _: &Batch<'_>, _: &Recording) -> (Vec<f64>, usize) {
        unreachable!("brute force records nothing")
    }
}

/// A ray of a group.
struct RayState<'a, 'c> {
    frame: FrameRay<'a>,
    best: Best,
    counters: Count<'c>,
    /// Whether the answer is final.
    done: bool,
}

impl Launch<'_> {
    /// [`Self::brute`] without counting.
    fn uncounted_brute<Q: Query>(&self, count: usize, write: Write<'_>) {
        let mut unused = vec![RayCounters::default(); self.rays.len()];
        let mut unused = unused.iter_mut();
        self.brute::<Q>(count, write, &mut |_| {
            Count::new(unused.next().expect("one set of counters per ray"))
        });
    }

    /// Tests every ray against all `count` triangles; passes each hit to `write`. `counter` returns the counters of
    /// each ray.
    fn brute<'c, Q: Query>(
        &self,
        count: usize,
        write: Write<'_>,
        counter: &mut dyn FnMut(usize) -> Count<'c>,
    ) {
        let mut cache = self.cache::<Q>();
        for (group, rays) in self.rays.chunks(RAYS).enumerate() {
            if self.is_cancelled() {
                return;
            }
            // Test the blockers that the previous group left in the cache.
            let mut states: Vec<_> = (rays.iter().enumerate())
                .map(|(i, ray)| {
                    let mut counters = counter(group * RAYS + i);
                    let frame = self.framed(group * RAYS + i)?;
                    let own = RayRef { ray, frame: &frame };
                    let known = self.cached(&cache, own, &mut counters);
                    Some(RayState {
                        best: known.map_or_else(|| Best::new(&frame), Best::known),
                        frame,
                        counters,
                        done: known.is_some(),
                    })
                })
                .collect();
            dispatch!(self.level, simd => {
                self.all_triangles::<_, Q>(simd, count, rays, &mut states);
            });
            if let Some(cache) = &mut cache {
                for (ray, state) in rays.iter().zip(&states) {
                    if let Some(state) = state {
                        cache.remember(cache.entry(ray), &state.best.hit());
                    }
                }
            }
            for (i, state) in states.iter().enumerate() {
                let hit = state.as_ref().map_or(Hit::MISS, |state| state.best.hit());
                write(group * RAYS + i, hit);
            }
        }
    }

    /// Tests the rays of a group against all `count` triangles. `None` stands for a ray that misses the scene.
    #[inline(always)]
    fn all_triangles<S: Simd, Q: Query>(
        &self,
        simd: S,
        count: usize,
        rays: &[Ray],
        states: &mut [Option<RayState<'_, '_>>],
    ) {
        for first in (0..count).step_by(TRIANGLES) {
            if self.is_cancelled() {
                return;
            }
            let part = Leaf {
                first: Blocks::offset(first),
                count: TRIANGLES.min(count - first),
            };
            for (ray, state) in rays.iter().zip(states.iter_mut()) {
                let Some(state) = state else {
                    continue;
                };
                if !state.done {
                    let frame = &state.frame;
                    state.done = self.job().test::<S, Q, _>(
                        simd,
                        part,
                        RayRef { ray, frame },
                        frame.t_max,
                        &mut state.best,
                        &mut state.counters,
                    );
                }
            }
        }
    }
}
