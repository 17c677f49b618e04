// SPDX-License-Identifier: GPL-3.0-or-later
//! Streams through interval hierarchies: the steps of [`crate::single::objects::slabs`] with one ray per lane.

use crate::stream::Steps;
use crate::stream::intervals::{Gap, Inside};
use crate::stream::lists::{Entry, Stream};
use crate::stream::ray_state::{FAR, INV, NEAR, RayState};
use fearless_simd::{Simd, SimdBase, SimdFloat, f32x8};
use halfspace_geom::Aabb;
use halfspace_geom::bound::{keep_max_each, keep_min_each};
use halfspace_leaf::Leaf;
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::slab_node::{SlabKind, SlabNode};
use halfspace_nodes::slab_tree::SlabTree;
use halfspace_ray::query::Counters;
use prefetch_index::prefetch_index;

/// The region of a node of which no plane is known.
const EVERYWHERE: Aabb = Aabb {
    min: [f32::NEG_INFINITY; 3],
    max: [f32::INFINITY; 3],
};

impl<N: SlabNode> Steps for SlabTree<N> {
    /// The node itself.
    type Node = N;
    type Scratch<S: Simd> = ();
    const INTERVALS: bool = true;

    fn root(&self) -> N {
        self.nodes[0]
    }

    #[inline(always)]
    fn leaf(&self, node: &N) -> Option<Leaf> {
        match node.kind() {
            SlabKind::Leaf { first, count } => Some(Leaf { first, count }),
            _ => None,
        }
    }

    #[inline(always)]
    fn fetch_ahead(&self, node: &N, blocks: &Blocks) {
        match node.kind() {
            SlabKind::Leaf { first, .. } => blocks.fetch_ahead(first),
            SlabKind::Pair { link, .. } | SlabKind::Only { link, .. } => {
                // The second child may begin in the next cache line.
                prefetch_index(&self.nodes, link as usize);
                prefetch_index(&self.nodes, link as usize + 1);
            }
        }
    }

    #[inline(always)]
    fn count<C: Counters>(&self, _: &N, counters: &mut C) {
        counters.step_boxes();
    }

    #[inline(always)]
    fn visit<S: Simd>(
        &self,
        simd: S,
        stream: &mut Stream<N>,
        own: Entry<N>,
        states: &[RayState],
        (): &mut (),
    ) {
        match own.node.kind() {
            SlabKind::Pair { axis, link } => {
                // The near child ends at its plane, and the far child begins at its own.
                let back = stream.octant >> axis & 1;
                let [below, above] = own.node.parts(axis, &EVERYWHERE);
                let (ends, begins) = if back == 0 {
                    (below.max[axis], above.min[axis])
                } else {
                    (above.min[axis], below.max[axis])
                };
                let near = link as usize + back;
                let far = link as usize + (back ^ 1);
                let children = [self.held(far), self.held(near)];
                let gap = Gap { axis, ends, begins };
                stream.halve(simd, own, states, children, gap);
            }
            SlabKind::Only { axis, link } => {
                let back = stream.octant >> axis & 1;
                let [inside, _] = own.node.parts(axis, &EVERYWHERE);
                let sides = [inside.min[axis], inside.max[axis]];
                stream.distribute(
                    simd,
                    own,
                    states,
                    [self.held(link as usize)],
                    #[inline(always)]
                    |group| {
                        // A plane at infinity, or a distance that is NaN, cuts off nothing.
                        let rows = group.axis(axis % 3);
                        let Inside { enter, leave } = group.within(&rows);
                        let [soon, late] =
                            [sides[back], sides[back ^ 1]].map(|x| f32x8::splat(simd, x));
                        [Inside {
                            enter: keep_max_each(soon.mul_add(rows[INV], rows[NEAR]), enter),
                            leave: keep_min_each(late.mul_add(rows[INV], rows[FAR]), leave),
                        }]
                    },
                );
            }
            SlabKind::Leaf { .. } => {}
        }
    }

    fn bytes(&self) -> usize {
        size_of_val(&*self.nodes)
    }
}

/// Children as stack entries hold them.
trait Held {
    /// A node.
    type Node;

    /// The node with this index, `None` for an empty leaf.
    fn held(&self, index: usize) -> Option<Self::Node>;
}

impl<N: SlabNode> Held for SlabTree<N> {
    type Node = N;

    #[inline(always)]
    fn held(&self, index: usize) -> Option<N> {
        let node = self.nodes[index];
        let empty = matches!(node.kind(), SlabKind::Leaf { count: 0, .. });
        (!empty).then_some(node)
    }
}
