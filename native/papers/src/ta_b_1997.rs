// SPDX-License-Identifier: GPL-3.0-or-later
//! The recursive ray traversal TA-B as published (Havran, Kopal, Bittner and Žára 1997; the listing in Havran's
//! thesis, 2000), without error bounds, for measuring its failures and its speed. Renderers use
//! [`crate::ta_b`].
//!
//! The listing keeps entry and exit points in one linked array. Here the points of the current cell are local
//! variables, and the exit points of the cells around it are on a stack. The listing's extra case Z1, the cell
//! ends in the plane, is left out: an earlier branch of the listing always takes it.

use fearless_simd::Simd;
use halfspace_leaf::{Job, Leaf};
use halfspace_nodes::axis_tree::{AxisNode, AxisTree, SharedAxisTree};
use halfspace_nodes::plane_tree::MAX_DEPTH;
use halfspace_ray::cases::{Turn, case};
use halfspace_ray::query::{Best, Counters, NoCount, Query};
use halfspace_ray::{FrameRay, RayRef};
use halfspace_single::single_rays;
use halfspace_trace::batch::SingleTraversal;
use halfspace_trace::first_hit;
use halfspace_trace::stack::Stack;

/// The node of the crossing where the ray leaves the scene. It is not visited: the stack is empty there.
const NOWHERE: u32 = u32::MAX;

/// A point of the ray where it leaves one cell and enters another.
#[derive(Clone, Copy, Default)]
pub struct Crossing {
    point: [f32; 3],
    t: f32,
    /// The child that the ray enters here.
    node: u32,
}

/// The traversal of one tree.
pub struct PublishedTaB<'a>(pub AxisTree<'a>);

/// The ray's point at distance `t`.
#[inline(always)]
fn point(frame: &FrameRay, t: f32) -> [f32; 3] {
    std::array::from_fn(|k| frame.o[k] + t * frame.d[k])
}

impl SingleTraversal for PublishedTaB<'_> {
    type Scratch = [Crossing; MAX_DEPTH + 1];
    type Uncounted = NoCount;

    fn scratch(&self) -> Self::Scratch {
        [Crossing::default(); MAX_DEPTH + 1]
    }

    #[inline(always)]
    fn cast<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        job: Job<'_>,
        ray: RayRef<'_>,
        scratch: &mut Self::Scratch,
        counters: &mut C,
    ) -> Best {
        let (tree, frame) = (self.0, ray.frame);
        let mut best = Best::new(frame);
        let mut stack = Stack::new(scratch);
        let mut entry = if frame.t_min >= 0.0 {
            point(frame, frame.t_min)
        } else {
            frame.o
        };
        let mut exit = Crossing {
            point: point(frame, frame.t_max),
            t: frame.t_max,
            node: NOWHERE,
        };
        let mut node = tree.root();
        loop {
            match tree.node(node) {
                AxisNode::Axis {
                    axis,
                    split,
                    children,
                    ..
                } => {
                    // Compare entry and exit with the plane; continue at once if one child is enough.
                    counters.step_axis();
                    let mut counted = |turn| {
                        counters.case(|| case(frame.o[axis], frame.d[axis], split, turn));
                    };
                    let far = if entry[axis] <= split {
                        node = children;
                        if exit.point[axis] <= split {
                            counted(Turn::Below); // N1 N2 N3 P5 Z2 Z3
                            continue;
                        }
                        children + 1 // N4
                    } else {
                        node = children + 1;
                        if split < exit.point[axis] {
                            counted(Turn::Above); // P1 P2 P3 N5
                            continue;
                        }
                        children // P4
                    };
                    // Both children: the crossing becomes the near child's exit and the far child's entry.
                    counted(Turn::Both);
                    stack.push(exit);
                    exit = crossing(frame, axis, split, far);
                    continue;
                }
                AxisNode::Leaf { first, count } => {
                    counters.leaf(count);
                    let leaf = Leaf { first, count };
                    if first_hit::test::<true, S, Q, C>(
                        simd, leaf, job, ray, exit.t, &mut best, counters,
                    ) {
                        return best;
                    }
                }
            }
            // Leave the cell: its exit is the entry of the next one.
            entry = exit.point;
            node = exit.node;
            match stack.pop() {
                Some(next) => exit = next,
                None => return best,
            }
        }
    }
}

/// The crossing of a plane into child `node`. The coordinate across the plane is that of the plane, exactly.
#[inline(always)]
fn crossing(frame: &FrameRay, axis: usize, split: f32, node: u32) -> Crossing {
    let t = (split - frame.o[axis]) / frame.d[axis];
    let mut point = point(frame, t);
    point[axis] = split;
    Crossing { point, t, node }
}

single_rays! {
    /// Single rays by TA-B as published, without error bounds.
    fn ta_b_published(SharedAxisTree) -> PublishedTaB<'a> {
        |kernel| PublishedTaB(kernel.tree.borrowed())
    }
}
