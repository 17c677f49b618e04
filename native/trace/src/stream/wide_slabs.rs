// SPDX-License-Identifier: GPL-3.0-or-later
//! Streams through interval hierarchies with an interval per child: the steps of
//! [`crate::single::objects::wide_slabs`] with one ray per lane. The children of a node are visited in the order of the
//! planes of entry.

use crate::stream::Steps;
use crate::stream::intervals::{Group, Inside};
use crate::stream::lists::{Entry, Stream};
use crate::stream::ray_state::{FAR, INV, NEAR, RayState};
use fearless_simd::{Simd, SimdBase, SimdFloat, f32x8};
use halfspace_geom::bound::{keep_max_each, keep_min_each};
use halfspace_leaf::Leaf;
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::slab_wide::{LEAF, Node, WideSlabs};
use halfspace_ray::query::Counters;
use prefetch_index::prefetch_index;

impl<const W: usize> Steps for WideSlabs<W> {
    /// Index of the node.
    type Node = u32;
    type Scratch<S: Simd> = ();
    const INTERVALS: bool = true;

    fn root(&self) -> u32 {
        0
    }

    #[inline(always)]
    fn leaf(&self, node: &u32) -> Option<Leaf> {
        let node = &self.nodes[*node as usize];
        (node.word & LEAF == LEAF).then(|| Leaf {
            first: node.planes[0][0].to_bits(),
            count: node.link() as usize,
        })
    }

    #[inline(always)]
    fn fetch_ahead(&self, node: &u32, blocks: &Blocks) {
        match Steps::leaf(self, node) {
            Some(leaf) => blocks.fetch_ahead(leaf.first),
            None => prefetch_index(&self.nodes, self.nodes[*node as usize].link() as usize),
        }
    }

    #[inline(always)]
    fn count<C: Counters>(&self, _: &u32, counters: &mut C) {
        counters.step_boxes();
    }

    #[inline(always)]
    fn visit<S: Simd>(
        &self,
        simd: S,
        stream: &mut Stream<u32>,
        own: Entry<u32>,
        states: &[RayState],
        (): &mut (),
    ) {
        let node = &self.nodes[own.node as usize];
        let axis = (node.word & LEAF) as usize % 3;
        let cuts = Cuts {
            node,
            axis,
            near: stream.octant >> axis & 1,
        };
        let order = cuts.order();
        let children = order.map(|child| {
            (child < node.children() as usize).then(|| {
                #[expect(clippy::cast_possible_truncation, reason = "at most 8")]
                let child = child as u32;
                node.link() + child
            })
        });
        stream.distribute(
            simd,
            own,
            states,
            children,
            #[inline(always)]
            |group| cuts.parts(simd, group, &order),
        );
    }

    fn bytes(&self) -> usize {
        size_of_val(&*self.nodes)
    }
}

/// A node as the rays of one octant meet it.
struct Cuts<'a, const W: usize> {
    node: &'a Node<W>,
    axis: usize,
    /// The row of the planes of entry.
    near: usize,
}

impl<const W: usize> Cuts<'_, W> {
    /// The children, the last to be entered first.
    #[inline(always)]
    fn order(&self) -> [usize; W] {
        let mut order = std::array::from_fn(|child| child);
        let along = self.node.planes[self.near].map(|x| if self.near == 1 { -x } else { x });
        for last in 1..W {
            for i in (0..last).rev() {
                if along[order[i + 1]] > along[order[i]] {
                    order.swap(i, i + 1);
                }
            }
        }
        order
    }

    /// The intervals of eight rays in the children, in this order.
    #[inline(always)]
    fn parts<S: Simd>(&self, simd: S, group: &Group<'_, S>, order: &[usize; W]) -> [Inside<S>; W] {
        let rows = group.axis(self.axis);
        let Inside { enter, leave } = group.within(&rows);
        order.map(
            #[inline(always)]
            |child| {
                let near = f32x8::splat(simd, self.node.planes[self.near][child]);
                let far = f32x8::splat(simd, self.node.planes[1 - self.near][child]);
                // NaN bounds nothing.
                Inside {
                    enter: keep_max_each(near.mul_add(rows[INV], rows[NEAR]), enter),
                    leave: keep_min_each(far.mul_add(rows[INV], rows[FAR]), leave),
                }
            },
        )
    }
}
