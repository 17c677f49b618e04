// SPDX-License-Identifier: GPL-3.0-or-later
//! Single rays through nodes bounded by slabs; a heap yields the nearest node (Kay and Kajiya 1986).

use crate::single_rays;
use fearless_simd::Simd;
use halfspace_geom::bound::{keep_max, keep_min};
use halfspace_leaf::{Job, Leaf};
use halfspace_nodes::dop_tree::{DopTree, INNER, NORMALS, Node};
use halfspace_ray::query::{Best, Counters, NoCount, Query};
use halfspace_ray::{FrameRay, Interval, RayRef};
use halfspace_trace::batch::SingleTraversal;
use halfspace_trace::slabs::Slabs;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// The slab test coefficients of a ray: it crosses the plane `n . x = p` no sooner than `p * inv + near` and no
/// later than `p * inv + far`.
pub struct Planes<const D: usize> {
    inv: [f32; D],
    near: [f32; D],
    far: [f32; D],
    /// Whether the ray enters through the upper plane.
    flip: [bool; D],
}

impl<const D: usize> Planes<D> {
    /// Computes the coefficients of a ray.
    #[inline(always)]
    pub fn new(ray: &FrameRay) -> Self {
        let slabs = Slabs::new(ray);
        let mut planes = Self {
            inv: [0.0; D],
            near: [f32::NEG_INFINITY; D],
            far: [f32::INFINITY; D],
            flip: [false; D],
        };
        // Axes use the slabs of boxes.
        for k in 0..3 {
            planes.inv[k] = slabs.inv[k];
            planes.near[k] = slabs.near[k];
            planes.far[k] = slabs.far[k];
            planes.flip[k] = slabs.entry_row(k) == 1;
        }
        // Oblique normals divide by the speed along the normal, moved off zero.
        for (k, n) in NORMALS.iter().enumerate().take(D).skip(3) {
            let dot = |v: [f32; 3]| n[0] * v[0] + n[1] * v[1] + n[2] * v[2];
            let speed = dot(ray.d);
            let inv = 1.0 / (speed + f32::MIN_POSITIVE.copysign(speed));
            let shift = dot(ray.o) * inv;
            // The frame's bound is 28 u for normals of unit length; these need 30 u.
            let slack = 2.0 * ray.oblique_pad * inv.abs();
            // If a product may overflow, the slab bounds nothing.
            if (4.0 * ray.span * inv).is_finite() && (slack + shift.abs()).is_finite() {
                planes.inv[k] = inv;
                planes.near[k] = -shift - slack;
                planes.far[k] = -shift + slack;
            }
            planes.flip[k] = speed.is_sign_negative();
        }
        planes
    }

    /// Whether the ray goes downwards along normal `k`, and so enters through the upper plane.
    #[inline(always)]
    pub fn flip(&self, k: usize) -> bool {
        self.flip[k]
    }

    /// Lower bound on the distance at which the ray crosses a plane of normal `k`.
    #[inline(always)]
    pub fn soonest(&self, k: usize, plane: f32) -> f32 {
        plane * self.inv[k] + self.near[k]
    }

    /// Upper bound on the distance at which the ray crosses a plane of normal `k`.
    #[inline(always)]
    pub fn latest(&self, k: usize, plane: f32) -> f32 {
        plane * self.inv[k] + self.far[k]
    }

    /// The entry distance of a node that the ray may hit within an interval, or `None` if it provably misses it.
    #[inline(always)]
    fn meet(&self, node: &Node<D>, within: Interval) -> Option<f32> {
        let Interval {
            mut enter,
            mut leave,
        } = within;
        for k in 0..D {
            let (low, high) = (node.low[k], node.high[k]);
            let (near, far) = if self.flip[k] {
                (high, low)
            } else {
                (low, high)
            };
            enter = keep_max(near * self.inv[k] + self.near[k], enter);
            leave = keep_min(far * self.inv[k] + self.far[k], leave);
        }
        (enter <= leave).then_some(enter)
    }
}

/// A heap entry. The nearest node is the greatest entry; of equally near ones the one with the smaller index.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeapEntry {
    enter: f32,
    node: u32,
}

impl Eq for HeapEntry {}

impl PartialOrd for HeapEntry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for HeapEntry {
    fn cmp(&self, other: &Self) -> Ordering {
        other
            .enter
            .total_cmp(&self.enter)
            .then(other.node.cmp(&self.node))
    }
}

/// The traversal of one tree by single rays.
pub struct DopTraversal<'a, const D: usize>(pub &'a DopTree<D>);

impl<const D: usize> SingleTraversal for DopTraversal<'_, D> {
    type Scratch = BinaryHeap<HeapEntry>;
    type Uncounted = NoCount;

    fn scratch(&self) -> Self::Scratch {
        BinaryHeap::new()
    }

    #[inline(always)]
    fn cast<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        job: Job<'_>,
        ray: RayRef<'_>,
        heap: &mut Self::Scratch,
        counters: &mut C,
    ) -> Best {
        let frame = ray.frame;
        let planes = Planes::<D>::new(frame);
        let mut best = Best::new(frame);
        heap.clear();
        heap.push(HeapEntry {
            enter: frame.t_min,
            node: 0,
        });
        while let Some(HeapEntry { enter, node }) = heap.pop() {
            if enter > best.reach {
                break;
            }
            // Test the triangles of a leaf.
            let Node { link, count, .. } = self.0.nodes[node as usize];
            if count & INNER == 0 {
                let leaf = Leaf {
                    first: link,
                    count: count as usize,
                };
                counters.leaf(leaf.count);
                if job.test_any::<S, Q, C>(simd, leaf, ray, frame.t_max, &mut best, counters) {
                    break;
                }
                continue;
            }
            // Put the children that may be hit on the heap.
            counters.step_boxes();
            let first = link as usize;
            let children = &self.0.nodes[first..first + (count & !INNER) as usize];
            let range = Interval::new(frame.t_min, best.reach);
            for (node, child) in (link..).zip(children) {
                if let Some(enter) = planes.meet(child, range) {
                    heap.push(HeapEntry { enter, node });
                }
            }
        }
        best
    }
}

single_rays! {
    /// Single rays through nodes bounded by 3 slabs, by a priority queue (Kay and Kajiya 1986).
    fn dops3(DopTree<3>) -> DopTraversal<'a, 3> {
        |kernel| DopTraversal(&kernel.tree)
    }
}

single_rays! {
    /// Single rays through nodes bounded by 7 slabs, by a priority queue (Kay and Kajiya 1986).
    fn dops7(DopTree<7>) -> DopTraversal<'a, 7> {
        |kernel| DopTraversal(&kernel.tree)
    }
}

single_rays! {
    /// Single rays through nodes bounded by 13 slabs, by a priority queue (Kay and Kajiya 1986).
    fn dops13(DopTree<13>) -> DopTraversal<'a, 13> {
        |kernel| DopTraversal(&kernel.tree)
    }
}

#[cfg(test)]
mod tests;
