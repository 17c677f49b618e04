// SPDX-License-Identifier: GPL-3.0-or-later
//! What a walk did, in order: for showing the way of one ray.

use super::query::{Count, Counters};
use super::ray::{Hit, RayCounters};

/// What the walk of one ray did.
#[derive(Debug, Clone, Default)]
pub struct Path {
    /// The sums.
    pub counters: RayCounters,
    /// The leaves whose triangles were tested, in order: where their blocks begin, and how many
    /// triangles they hold.
    pub leaves: Vec<(u32, usize)>,
}

/// Counts into a path, and lists the leaves that are tested.
pub struct Follow<'a> {
    count: Count<'a>,
    leaves: &'a mut Vec<(u32, usize)>,
}

impl<'a> Follow<'a> {
    /// Goes on where the path ends.
    pub fn new(path: &'a mut Path) -> Self {
        Self {
            count: Count(&mut path.counters, None),
            leaves: &mut path.leaves,
        }
    }
}

impl Counters for Follow<'_> {
    #[inline(always)]
    fn step_axis(&mut self) {
        self.count.step_axis();
    }
    #[inline(always)]
    fn step_oblique(&mut self) {
        self.count.step_oblique();
    }
    #[inline(always)]
    fn leaf(&mut self, triangles: usize) {
        self.count.leaf(triangles);
    }
    #[inline(always)]
    fn tests(&mut self, triangles: usize) {
        self.count.tests(triangles);
    }
    #[inline(always)]
    fn verdict(&mut self) {
        self.count.verdict();
    }
    #[inline(always)]
    fn case(&mut self, case: impl FnOnce() -> usize) {
        self.count.case(case);
    }
    #[inline(always)]
    fn visit(&mut self, first: u32, triangles: usize) {
        // An empty leaf begins where the next one does.
        if triangles > 0 {
            self.leaves.push((first, triangles));
        }
    }
    #[inline(always)]
    fn improved(&mut self, hit: Hit) {
        self.count.improved(hit);
    }
    #[inline(always)]
    fn spared(&mut self) {
        self.count.spared();
    }
}
