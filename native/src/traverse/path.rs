// SPDX-License-Identifier: GPL-3.0-or-later
//! What a walk did, in order: for showing the way of one ray.

use super::query::{Count, Notes};
use super::ray::RayCounters;

/// What the walk of one ray did.
#[derive(Debug, Clone, Default)]
pub struct Path {
    /// The sums.
    pub counters: RayCounters,
    /// The leaves whose triangles were tested, in order: where their blocks begin, and how many
    /// triangles they hold.
    pub leaves: Vec<(u32, usize)>,
}

impl Path {
    /// Counts into it, and lists the leaves.
    pub(super) fn count(&mut self) -> Count<'_> {
        Count(&mut self.counters, Notes::Leaves(&mut self.leaves))
    }
}
