// SPDX-License-Identifier: GPL-3.0-or-later
//! When tiles are not worth trying.

use std::sync::atomic::{AtomicU32, Ordering};

/// All tiles, as a share.
const ALL: u32 = 1 << 12;

/// Of the last so many tiles most is known.
const MEMORY: u32 = 32;

/// One tile of so many is tried where few come to their end.
const PROBE: u32 = 32;

/// The share of tiles that came to their end, of those tried lately: what one batch of rays tells the next, on
/// whatever thread. It decides on time alone, so nobody waits for anybody.
#[derive(Debug)]
pub struct Lately(AtomicU32);

impl Default for Lately {
    /// All of them.
    fn default() -> Self {
        Self(AtomicU32::new(ALL))
    }
}

/// Whether the next tile is walked as one: while most of those that were tried lately came to their end. Otherwise
/// only one in a few is tried, to learn whether that has changed. Where geometry is finer than rays are, it is for
/// many tiles.
#[derive(Debug)]
pub struct Backoff<'a> {
    lately: Option<&'a Lately>,
    share: u32,
    /// With a lower share tiles are not worth trying.
    least: u32,
    /// Tiles since the last that was tried.
    waited: u32,
}

impl<'a> Backoff<'a> {
    /// Tiles are worth trying where so many of 16 come to their end. Without `lately` each batch learns anew, and does
    /// the same each time.
    pub fn new(least: u32, lately: Option<&'a Lately>) -> Self {
        Self {
            lately,
            share: lately.map_or(ALL, |lately| lately.0.load(Ordering::Relaxed)),
            least: least * (ALL / 16),
            waited: 0,
        }
    }

    /// Whether the next tile is to be tried.
    #[inline(always)]
    pub fn tries(&mut self) -> bool {
        self.waited += 1;
        let tries = self.share >= self.least || self.waited >= PROBE;
        if tries {
            self.waited = 0;
        }
        tries
    }

    /// Learns whether a tile came to its end.
    #[inline(always)]
    pub fn learn(&mut self, finished: bool) {
        self.share -= self.share / MEMORY;
        if finished {
            self.share += ALL / MEMORY;
        }
        if let Some(lately) = self.lately {
            lately.0.store(self.share, Ordering::Relaxed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How many of so many tiles are tried, if this tells which of them come to their end.
    fn tried(backoff: &mut Backoff<'_>, tiles: u32, ends: impl Fn(u32) -> bool) -> u32 {
        let mut tried = 0;
        for i in 0..tiles {
            if backoff.tries() {
                tried += 1;
                backoff.learn(ends(i));
            }
        }
        tried
    }

    #[test]
    fn tiles_are_tried_where_they_pay() {
        let lately = Lately::default();
        let mut backoff = Backoff::new(12, Some(&lately));
        assert_eq!(tried(&mut backoff, 1000, |_| true), 1000);
        assert!(tried(&mut backoff, 1000, |i| i % 8 != 0) > 900, "most do");
        assert!(tried(&mut backoff, 3200, |_| false) < 110, "none does");
        // The next batch knows that already, and learns when it is no longer so.
        let mut next = Backoff::new(12, Some(&lately));
        assert!(tried(&mut next, 31, |_| false) == 0);
        assert!(tried(&mut next, 3200, |_| true) > 1500);
        let mut alone = Backoff::new(12, None);
        assert!(
            tried(&mut alone, 8, |_| true) == 8,
            "knows nothing of others"
        );
    }
}
