// SPDX-License-Identifier: GPL-3.0-or-later
//! Splits long batches of rays into short calls, so that a request to stop takes effect soon.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Target duration of a call: far below the 0.1 s in which a cancelled render has to stop.
const CALL: Duration = Duration::from_millis(8);

/// Largest number of rays per call.
const MAX_RAYS: usize = 1 << 16;

/// The render was cancelled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cancelled;

/// Number of rays per call, adapted to the duration of the previous calls.
pub struct Calls {
    rays: usize,
}

impl Default for Calls {
    fn default() -> Self {
        Self { rays: 64 }
    }
}

impl Calls {
    /// Calls `f` on consecutive ranges that cover `0..n`, each sized to take about [`CALL`], and checks `stop`
    /// before each. Rays are independent of each other, so the division does not change any result.
    ///
    /// # Errors
    /// [`Cancelled`] if `stop` is set.
    pub fn cover(
        &mut self,
        n: usize,
        stop: &AtomicBool,
        mut f: impl FnMut(Range<usize>),
    ) -> Result<(), Cancelled> {
        let mut start = 0;
        while start < n {
            if stop.load(Ordering::Relaxed) {
                return Err(Cancelled);
            }
            // Time one call of the current length.
            let end = (start + self.rays).min(n);
            let begun = Instant::now();
            f(start..end);
            let took = begun.elapsed();
            // Halve calls that took more than twice the target, double full ones that stayed below it.
            if took > CALL * 2 {
                self.rays = (self.rays / 2).max(1);
            } else if took < CALL && end - start == self.rays {
                self.rays = (self.rays * 2).min(MAX_RAYS);
            }
            start = end;
        }
        Ok(())
    }
}
