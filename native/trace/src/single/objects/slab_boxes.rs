// SPDX-License-Identifier: GPL-3.0-or-later
//! Bounding interval hierarchies traversed as hierarchies of boxes: nodes store two planes as usual, and each
//! box is derived from its parent's during the descent by moving one or two faces (Wächter and Keller 2006;
//! Wald, Boulos and Shirley 2007).

use crate::batch;
use crate::pending::{Waits, next};
use crate::single::single_rays;
use crate::slabs::Slabs;
use fearless_simd::Simd;
use halfspace_geom::Aabb;
use halfspace_leaf::{Job, Leaf};
use halfspace_nodes::plane_tree::MAX_DEPTH;
use halfspace_nodes::slab_node::{Double, SlabKind, SlabNode};
use halfspace_nodes::slab_tree::SlabTree;
use halfspace_ray::query::{Best, Counters, Query};
use halfspace_ray::{Hit, RayRef};

/// A stack entry: a node, the ray's entry distance, and the node's box.
#[derive(Clone, Copy)]
pub struct Pending {
    node: u32,
    enter: f32,
    region: Aabb,
}

impl Waits for Pending {
    #[inline(always)]
    fn enter(&self) -> f32 {
        self.enter
    }
}

/// The traversal of one tree over a scene with these bounds.
pub struct Walk<'a, N>(pub &'a SlabTree<N>, pub Aabb);

impl<N: SlabNode> batch::Walk for Walk<'_, N> {
    type Scratch = [Pending; MAX_DEPTH + 1];

    fn scratch(&self) -> Self::Scratch {
        let none = Pending {
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
        RayRef { ray, frame }: RayRef<'_>,
        stack: &mut Self::Scratch,
        counters: &mut C,
    ) -> Hit {
        let nodes = &self.0.nodes[..];
        let slabs = Slabs::new(frame);
        let mut best = Best::new(frame);
        let mut waiting = 0;
        let mut node = nodes[0];
        let mut region = self.1;
        loop {
            match node.kind() {
                SlabKind::Pair { axis, link } => {
                    counters.step_boxes();
                    // Intersect the boxes of both children; visit the near one, push the far one.
                    let parts = node.parts(axis, &region);
                    let side = frame.negative[axis] as usize & 1;
                    let range = (frame.t_min, best.reach);
                    let (near, far) = (
                        slabs.meet(&parts[side], range),
                        slabs.meet(&parts[side ^ 1], range),
                    );
                    let places = [link, link + 1];
                    if near.is_some() {
                        if let Some(enter) = far {
                            stack[waiting] = Pending {
                                node: places[side ^ 1],
                                enter,
                                region: parts[side ^ 1],
                            };
                            waiting += 1;
                        }
                        (node, region) = (nodes[places[side] as usize], parts[side]);
                        continue;
                    }
                    if far.is_some() {
                        (node, region) = (nodes[places[side ^ 1] as usize], parts[side ^ 1]);
                        continue;
                    }
                }
                SlabKind::Only { axis, link } => {
                    counters.step_boxes();
                    // Visit the only child if the ray meets its box.
                    let [inside, _] = node.parts(axis, &region);
                    if slabs.meet(&inside, (frame.t_min, best.reach)).is_some() {
                        (node, region) = (nodes[link as usize], inside);
                        continue;
                    }
                }
                SlabKind::Leaf { first, count } => {
                    counters.leaf(count);
                    if job.test_any::<S, Q, C>(
                        simd,
                        Leaf { first, count },
                        RayRef { ray, frame },
                        frame.t_max,
                        &mut best,
                        counters,
                    ) {
                        return best.hit();
                    }
                }
            }
            let Some(child) = next(stack, &mut waiting, best.reach) else {
                return best.hit();
            };
            (node, region) = (nodes[child.node as usize], child.region);
        }
    }
}

single_rays! {
    /// Single rays through the boxes that intervals leave. `bounds`: the scene's box in the frame.
    fn slab_boxes(SlabTree<Double>, bounds: Aabb) -> Walk<'a, Double> {
        |kernel| Walk(&kernel.tree, kernel.bounds)
    }
}
