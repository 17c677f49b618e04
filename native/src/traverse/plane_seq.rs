// SPDX-License-Identifier: GPL-3.0-or-later
//! Axis-aligned trees walked leaf after leaf, each found from the root (Kaplan 1985), without a stack.
//!
//! Kaplan looks for the leaf that holds a point a little beyond the last one's wall. How little is the
//! difficulty: too little, and the walk stays where it is; too much, and it passes a flat cell. Here the walk
//! remembers instead, in one bit for each level, whether it is done with the near child there (the restart trail of
//! Laine 2010): so each time it comes to the next leaf that the walk by distances and with a stack would come
//! to, however thin its cell, and never to the same one twice.

use super::batch;
use super::blocks::Blocks;
use super::bound::{keep_max, keep_min};
use super::frame::FrameRay;
use super::query::{Best, Counters, Query};
use super::ray::{Hit, Ray};
use crate::build::plane_tree::{MAX_DEPTH, Node, PlaneTree, near_child};
use crate::scene::Triangles;
use fearless_simd::Simd;

const _: () = assert!(MAX_DEPTH < u64::BITS as usize, "a bit for each level");

/// The walk over one tree.
///
/// # Panics
/// On a tree with oblique planes; the registry offers this walk for axis-aligned trees only.
pub struct Walk<'a>(pub &'a PlaneTree);

/// A leaf, and where the ray is inside.
struct Found {
    leaf: (u32, usize),
    enter: f32,
    leave: f32,
}

impl Walk<'_> {
    /// Goes down from the root to the leaf that follows what is `done`, and notes in `waiting` the levels where the
    /// far child remains. Which children are on the way depends on nothing that a hit changes, so that the
    /// levels above mean the same each time.
    #[inline(always)]
    fn descend<C: Counters>(
        &self,
        frame: &FrameRay,
        done: u64,
        reach: f32,
        waiting: &mut u64,
        counters: &mut C,
    ) -> Found {
        let mut node = self.0.root();
        let (mut enter, mut leave) = (frame.t_min, frame.t_max);
        let mut level = 1_u64;
        loop {
            let (axis, split, empty, link) = match self.0.node(node) {
                Node::Axis {
                    axis,
                    split,
                    empty,
                    link,
                    ..
                } => (axis, split, empty, link),
                Node::Oblique { .. } => unreachable!("this walk is for axis-aligned trees"),
                Node::Leaf { first, count } => {
                    let leaf = (first, count);
                    return Found { leaf, enter, leave };
                }
            };
            counters.step_axis();
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
                    *waiting |= level;
                }
                (node, leave) = (near, keep_min(high, leave));
            }
            level <<= 1;
        }
    }
}

impl batch::Walk for Walk<'_> {
    type Scratch = ();

    fn scratch(&self) {}

    #[inline(always)]
    fn cast<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        (scene, blocks): (&Triangles, &Blocks),
        (ray, frame): (&Ray, &FrameRay),
        (): &mut (),
        counters: &mut C,
    ) -> Hit {
        let mut best = Best::new(frame);
        let mut done = 0_u64;
        loop {
            let mut waiting = 0_u64;
            let Found { leaf, enter, leave } =
                self.descend(frame, done, best.reach, &mut waiting, counters);
            counters.leaf(leaf.1);
            if enter <= best.reach {
                let ray = (ray, frame, leave);
                if blocks.test::<S, Q, C>(simd, leaf, scene, ray, &mut best, counters) {
                    return best.hit();
                }
            }
            if waiting == 0 {
                return best.hit();
            }
            // Next the far child of the deepest level that has one left; below it nothing is done.
            let deepest = 1 << waiting.ilog2();
            done = done & (deepest - 1) | deepest;
        }
    }
}
