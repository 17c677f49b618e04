// SPDX-License-Identifier: GPL-3.0-or-later
//! Plane trees walked in the order of the direction, by distances (Keller 1997; Wald 2004).
//!
//! At each node the signs of the direction name the near child; comparing the plane's distance
//! with the interval decides which children to visit. The distance carries an error bound: only
//! when the whole bound lies beyond an end of the interval is a child skipped, and when both are
//! visited their intervals overlap by the bound. So a hit is found wherever rounding routes it.

use super::batch;
use super::blocks::Blocks;
use super::bound::{keep_max, keep_min};
use super::frame::FrameRay;
use super::pending::{Pending, next};
use super::planes::{Inside, Planes};
use super::query::{Best, Counters, Query};
use super::ray::{Hit, Ray};
use crate::build::plane_tree::{MAX_DEPTH, Node, near_child};
use crate::scene::Triangles;
use fearless_simd::Simd;

/// The walk over one tree.
pub struct Walk<T>(pub T);

/// Children still to visit, one for each level at most.
pub type Stack<A> = [Pending<A>; MAX_DEPTH + 1];

impl<T: Planes> batch::Walk for Walk<T> {
    type Scratch = Stack<T::At>;

    fn scratch(&self) -> Self::Scratch {
        [Pending {
            node: self.0.root(),
            enter: 0.0,
            leave: 0.0,
        }; MAX_DEPTH + 1]
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
        let mut waiting = 0;
        let mut node = tree.root();
        let (mut enter, mut leave) = (frame.t_min, frame.t_max);
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
                    let distance = (split - frame.o[axis]) * frame.inv[axis];
                    let slack = frame.slack[axis];
                    let near = near_child(link, frame.signs);
                    (node, enter, leave) = step(
                        tree,
                        (node, near, empty),
                        (distance - slack, distance + slack),
                        (enter, leave),
                        (stack, &mut waiting),
                    );
                    continue;
                }
                Node::Oblique {
                    normal,
                    offset,
                    children,
                    empty,
                } => {
                    counters.step_oblique();
                    let speed = dot(normal, frame.d);
                    let inv = 1.0 / (speed + f32::MIN_POSITIVE.copysign(speed));
                    let distance = (offset - dot(normal, frame.o)) * inv;
                    let slack = frame.oblique_pad * inv.abs();
                    let near = children ^ u32::from(speed.is_sign_negative());
                    (node, enter, leave) = step(
                        tree,
                        (node, near, empty),
                        (distance - slack, distance + slack),
                        (enter, leave),
                        (stack, &mut waiting),
                    );
                    continue;
                }
                Node::Leaf { first, count } => {
                    let blocks = match tree.inside((node, first, count), (scene, blocks)) {
                        Inside::Triangles(blocks) => blocks,
                        Inside::Part(root) => {
                            node = root;
                            continue;
                        }
                    };
                    counters.leaf(count);
                    if blocks.test::<S, Q, C>(
                        simd,
                        (first, count),
                        scene,
                        (ray, frame, leave),
                        &mut best,
                        counters,
                    ) {
                        return best.hit();
                    }
                }
            }
            match next(stack, &mut waiting, best.reach) {
                Some(child) => (node, enter, leave) = child.within(best.reach),
                None => return best.hit(),
            }
        }
    }
}

/// Chooses between the near child, the far child and both (the far one then waits). NaN distances
/// fail both comparisons, so both children are visited, over the whole interval.
///
/// Of two children on the way an empty one is not visited: the other gets its part of the interval.
#[inline(always)]
fn step<T: Planes>(
    tree: T,
    (node, near, empty): (T::At, u32, u32),
    (low, high): (f32, f32),
    (enter, leave): (f32, f32),
    (stack, waiting): (&mut Stack<T::At>, &mut usize),
) -> (T::At, f32, f32) {
    let far = tree.sibling(node, near ^ 1);
    let side = near & 1;
    let near = tree.sibling(node, near);
    if low > leave {
        (near, enter, leave)
    } else if high < enter {
        (far, enter, leave)
    } else if empty >> side & 1 == 1 {
        (far, keep_max(low, enter), leave)
    } else {
        if empty == 0 {
            stack[*waiting] = Pending {
                node: far,
                enter: keep_max(low, enter),
                leave,
            };
            *waiting += 1;
        }
        (near, enter, keep_min(high, leave))
    }
}

#[inline(always)]
fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
