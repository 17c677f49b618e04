// SPDX-License-Identifier: GPL-3.0-or-later
//! Adaptive use of tiles: tiles are skipped where they rarely pay.

use std::sync::atomic::{AtomicU32, Ordering};

/// Fixed-point representation of one, the share of all tiles.
const ALL: u32 = 1 << 12;

/// Number of recent tiles that dominate the running success rate.
const MEMORY: u32 = 32;

/// Number of tiles per attempt while tiles rarely finish.
const PROBE: u32 = 32;

/// The share of recently tried tiles that finished, handed from one batch of rays to the next on any thread. It
/// affects speed only, so relaxed atomic access suffices.
#[derive(Debug)]
pub struct SuccessRate(AtomicU32);

impl Default for SuccessRate {
    /// Starts with full success.
    fn default() -> Self {
        Self(AtomicU32::new(ALL))
    }
}

/// Decides whether the next tile is traced as a whole: always while most recent ones finished, otherwise only
/// now and then, to detect a change. Where geometry is finer than the spacing of rays, many consecutive tiles
/// do not finish.
#[derive(Debug)]
pub struct Backoff<'a> {
    rate: Option<&'a SuccessRate>,
    share: u32,
    /// Share below which tiles are not worth trying.
    least: u32,
    /// Number of tiles since the last attempt.
    waited: u32,
}

impl<'a> Backoff<'a> {
    /// Tries tiles while at least `least` of 16 finish. Without `rate` each batch starts anew, which makes
    /// its work reproducible.
    pub fn new(least: u32, rate: Option<&'a SuccessRate>) -> Self {
        Self {
            rate,
            share: rate.map_or(ALL, |rate| rate.0.load(Ordering::Relaxed)),
            least: least * (ALL / 16),
            waited: 0,
        }
    }

    /// Whether to try the next tile.
    #[inline(always)]
    pub fn should_try(&mut self) -> bool {
        self.waited += 1;
        let tries = self.share >= self.least || self.waited >= PROBE;
        if tries {
            self.waited = 0;
        }
        tries
    }

    /// Records whether a tile finished.
    #[inline(always)]
    pub fn record(&mut self, finished: bool) {
        self.share -= self.share / MEMORY;
        if finished {
            self.share += ALL / MEMORY;
        }
        if let Some(rate) = self.rate {
            rate.0.store(self.share, Ordering::Relaxed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Number of tiles tried out of `tiles`, if `ends` gives whether each finishes.
    fn tried(backoff: &mut Backoff<'_>, tiles: u32, ends: impl Fn(u32) -> bool) -> u32 {
        let mut tried = 0;
        for i in 0..tiles {
            if backoff.should_try() {
                tried += 1;
                backoff.record(ends(i));
            }
        }
        tried
    }

    #[test]
    fn tiles_are_tried_where_they_pay() {
        let rate = SuccessRate::default();
        let mut backoff = Backoff::new(12, Some(&rate));
        assert_eq!(tried(&mut backoff, 1000, |_| true), 1000);
        assert!(tried(&mut backoff, 1000, |i| i % 8 != 0) > 900, "most do");
        assert!(tried(&mut backoff, 3200, |_| false) < 110, "none does");
        // The next batch starts with this share, and detects a change.
        let mut next = Backoff::new(12, Some(&rate));
        assert!(tried(&mut next, 31, |_| false) == 0);
        assert!(tried(&mut next, 3200, |_| true) > 1500);
        let mut alone = Backoff::new(12, None);
        assert!(
            tried(&mut alone, 8, |_| true) == 8,
            "depends on other batches"
        );
    }
}
