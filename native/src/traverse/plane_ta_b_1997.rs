// SPDX-License-Identifier: GPL-3.0-or-later
//! The recursive ray traversal TA-B as published (Havran, Kopal, Bittner and Žára 1997; the listing in
//! Havran's thesis, 2000), without allowance for rounding: for measuring how often it fails and how
//! long it takes. For pictures there is [`super::plane_ta_b`].
//!
//! The listing keeps entry and exit points in one array, with links between them; here the points of
//! the current cell are at hand, and the exits that they hide on a stack. The listing has one more
//! case, that the cell ends in the plane (Z1), which it tests where an earlier branch has caught
//! it; so it is not here.

use super::batch;
use super::blocks::Blocks;
use super::cases::{Turn, case};
use super::first_hit;
use super::frame::FrameRay;
use super::query::{Best, Counters, Query};
use super::ray::{Hit, Ray};
use crate::build::plane_tree::{MAX_DEPTH, Node, PlaneTree};
use crate::scene::Triangles;
use fearless_simd::Simd;

/// Instead of a child: the ray leaves the scene.
const NOWHERE: u32 = u32::MAX;

/// A point of the ray where it leaves one cell and enters another.
#[derive(Clone, Copy, Default)]
pub struct Crossing {
    point: [f32; 3],
    t: f32,
    /// The child that the ray enters here.
    node: u32,
}

/// The walk over one tree.
///
/// # Panics
/// On a tree with oblique planes; the registry offers this walk for axis-aligned trees only.
pub struct Walk<'a>(pub &'a PlaneTree);

impl batch::Walk for Walk<'_> {
    type Scratch = [Crossing; MAX_DEPTH + 1];

    fn scratch(&self) -> Self::Scratch {
        [Crossing::default(); MAX_DEPTH + 1]
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
        let along = |t: f32| std::array::from_fn(|k| frame.o[k] + t * frame.d[k]);
        let mut entry = if frame.t_min >= 0.0 {
            along(frame.t_min)
        } else {
            frame.o
        };
        let mut exit = Crossing {
            point: along(frame.t_max),
            t: frame.t_max,
            node: NOWHERE,
        };
        let mut waiting = 0;
        let mut node = tree.root();
        loop {
            match tree.node(node) {
                Node::Axis {
                    axis,
                    split,
                    children,
                    ..
                } => {
                    counters.step_axis();
                    let mut counted = |turn| {
                        counters.case(|| case(frame.o[axis], frame.d[axis], split, turn));
                    };
                    let far = if entry[axis] <= split {
                        if exit.point[axis] <= split {
                            counted(Turn::Below);
                            node = children; // N1 N2 N3 P5 Z2 Z3
                            continue;
                        }
                        node = children; // N4
                        children + 1
                    } else {
                        if split < exit.point[axis] {
                            counted(Turn::Above);
                            node = children + 1; // P1 P2 P3 N5
                            continue;
                        }
                        node = children + 1; // P4
                        children
                    };
                    counted(Turn::Both);
                    let t = (split - frame.o[axis]) / frame.d[axis];
                    let mut point = along(t);
                    point[axis] = split;
                    stack[waiting] = exit;
                    waiting += 1;
                    exit = Crossing {
                        point,
                        t,
                        node: far,
                    };
                    continue;
                }
                Node::Oblique { .. } => unreachable!("TA-B walks axis-aligned trees"),
                Node::Leaf { first, count } => {
                    counters.leaf(count);
                    if first_hit::test::<true, S, Q, C>(
                        simd,
                        (first, count),
                        (scene, blocks),
                        (ray, frame, exit.t),
                        &mut best,
                        counters,
                    ) {
                        return best.hit();
                    }
                }
            }
            entry = exit.point;
            node = exit.node;
            if node == NOWHERE {
                return best.hit();
            }
            waiting -= 1;
            exit = stack[waiting];
        }
    }
}
