// SPDX-License-Identifier: GPL-3.0-or-later
//! Interval hierarchies with an interval per child: the steps of [`halfspace_single::objects::wide_slabs`] with one ray
//! per lane. The children of a node are visited in the order of the planes of entry.

use crate::visits::{Cut, FAR, INV, Inside, Lanes, NEAR, Nodes, Visitor};
use fearless_simd::{Simd, SimdBase, SimdFloat, f32x8};
use halfspace_geom::bound::{keep_max_each, keep_min_each};
use halfspace_leaf::Leaf;
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::slab_wide::{LEAF, Node, WideSlabs};
use halfspace_ray::query::Counters;
use prefetch_index::prefetch_index;

impl<const W: usize> Nodes for WideSlabs<W> {
    /// Index of the node.
    type Node = u32;
    const CHILDREN: usize = W;

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
        match Nodes::leaf(self, node) {
            Some(leaf) => blocks.fetch_ahead(leaf.first),
            None => prefetch_index(&self.nodes, self.nodes[*node as usize].link() as usize),
        }
    }

    #[inline(always)]
    fn count<C: Counters>(&self, _: &u32, counters: &mut C) {
        counters.step_boxes();
    }

    #[inline(always)]
    fn visit<S: Simd>(&self, simd: S, node: &u32, visitor: &mut impl Visitor<u32>) {
        let node = &self.nodes[*node as usize];
        let axis = (node.word & LEAF) as usize % 3;
        let cuts = Cuts {
            node,
            axis,
            near: visitor.octant() >> axis & 1,
        };
        let order = cuts.order();
        let children = order.map(|child| {
            (child < node.children() as usize).then(|| {
                #[expect(clippy::cast_possible_truncation, reason = "at most 8")]
                let child = child as u32;
                node.link() + child
            })
        });
        visitor.distribute(simd, children, &Ordered { cuts, order });
    }

    fn bytes(&self) -> usize {
        size_of_val(&*self.nodes)
    }
}

/// A node, seen by the rays of one octant.
#[derive(Clone, Copy)]
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
        // Sort the few children by insertion.
        for last in 1..W {
            for i in (0..last).rev() {
                if along[order[i + 1]] > along[order[i]] {
                    order.swap(i, i + 1);
                }
            }
        }
        order
    }
}

/// The children of a node, the last to be entered first.
struct Ordered<'a, const W: usize> {
    cuts: Cuts<'a, W>,
    order: [usize; W],
}

impl<S: Simd, const W: usize> Cut<S, W> for Ordered<'_, W> {
    #[inline(always)]
    fn cut<L: Lanes<S>>(&self, simd: S, lanes: &L) -> [Inside<S>; W] {
        let Cuts { node, axis, near } = self.cuts;
        let rows = lanes.axis(axis);
        let Inside { enter, leave } = lanes.within(&rows);
        self.order.map(
            #[inline(always)]
            |child| {
                let soon = f32x8::splat(simd, node.planes[near][child]);
                let late = f32x8::splat(simd, node.planes[1 - near][child]);
                // Ignore a distance that is NaN.
                Inside {
                    enter: keep_max_each(soon.mul_add(rows[INV], rows[NEAR]), enter),
                    leave: keep_min_each(late.mul_add(rows[INV], rows[FAR]), leave),
                }
            },
        )
    }
}
