// SPDX-License-Identifier: GPL-3.0-or-later
//! Streams through nodes of two or four boxes, one ray per lane. The boxes of a node are visited in the order of their
//! centres along the diagonal of the octant.

use crate::stream::Steps;
use crate::stream::intervals::{Group, Inside};
use crate::stream::lists::{Entry, Stream};
use crate::stream::ray_state::{FAR, INV, NEAR, RayState};
use fearless_simd::{Simd, SimdBase, SimdFloat, f32x8};
use halfspace_geom::bound::{keep_max_each, keep_min_each};
use halfspace_leaf::Leaf;
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::box_tree::{BoxTree, INNER, Wide};
use halfspace_ray::query::Counters;

/// A child of a node.
#[derive(Clone, Copy)]
pub struct Child {
    /// Link and count, as in the node.
    link: u32,
    count: u32,
}

macro_rules! few_boxes {
    ($children:literal) => {
        impl Steps for BoxTree<$children> {
            type Node = Child;
            type Scratch<S: Simd> = ();
            const INTERVALS: bool = true;

            fn root(&self) -> Child {
                Child {
                    link: 0,
                    count: INNER,
                }
            }

            #[inline(always)]
            fn leaf(&self, node: &Child) -> Option<Leaf> {
                (node.count != INNER).then_some(Leaf {
                    first: node.link,
                    count: node.count as usize,
                })
            }

            #[inline(always)]
            fn fetch_ahead(&self, node: &Child, blocks: &Blocks) {
                BoxTree::fetch_ahead(self, node.link, node.count, blocks);
            }

            #[inline(always)]
            fn count<C: Counters>(&self, _: &Child, counters: &mut C) {
                counters.step_boxes();
            }

            #[inline(always)]
            fn visit<S: Simd>(
                &self,
                simd: S,
                stream: &mut Stream<Child>,
                own: Entry<Child>,
                states: &[RayState],
                (): &mut (),
            ) {
                let node = &self.nodes[own.node.link as usize];
                let octant = stream.octant;
                let order = order(node, octant);
                let children = order.map(|child| {
                    let (link, count) = (node.link[child], node.count[child]);
                    (count != 0).then_some(Child { link, count })
                });
                stream.distribute(
                    simd,
                    own,
                    states,
                    children,
                    #[inline(always)]
                    |group| parts(simd, group, node, octant, &order),
                );
            }

            fn bytes(&self) -> usize {
                size_of_val(&*self.nodes)
            }
        }
    };
}

few_boxes!(2);
few_boxes!(4);

/// The children of a node, the farthest along the diagonal of an octant first.
#[inline(always)]
fn order<const W: usize>(node: &Wide<W>, octant: usize) -> [usize; W] {
    let mut order = std::array::from_fn(|child| child);
    // Add the coordinates of the centres, doubled, with the signs of the octant.
    let far = std::array::from_fn::<_, W, _>(|child| {
        let along = |k: usize| {
            let sum = node.bounds[k][child] + node.bounds[k + 3][child];
            if octant >> k & 1 == 1 { -sum } else { sum }
        };
        along(0) + along(1) + along(2)
    });
    for last in 1..W {
        for i in (0..last).rev() {
            if far[order[i + 1]] > far[order[i]] {
                order.swap(i, i + 1);
            }
        }
    }
    order
}

/// The intervals of eight rays of one octant in the boxes of a node, in this order.
#[inline(always)]
fn parts<S: Simd, const W: usize>(
    simd: S,
    group: &Group<'_, S>,
    node: &Wide<W>,
    octant: usize,
    order: &[usize; W],
) -> [Inside<S>; W] {
    let rows = [group.axis(0), group.axis(1), group.axis(2)];
    let whole = group.within(&rows[0]);
    order.map(
        #[inline(always)]
        |child| {
            let mut part = whole;
            for (k, rows) in rows.iter().enumerate() {
                let back = octant >> k & 1;
                let near = f32x8::splat(simd, node.bounds[k + 3 * back][child]);
                let far = f32x8::splat(simd, node.bounds[k + 3 * (1 - back)][child]);
                let soon = near.mul_add(rows[INV], rows[NEAR]);
                let late = far.mul_add(rows[INV], rows[FAR]);
                // NaN bounds nothing.
                part.enter = keep_max_each(soon, part.enter);
                part.leave = keep_min_each(late, part.leave);
            }
            part
        },
    )
}
