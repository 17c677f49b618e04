// SPDX-License-Identifier: GPL-3.0-or-later
//! Traversals that can be interrupted after each step, through nodes of seven planes and of eight boxes.

pub mod boxes;
pub mod planes;

use crate::single_rays;
use fearless_simd::Simd;
use halfspace_leaf::Job;
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::next::Next;
use halfspace_nodes::wide_tree::WideTree;
use halfspace_ray::query::{Best, Counters, NoCount, Query};
use halfspace_ray::{FrameRay, RayRef};
use halfspace_trace::batch::SingleTraversal;
use planes::PlaneSteps;

/// The index of the topmost of `size` stack entries that starts within `reach`; entries above it are dropped.
///
/// Entry 0 is a sentinel that starts at negative infinity and ends the traversal, so the loop needs no check
/// for an empty stack.
#[inline(always)]
pub fn topmost(enter: &[f32], size: usize, reach: f32) -> usize {
    let mut top = size - 1;
    while enter[top] > reach {
        top -= 1;
    }
    top
}

/// A traversal that can be interrupted after each step.
pub trait Steps: Sync {
    /// The traversal state of one ray.
    type State;

    /// The state of no ray, for allocation.
    fn blank(&self) -> Self::State;

    /// Starts the traversal of a ray at the root.
    fn start(&self, ray: &FrameRay, state: &mut Self::State);

    /// The kind of the ray's next step.
    fn next(&self, state: &Self::State) -> Next;

    /// Counts a step through a plain node.
    #[inline(always)]
    fn count_plain<C: Counters>(&self, counters: &mut C) {
        counters.step_axis();
    }

    /// Steps through a plain node and selects the next child that starts within `reach`.
    fn plain<S: Simd>(&self, simd: S, state: &mut Self::State, reach: f32);

    /// Steps through a node of the second kind; does nothing in trees of one kind.
    #[inline(always)]
    fn general<S: Simd>(&self, simd: S, ray: &FrameRay, state: &mut Self::State, reach: f32) {
        let _ = (simd, ray, state, reach);
    }

    /// Size of the nodes in bytes.
    fn bytes(&self) -> usize;

    /// Prefetches the plain node of the ray's next step.
    fn fetch_plain(&self, state: &Self::State);

    /// Prefetches the node, of the second kind, of the ray's next step.
    #[inline(always)]
    fn fetch_general(&self, state: &Self::State) {
        let _ = state;
    }

    /// Prefetches the leaf that the ray is to test next.
    fn fetch_leaf(&self, blocks: &Blocks, state: &Self::State);

    /// Tests the triangles of the ray's next leaf, and selects the next child or ends the traversal.
    fn leaf<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        job: Job<'_>,
        ray: RayRef<'_>,
        state: &mut Self::State,
        best: &mut Best,
        counters: &mut C,
    );
}

/// A traversal by steps, run to its end for one ray at a time.
pub struct SingleSteps<T>(pub T);

impl<T: Steps> SingleTraversal for SingleSteps<T> {
    type Scratch = T::State;
    type Uncounted = NoCount;

    fn scratch(&self) -> Self::Scratch {
        self.0.blank()
    }

    #[inline(always)]
    fn cast<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        job: Job<'_>,
        ray: RayRef<'_>,
        state: &mut Self::Scratch,
        counters: &mut C,
    ) -> Best {
        let steps = &self.0;
        let mut best = Best::new(ray.frame);
        steps.start(ray.frame, state);
        loop {
            // Take the steps one after another; nothing is sorted for a single ray.
            match steps.next(state) {
                Next::PLAIN => {
                    steps.count_plain(counters);
                    steps.plain(simd, state, best.reach);
                }
                Next::GENERAL => {
                    counters.step_oblique();
                    steps.general(simd, ray.frame, state, best.reach);
                }
                Next::LEAF => {
                    steps.leaf::<S, Q, C>(simd, job, ray, state, &mut best, counters);
                }
                _ => return best,
            }
        }
    }
}

single_rays! {
    /// Single rays through wide nodes of planes.
    fn wide_planes(WideTree) -> SingleSteps<PlaneSteps<'a>> {
        |kernel| SingleSteps(PlaneSteps(&kernel.tree))
    }
}
