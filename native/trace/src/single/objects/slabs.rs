// SPDX-License-Identifier: GPL-3.0-or-later
//! Single rays through interval hierarchies with one or two planes a node.

use crate::batch;
use crate::pending::{Pending, next};
use crate::single::single_rays;
use fearless_simd::Simd;
use halfspace_leaf::{Job, Leaf};
use halfspace_nodes::plane_tree::MAX_DEPTH;
use halfspace_nodes::slab_node::{Double, SlabKind, SlabNode};
use halfspace_nodes::slab_tree::SlabTree;
use halfspace_ray::query::{Best, Counters, Query};
use halfspace_ray::{Hit, Interval, RayRef};

/// The traversal of one tree.
pub struct Walk<'a, N>(pub &'a SlabTree<N>);

impl<N: SlabNode> batch::Walk for Walk<'_, N> {
    type Scratch = [Pending; MAX_DEPTH + 1];

    fn scratch(&self) -> Self::Scratch {
        [Pending::default(); MAX_DEPTH + 1]
    }

    #[inline(always)]
    fn cast<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        job: Job<'_>,
        RayRef { ray, frame }: RayRef<'_>,
        stack: &mut Self::Scratch,
        counters: &mut C,
    ) -> Hit {
        let nodes = &self.0.nodes[..];
        let mut best = Best::new(frame);
        let mut waiting = 0;
        let mut node = nodes[0];
        let (mut enter, mut leave) = (frame.t_min, frame.t_max);
        loop {
            match node.kind() {
                SlabKind::Pair { axis, link } => {
                    counters.step_boxes();
                    // Visit the near child if the ray enters before it ends, the far one if that begins in
                    // time.
                    let (ends, begins) = node.intervals(axis, frame, Interval::new(enter, leave));
                    let side = frame.negative[axis];
                    let far = link + (side ^ 1);
                    if enter <= ends {
                        if begins <= leave {
                            stack[waiting] = Pending {
                                node: far,
                                enter: begins,
                                leave,
                            };
                            waiting += 1;
                        }
                        leave = ends;
                        node = nodes[(link + side) as usize];
                        continue;
                    }
                    if begins <= leave {
                        enter = begins;
                        node = nodes[far as usize];
                        continue;
                    }
                }
                SlabKind::Only { axis, link } => {
                    counters.step_boxes();
                    // Cut the interval to the only child.
                    (leave, enter) = node.intervals(axis, frame, Interval::new(enter, leave));
                    if enter <= leave {
                        node = nodes[link as usize];
                        continue;
                    }
                }
                SlabKind::Leaf { first, count } => {
                    counters.leaf(count);
                    if job.test_any::<S, Q, C>(
                        simd,
                        Leaf { first, count },
                        RayRef { ray, frame },
                        leave,
                        &mut best,
                        counters,
                    ) {
                        return best.hit();
                    }
                }
            }
            let Some(child) = next(stack, &mut waiting, best.reach) else {
                return best.hit();
            };
            let place;
            (place, enter, leave) = child.within(best.reach);
            node = nodes[place as usize];
        }
    }
}

single_rays! {
    /// Single rays through intervals, two planes to a node.
    fn slabs(SlabTree<Double>) -> Walk<'a, Double> {
        |kernel| Walk(&kernel.tree)
    }
}

single_rays! {
    /// Single rays through intervals, one plane to a node.
    fn single_slabs(SlabTree<halfspace_nodes::slab_node::Single>) -> Walk<'a, halfspace_nodes::slab_node::Single> {
        |kernel| Walk(&kernel.tree)
    }
}
