// SPDX-License-Identifier: GPL-3.0-or-later
//! Single rays through interval hierarchies with one or two planes a node.

use crate::objects::intervals::{
    IntervalTraversal, IntervalTree, Next, Stack, visit_only, visit_pair,
};
use crate::single_rays;
use fearless_simd::Simd;
use halfspace_leaf::Leaf;
use halfspace_nodes::plane_tree::MAX_DEPTH;
use halfspace_nodes::slab_node::{Double, Single, SlabKind, SlabNode};
use halfspace_nodes::slab_tree::SlabTree;
use halfspace_ray::query::{Counters, Query};
use halfspace_ray::{FrameRay, Interval};
use halfspace_trace::stack::NodeEntry;

impl<N: SlabNode> IntervalTree for SlabTree<N> {
    type Node<'a>
        = &'a N
    where
        N: 'a;
    type Ray<'r> = &'r FrameRay<'r>;
    type Entries = [NodeEntry; MAX_DEPTH + 1];

    fn entries() -> Self::Entries {
        [NodeEntry::blank(0); MAX_DEPTH + 1]
    }

    #[inline(always)]
    fn node(&self, index: u32) -> &N {
        &self.nodes[index as usize]
    }

    #[inline(always)]
    fn prepare<'r>(ray: &'r FrameRay<'r>) -> Self::Ray<'r> {
        ray
    }

    #[inline(always)]
    fn step<'a, S: Simd, Q: Query, C: Counters>(
        &'a self,
        _: S,
        node: &'a N,
        ray: &Self::Ray<'_>,
        interval: Interval,
        stack: &mut Stack<'_>,
        counters: &mut C,
    ) -> Next<&'a N> {
        let read = |index| self.node(index);
        match node.kind() {
            SlabKind::Pair { axis, link } => {
                counters.step_boxes();
                let (ends, begins) = node.intervals(axis, ray, interval);
                let side = ray.negative[axis];
                let children = [link + side, link + (side ^ 1)];
                visit_pair(read, children, [ends, begins], interval, stack)
            }
            SlabKind::Only { axis, link } => {
                counters.step_boxes();
                // Cut the interval to the only child.
                let (leave, enter) = node.intervals(axis, ray, interval);
                visit_only(read, link, Interval::new(enter, leave))
            }
            SlabKind::Leaf { first, count } => Next::Leaf(Leaf { first, count }),
        }
    }
}

single_rays! {
    /// Single rays through intervals, two planes to a node.
    fn slabs(SlabTree<Double>) -> IntervalTraversal<'a, SlabTree<Double>> {
        |kernel| IntervalTraversal(&*kernel.tree)
    }
}

single_rays! {
    /// Single rays through intervals, one plane to a node.
    fn single_slabs(SlabTree<Single>) -> IntervalTraversal<'a, SlabTree<Single>> {
        |kernel| IntervalTraversal(&*kernel.tree)
    }
}
