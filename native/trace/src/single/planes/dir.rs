// SPDX-License-Identifier: GPL-3.0-or-later
//! Traversal of plane trees ordered by direction, with distances (Keller 1997; Wald 2004).
//!
//! The direction's signs give the near child of a node; the plane's distance, compared with the ray's interval,
//! gives the children to visit. The distance has an error bound: a child is skipped only if the whole bound
//! lies beyond an end of the interval, and if both are visited their intervals overlap by the bound. A hit is
//! thus found wherever rounding routes it.

use crate::batch;
use crate::pending::{Pending, next};
use crate::single::single_rays;
use fearless_simd::Simd;
use halfspace_geom::bound::{keep_max, keep_min};
use halfspace_leaf::{Job, Leaf};
use halfspace_nodes::lazy_tree::LazyTree;
use halfspace_nodes::plane_tree::{MAX_DEPTH, Node, PlaneTree, near_child};
use halfspace_nodes::planes::{Inside, Planes};
use halfspace_ray::query::{Best, Counters, Query};
use halfspace_ray::{Hit, RayRef};

/// The traversal of one tree.
pub struct Walk<T>(pub T);

/// The stack, at most one entry per level.
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
        job: Job<'_>,
        RayRef { ray, frame }: RayRef<'_>,
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
                    // Bound the distance to the plane, and choose the children.
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
                    // The smallest normal number keeps the reciprocal finite for rays along the plane.
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
                    // Test the triangles, or continue at the root of the part that the leaf stands for.
                    let job = match tree.inside(node, Leaf { first, count }, job) {
                        Inside::Triangles(blocks) => Job { blocks, ..job },
                        Inside::Part(root) => {
                            node = root;
                            continue;
                        }
                    };
                    counters.leaf(count);
                    if job.test::<S, Q, C>(
                        simd,
                        Leaf { first, count },
                        RayRef { ray, frame },
                        leave,
                        &mut best,
                        counters,
                    ) {
                        return best.hit();
                    }
                }
            }
            // Continue with the nearest node on the stack that starts before the best hit.
            match next(stack, &mut waiting, best.reach) {
                Some(child) => (node, enter, leave) = child.within(best.reach),
                None => return best.hit(),
            }
        }
    }
}

/// Returns the child to visit next and its interval; if both children are to be visited, pushes the far one. If
/// the distance is NaN both comparisons fail: both children are visited over the whole interval.
///
/// An empty child is skipped; the other one then gets its own part of the interval.
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
        // Both children hold something: the far one is visited later.
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

single_rays! {
    /// Single rays by plane distances in the order of the direction.
    fn dir(PlaneTree) -> Walk<&'a PlaneTree> {
        |kernel| Walk(&*kernel.tree)
    }
}

single_rays! {
    /// The same through a tree that rays have built.
    fn lazy(LazyTree) -> Walk<&'a LazyTree> {
        |kernel| Walk(&*kernel.tree)
    }
}
