// SPDX-License-Identifier: GPL-3.0-or-later
//! The recursive ray traversal TA-A of Havran, Kopal, Bittner and Žára 1997, for axis-aligned trees. The cases
//! of ray and plane are distinguished one by one: first by the origin's side (N below, P above, Z in the plane)
//! and the direction, without a distance; then, if the plane lies ahead, by its distance.

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
                    let gap = split - frame.o[axis];
                    // Decide by side and direction if the ray does not cross the plane.
                    let speed = frame.d[axis];
                    let near = if gap > around[axis] {
                        if speed <= 0.0 {
                            node = children; // N1 N2: away from the plane, or along it
                            continue;
                        }
                        children
                    } else if -gap > around[axis] {
                        if speed >= 0.0 {
                            node = children + 1; // P1 P2
                            continue;
                        }
                        children + 1
                    } else if PUBLISHED {
                        node = children + u32::from(speed > 0.0); // Z1; Z2 Z3
                        continue;
                    } else {
                        // Z: the near child is the one that the ray leaves; either or both may be visited.
                        near_child(link, frame.signs)
                    };
                    // The plane lies ahead: decide by its distance.
                    let distance = gap * frame.inv[axis];
                    let part = (enter, leave);
                    let waiting = (&mut *stack, &mut waiting);
                    if PUBLISHED {
                        if distance > leave {
                            node = near; // N3 P3: the cell ends before the plane
                        } else if distance < enter {
                            node = near ^ 1; // N5 P5: it begins behind the plane
                        } else {
                            (node, enter, leave) = both_published(near, distance, part, waiting); // N4 P4
                        }
                        continue;
                    }
                    // With error bounds: skip a child only if the whole bound lies outside the interval.
                    let (low, high) = ends(distance, frame.slack[axis]);
                    if low > leave {
                        node = near;
                    } else if high < enter {
                        node = near ^ 1;
                    } else {
                        (node, enter, leave) = both((near, empty), (low, high), part, waiting);
                    }
                    continue;
                }
                Node::Oblique { .. } => unreachable!("TA-A walks axis-aligned trees"),
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
    /// Single rays by TA-A, with error bounds.
    fn ta_a(PlaneTree) -> Walk<'a, false> {
        |kernel| Walk(&kernel.tree)
    }
}

single_rays! {
    /// The same as published, without error bounds.
    fn ta_a_published(PlaneTree) -> Walk<'a, true> {
        |kernel| Walk(&kernel.tree)
    }
}
