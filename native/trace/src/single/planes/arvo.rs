// SPDX-License-Identifier: GPL-3.0-or-later
//! Traversal of axis-aligned plane trees after Arvo 1988 (Linear-time voxel walking for octrees, Ray Tracing
//! News).
//!
//! A stack holds nodes with the ray's intervals in them, and every node, inner or leaf, is popped from it. An
//! inner node pushes the children the ray enters, the far one first. Reciprocals of the direction are computed
//! once per ray.

use crate::pending::Pending;
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
        // Begin with the root on the stack.
        stack[0] = Pending {
            node: tree.root(),
            enter: frame.t_min,
            leave: frame.t_max,
        };
        let mut waiting = 1;
        while let Some((node, enter, leave)) = next::<PUBLISHED>(stack, &mut waiting, best.reach) {
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
                    let distance = gap * frame.inv[axis];
                    let near = children + u32::from(split <= frame.o[axis]);
                    let part = (enter, leave);
                    let rest = (&mut *stack, &mut waiting);
                    let (node, enter, leave) = if PUBLISHED {
                        if distance < 0.0 || distance > leave {
                            (near, enter, leave)
                        } else if distance < enter {
                            (near ^ 1, enter, leave)
                        } else {
                            both_published(near, distance, part, rest)
                        }
                    } else {
                        // Within the error of a coordinate, the origin lies in the plane: go by the direction.
                        let embedded = gap.abs() <= around[axis];
                        let near = if embedded {
                            near_child(link, frame.signs)
                        } else {
                            near
                        };
                        // With error bounds: skip a child only if the whole bound lies outside the interval.
                        let (low, high) = ends(distance, frame.slack[axis]);
                        if (distance < 0.0 && !embedded) || low > leave {
                            (near, enter, leave)
                        } else if high < enter {
                            (near ^ 1, enter, leave)
                        } else {
                            both((near, empty), (low, high), part, rest)
                        }
                    };
                    // Push the node to visit next, as published: it is popped at once.
                    stack[waiting] = Pending { node, enter, leave };
                    waiting += 1;
                }
                Node::Oblique { .. } => unreachable!("Arvo's walk is for axis-aligned trees"),
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
        }
        best.hit()
    }
}

single_rays! {
    /// Single rays by Arvo's algorithm, with error bounds.
    fn arvo(PlaneTree) -> Walk<'a, false> {
        |kernel| Walk(&kernel.tree)
    }
}

single_rays! {
    /// The same as published, without error bounds.
    fn arvo_published(PlaneTree) -> Walk<'a, true> {
        |kernel| Walk(&kernel.tree)
    }
}
