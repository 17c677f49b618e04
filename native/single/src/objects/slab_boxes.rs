// SPDX-License-Identifier: GPL-3.0-or-later
//! Bounding interval hierarchies traversed as hierarchies of boxes: nodes store two planes as usual, and each
//! box is derived from its parent's during the descent by moving one or two faces (Wächter and Keller 2006;
//! Wald, Boulos and Shirley 2007).

use crate::single_rays;
use fearless_simd::Simd;
use halfspace_geom::Aabb;
use halfspace_leaf::{Job, Leaf};
use halfspace_nodes::plane_tree::MAX_DEPTH;
use halfspace_nodes::slab_boxes::SlabBoxes;
use halfspace_nodes::slab_node::{Double, SlabKind, SlabNode};
use halfspace_nodes::slab_tree::SlabTree;
use halfspace_ray::query::{Best, Counters, NoCount, Query};
use halfspace_ray::{Interval, RayRef};
use halfspace_trace::batch::SingleTraversal;
use halfspace_trace::slabs::Slabs;
use halfspace_trace::stack::{Entry, Stack};

/// A stack entry: a node, the ray's entry distance, and the node's box.
#[derive(Clone, Copy)]
pub struct RegionEntry {
    node: u32,
    enter: f32,
    region: Aabb,
}

impl Entry for RegionEntry {
    #[inline(always)]
    fn enter(&self) -> f32 {
        self.enter
    }
}

/// The traversal of one tree.
pub struct SlabBoxTraversal<'a, N> {
    tree: &'a SlabTree<N>,
    /// The scene's box in the frame.
    bounds: Aabb,
}

impl<'a, N> SlabBoxTraversal<'a, N> {
    /// The traversal of this tree. `bounds`: the scene's box in the frame.
    pub fn new(tree: &'a SlabTree<N>, bounds: Aabb) -> Self {
        Self { tree, bounds }
    }
}

impl<N: SlabNode> SingleTraversal for SlabBoxTraversal<'_, N> {
    type Scratch = [RegionEntry; MAX_DEPTH + 1];
    type Uncounted = NoCount;

    fn scratch(&self) -> Self::Scratch {
        let none = RegionEntry {
            node: 0,
            enter: 0.0,
            region: Aabb::EMPTY,
        };
        [none; MAX_DEPTH + 1]
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
        let frame = ray.frame;
        let nodes = &self.tree.nodes[..];
        let slabs = Slabs::new(frame);
        let mut best = Best::new(frame);
        let mut stack = Stack::new(scratch);
        let mut node = nodes[0];
        let mut region = self.bounds;
        loop {
            match node.kind() {
                SlabKind::Pair { axis, link } => {
                    counters.step_boxes();
                    // Intersect the boxes of both children; visit the near one, push the far one.
                    let parts = node.parts(axis, &region);
                    let side = frame.negative[axis] as usize & 1;
                    let range = Interval::new(frame.t_min, best.reach);
                    let near = slabs.meet(&parts[side], range);
                    let far = slabs.meet(&parts[side ^ 1], range);
                    let children = [link, link + 1];
                    if near.is_some() {
                        if let Some(enter) = far {
                            stack.push(RegionEntry {
                                node: children[side ^ 1],
                                enter,
                                region: parts[side ^ 1],
                            });
                        }
                        (node, region) = (nodes[children[side] as usize], parts[side]);
                        continue;
                    }
                    if far.is_some() {
                        (node, region) = (nodes[children[side ^ 1] as usize], parts[side ^ 1]);
                        continue;
                    }
                }
                SlabKind::Only { axis, link } => {
                    counters.step_boxes();
                    // Visit the only child if the ray meets its box.
                    let [inside, _] = node.parts(axis, &region);
                    let range = Interval::new(frame.t_min, best.reach);
                    if slabs.meet(&inside, range).is_some() {
                        (node, region) = (nodes[link as usize], inside);
                        continue;
                    }
                }
                SlabKind::Leaf { first, count } => {
                    counters.leaf(count);
                    let (leaf, leave) = (Leaf { first, count }, frame.t_max);
                    if job.test_any::<S, Q, C>(simd, leaf, ray, leave, &mut best, counters) {
                        return best;
                    }
                }
            }
            let Some(child) = stack.pop_within(best.reach) else {
                return best;
            };
            (node, region) = (nodes[child.node as usize], child.region);
        }
    }
}

single_rays! {
    /// Single rays through the boxes that intervals leave.
    fn slab_boxes(SlabBoxes) -> SlabBoxTraversal<'a, Double> {
        |kernel| SlabBoxTraversal::new(&kernel.tree.tree, kernel.tree.bounds)
    }
}
