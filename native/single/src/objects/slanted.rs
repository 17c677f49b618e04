// SPDX-License-Identifier: GPL-3.0-or-later
//! Single rays through interval hierarchies along thirteen directions.

use crate::objects::dops::Planes;
use crate::objects::intervals::{
    IntervalTraversal, IntervalTree, Next, Stack, visit_only, visit_pair,
};
use crate::single_rays;
use fearless_simd::Simd;
use halfspace_geom::bound::{keep_max, keep_min};
use halfspace_leaf::Leaf;
use halfspace_nodes::plane_tree::MAX_DEPTH;
use halfspace_nodes::slant_tree::{Node, SlantKind, SlantTree};
use halfspace_nodes::slanted_tree::DIRECTIONS;
use halfspace_ray::query::{Counters, Query};
use halfspace_ray::{FrameRay, Interval};
use halfspace_trace::stack::NodeEntry;

impl IntervalTree for SlantTree {
    type Node<'a> = &'a Node;
    type Ray<'r> = Planes<DIRECTIONS>;
    type Entries = [NodeEntry; MAX_DEPTH + 1];

    fn entries() -> Self::Entries {
        [NodeEntry::blank(0); MAX_DEPTH + 1]
    }

    #[inline(always)]
    fn node(&self, index: u32) -> &Node {
        &self.nodes[index as usize]
    }

    #[inline(always)]
    fn prepare<'r>(ray: &'r FrameRay<'r>) -> Self::Ray<'r> {
        Planes::new(ray)
    }

    #[inline(always)]
    fn step<'a, S: Simd, Q: Query, C: Counters>(
        &'a self,
        _: S,
        node: &'a Node,
        slabs: &Self::Ray<'_>,
        interval: Interval,
        stack: &mut Stack<'_>,
        counters: &mut C,
    ) -> Next<&'a Node> {
        let (direction, alone, planes, link) = match node.kind() {
            SlantKind::Inner {
                direction,
                alone,
                planes,
                link,
            } => (direction, alone, planes, link),
            SlantKind::Leaf { first, count } => return Next::Leaf(Leaf { first, count }),
        };
        if direction < 3 {
            counters.step_boxes();
        } else {
            counters.step_oblique();
        }
        // An only child is entered through the plane where the near one of two children would be left.
        let side = slabs.flip(direction);
        let (near, far) = if side == alone {
            (planes[0], planes[1])
        } else {
            (planes[1], planes[0])
        };
        let ends = keep_min(slabs.latest(direction, near), interval.leave);
        let begins = keep_max(slabs.soonest(direction, far), interval.enter);
        let read = |index| self.node(index);
        if alone {
            visit_only(read, link, Interval::new(begins, ends))
        } else {
            let children = [link + u32::from(side), link + u32::from(!side)];
            visit_pair(read, children, [ends, begins], interval, stack)
        }
    }
}

single_rays! {
    /// Single rays through intervals along any of thirteen directions.
    fn slanted(SlantTree) -> IntervalTraversal<'a, SlantTree> {
        |kernel| IntervalTraversal(&*kernel.tree)
    }
}
