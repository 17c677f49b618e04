// SPDX-License-Identifier: GPL-3.0-or-later
//! Neighbour finding by point location from the root (Glassner 1984). Glassner moves the exit point into the
//! next cell by half a smallest cell; here its integer coordinate is that cell's already.

use crate::octants::step::{NeighbourTraversal, Neighbours, NumberedLeaf};
use crate::single_rays;
use halfspace_nodes::octree_nodes::Octree;
use halfspace_ray::query::Counters;

/// Point location from the root at each step.
pub struct Location;

impl Neighbours for Location {
    #[inline(always)]
    fn across<C: Counters>(_: &Octree, _: NumberedLeaf, _: usize, _: u32, _: &mut C) -> u32 {
        0
    }
}

single_rays! {
    /// Single rays that locate each leaf from the root.
    fn glassner(Octree) -> NeighbourTraversal<'a, Location> {
        |kernel| NeighbourTraversal(&kernel.tree, Location)
    }
}
