// SPDX-License-Identifier: GPL-3.0-or-later
//! Traversals of axis-aligned plane trees whose near child is the one that holds the ray's origin: Sung and Shirley
//! 1992 (Graphics Gems III), Arvo 1988 (Linear-time voxel walking for octrees, Ray Tracing News; also Jansen 1986),
//! and the TA-A of Havran, Kopal, Bittner and Žára 1997. They differ in a few steps ([`Rule`]).
//!
//! All of them rely on one fact: a plane behind the origin is not crossed, and the ray stays on the origin's
//! side of it. As published they fail if the origin lies in the plane, because it then belongs to both children
//! and the choice of the wrong one loses hits. Here the origin counts as lying in every plane within the error
//! of a coordinate, and for those planes the near child is the one that the ray leaves, as if it came from far
//! behind its origin.

use fearless_simd::Simd;
use halfspace_geom::bound::{keep_max, keep_min};
use halfspace_leaf::{Job, Leaf};
use halfspace_nodes::axis_tree::{AxisNode, AxisTree, SharedAxisTree};
use halfspace_nodes::plane_tree::{MAX_DEPTH, near_child};
use halfspace_ray::query::{Best, Counters, NoCount, Query};
use halfspace_ray::{FrameRay, Interval, RayRef};
use halfspace_single::single_rays;
use halfspace_trace::batch::SingleTraversal;
use halfspace_trace::first_hit;
use halfspace_trace::stack::{self, Entry, NodeEntry};
use std::marker::PhantomData;

/// The stack of one ray. The next node to visit is on top.
type Stack<'s> = stack::Stack<'s, NodeEntry>;

/// A split plane across an axis, as a ray meets it.
pub struct Plane {
    axis: usize,
    split: f32,
    /// Difference of the plane's coordinate and the origin's.
    gap: f32,
    /// Number of the child below the plane; the child above is the next one.
    children: u32,
    /// Bits of the empty children.
    empty: u32,
    /// Word 1 of the node, for [`near_child`].
    link: u32,
}

/// The child that holds the origin.
pub enum OriginSide {
    /// The only child that the ray can meet.
    Only(u32),
    /// The child that the ray visits first.
    Near {
        /// Its number.
        child: u32,
        /// Whether the origin may lie in the plane.
        embedded: bool,
    },
}

/// The steps in which the traversals differ.
pub trait Rule: Sync + 'static {
    /// Whether the next node is pushed and popped like all others.
    const PUSHES_NEXT: bool;

    /// Whether a negative distance decides that the plane lies behind the origin.
    const TESTS_SIGN: bool;

    /// Finds the child that holds the origin. `around`: largest distance between origin and plane at which the origin
    /// counts as lying in the plane.
    fn side<const PUBLISHED: bool>(plane: &Plane, ray: &FrameRay, around: f32) -> OriginSide;

    /// Distance at which the ray crosses the plane.
    fn distance(plane: &Plane, ray: &FrameRay) -> f32;
}

/// Compares the origin with the plane.
#[inline(always)]
fn by_coordinate<const PUBLISHED: bool>(plane: &Plane, ray: &FrameRay, around: f32) -> OriginSide {
    let child = plane.children + u32::from(plane.split <= ray.o[plane.axis]);
    if PUBLISHED {
        return OriginSide::Near {
            child,
            embedded: false,
        };
    }
    // Within the error of a coordinate, the origin lies in the plane: go by the direction.
    let embedded = plane.gap.abs() <= around;
    let child = if embedded {
        near_child(plane.link, ray.signs)
    } else {
        child
    };
    OriginSide::Near { child, embedded }
}

/// The algorithm of Sung and Shirley: the distance takes a division; three cases are tested in this order: near child
/// only, far child only, both.
pub struct Sung;

impl Rule for Sung {
    const PUSHES_NEXT: bool = false;
    const TESTS_SIGN: bool = true;

    #[inline(always)]
    fn side<const PUBLISHED: bool>(plane: &Plane, ray: &FrameRay, around: f32) -> OriginSide {
        by_coordinate::<PUBLISHED>(plane, ray, around)
    }

    #[inline(always)]
    fn distance(plane: &Plane, ray: &FrameRay) -> f32 {
        plane.gap / ray.d[plane.axis]
    }
}

/// Arvo's algorithm: reciprocals of the direction are computed once per ray, and every node, inner or leaf, is popped
/// from the stack.
pub struct Arvo;

impl Rule for Arvo {
    const PUSHES_NEXT: bool = true;
    const TESTS_SIGN: bool = true;

    #[inline(always)]
    fn side<const PUBLISHED: bool>(plane: &Plane, ray: &FrameRay, around: f32) -> OriginSide {
        by_coordinate::<PUBLISHED>(plane, ray, around)
    }

    #[inline(always)]
    fn distance(plane: &Plane, ray: &FrameRay) -> f32 {
        plane.gap * ray.inv[plane.axis]
    }
}

/// TA-A: the cases of ray and plane are distinguished one by one, first by the origin's side (N below, P above, Z in
/// the plane) and the direction, without a distance; then, if the plane lies ahead, by its distance.
pub struct TaA;

impl Rule for TaA {
    const PUSHES_NEXT: bool = false;
    const TESTS_SIGN: bool = false;

    #[inline(always)]
    fn side<const PUBLISHED: bool>(plane: &Plane, ray: &FrameRay, around: f32) -> OriginSide {
        let (below, above) = (plane.children, plane.children + 1);
        let speed = ray.d[plane.axis];
        let child = if plane.gap > around {
            if speed <= 0.0 {
                return OriginSide::Only(below); // N1 N2: away from the plane, or along it
            }
            below
        } else if -plane.gap > around {
            if speed >= 0.0 {
                return OriginSide::Only(above); // P1 P2
            }
            above
        } else if PUBLISHED {
            return OriginSide::Only(plane.children + u32::from(speed > 0.0)); // Z1; Z2 Z3
        } else {
            // Z: the near child is the one that the ray leaves; either or both may be visited.
            near_child(plane.link, ray.signs)
        };
        // N3 N4 N5, P3 P4 P5: decided by the distance.
        OriginSide::Near {
            child,
            embedded: false,
        }
    }

    #[inline(always)]
    fn distance(plane: &Plane, ray: &FrameRay) -> f32 {
        plane.gap * ray.inv[plane.axis]
    }
}

/// Per axis, the largest distance between plane and origin at which the origin counts as lying in the plane.
#[inline(always)]
fn around(ray: &FrameRay) -> [f32; 3] {
    // A hit before the origin that rounds to it lies within the padding, unless the direction is extremely
    // long. A ray may also start behind its origin: for such a ray the direction alone gives the near child.
    if ray.t_min < -1e-30 {
        [f32::INFINITY; 3]
    } else {
        ray.pad
    }
}

/// Returns the child to visit next, with its interval; pushes the other child if both are visited.
#[inline(always)]
fn step<R: Rule, const PUBLISHED: bool>(
    plane: &Plane,
    side: OriginSide,
    ray: &FrameRay,
    interval: Interval,
    stack: &mut Stack<'_>,
) -> NodeEntry {
    let (near, embedded) = match side {
        OriginSide::Only(node) => return NodeEntry { node, interval },
        OriginSide::Near { child, embedded } => (child, embedded),
    };
    let Interval { enter, leave } = interval;
    let whole = |node: u32| NodeEntry { node, interval };
    let distance = R::distance(plane, ray);
    if PUBLISHED {
        if distance > leave || (R::TESTS_SIGN && distance < 0.0) {
            return whole(near);
        }
        if distance < enter {
            return whole(near ^ 1);
        }
        // The intervals of both children meet at the plane.
        stack.push(NodeEntry {
            node: near ^ 1,
            interval: Interval::new(distance, leave),
        });
        return NodeEntry {
            node: near,
            interval: Interval::new(enter, distance),
        };
    }
    // With error bounds: skip a child only if the whole bound lies outside the interval.
    let slack = ray.slack[plane.axis];
    let (low, high) = (distance - slack, distance + slack);
    if low > leave || (R::TESTS_SIGN && distance < 0.0 && !embedded) {
        return whole(near);
    }
    if high < enter {
        return whole(near ^ 1);
    }
    // Both children: skip an empty one. NaN distances leave the interval unchanged.
    let far = NodeEntry {
        node: near ^ 1,
        interval: Interval::new(keep_max(low, enter), leave),
    };
    if plane.empty >> (near & 1) & 1 == 1 {
        return far;
    }
    if plane.empty == 0 {
        stack.push(far);
    }
    NodeEntry {
        node: near,
        interval: Interval::new(enter, keep_min(high, leave)),
    }
}

/// Pops the next node to visit. As published every entry is visited; with error bounds, entries that start beyond
/// `reach` are dropped, since nothing in them can precede the best hit.
#[inline(always)]
fn pop<const PUBLISHED: bool>(stack: &mut Stack<'_>, reach: f32) -> Option<NodeEntry> {
    if PUBLISHED {
        stack.pop_entry().map(Entry::read)
    } else {
        stack.pop_within(reach).map(|entry| entry.within(reach))
    }
}

/// The traversal of one tree by one rule, as published or with error bounds.
pub struct OriginTraversal<'a, R, const PUBLISHED: bool> {
    tree: AxisTree<'a>,
    rule: PhantomData<R>,
}

impl<'a, R, const PUBLISHED: bool> OriginTraversal<'a, R, PUBLISHED> {
    /// The traversal of this tree.
    pub fn new(tree: AxisTree<'a>) -> Self {
        Self {
            tree,
            rule: PhantomData,
        }
    }
}

impl<R: Rule, const PUBLISHED: bool> SingleTraversal for OriginTraversal<'_, R, PUBLISHED> {
    type Scratch = [NodeEntry; MAX_DEPTH + 1];
    type Uncounted = NoCount;

    fn scratch(&self) -> Self::Scratch {
        [NodeEntry::blank(0); MAX_DEPTH + 1]
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
        let (tree, frame) = (self.tree, ray.frame);
        let around = around(frame);
        let mut best = Best::new(frame);
        let mut stack = Stack::new(scratch);
        let mut next = NodeEntry {
            node: tree.root(),
            interval: Interval::new(frame.t_min, frame.t_max),
        };
        loop {
            match tree.node(next.node) {
                AxisNode::Axis {
                    axis,
                    split,
                    children,
                    empty,
                    link,
                } => {
                    counters.step_axis();
                    let plane = Plane {
                        axis,
                        split,
                        gap: split - frame.o[axis],
                        children,
                        empty,
                        link,
                    };
                    let side = R::side::<PUBLISHED>(&plane, frame, around[axis]);
                    next = step::<R, PUBLISHED>(&plane, side, frame, next.interval, &mut stack);
                    if !R::PUSHES_NEXT {
                        continue;
                    }
                    stack.push(next);
                }
                AxisNode::Leaf { first, count } => {
                    counters.leaf(count);
                    let (leaf, leave) = (Leaf { first, count }, next.interval.leave);
                    if first_hit::test::<PUBLISHED, S, Q, C>(
                        simd, leaf, job, ray, leave, &mut best, counters,
                    ) {
                        return best;
                    }
                }
            }
            match pop::<PUBLISHED>(&mut stack, best.reach) {
                Some(entry) => next = entry,
                None => return best,
            }
        }
    }
}

single_rays! {
    /// Single rays by the algorithm of Sung and Shirley, with error bounds.
    fn sung(SharedAxisTree) -> OriginTraversal<'a, Sung, false> {
        |kernel| OriginTraversal::new(kernel.tree.borrowed())
    }
}

single_rays! {
    /// The same as published, without error bounds.
    fn sung_published(SharedAxisTree) -> OriginTraversal<'a, Sung, true> {
        |kernel| OriginTraversal::new(kernel.tree.borrowed())
    }
}

single_rays! {
    /// Single rays by TA-A, with error bounds.
    fn ta_a(SharedAxisTree) -> OriginTraversal<'a, TaA, false> {
        |kernel| OriginTraversal::new(kernel.tree.borrowed())
    }
}

single_rays! {
    /// The same as published, without error bounds.
    fn ta_a_published(SharedAxisTree) -> OriginTraversal<'a, TaA, true> {
        |kernel| OriginTraversal::new(kernel.tree.borrowed())
    }
}

single_rays! {
    /// Single rays by Arvo's algorithm, with error bounds.
    fn arvo(SharedAxisTree) -> OriginTraversal<'a, Arvo, false> {
        |kernel| OriginTraversal::new(kernel.tree.borrowed())
    }
}

single_rays! {
    /// The same as published, without error bounds.
    fn arvo_published(SharedAxisTree) -> OriginTraversal<'a, Arvo, true> {
        |kernel| OriginTraversal::new(kernel.tree.borrowed())
    }
}
