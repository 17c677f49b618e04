// SPDX-License-Identifier: GPL-3.0-or-later
//! When tiles are not worth trying.

/// Whether the next tile is walked as one: after tiles that did not come to their end, some go singly without
/// having tried, twice as many each time. Where geometry is finer than rays are, it is for many tiles.
#[derive(Debug, Default)]
pub struct Backoff {
    /// So many tiles go singly now.
    waiting: u32,
    /// And so many after the next that does not come to its end.
    next: u32,
}

impl Backoff {
    const LEAST: u32 = 2;
    const MOST: u32 = 16;

    /// Whether the next tile is to be tried.
    #[inline(always)]
    pub fn tries(&mut self) -> bool {
        let tries = self.waiting == 0;
        self.waiting = self.waiting.saturating_sub(1);
        tries
    }

    /// Learns whether a tile came to its end.
    #[inline(always)]
    pub fn learn(&mut self, finished: bool) {
        if finished {
            self.next = Self::LEAST;
        } else {
            self.waiting = self.next.max(Self::LEAST);
            self.next = (2 * self.waiting).min(Self::MOST);
        }
    }
}
