// SPDX-License-Identifier: GPL-3.0-or-later
//! Octrees: the steps of [`halfspace_single::octants::param`] with one ray per lane.

use crate::visits::{Cut, FAR, INV, Inside, Lanes, NEAR, Nodes, Visitor};
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

impl Cell {
    /// Where the mid planes of an inner node lie.
    #[inline(always)]
    pub fn mid(&self, tree: &Octree) -> [f32; 3] {
        let half = tree.cube().edge(self.node.level() + 1);
        map(self.low, |x| x + half)
    }

    /// The octant of an inner node that lies above the mid planes of the axes in `octant`; `None` for an empty leaf.
    #[inline(always)]
    pub fn child(&self, tree: &Octree, octant: usize, mid: [f32; 3]) -> Option<Self> {
        let octant = octant % CHILDREN;
        #[expect(clippy::cast_possible_truncation, reason = "below eight")]
        let index = self.node.children() + octant as u32;
        (self.node.empty_octants() >> octant & 1 == 0).then(|| Self {
            node: tree.node(index),
            low: map([0, 1, 2], |k: usize| {
                if octant >> k & 1 == 1 {
                    mid[k]
                } else {
                    self.low[k]
                }
            }),
        })
    }
}

impl Nodes for Octree {
    type Node = Cell;
    const CHILDREN: usize = CHILDREN;

    fn root(&self) -> Cell {
        Cell {
            node: self.node(0),
            low: self.cube().corner,
        }
    }

    #[inline(always)]
    fn leaf(&self, node: &Cell) -> Option<Leaf> {
        (!node.node.is_inner()).then(|| node.node.blocks())
    }

    #[inline(always)]
    fn fetch_ahead(&self, node: &Cell, blocks: &Blocks) {
        if node.node.is_inner() {
            self.fetch_children(node.node);
        } else {
            blocks.fetch_ahead(node.node.blocks().first);
        }
    }

    #[inline(always)]
    fn count<C: Counters>(&self, _: &Cell, counters: &mut C) {
        counters.step_boxes();
    }

    #[inline(always)]
    fn visit<S: Simd>(&self, simd: S, node: &Cell, visitor: &mut impl Visitor<Cell>) {
        let mid = node.mid(self);
        let octant = visitor.octant();
        // Octant `i` in the order of the direction lies beyond the mid planes of the axes in `i`; the farthest is
        // pushed first.
        let children = std::array::from_fn::<_, CHILDREN, _>(|i| {
            node.child(self, (CHILDREN - 1 - i) ^ octant, mid)
        });
        visitor.distribute(simd, children, &Planes { mid });
    }

    fn bytes(&self) -> usize {
        Octree::bytes(self)
    }
}

/// The mid planes of a node, which separate its octants, the farthest first: octants beyond a mid plane begin at it, the
/// others end there.
struct Planes {
    mid: [f32; 3],
}

impl<S: Simd> Cut<S, CHILDREN> for Planes {
    #[inline(always)]
    fn cut<L: Lanes<S>>(&self, simd: S, lanes: &L) -> [Inside<S>; CHILDREN] {
        let mut parts = [lanes.inside(); CHILDREN];
        // Bit `k` of a part's index is clear beyond the plane of axis `k`. Each axis halves the parts before.
        for k in [2, 1, 0] {
            let rows = lanes.axis(k);
            if k == 2 {
                parts[0] = lanes.within(&rows);
            }
            let mid = f32x8::splat(simd, self.mid[k]);
            let late = mid.mul_add(rows[INV], rows[FAR]);
            let soon = mid.mul_add(rows[INV], rows[NEAR]);
            let step = 1 << k;
            for first in (0..CHILDREN).step_by(2 * step) {
                // Ignore a distance that is NaN.
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
}
