// SPDX-License-Identifier: GPL-3.0-or-later
//! Traversal of axis-aligned plane trees after Sung and Shirley 1992 (Graphics Gems III). At each node the near
//! child is found by comparing the origin with the plane and the plane's distance by a division; three cases
//! are tested in this order: near child only, far child only, both.

use crate::single::planes::origin::{STACK, Stack, around, both, both_published, ends, next};
use crate::single::single_rays;
use crate::{batch, first_hit};
use fearless_simd::Simd;
use halfspace_leaf::{Job, Leaf};
use halfspace_nodes::plane_tree::{Node, PlaneTree, near_child};
use halfspace_ray::query::{Best, Counters, Query};
use halfspace_ray::{Hit, RayRef};

/// The traversal of one tree, as published or with error bounds.
///
/// # Panics
/// On a tree with oblique planes; the registry offers this traversal for axis-aligned trees only.
pub struct Walk<'a, const PUBLISHED: bool>(pub &'a PlaneTree);

impl<const PUBLISHED: bool> batch::Walk for Walk<'_, PUBLISHED> {
    type Scratch = Stack;

    fn scratch(&self) -> Self::Scratch {
        STACK
    }

    #[inline(always)]
    fn cast<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        Job { scene, blocks }: Job<'_>,
        RayRef { ray, frame }: RayRef<'_>,
        stack: &mut Self::Scratch,
        counters: &mut C,
    ) -> Hit {
        let tree = self.0;
        let around = around(frame);
        let mut best = Best::new(frame);
        let mut waiting = 0;
        let mut node = tree.root();
        let (mut enter, mut leave) = (frame.t_min, frame.t_max);
        loop {
            match tree.node(node) {
                Node::Axis {
                    axis,
                    split,
                    children,
                    empty,
                    link,
                } => {
                    counters.step_axis();
                    // Find the near child as the one that holds the origin.
                    let gap = split - frame.o[axis];
                    let distance = gap / frame.d[axis];
                    let near = children + u32::from(split <= frame.o[axis]);
                    let part = (enter, leave);
                    let waiting = (&mut *stack, &mut waiting);
                    if PUBLISHED {
                        if distance > leave || distance < 0.0 {
                            node = near;
                        } else if distance < enter {
                            node = near ^ 1;
                        } else {
                            (node, enter, leave) = both_published(near, distance, part, waiting);
                        }
                        continue;
                    }
                    // Within the error of a coordinate, the origin lies in the plane: go by the direction.
                    let embedded = gap.abs() <= around[axis];
                    let near = if embedded {
                        near_child(link, frame.signs)
                    } else {
                        near
                    };
                    // With error bounds: skip a child only if the whole bound lies outside the interval.
                    let (low, high) = ends(distance, frame.slack[axis]);
                    if low > leave || (distance < 0.0 && !embedded) {
                        node = near;
                    } else if high < enter {
                        node = near ^ 1;
                    } else {
                        (node, enter, leave) = both((near, empty), (low, high), part, waiting);
                    }
                    continue;
                }
                Node::Oblique { .. } => unreachable!("Sung's walk is for axis-aligned trees"),
                Node::Leaf { first, count } => {
                    counters.leaf(count);
                    if first_hit::test::<PUBLISHED, S, Q, C>(
                        simd,
                        Leaf { first, count },
                        Job { scene, blocks },
                        RayRef { ray, frame },
                        leave,
                        &mut best,
                        counters,
                    ) {
                        return best.hit();
                    }
                }
            }
            match next::<PUBLISHED>(stack, &mut waiting, best.reach) {
                Some(part) => (node, enter, leave) = part,
                None => return best.hit(),
            }
        }
    }
}

single_rays! {
    /// Single rays by the algorithm of Sung and Shirley, with error bounds.
    fn sung(PlaneTree) -> Walk<'a, false> {
        |kernel| Walk(&kernel.tree)
    }
}

single_rays! {
    /// The same as published, without error bounds.
    fn sung_published(PlaneTree) -> Walk<'a, true> {
        |kernel| Walk(&kernel.tree)
    }
}
