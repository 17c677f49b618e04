// SPDX-License-Identifier: GPL-3.0-or-later
//! A bounding interval hierarchy walked as a hierarchy of boxes: nodes store two planes as ever, and
//! each box is made from its parent's on the way down, one or two of its faces being moved (Wächter
//! and Keller 2006; Wald, Boulos and Shirley 2007).

use super::batch;
use super::blocks::Blocks;
use super::box_tree::Slabs;
use super::frame::FrameRay;
use super::pending::{Waits, next};
use super::query::{Best, Counters, Query};
use super::ray::{Hit, Ray};
use super::slab_node::{Kind, SlabNode};
use super::slab_tree::SlabTree;
use crate::build::plane_tree::MAX_DEPTH;
use crate::geom::Aabb;
use crate::scene::Triangles;
use fearless_simd::Simd;

/// A child still to visit, where the ray enters its box, and that box.
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

/// The walk over one tree over a scene of these bounds.
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
        (scene, blocks): (&Triangles, &Blocks),
        (ray, frame): (&Ray, &FrameRay),
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
                Kind::Pair { axis, link } => {
                    counters.step_axis();
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
                Kind::Only { axis, link } => {
                    counters.step_axis();
                    let [inside, _] = node.parts(axis, &region);
                    if slabs.meet(&inside, (frame.t_min, best.reach)).is_some() {
                        (node, region) = (nodes[link as usize], inside);
                        continue;
                    }
                }
                Kind::Leaf { first, count } => {
                    counters.leaf(count);
                    if blocks.test_any::<S, Q, C>(
                        simd,
                        (first, count),
                        scene,
                        (ray, frame, frame.t_max),
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
