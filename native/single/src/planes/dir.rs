// SPDX-License-Identifier: GPL-3.0-or-later
//! Traversal of plane trees ordered by direction, with distances (Keller 1997; Wald 2004).
//!
//! The direction's signs give the near child of a node; the plane's distance, compared with the ray's interval,
//! gives the children to visit. The distance has an error bound: a child is skipped only if the whole bound
//! lies beyond an end of the interval, and if both are visited their intervals overlap by the bound. A hit is
//! thus found wherever rounding routes it.

use crate::single_rays;
use fearless_simd::Simd;
use halfspace_geom::bound::{keep_max, keep_min};
use halfspace_leaf::{Job, Leaf};
use halfspace_nodes::lazy_tree::LazyTree;
use halfspace_nodes::plane_tree::{MAX_DEPTH, Node, PlaneTree, near_child};
use halfspace_nodes::planes::{Inside, Planes};
use halfspace_ray::query::{Best, Counters, NoCount, Query};
use halfspace_ray::{FrameRay, Interval, RayRef};
use halfspace_trace::batch::SingleTraversal;
use halfspace_trace::stack::{NodeEntry, Stack};

/// The traversal of one tree.
pub struct PlaneTraversal<T>(pub T);

/// Memory of the stack, at most one entry per level.
pub type Entries<A> = [NodeEntry<A>; MAX_DEPTH + 1];

/// A plane as a ray meets it.
pub struct Crossing {
    /// Number of the child on the near side; the other differs in the lowest bit.
    pub near: u32,
    /// Bits of the empty children.
    pub empty: u32,
    /// Bounds of the distance where the ray crosses the plane: the far child begins at the first, the near child ends
    /// at the second.
    pub bounds: Interval,
}

impl<T: Planes> SingleTraversal for PlaneTraversal<T> {
    type Scratch = Entries<T::At>;
    type Uncounted = NoCount;

    fn scratch(&self) -> Self::Scratch {
        [NodeEntry::blank(self.0.root()); MAX_DEPTH + 1]
    }

    #[inline(always)]
    fn cast<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        job: Job<'_>,
        ray: RayRef<'_>,
        scratch: &mut Self::Scratch,
        counters: &mut C,
    ) -> Best {
        let (tree, frame) = (self.0, ray.frame);
        let mut best = Best::new(frame);
        let mut stack = Stack::new(scratch);
        let mut next = NodeEntry {
            node: tree.root(),
            interval: Interval::new(frame.t_min, frame.t_max),
        };
        loop {
            match tree.node(next.node) {
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
                    let crossing = Crossing {
                        near: near_child(link, frame.signs),
                        empty,
                        bounds: Interval::new(distance - slack, distance + slack),
                    };
                    next = step(next, |i| tree.sibling(next.node, i), &crossing, &mut stack);
                    continue;
                }
                Node::Oblique {
                    normal,
                    offset,
                    children,
                    empty,
                } => {
                    counters.step_oblique();
                    let crossing = oblique(frame, normal, offset, children, empty);
                    next = step(next, |i| tree.sibling(next.node, i), &crossing, &mut stack);
                    continue;
                }
                Node::Leaf { first, count } => {
                    // Test the triangles, or continue at the root of the part that the leaf stands for.
                    let leaf = Leaf { first, count };
                    let job = match tree.inside(next.node, leaf, job) {
                        Inside::Triangles(blocks) => Job { blocks, ..job },
                        Inside::Part(root) => {
                            next.node = root;
                            continue;
                        }
                    };
                    counters.leaf(count);
                    let leave = next.interval.leave;
                    if job.test::<S, Q, C>(simd, leaf, ray, leave, &mut best, counters) {
                        return best;
                    }
                }
            }
            // Continue with the nearest node on the stack that starts before the best hit.
            match stack.pop_within(best.reach) {
                Some(entry) => next = entry.within(best.reach),
                None => return best,
            }
        }
    }
}

/// The crossing of a plane `normal . x = offset`.
#[inline(always)]
pub fn oblique(
    frame: &FrameRay,
    normal: [f32; 3],
    offset: f32,
    children: u32,
    empty: u32,
) -> Crossing {
    // The smallest normal number keeps the reciprocal finite for rays along the plane.
    let speed = dot(normal, frame.d);
    let inv = 1.0 / (speed + f32::MIN_POSITIVE.copysign(speed));
    let distance = (offset - dot(normal, frame.o)) * inv;
    let slack = frame.oblique_pad * inv.abs();
    Crossing {
        near: children ^ u32::from(speed.is_sign_negative()),
        empty,
        bounds: Interval::new(distance - slack, distance + slack),
    }
}

/// Returns the child to visit next, with its interval; if both children are to be visited, pushes the far one. If
/// the distance is NaN both comparisons fail: both children are visited over the whole interval.
///
/// An empty child is skipped; the other one then gets its own part of the interval. `node`: the node with an index.
#[inline(always)]
pub fn step<A: Copy>(
    at: NodeEntry<A>,
    node: impl Fn(u32) -> A,
    crossing: &Crossing,
    stack: &mut Stack<'_, NodeEntry<A>>,
) -> NodeEntry<A> {
    let Interval { enter, leave } = at.interval;
    let (low, high) = (crossing.bounds.enter, crossing.bounds.leave);
    let (near, far) = (node(crossing.near), node(crossing.near ^ 1));
    if low > leave {
        return NodeEntry { node: near, ..at };
    }
    if high < enter {
        return NodeEntry { node: far, ..at };
    }
    // Both children are met: visit the far one later if both hold something.
    let far = NodeEntry {
        node: far,
        interval: Interval::new(keep_max(low, enter), leave),
    };
    if crossing.empty >> (crossing.near & 1) & 1 == 1 {
        return far;
    }
    if crossing.empty == 0 {
        stack.push(far);
    }
    NodeEntry {
        node: near,
        interval: Interval::new(enter, keep_min(high, leave)),
    }
}

#[inline(always)]
fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

single_rays! {
    /// Single rays by plane distances in the order of the direction.
    fn dir(PlaneTree) -> PlaneTraversal<&'a PlaneTree> {
        |kernel| PlaneTraversal(&*kernel.tree)
    }
}

single_rays! {
    /// The same through a tree that rays have built.
    fn lazy(LazyTree) -> PlaneTraversal<&'a LazyTree> {
        |kernel| PlaneTraversal(&*kernel.tree)
    }
}
