// SPDX-License-Identifier: GPL-3.0-or-later
//! The shadow cache of tiles and packets: the leaf that blocked most rays of the last group often blocks the next one, so
//! it is tested first, against all its rays at once. Wilt 1994 keeps one triangle per light; the rays of a group have one
//! light. Any blocker proves occlusion, so no result changes. A group in which nothing is blocked clears the cache.

use halfspace_leaf::Leaf;

/// The leaf that blocks most rays of a group.
#[derive(Debug, Clone, Copy, Default)]
pub struct Blocker {
    leaf: Option<Leaf>,
    /// Number of rays that it blocks, and that the leaf under test has blocked so far.
    most: u32,
    now: u32,
}

impl Blocker {
    /// Notes that the leaf under test blocks further rays.
    #[inline(always)]
    pub fn blocks(&mut self, rays: u32) {
        self.now += rays;
    }

    /// Notes which leaf was tested.
    #[inline(always)]
    pub fn tested(&mut self, leaf: Leaf) {
        if self.now > self.most {
            (self.leaf, self.most) = (Some(leaf), self.now);
        }
        self.now = 0;
    }

    /// The leaf, if any ray is blocked.
    #[inline(always)]
    pub fn leaf(&self) -> Option<Leaf> {
        self.leaf
    }
}
