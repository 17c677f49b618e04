// SPDX-License-Identifier: GPL-3.0-or-later
//! The sequential traversal as published (Kaplan 1985), without allowance for rounding: for measuring how
//! often it fails and how long it takes. For pictures there is [`super::plane_seq`].
//!
//! The leaf of a point is found from the root; where the ray leaves its cell, and a small step farther, is
//! the next point. A walk that no longer comes forward ends.

use super::batch;
use super::blocks::Blocks;
use super::frame::FrameRay;
use super::query::{Best, Counters, Query};
use super::ray::{Hit, Ray};
use crate::build::plane_tree::{Node, PlaneTree};
use crate::geom::Aabb;
use crate::scene::Triangles;
use fearless_simd::Simd;

/// The step beyond a wall, as a share of the scene's largest coordinate.
const STEP: f32 = 1.0 / 1_048_576.0;

/// The walk over one tree; with it the scene's box.
///
/// # Panics
/// On a tree with oblique planes; the registry offers this walk for axis-aligned trees only.
pub struct Walk<'a>(pub &'a PlaneTree, pub Aabb);

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
        let Self(tree, bounds) = self;
        let step = STEP * bounds.magnitude();
        let mut best = Best::new(frame);
        let mut t = frame.t_min;
        loop {
            let point: [f32; 3] = std::array::from_fn(|k| frame.o[k] + t * frame.d[k]);
            let mut cell = *bounds;
            let mut node = tree.root();
            let leaf = loop {
                match tree.node(node) {
                    Node::Axis {
                        axis,
                        split,
                        children,
                        ..
                    } => {
                        counters.step_axis();
                        if point[axis] < split {
                            (node, cell.max[axis]) = (children, split);
                        } else {
                            (node, cell.min[axis]) = (children + 1, split);
                        }
                    }
                    Node::Oblique { .. } => unreachable!("this walk is for axis-aligned trees"),
                    Node::Leaf { first, count } => break (first, count),
                }
            };
            counters.leaf(leaf.1);
            let mut leave = frame.t_max;
            for k in 0..3 {
                let wall = if frame.negative[k] == 1 {
                    cell.min[k]
                } else {
                    cell.max[k]
                };
                leave = leave.min((wall - frame.o[k]) * frame.inv[k]);
            }
            let ray = (ray, frame, leave);
            let ends = blocks.test::<S, Q, C>(simd, leaf, scene, ray, &mut best, counters);
            // As published, the first leaf with a hit inside has the nearest one.
            let next = leave + step;
            if ends || best.hit().is_hit() || next.is_nan() || next <= t || next > frame.t_max {
                return best.hit();
            }
            t = next;
        }
    }
}
