// SPDX-License-Identifier: GPL-3.0-or-later
//! The kernels of camera rays, and of shadow rays.

use crate::rays::Sorted;
use crate::shadow::{LIGHTS, Reversal, occluded};
use crate::traversal::{Scratch, Traversal};
use fearless_simd::{Simd, dispatch};
use halfspace_leaf::Job;
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::octree_nodes::Octree;
use halfspace_ray::query::{Any, Closest, Count, Counters, NoCount, Query};
use halfspace_ray::{Hit, Ray, RayCounters, RaySlice};
use halfspace_trace::batch::Batch;
use halfspace_trace::kernel::Kernel;
use std::marker::PhantomData;
use std::sync::Arc;

/// Largest number of rays in a batch. Four times as many save a few steps, and take longer: allocators return so much
/// memory to the system, and half of the time is spent on getting it back.
const BATCH: usize = 1 << 19;

/// Camera rays as beams that begin with the whole image.
#[derive(Debug)]
struct PolygonBeams {
    tree: Arc<Octree>,
    leaves: Arc<Blocks>,
    /// Rays go on singly where fewer than this are left together.
    least: u32,
}

/// Camera rays as polygons through octants with links; where fewer than `least` rays are left together they go on
/// singly.
pub fn octants(tree: &Arc<Octree>, leaves: &Arc<Blocks>, least: u32) -> Arc<dyn Kernel<Closest>> {
    Arc::new(PolygonBeams {
        tree: tree.clone(),
        leaves: leaves.clone(),
        least,
    })
}

impl PolygonBeams {
    /// Traces the rays with one instruction set and the given counters.
    #[inline(always)]
    fn run<S: Simd, C: Counters>(
        &self,
        simd: S,
        batch: &Batch<'_>,
        answers: &mut [Hit],
        counters: &mut [C],
    ) {
        answers.fill(Hit::MISS);
        let Some(first) = batch.rays.first() else {
            return;
        };
        let origin = batch.frame.point(first.o);
        let sorted = if self.has_beams(batch, first, origin) {
            Sorted::new(simd, batch.frame, batch.rays, first.o)
        } else {
            Sorted {
                rest: (0..).take(batch.rays.len()).collect(),
                ..Sorted::default()
            }
        };
        self.traverse::<S, Closest, C>(simd, batch, answers, counters, sorted, origin);
    }

    /// Traces sorted rays from an origin.
    #[inline(always)]
    fn traverse<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        batch: &Batch<'_>,
        answers: &mut [Hit],
        counters: &mut [C],
        sorted: Sorted,
        origin: [f32; 3],
    ) {
        let mut traversal = Traversal {
            query: PhantomData::<Q>,
            tree: &self.tree,
            least: self.least,
            job: Job {
                scene: batch.scene,
                blocks: &self.leaves,
            },
            slice: RaySlice {
                frame: batch.frame,
                rays: batch.rays,
            },
            answers,
            counters,
            sorted,
            scratch: Scratch::default(),
        };
        traversal.run(simd, origin);
    }

    /// Whether beams from the first ray's origin are correct: the frame keeps it exactly, and it is not too far for
    /// steps from cell to cell.
    fn has_beams(&self, batch: &Batch<'_>, first: &Ray, origin: [f32; 3]) -> bool {
        let finite = first.o.iter().all(|x| x.is_finite());
        finite
            && batch.frame.is_unscaled()
            && batch.frame.map().is_exact(origin)
            && self.tree.is_near(origin)
    }
}

impl Kernel<Closest> for PolygonBeams {
    fn trace(&self, batch: &Batch<'_>, answers: &mut [Hit]) {
        let mut none = vec![NoCount; batch.rays.len()];
        dispatch!(batch.level, simd => self.run(simd, batch, answers, &mut none));
    }

    fn count(&self, batch: &Batch<'_>, answers: &mut [Hit], counters: &mut [RayCounters]) -> bool {
        let mut counters: Vec<_> = counters.iter_mut().map(Count::new).collect();
        dispatch!(batch.level, simd => self.run(simd, batch, answers, &mut counters));
        true
    }

    fn counts(&self) -> bool {
        true
    }

    fn batch(&self) -> Option<usize> {
        Some(BATCH)
    }
}

/// Shadow rays of point lights as beams that begin with all rays of a light.
#[derive(Debug)]
struct ShadowPolygons(PolygonBeams);

/// Shadow rays as polygons from their light through octants with links; where fewer than `least` rays are left together,
/// and where rays have no light in common, they go singly.
pub fn shadow_octants(
    tree: &Arc<Octree>,
    leaves: &Arc<Blocks>,
    least: u32,
) -> Arc<dyn Kernel<Any>> {
    Arc::new(ShadowPolygons(PolygonBeams {
        tree: tree.clone(),
        leaves: leaves.clone(),
        least,
    }))
}

impl ShadowPolygons {
    /// Traces the rays light by light, then those without a light.
    #[inline(always)]
    fn run<S: Simd, C: Counters>(
        &self,
        simd: S,
        batch: &Batch<'_>,
        answers: &mut [bool],
        counters: &mut [C],
    ) {
        let mut hits = vec![Hit::MISS; batch.rays.len()];
        let mut rest: Vec<u32> = (0..).take(batch.rays.len()).collect();
        let reversal = Reversal::new(batch);
        for _ in 0..LIGHTS {
            let Some(seen) = reversal
                .as_ref()
                .and_then(|own| own.seen(batch.rays, &rest))
            else {
                break;
            };
            // Leave rays singly where beams would take few of them.
            if seen.count < self.0.least as usize || !self.0.tree.is_near(seen.light) {
                break;
            }
            let mut sorted = Sorted::new(simd, batch.frame, &seen.rays, seen.light);
            let others = std::mem::take(&mut sorted.rest);
            rest.retain(|id| others.binary_search(id).is_ok());
            self.0
                .traverse::<S, Any, C>(simd, batch, &mut hits, counters, sorted, seen.light);
        }
        let sorted = Sorted {
            rest,
            ..Sorted::default()
        };
        self.0
            .traverse::<S, Any, C>(simd, batch, &mut hits, counters, sorted, [0.0; 3]);
        occluded(&hits, answers);
    }
}

impl Kernel<Any> for ShadowPolygons {
    fn trace(&self, batch: &Batch<'_>, answers: &mut [bool]) {
        let mut none = vec![NoCount; batch.rays.len()];
        dispatch!(batch.level, simd => self.run(simd, batch, answers, &mut none));
    }

    fn count(&self, batch: &Batch<'_>, answers: &mut [bool], counters: &mut [RayCounters]) -> bool {
        let mut counters: Vec<_> = counters.iter_mut().map(Count::new).collect();
        dispatch!(batch.level, simd => self.run(simd, batch, answers, &mut counters));
        true
    }

    fn counts(&self) -> bool {
        true
    }

    fn batch(&self) -> Option<usize> {
        Some(BATCH)
    }
}
