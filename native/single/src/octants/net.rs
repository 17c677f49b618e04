// SPDX-License-Identifier: GPL-3.0-or-later
//! Neighbour finding by stored links: one load per step (Endl and Sommer 1994, Samet-Net).

use crate::octants::step::{NeighbourTraversal, Neighbours, NumberedLeaf};
use crate::single_rays;
use halfspace_nodes::octree_nodes::Octree;
use halfspace_ray::query::Counters;

/// Neighbour finding by six links per leaf.
pub struct Links;

impl Neighbours for Links {
    #[inline(always)]
    fn across<C: Counters>(
        tree: &Octree,
        leaf: NumberedLeaf,
        axis: usize,
        side: u32,
        _: &mut C,
    ) -> u32 {
        tree.links(leaf.node.leaf_index())[2 * axis + side as usize]
    }
}

single_rays! {
    /// Single rays from leaf to leaf by stored links.
    fn net(Octree) -> NeighbourTraversal<'a, Links> {
        |kernel| NeighbourTraversal(&kernel.tree, Links)
    }
}
