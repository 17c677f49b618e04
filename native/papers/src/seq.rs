// SPDX-License-Identifier: GPL-3.0-or-later
//! Sequential traversal of axis-aligned plane trees without a stack: each leaf is located from the root (Kaplan
//! 1985).
//!
//! Kaplan locates the leaf of a point slightly behind the last leaf's wall. A step too small finds the same
//! leaf again, one too large skips a flat cell. Instead of a step, this traversal keeps one bit per level, set
//! if the near child there is finished (the restart trail of Laine 2010). It visits exactly the leaves of the
//! traversal with a stack, however thin their cells, and none twice.

use fearless_simd::Simd;
use halfspace_geom::bound::{keep_max, keep_min};
use halfspace_leaf::{Job, Leaf};
use halfspace_nodes::axis_tree::{AxisNode, AxisTree, SharedAxisTree};
use halfspace_nodes::plane_tree::{MAX_DEPTH, near_child};
use halfspace_ray::query::{Best, Counters, NoCount, Query};
use halfspace_ray::{FrameRay, Interval, RayRef};
use halfspace_single::single_rays;
use halfspace_trace::batch::SingleTraversal;

const _: () = assert!(MAX_DEPTH < u64::BITS as usize, "a bit for each level");

/// The traversal of one tree.
pub struct RestartTraversal<'a>(pub AxisTree<'a>);

/// A leaf and the ray's interval in it.
struct Found {
    leaf: Leaf,
    interval: Interval,
}

impl RestartTraversal<'_> {
    /// Descends from the root to the first leaf that is not `done`, and sets in `pending` the bits of the
    /// levels whose far child remains to be visited.
    ///
    /// The choice of children does not depend on hits, so a level's bit has the same meaning in each descent.
    #[inline(always)]
    fn descend<C: Counters>(
        &self,
        frame: &FrameRay,
        done: u64,
        reach: f32,
        pending: &mut u64,
        counters: &mut C,
    ) -> Found {
        let mut node = self.0.root();
        let (mut enter, mut leave) = (frame.t_min, frame.t_max);
        let mut level = 1_u64;
        loop {
            let (axis, split, empty, link) = match self.0.node(node) {
                AxisNode::Axis {
                    axis,
                    split,
                    empty,
                    link,
                    ..
                } => (axis, split, empty, link),
                AxisNode::Leaf { first, count } => {
                    let (leaf, interval) = (Leaf { first, count }, Interval::new(enter, leave));
                    return Found { leaf, interval };
                }
            };
            counters.step_axis();
            // Compare as in the traversal by distances; at a finished level take the far child.
            let distance = (split - frame.o[axis]) * frame.inv[axis];
            let slack = frame.slack[axis];
            let (low, high) = (distance - slack, distance + slack);
            let near = near_child(link, frame.signs);
            if low > leave {
                node = near;
            } else if high < enter {
                node = near ^ 1;
            } else if done & level != 0 || empty >> (near & 1) & 1 == 1 {
                (node, enter) = (near ^ 1, keep_max(low, enter));
            } else {
                if empty == 0 && keep_max(low, enter) <= reach {
                    *pending |= level;
                }
                (node, leave) = (near, keep_min(high, leave));
            }
            level <<= 1;
        }
    }
}

impl SingleTraversal for RestartTraversal<'_> {
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
        let mut best = Best::new(ray.frame);
        let mut done = 0_u64;
        loop {
            let mut pending = 0_u64;
            let Found { leaf, interval } =
                self.descend(ray.frame, done, best.reach, &mut pending, counters);
            counters.leaf(leaf.count);
            // Test the leaf unless the best hit lies before it.
            if interval.enter <= best.reach
                && job.test::<S, Q, C>(simd, leaf, ray, interval.leave, &mut best, counters)
            {
                return best;
            }
            if pending == 0 {
                return best;
            }
            // Finish the near child of the deepest level with a far child left; clear all bits below it.
            let deepest = 1 << pending.ilog2();
            done = done & (deepest - 1) | deepest;
        }
    }
}

single_rays! {
    /// Single rays that find each leaf from the root, with error bounds.
    fn seq(SharedAxisTree) -> RestartTraversal<'a> {
        |kernel| RestartTraversal(kernel.tree.borrowed())
    }
}
