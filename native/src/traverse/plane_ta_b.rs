// SPDX-License-Identifier: GPL-3.0-or-later
//! The recursive ray traversal TA-B of Havran, Kopal, Bittner and Žára 1997, for axis-aligned trees.
//!
//! Where other walks keep distances, TA-B keeps the entry and the exit *point* of the ray in the
//! current cell. Comparing one coordinate of each with the split plane tells all cases apart in
//! two comparisons; a distance is computed only when both children are visited.
//!
//! Our form mirrors every axis along which the ray runs downwards, so that the entry always has
//! the smaller coordinate, and moves the two points apart by the error of a coordinate. So a child
//! is skipped only when the ray certainly does not enter it, in two comparisons as before.
//!
//! For rays of the scene itself the distances alone would do, which are moved by the slack of the
//! plane that was crossed: that is more than any coordinate of the point loses. Not so for rays in
//! the space of an instance, whose coordinates are off from the start.

use super::batch;
use super::blocks::Blocks;
use super::bound::{keep_max, keep_min};
use super::cases::{Turn, case};
use super::frame::FrameRay;
use super::pending::{Waits, next};
use super::query::{Best, Counters, Query};
use super::ray::{Hit, Ray};
use crate::build::plane_tree::{MAX_DEPTH, Node, PlaneTree, near_child};
use crate::scene::Triangles;
use fearless_simd::Simd;

/// A part of the ray: its interval, and its two end points in mirrored coordinates, all moved outwards.
/// The fourth coordinate only fills the register.
#[derive(Clone, Copy, Default)]
pub struct Segment {
    entry: [f32; 4],
    exit: [f32; 4],
    enter: f32,
    leave: f32,
}

impl Waits for (u32, Segment) {
    #[inline(always)]
    fn enter(&self) -> f32 {
        self.1.enter
    }
}

/// The ray in mirrored coordinates: all its speeds are positive.
struct Mirrored {
    speed: [f32; 4],
    before: [f32; 4],
    after: [f32; 4],
    /// The sign bits of the mirrored axes.
    flip: [u32; 3],
}

impl Mirrored {
    #[inline(always)]
    fn new(ray: &FrameRay) -> Self {
        let mut out = Self {
            speed: [0.0; 4],
            before: [0.0; 4],
            after: [0.0; 4],
            flip: [0; 3],
        };
        for k in 0..3 {
            out.flip[k] = ray.negative[k] << 31;
            let origin = f32::from_bits(ray.o[k].to_bits() ^ out.flip[k]);
            out.speed[k] = ray.d[k].abs();
            out.before[k] = origin - ray.pad[k];
            out.after[k] = origin + ray.pad[k];
        }
        out
    }

    /// The entry point of a segment that begins at `t`. Later is farther, rounding included.
    #[inline(always)]
    fn entry(&self, t: f32) -> [f32; 4] {
        let at = |k: usize| self.before[k] + t * self.speed[k];
        [at(0), at(1), at(2), at(3)]
    }

    /// The exit point of a segment that ends at `t`.
    #[inline(always)]
    fn exit(&self, t: f32) -> [f32; 4] {
        let at = |k: usize| self.after[k] + t * self.speed[k];
        [at(0), at(1), at(2), at(3)]
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
        let ray_up = Mirrored::new(frame);
        let mut segment = Segment {
            entry: ray_up.entry(frame.t_min),
            exit: ray_up.exit(frame.t_max),
            enter: frame.t_min,
            leave: frame.t_max,
        };
        let mut waiting = 0;
        let mut node = tree.root();
        loop {
            match tree.node(node) {
                Node::Axis {
                    axis,
                    split,
                    empty,
                    link,
                    ..
                } => {
                    counters.step_axis();
                    let near = near_child(link, frame.signs);
                    let height = f32::from_bits(split.to_bits() ^ ray_up.flip[axis]);
                    // The turn to the near side, or to the other.
                    let turn = |far: u32| match frame.negative[axis] ^ far {
                        0 => Turn::Below,
                        _ => Turn::Above,
                    };
                    let which = |turn| case(frame.o[axis], frame.d[axis], split, turn);
                    if segment.exit[axis] < height {
                        counters.case(|| which(turn(0)));
                        node = near; // N1 N2 N3 P5 and their mirror images: the plane is not reached
                    } else if segment.entry[axis] > height {
                        counters.case(|| which(turn(1)));
                        node = near ^ 1; // P1 P2 P3 N5: the plane is behind
                    } else {
                        // N4 P4, and every Z case: both, the far side waits; of two children on the
                        // way an empty one is not visited.
                        counters.case(|| which(Turn::Both));
                        let distance = (split - frame.o[axis]) * frame.inv[axis];
                        let slack = frame.slack[axis];
                        let far_from = keep_max(distance - slack, segment.enter);
                        let near_to = keep_min(distance + slack, segment.leave);
                        let far = Segment {
                            entry: ray_up.entry(far_from),
                            enter: far_from,
                            ..segment
                        };
                        if (empty >> (near & 1)) & 1 == 1 {
                            (node, segment) = (near ^ 1, far);
                        } else {
                            if empty == 0 {
                                stack[waiting] = (near ^ 1, far);
                                waiting += 1;
                            }
                            segment.exit = ray_up.exit(near_to);
                            segment.leave = near_to;
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
            match next(stack, &mut waiting, best.reach) {
                Some(part) => (node, segment) = part,
                None => return best.hit(),
            }
        }
    }
}
