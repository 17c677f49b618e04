// SPDX-License-Identifier: GPL-3.0-or-later
//! Single rays through nodes of two, four or eight boxes. The nearest box is visited first, the others go to a stack.

use crate::single_rays;
use fearless_simd::{Simd, f32x4, f32x8};
use halfspace_leaf::{Job, Leaf};
use halfspace_nodes::box_tree::{BoxTree, INNER, WIDEST};
use halfspace_nodes::plane_tree::MAX_DEPTH;
use halfspace_ray::query::{Best, Counters, Query};
use halfspace_ray::{Hit, Interval, RayRef};
use halfspace_trace::batch::SingleTraversal;
use halfspace_trace::slabs::Slabs;
use halfspace_trace::stack::{Entry, Stack};

/// A stack entry: a box still to visit and its entry distance.
#[derive(Debug, Clone, Copy, Default)]
pub struct BoxEntry {
    /// Distance where the ray enters the box.
    pub enter: f32,
    /// Link of the child.
    pub link: u32,
    /// Count of the child.
    pub count: u32,
}

impl Entry for BoxEntry {
    #[inline(always)]
    fn enter(&self) -> f32 {
        self.enter
    }
}

/// The traversal of one tree by single rays.
pub struct BoxTraversal<'a, const W: usize>(pub &'a BoxTree<W>);

impl<const W: usize> SingleTraversal for BoxTraversal<'_, W> {
    type Scratch = Vec<BoxEntry>;

    fn scratch(&self) -> Self::Scratch {
        // Each level leaves at most all children but one on the stack, and the lowest level all of them.
        vec![BoxEntry::default(); (MAX_DEPTH + 1) * (W - 1) + 2 * WIDEST]
    }

    #[inline(always)]
    fn cast<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        job: Job<'_>,
        ray: RayRef<'_>,
        scratch: &mut Self::Scratch,
        counters: &mut C,
    ) -> Hit {
        let frame = ray.frame;
        let slabs = Slabs::new(frame);
        let mut best = Best::new(frame);
        let mut stack = Stack::new(scratch);
        let mut node = &self.0.nodes[0];
        loop {
            // Test all children, and push those that may be hit, the nearest on top.
            counters.step_boxes();
            let mut enters = [0.0; W];
            let range = Interval::new(frame.t_min, best.reach);
            let mut hits = match W {
                8 => slabs.test::<S, f32x8<S>, W>(simd, &node.bounds, range, &mut enters),
                4 => slabs.test::<S, f32x4<S>, W>(simd, &node.bounds, range, &mut enters),
                _ => slabs.test_few(&node.bounds, range, &mut enters),
            };
            let child = |lane: usize| BoxEntry {
                enter: enters[lane],
                link: node.link[lane],
                count: node.count[lane],
            };
            let mut ahead = None;
            let base = stack.size();
            let first = hits.trailing_zeros() as usize % W;
            if hits & hits.wrapping_sub(1) == 0 {
                // Common case: at most one child is hit, nothing to sort. It is no empty slot: a ray that hits
                // those hits all slots.
                ahead = (hits != 0).then(|| child(first));
                hits = 0;
            }
            while hits != 0 {
                let lane = hits.trailing_zeros() as usize % W;
                hits &= hits - 1;
                // Skip empty slots, which a ray without any bounding axis hits too.
                if node.count[lane] == 0 {
                    continue;
                }
                let entry = child(lane);
                self.0.fetch_ahead(entry.link, entry.count, job.blocks);
                stack.insert::<Q>(base, entry);
            }

            // Pop the nearest box, and test leaves until an inner node comes up.
            node = loop {
                let Some(next) = ahead.take().or_else(|| stack.pop()) else {
                    return best.hit();
                };
                // Skip boxes behind the best hit, which may have come nearer since they were pushed.
                if next.enter > best.reach {
                    continue;
                }
                if next.count == INNER {
                    break &self.0.nodes[next.link as usize];
                }
                let leaf = Leaf {
                    first: next.link,
                    count: next.count as usize,
                };
                counters.leaf(leaf.count);
                if job.test::<S, Q, C>(simd, leaf, ray, frame.t_max, &mut best, counters) {
                    return best.hit();
                }
            };
        }
    }
}

single_rays! {
    /// Single rays through nodes of 2 boxes, the nearest first.
    fn boxes2(BoxTree<2>) -> BoxTraversal<'a, 2> {
        |kernel| BoxTraversal(&kernel.tree)
    }
}

single_rays! {
    /// Single rays through nodes of 4 boxes, the nearest first.
    fn boxes4(BoxTree<4>) -> BoxTraversal<'a, 4> {
        |kernel| BoxTraversal(&kernel.tree)
    }
}

single_rays! {
    /// Single rays through nodes of 8 boxes, the nearest first.
    fn boxes8(BoxTree<8>) -> BoxTraversal<'a, 8> {
        |kernel| BoxTraversal(&kernel.tree)
    }
}
