// SPDX-License-Identifier: GPL-3.0-or-later
//! Neighbours by stored links: one load a step (Endl and Sommer 1994, Samet-Net).

use super::octree_step::Neighbours;
use super::query::Counters;
use crate::build::octree_nodes::{Node, Octree};

/// Six links per leaf.
pub struct Links;

impl Neighbours for Links {
    #[inline(always)]
    fn across<C: Counters>(
        tree: &Octree,
        (_, leaf): (u32, Node),
        axis: usize,
        side: u32,
        _: &mut C,
    ) -> u32 {
        tree.links(leaf.place())[2 * axis + side as usize]
    }
}
