// SPDX-License-Identifier: GPL-3.0-or-later
//! Streams through octrees: the steps of [`crate::single::octants::param`] with one ray per lane.

use crate::stream::Steps;
use crate::stream::intervals::{Group, Inside};
use crate::stream::lists::{Entry, Stream};
use crate::stream::ray_state::{FAR, INV, NEAR, RayState};
use fearless_simd::{Simd, SimdBase, SimdFloat, f32x8};
use halfspace_geom::bound::{keep_max_each, keep_min_each};
use halfspace_geom::vec3::map;
use halfspace_leaf::Leaf;
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::octree_nodes::{Node, Octree};
use halfspace_ray::query::Counters;

/// Number of children of a node.
const CHILDREN: usize = 8;

/// A node and its lower corner.
#[derive(Clone, Copy)]
pub struct Cell {
    node: Node,
    low: [f32; 3],
}

impl Steps for Octree {
    type Node = Cell;
    type Scratch<S: Simd> = ();
    const INTERVALS: bool = true;

    fn root(&self) -> Cell {
        Cell {
            node: self.node(0),
            low: self.cube().corner,
        }
    }

    #[inline(always)]
    fn leaf(&self, cell: &Cell) -> Option<Leaf> {
        (!cell.node.is_inner()).then(|| cell.node.blocks())
    }

    #[inline(always)]
    fn fetch_ahead(&self, cell: &Cell, blocks: &Blocks) {
        if cell.node.is_inner() {
            self.fetch_children(cell.node);
        } else {
            blocks.fetch_ahead(cell.node.blocks().first);
        }
    }

    #[inline(always)]
    fn count<C: Counters>(&self, _: &Cell, counters: &mut C) {
        counters.step_boxes();
    }

    #[inline(always)]
    fn visit<S: Simd>(
        &self,
        simd: S,
        stream: &mut Stream<Cell>,
        own: Entry<Cell>,
        states: &[RayState],
        (): &mut (),
    ) {
        let Cell { node, low } = own.node;
        let half = self.cube().edge(node.level() + 1);
        let mid = map(low, |x| x + half);
        // Octant `i` in the order of the direction lies beyond the mid planes of the axes in `i`; the farthest is
        // pushed first.
        let children = std::array::from_fn::<_, CHILDREN, _>(|i| {
            let octant = (CHILDREN - 1 - i) ^ stream.octant;
            #[expect(clippy::cast_possible_truncation, reason = "below eight")]
            let index = node.children() + octant as u32;
            (node.empty_octants() >> octant & 1 == 0).then(|| Cell {
                node: self.node(index),
                low: map([0, 1, 2], |k: usize| {
                    if octant >> k & 1 == 1 { mid[k] } else { low[k] }
                }),
            })
        });
        stream.distribute(
            simd,
            own,
            states,
            children,
            #[inline(always)]
            |group| parts(simd, group, mid),
        );
    }

    fn bytes(&self) -> usize {
        Octree::bytes(self)
    }
}

/// The intervals of eight rays in the octants of a node, the farthest first: octants beyond a mid plane begin at it,
/// the others end there.
#[inline(always)]
fn parts<S: Simd>(simd: S, group: &Group<'_, S>, mid: [f32; 3]) -> [Inside<S>; CHILDREN] {
    let mut parts = [group.inside; CHILDREN];
    // Bit `k` of a part's index is clear beyond the plane of axis `k`. Each axis halves the parts before.
    for k in [2, 1, 0] {
        let rows = group.axis(k);
        if k == 2 {
            parts[0] = group.within(&rows);
        }
        let mid = f32x8::splat(simd, mid[k]);
        let late = mid.mul_add(rows[INV], rows[FAR]);
        let soon = mid.mul_add(rows[INV], rows[NEAR]);
        let step = 1 << k;
        for first in (0..CHILDREN).step_by(2 * step) {
            // NaN bounds nothing.
            let Inside { enter, leave } = parts[first];
            parts[first].enter = keep_max_each(soon, enter);
            parts[first + step] = Inside {
                enter,
                leave: keep_min_each(late, leave),
            };
        }
    }
    parts
}
