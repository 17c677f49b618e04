// SPDX-License-Identifier: GPL-3.0-or-later
//! The recursive ray traversal TA-B as published (Havran, Kopal, Bittner and Žára 1997; the listing in Havran's
//! thesis, 2000), without error bounds, for measuring its failures and its speed. Renderers use
//! [`crate::single::planes::ta_b`].
//!
//! The listing keeps entry and exit points in one linked array. Here the points of the current cell are local
//! variables, and the exit points of the cells around it are on a stack. The listing's extra case Z1, the cell
//! ends in the plane, is left out: an earlier branch of the listing always takes it.

use crate::single::single_rays;
use crate::{batch, first_hit};
use fearless_simd::Simd;
use halfspace_leaf::{Job, Leaf};
use halfspace_nodes::plane_tree::{MAX_DEPTH, Node, PlaneTree};
use halfspace_ray::cases::{Turn, case};
use halfspace_ray::query::{Best, Counters, Query};
use halfspace_ray::{Hit, RayRef};

/// Stands for a child where the ray leaves the scene.
const NOWHERE: u32 = u32::MAX;

/// A point of the ray where it leaves one cell and enters another.
#[derive(Clone, Copy, Default)]
pub struct Crossing {
    point: [f32; 3],
    t: f32,
    /// The child that the ray enters here.
    node: u32,
}

/// The traversal of one tree.
///
/// # Panics
/// On a tree with oblique planes; the registry offers this traversal for axis-aligned trees only.
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
        Job { scene, blocks }: Job<'_>,
        RayRef { ray, frame }: RayRef<'_>,
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
                    // Compare entry and exit with the plane; continue at once if one child is enough.
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
                    // Both children: the crossing becomes the near child's exit and the far child's entry.
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
                        Leaf { first, count },
                        Job { scene, blocks },
                        RayRef { ray, frame },
                        exit.t,
                        &mut best,
                        counters,
                    ) {
                        return best.hit();
                    }
                }
            }
            // Leave the cell: its exit is the entry of the next one.
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

single_rays! {
    /// Single rays by TA-B as published, without error bounds.
    fn ta_b_published(PlaneTree) -> Walk<'a> {
        |kernel| Walk(&kernel.tree)
    }
}
