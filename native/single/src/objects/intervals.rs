// SPDX-License-Identifier: GPL-3.0-or-later
//! The traversal of interval hierarchies, whose nodes bound their children along one direction. The layouts of nodes
//! differ in their step ([`IntervalTree`]).

use fearless_simd::Simd;
use halfspace_leaf::{Job, Leaf};
use halfspace_ray::query::{Best, Counters, NoCount, Query};
use halfspace_ray::{FrameRay, Interval, RayRef};
use halfspace_trace::batch::SingleTraversal;
use halfspace_trace::stack::{self, NodeEntry};

/// The stack of one ray.
pub type Stack<'s> = stack::Stack<'s, NodeEntry>;

/// Next step of a ray after a node.
pub enum Next<N> {
    /// It visits this child, in this interval.
    Child(N, Interval),
    /// It tests the triangles of this leaf.
    Leaf(Leaf),
    /// It continues with the nearest node on the stack.
    Pop,
}

/// A layout of interval hierarchies.
pub trait IntervalTree: Sync {
    /// A node as it is read from memory.
    type Node<'a>: Copy
    where
        Self: 'a;
    /// Constants of a ray.
    type Ray<'r>;
    /// Memory of the stack.
    type Entries: AsMut<[NodeEntry]>;

    /// Memory of a stack for the deepest path.
    fn entries() -> Self::Entries;

    /// Reads a node; node 0 is the root.
    fn node(&self, index: u32) -> Self::Node<'_>;

    /// Computes what steps need of a ray.
    fn prepare<'r>(ray: &'r FrameRay<'r>) -> Self::Ray<'r>;

    /// Visits a node. Pushes the children that are to be visited later, for nearest hits the nearest on top.
    fn step<'a, S: Simd, Q: Query, C: Counters>(
        &'a self,
        simd: S,
        node: Self::Node<'a>,
        ray: &Self::Ray<'_>,
        interval: Interval,
        stack: &mut Stack<'_>,
        counters: &mut C,
    ) -> Next<Self::Node<'a>>;
}

/// The traversal of one tree.
pub struct IntervalTraversal<'a, T>(pub &'a T);

impl<T: IntervalTree> SingleTraversal for IntervalTraversal<'_, T> {
    type Scratch = T::Entries;
    type Uncounted = NoCount;

    fn scratch(&self) -> Self::Scratch {
        T::entries()
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
        let prepared = T::prepare(frame);
        let mut best = Best::new(frame);
        let mut stack = Stack::new(scratch.as_mut());
        let mut node = tree.node(0);
        let mut interval = Interval::new(frame.t_min, frame.t_max);
        loop {
            match tree.step::<S, Q, C>(simd, node, &prepared, interval, &mut stack, counters) {
                Next::Child(child, inside) => {
                    (node, interval) = (child, inside);
                    continue;
                }
                Next::Leaf(leaf) => {
                    counters.leaf(leaf.count);
                    let leave = interval.leave;
                    if job.test_any::<S, Q, C>(simd, leaf, ray, leave, &mut best, counters) {
                        return best;
                    }
                }
                Next::Pop => {}
            }
            let Some(entry) = stack.pop_within(best.reach) else {
                return best;
            };
            NodeEntry { interval, .. } = entry.within(best.reach);
            node = tree.node(entry.node);
        }
    }
}

/// The step to two children of which the ray leaves the near one at `ends` and enters the far one at `begins`: visits
/// the near child if the ray enters before it ends, the far one if that begins in time. `read` reads a node.
#[inline(always)]
pub fn visit_pair<N>(
    read: impl Fn(u32) -> N,
    [near, far]: [u32; 2],
    [ends, begins]: [f32; 2],
    interval: Interval,
    stack: &mut Stack<'_>,
) -> Next<N> {
    let Interval { enter, leave } = interval;
    let beyond = Interval::new(begins, leave);
    if enter <= ends {
        if begins <= leave {
            stack.push(NodeEntry {
                node: far,
                interval: beyond,
            });
        }
        return Next::Child(read(near), Interval::new(enter, ends));
    }
    if begins <= leave {
        return Next::Child(read(far), beyond);
    }
    Next::Pop
}

/// The step to an only child, unless its interval is empty. `read` reads a node.
#[inline(always)]
pub fn visit_only<N>(read: impl Fn(u32) -> N, child: u32, interval: Interval) -> Next<N> {
    if interval.enter <= interval.leave {
        Next::Child(read(child), interval)
    } else {
        Next::Pop
    }
}
