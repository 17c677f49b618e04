// SPDX-License-Identifier: GPL-3.0-or-later
//! The kernel of camera rays.

use crate::rays::Sorted;
use crate::traversal::{Scratch, Traversal};
use fearless_simd::{Simd, dispatch};
use halfspace_leaf::Job;
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::octree_nodes::Octree;
use halfspace_ray::query::{Closest, Count, Counters, NoCount};
use halfspace_ray::{Hit, Ray, RayCounters, RaySlice};
use halfspace_trace::batch::Batch;
use halfspace_trace::kernel::Kernel;
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
        let mut traversal = Traversal {
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
