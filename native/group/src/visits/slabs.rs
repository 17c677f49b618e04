// SPDX-License-Identifier: GPL-3.0-or-later
//! Interval hierarchies: the steps of [`halfspace_single::objects::slabs`] with one ray per lane.

use crate::visits::{Cut, FAR, Gap, INV, Inside, Lanes, NEAR, Nodes, Visitor};
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

impl<N: SlabNode> Nodes for SlabTree<N> {
    /// The node itself.
    type Node = N;
    const CHILDREN: usize = 2;

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
    fn visit<S: Simd>(&self, simd: S, node: &N, visitor: &mut impl Visitor<N>) {
        match node.kind() {
            SlabKind::Pair { axis, link } => {
                // The near child ends at its plane, and the far child begins at its own.
                let back = visitor.octant() >> axis & 1;
                let [below, above] = node.parts(axis, &EVERYWHERE);
                let (ends, begins) = if back == 0 {
                    (below.max[axis], above.min[axis])
                } else {
                    (above.min[axis], below.max[axis])
                };
                let near = link as usize + back;
                let far = link as usize + (back ^ 1);
                let children = [self.held(far), self.held(near)];
                let gap = Gap { axis, ends, begins };
                visitor.halve(simd, children, &gap);
            }
            SlabKind::Only { axis, link } => {
                let back = visitor.octant() >> axis & 1;
                let [inside, _] = node.parts(axis, &EVERYWHERE);
                let sides = [inside.min[axis], inside.max[axis]];
                let between = Between {
                    axis,
                    begins: sides[back],
                    ends: sides[back ^ 1],
                };
                visitor.distribute(simd, [self.held(link as usize)], &between);
            }
            SlabKind::Leaf { .. } => {}
        }
    }

    fn bytes(&self) -> usize {
        size_of_val(&*self.nodes)
    }
}

/// The only child of a node: it begins at one plane and ends at the other. A plane at infinity cuts off nothing.
struct Between {
    axis: usize,
    begins: f32,
    ends: f32,
}

impl<S: Simd> Cut<S, 1> for Between {
    #[inline(always)]
    fn cut<L: Lanes<S>>(&self, simd: S, lanes: &L) -> [Inside<S>; 1] {
        let rows = lanes.axis(self.axis % 3);
        let Inside { enter, leave } = lanes.within(&rows);
        let [soon, late] = [self.begins, self.ends].map(|plane| f32x8::splat(simd, plane));
        [Inside {
            enter: keep_max_each(soon.mul_add(rows[INV], rows[NEAR]), enter),
            leave: keep_min_each(late.mul_add(rows[INV], rows[FAR]), leave),
        }]
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
