// SPDX-License-Identifier: GPL-3.0-or-later
//! Any-hit streams through nodes of eight boxes: the children of each node are visited in an order of their own,
//! by a rule of [`crate::order`].

use crate::Steps;
use crate::boxes::{Child, Order, visit};
use crate::lists::{Entry, Stream};
use crate::order::{CHILDREN, Listed, Rule};
use crate::ray_state::{Line, RayState};
use fearless_simd::{Simd, u8x16};
use halfspace_leaf::Leaf;
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::box_tree::BoxTree;
use halfspace_ray::query::Counters;
use std::sync::{Arc, OnceLock};

/// One in each of eight bytes.
const ONES: u64 = 0x0101_0101_0101_0101;

/// A tree with an order of the children of each node.
#[derive(Debug)]
pub struct BlockersFirst {
    tree: Arc<BoxTree<CHILDREN>>,
    leaves: Arc<Blocks>,
    rule: Rule,
    /// Eight bytes per order of a node, made for the first rays.
    order: OnceLock<Vec<Listed>>,
}

impl BlockersFirst {
    /// The tree, whose children are ordered by `rule`; `leaves` are its own, stored with their vertices.
    pub fn new(tree: &Arc<BoxTree<CHILDREN>>, leaves: &Arc<Blocks>, rule: Rule) -> Self {
        Self {
            tree: tree.clone(),
            leaves: leaves.clone(),
            rule,
            order: OnceLock::new(),
        }
    }

    /// The order of the children of a node for the rays of an octant.
    #[inline(always)]
    fn order(&self, node: usize, octant: usize) -> Listed {
        let orders = self.rule.orders();
        let listed = self.order.get_or_init(|| self.listed());
        listed[orders * node + (octant & (orders - 1))]
    }

    /// The orders of all nodes. Compiled once, out of the loop over nodes.
    #[inline(never)]
    fn listed(&self) -> Vec<Listed> {
        self.rule.listed(&self.tree, &self.leaves)
    }
}

/// Moves the lowest bit of byte `i` to bit `i`.
#[inline(always)]
pub const fn gather(bytes: u64) -> u64 {
    (bytes & ONES).wrapping_mul(0x0102_0408_1020_4080) >> 56
}

impl Order for Listed {
    #[inline(always)]
    fn positions(self, children: u64) -> u64 {
        // Copy all children to each byte, and keep there the child of its position. Adding 127 sets the upper bit of
        // each byte that is not zero.
        let own = children.wrapping_mul(ONES) & self.0;
        gather((own + 127 * ONES) >> 7)
    }

    #[inline(always)]
    fn child(self, position: usize) -> usize {
        (self.0 >> (8 * position)).trailing_zeros() as usize % CHILDREN
    }
}

impl Steps for BlockersFirst {
    type Node = Child;
    type Scratch<S: Simd> = Vec<u8x16<S>>;
    const INTERVALS: bool = false;

    fn root(&self) -> Child {
        Steps::root(&*self.tree)
    }

    #[inline(always)]
    fn leaf(&self, child: &Child) -> Option<Leaf> {
        Steps::leaf(&*self.tree, child)
    }

    #[inline(always)]
    fn fetch_ahead(&self, child: &Child, blocks: &Blocks) {
        Steps::fetch_ahead(&*self.tree, child, blocks);
    }

    #[inline(always)]
    fn enters(child: &Child, line: &Line) -> bool {
        <BoxTree<CHILDREN> as Steps>::enters(child, line)
    }

    #[inline(always)]
    fn count<C: Counters>(&self, child: &Child, counters: &mut C) {
        Steps::count(&*self.tree, child, counters);
    }

    #[inline(always)]
    fn visit<S: Simd>(
        &self,
        simd: S,
        stream: &mut Stream<Child>,
        own: Entry<Child>,
        states: &[RayState],
        masks: &mut Vec<u8x16<S>>,
    ) {
        let order = self.order(own.node.index(), stream.octant);
        let node = &self.tree.nodes[own.node.index()];
        visit(simd, node, order, stream, own, states, masks);
    }

    fn bytes(&self) -> usize {
        let orders = self.rule.orders() * self.tree.nodes.len();
        Steps::bytes(&*self.tree) + orders * size_of::<Listed>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_gathered_from_bytes() {
        for mask in 0..256_u64 {
            let spread = (0..8).map(|i| (mask >> i & 1) << (8 * i)).sum::<u64>();
            assert_eq!(gather(spread), mask);
            assert_eq!(gather(spread | 0xfefe_fefe_fefe_fefe), mask, "upper bits");
        }
    }

    /// Any order of children is a permutation that keeps all of them.
    #[test]
    fn positions_are_those_of_the_children() {
        let order = Listed::new([1, 3, 6, 4, 0, 7, 2, 5]);
        let listed = [0, 1, 2, 3, 4, 5, 6, 7].map(|position| order.child(position));
        assert_eq!(listed, [1, 3, 6, 4, 0, 7, 2, 5]);
        for mask in 0..256_u64 {
            let wanted = (0..8).map(|position| (mask >> listed[position] & 1) << position);
            assert_eq!(order.positions(mask), wanted.sum::<u64>(), "{mask:b}");
        }
    }
}
