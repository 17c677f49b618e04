// SPDX-License-Identifier: GPL-3.0-or-later
//! Nodes of two or four boxes, one ray per lane. The boxes of a node are visited in the order of their
//! centres along the diagonal of the octant.

use crate::visits::{Cut, FAR, INV, Inside, Lanes, NEAR, Nodes, Visitor};
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

/// Implements visits for nodes of this number of boxes.
macro_rules! few_boxes {
    ($children:literal) => {
        impl Nodes for BoxTree<$children> {
            type Node = Child;
            const CHILDREN: usize = $children;

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
            fn visit<S: Simd>(&self, simd: S, node: &Child, visitor: &mut impl Visitor<Child>) {
                let node = &self.nodes[node.link as usize];
                let octant = visitor.octant();
                let order = order(node, octant);
                let children = order.map(|child| {
                    let (link, count) = (node.link[child], node.count[child]);
                    (count != 0).then_some(Child { link, count })
                });
                let boxes = Boxes {
                    node,
                    octant,
                    order,
                };
                visitor.distribute(simd, children, &boxes);
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
    // Sort the few children by insertion.
    for last in 1..W {
        for i in (0..last).rev() {
            if far[order[i + 1]] > far[order[i]] {
                order.swap(i, i + 1);
            }
        }
    }
    order
}

/// The boxes of a node, the farthest along the diagonal of an octant first.
struct Boxes<'a, const W: usize> {
    node: &'a Wide<W>,
    octant: usize,
    order: [usize; W],
}

impl<S: Simd, const W: usize> Cut<S, W> for Boxes<'_, W> {
    #[inline(always)]
    fn cut<L: Lanes<S>>(&self, simd: S, lanes: &L) -> [Inside<S>; W] {
        let rows = [lanes.axis(0), lanes.axis(1), lanes.axis(2)];
        let whole = lanes.within(&rows[0]);
        let bounds = &self.node.bounds;
        self.order.map(
            #[inline(always)]
            |child| {
                let mut part = whole;
                for (k, rows) in rows.iter().enumerate() {
                    let back = self.octant >> k & 1;
                    let near = f32x8::splat(simd, bounds[k + 3 * back][child]);
                    let far = f32x8::splat(simd, bounds[k + 3 * (1 - back)][child]);
                    // Ignore a distance that is NaN.
                    part.enter = keep_max_each(near.mul_add(rows[INV], rows[NEAR]), part.enter);
                    part.leave = keep_min_each(far.mul_add(rows[INV], rows[FAR]), part.leave);
                }
                part
            },
        )
    }
}
