// SPDX-License-Identifier: GPL-3.0-or-later
//! Plane trees walked as by Sung and Shirley 1992 (Graphics Gems III), for axis-aligned trees: at each
//! node the near child is found by comparing coordinates of origin and plane, the plane's distance by
//! a division, and three cases are told apart in this order: near only, far only, both.

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
                    let embedded = gap.abs() <= around[axis];
                    let near = if embedded {
                        near_child(link, frame.signs)
                    } else {
                        near
                    };
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
