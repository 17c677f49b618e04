// SPDX-License-Identifier: GPL-3.0-or-later
//! The recursive ray traversal TA-A of Havran, Kopal, Bittner and Žára 1997, for axis-aligned trees:
//! the cases of a ray and a plane told apart one by one, by the side of the origin (N below, P above,
//! Z in the plane) and by the direction, before any distance is computed; then, where the plane lies
//! ahead, by its distance.

use super::batch;
use super::blocks::Blocks;
use super::first_hit;
use super::frame::FrameRay;
use super::plane_origin::{STACK, Stack, around, both, both_published, ends, next};
use super::query::{Best, Counters, Query};
use super::ray::{Hit, Ray};
use crate::build::plane_tree::{Node, PlaneTree, near_child};
use crate::scene::Triangles;
use fearless_simd::Simd;

/// The walk over one tree; as published, or with allowance for rounding.
///
/// # Panics
/// On a tree with oblique planes; the registry offers this walk for axis-aligned trees only.
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
        (scene, blocks): (&Triangles, &Blocks),
        (ray, frame): (&Ray, &FrameRay),
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
                        // Z: the child that the ray leaves, and that which it enters, or one of them.
                        near_child(link, frame.signs)
                    };
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
                        (first, count),
                        (scene, blocks),
                        (ray, frame, leave),
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
