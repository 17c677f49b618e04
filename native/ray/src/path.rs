// SPDX-License-Identifier: GPL-3.0-or-later
//! The record of one ray's traversal, for drawing its path.

use crate::counters::{Count, Log};
use crate::ray::RayCounters;

/// The counters and the tested leaves of one traversal.
#[derive(Debug, Clone, Default)]
pub struct Path {
    /// The counters of the traversal.
    pub counters: RayCounters,
    /// The leaves whose triangles were tested, in the order of the traversal.
    pub leaves: Vec<PathLeaf>,
}

/// A leaf whose triangles a traversal tested.
#[derive(Debug, Clone, Copy)]
pub struct PathLeaf {
    /// Word offset of its first block.
    pub first: u32,
    /// Number of inner nodes that the traversal had visited when it reached the leaf.
    pub steps: u32,
}

impl Path {
    /// Returns a counter that adds to `counters` and appends to `leaves`.
    pub fn count(&mut self) -> Count<'_> {
        Count::with(&mut self.counters, Log::Leaves(&mut self.leaves))
    }
}
