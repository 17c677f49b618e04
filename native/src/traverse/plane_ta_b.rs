// SPDX-License-Identifier: GPL-3.0-or-later
//! The recursive ray traversal TA-B of Havran, Kopal, Bittner and Žára 1997, for axis-aligned trees.
//!
//! Where other walks keep distances, TA-B keeps the entry and the exit *point* of the ray in the
//! current cell. Comparing one coordinate of each with the split plane tells all cases apart in
//! two comparisons; a distance is computed only when both children are visited.
//!
//! Our form keeps the box around the two points instead of the points: which of them has the
//! smaller coordinate on an axis is a matter of the direction's sign, so nothing is lost, and the
//! comparisons no longer ask for the sign. The box is padded by the error of a computed point, so
//! that a child is skipped only when the ray certainly does not enter it.

use super::batch;
use super::blocks::Blocks;
use super::frame::{FrameRay, keep_max, keep_min};
use super::query::{Best, Counters, Query};
use super::ray::{Hit, Ray};
use crate::build::plane_tree::{MAX_DEPTH, Node, PlaneTree};
use crate::scene::Triangles;
use fearless_simd::Simd;

/// A part of the ray: its interval, and the padded box around its two end points.
#[derive(Clone, Copy, Default)]
pub struct Segment {
    low: [f32; 3],
    high: [f32; 3],
    enter: f32,
    leave: f32,
}

impl Segment {
    fn new(ray: &FrameRay) -> Self {
        let whole = Self {
            low: [f32::NEG_INFINITY; 3],
            high: [f32::INFINITY; 3],
            enter: ray.t_min,
            leave: ray.t_max,
        };
        whole.begin(ray, ray.t_min).end(ray, ray.t_max)
    }

    /// The same segment from `t` on.
    #[inline(always)]
    fn begin(mut self, ray: &FrameRay, t: f32) -> Self {
        self.enter = t;
        for k in 0..3 {
            let point = ray.o[k] + t * ray.d[k];
            if ray.negative[k] == 1 {
                self.high[k] = keep_min(point + ray.pad[k], self.high[k]);
            } else {
                self.low[k] = keep_max(point - ray.pad[k], self.low[k]);
            }
        }
        self
    }

    /// The same segment up to `t`.
    #[inline(always)]
    fn end(mut self, ray: &FrameRay, t: f32) -> Self {
        self.leave = t;
        for k in 0..3 {
            let point = ray.o[k] + t * ray.d[k];
            if ray.negative[k] == 1 {
                self.low[k] = keep_max(point - ray.pad[k], self.low[k]);
            } else {
                self.high[k] = keep_min(point + ray.pad[k], self.high[k]);
            }
        }
        self
    }
}

/// The walk over one tree.
///
/// # Panics
/// On a tree with oblique planes; the registry offers this walk for axis-aligned trees only.
pub struct Walk<'a>(pub &'a PlaneTree);

impl batch::Walk for Walk<'_> {
    type Scratch = [(u32, Segment); MAX_DEPTH + 1];

    fn scratch(&self) -> Self::Scratch {
        [(0, Segment::default()); MAX_DEPTH + 1]
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
        let mut best = Best::new(frame);
        let mut segment = Segment::new(frame);
        let mut waiting = 0;
        let mut node = tree.root();
        loop {
            match tree.node(node) {
                Node::Axis {
                    axis,
                    split,
                    children,
                    empty,
                } => {
                    counters.step_axis();
                    if segment.high[axis] < split {
                        node = children; // N1 N2 N3 P5: below all along
                    } else if segment.low[axis] > split {
                        node = children + 1; // P1 P2 P3 N5: above all along
                    } else {
                        // N4 P4, and every Z case: both, the far side waits; of two children on the
                        // way an empty one is not visited.
                        let distance = (split - frame.o[axis]) * frame.inv[axis];
                        let slack = frame.slack[axis];
                        let near = children ^ frame.negative[axis];
                        let far_from = keep_max(distance - slack, segment.enter);
                        let near_to = keep_min(distance + slack, segment.leave);
                        if empty >> (near & 1) & 1 == 1 {
                            segment = segment.begin(frame, far_from);
                            node = near ^ 1;
                        } else {
                            if empty == 0 {
                                stack[waiting] = (near ^ 1, segment.begin(frame, far_from));
                                waiting += 1;
                            }
                            segment = segment.end(frame, near_to);
                            node = near;
                        }
                    }
                    continue;
                }
                Node::Oblique { .. } => unreachable!("TA-B walks axis-aligned trees"),
                Node::Leaf { first, count } => {
                    counters.leaf(count);
                    if blocks.test::<S, Q, C>(
                        simd,
                        (first, count),
                        scene,
                        (ray, frame, segment.leave),
                        &mut best,
                        counters,
                    ) {
                        return best.hit();
                    }
                }
            }
            loop {
                if waiting == 0 {
                    return best.hit();
                }
                waiting -= 1;
                let (next, part) = stack[waiting];
                if part.enter <= best.reach {
                    (node, segment) = (next, part);
                    break;
                }
            }
        }
    }
}
