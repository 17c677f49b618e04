// SPDX-License-Identifier: GPL-3.0-or-later
//! Neighbour finding by ascent and descent (Samet 1989): up to the first ancestor that also contains the
//! neighbour, then down along the mirrored path. Nothing is stored.

use crate::octants::step::{NeighbourTraversal, Neighbours, NumberedLeaf};
use crate::single_rays;
use halfspace_nodes::octants::MAX_DEPTH;
use halfspace_nodes::octree_nodes::{OUTSIDE, Octree};
use halfspace_ray::query::Counters;

/// Neighbour finding through the nearest common ancestor.
pub struct Ascent;

impl Neighbours for Ascent {
    #[inline(always)]
    fn across<C: Counters>(
        tree: &Octree,
        leaf: NumberedLeaf,
        axis: usize,
        side: u32,
        counters: &mut C,
    ) -> u32 {
        let bit = 1 << axis;
        let mut path = [0; MAX_DEPTH as usize];
        let mut length = 0;
        let mut node = leaf.node;
        // ADJ: an octant on the face's side has no sibling across it, so ascend.
        loop {
            if node.level() == 0 {
                return OUTSIDE;
            }
            path[length] = node.octant() ^ bit;
            length += 1;
            let parent = tree.node(node.parent());
            counters.step_boxes();
            let adjacent = u32::from(node.octant() & bit != 0) == side;
            node = parent;
            if !adjacent {
                break;
            }
        }
        // REFLECT: descend along the mirrored path; it may end early, in a larger neighbour.
        let mut index = OUTSIDE;
        while node.is_inner() && length != 0 {
            length -= 1;
            index = node.children() + path[length];
            node = tree.node(index);
            counters.step_boxes();
        }
        index
    }
}

single_rays! {
    /// Single rays from leaf to leaf by the common ancestor.
    fn samet(Octree) -> NeighbourTraversal<'a, Ascent> {
        |kernel| NeighbourTraversal(&kernel.tree, Ascent)
    }
}
