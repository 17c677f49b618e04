// SPDX-License-Identifier: GPL-3.0-or-later
//! The sequential traversal as published (Kaplan 1985), without error bounds, for measuring its failures and
//! its speed. Renderers use [`crate::seq`].
//!
//! The leaf of a point is located from the root; the next point lies a small step behind the ray's exit from
//! the leaf's cell. A traversal whose distance no longer increases ends.

use fearless_simd::Simd;
use halfspace_geom::Aabb;
use halfspace_leaf::{Job, Leaf};
use halfspace_nodes::axis_tree::{AxisNode, AxisTree, SharedAxisTree};
use halfspace_ray::query::{Best, Counters, NoCount, Query};
use halfspace_ray::{FrameRay, RayRef};
use halfspace_single::single_rays;
use halfspace_trace::batch::SingleTraversal;

/// The step behind a wall, relative to the scene's largest coordinate. Chosen: 16 u, above the rounding of a
/// coordinate.
const STEP: f32 = 1.0 / 1_048_576.0;

/// The traversal of one tree.
pub struct PointTraversal<'a> {
    /// The tree.
    pub tree: AxisTree<'a>,
    /// The scene's box in the frame.
    pub bounds: Aabb,
}

impl PointTraversal<'_> {
    /// Descends from the root to the leaf that contains a point; returns the leaf and its cell.
    #[inline(always)]
    fn locate<C: Counters>(&self, point: [f32; 3], counters: &mut C) -> (Leaf, Aabb) {
        let mut cell = self.bounds;
        let mut node = self.tree.root();
        loop {
            match self.tree.node(node) {
                AxisNode::Axis {
                    axis,
                    split,
                    children,
                    ..
                } => {
                    counters.step_axis();
                    if point[axis] < split {
                        (node, cell.max[axis]) = (children, split);
                    } else {
                        (node, cell.min[axis]) = (children + 1, split);
                    }
                }
                AxisNode::Leaf { first, count } => return (Leaf { first, count }, cell),
            }
        }
    }
}

/// Distance where the ray leaves a cell, through the first of its far walls.
#[inline(always)]
fn exit(frame: &FrameRay, cell: &Aabb) -> f32 {
    let mut leave = frame.t_max;
    for k in 0..3 {
        let wall = if frame.negative[k] == 1 {
            cell.min[k]
        } else {
            cell.max[k]
        };
        leave = leave.min((wall - frame.o[k]) * frame.inv[k]);
    }
    leave
}

impl SingleTraversal for PointTraversal<'_> {
    type Scratch = ();
    type Uncounted = NoCount;

    fn scratch(&self) {}

    #[inline(always)]
    fn cast<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        job: Job<'_>,
        ray: RayRef<'_>,
        (): &mut (),
        counters: &mut C,
    ) -> Best {
        let frame = ray.frame;
        let step = STEP * self.bounds.magnitude();
        let mut best = Best::new(frame);
        let mut t = frame.t_min;
        loop {
            let point = std::array::from_fn(|k| frame.o[k] + t * frame.d[k]);
            let (leaf, cell) = self.locate(point, counters);
            counters.leaf(leaf.count);
            let leave = exit(frame, &cell);
            let ends = job.test::<S, Q, C>(simd, leaf, ray, leave, &mut best, counters);
            // As published: the first leaf with a hit inside its cell holds the nearest one.
            let next = leave + step;
            let found = best.is_found_before(leave);
            if ends || found || next.is_nan() || next <= t || next > frame.t_max {
                return best;
            }
            t = next;
        }
    }
}

single_rays! {
    /// Single rays by point location as published, without error bounds. `bounds`: the scene's box in the frame.
    fn seq_published(SharedAxisTree, bounds: Aabb) -> PointTraversal<'a> {
        |kernel| PointTraversal { tree: kernel.tree.borrowed(), bounds: kernel.bounds }
    }
}
