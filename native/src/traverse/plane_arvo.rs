// SPDX-License-Identifier: GPL-3.0-or-later
//! Plane trees walked as by Arvo 1988 (Linear-time voxel walking for octrees, Ray Tracing News), for
//! axis-aligned trees: a stack holds nodes with the intervals of the ray inside them, and every node,
//! inner or leaf, is taken from it. Of an inner node those children go back on it that the ray enters,
//! the one behind the plane first. Reciprocals of the direction are computed once per ray.

use super::batch;
use super::blocks::Blocks;
use super::first_hit;
use super::frame::FrameRay;
use super::pending::Pending;
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
                        let embedded = gap.abs() <= around[axis];
                        let near = if embedded {
                            near_child(link, frame.signs)
                        } else {
                            near
                        };
                        let (low, high) = ends(distance, frame.slack[axis]);
                        if (distance < 0.0 && !embedded) || low > leave {
                            (near, enter, leave)
                        } else if high < enter {
                            (near ^ 1, enter, leave)
                        } else {
                            both((near, empty), (low, high), part, rest)
                        }
                    };
                    stack[waiting] = Pending { node, enter, leave };
                    waiting += 1;
                }
                Node::Oblique { .. } => unreachable!("Arvo's walk is for axis-aligned trees"),
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
        }
        best.hit()
    }
}
