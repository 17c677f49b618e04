// SPDX-License-Identifier: GPL-3.0-or-later
//! Neighbours by point location from the root (Glassner 1984). He moves the exit point into the next
//! cell by half of a smallest one; here its integer coordinate is that cell's already.

use super::octree_step::Neighbours;
use super::query::Counters;
use crate::build::octree_nodes::{Node, Octree};

/// From the root, every time.
pub struct Location;

impl Neighbours for Location {
    #[inline(always)]
    fn across<C: Counters>(_: &Octree, _: (u32, Node), _: usize, _: u32, _: &mut C) -> u32 {
        0
    }
}
