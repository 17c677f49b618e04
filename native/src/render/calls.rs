// SPDX-License-Identifier: GPL-3.0-or-later
//! Long work in short calls, so that a stop is heeded in time.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Calls take about this long.
const CALL: Duration = Duration::from_millis(8);

/// Rays per call at most.
const MOST: usize = 1 << 16;

/// The render was told to stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stopped;

/// How many rays a call gets, as far as the last ones told.
pub struct Calls {
    rays: usize,
}

impl Default for Calls {
    fn default() -> Self {
        Self { rays: 64 }
    }
}

impl Calls {
    /// Calls `f` on ranges that together cover `0..n`, each sized to take about [`CALL`], and heeds `stop` between them.
    /// Rays do not see each other, so the cuts change no answer.
    ///
    /// # Errors
    /// [`Stopped`] when told to.
    pub fn cover(
        &mut self,
        n: usize,
        stop: &AtomicBool,
        mut f: impl FnMut(Range<usize>),
    ) -> Result<(), Stopped> {
        let mut start = 0;
        while start < n {
            if stop.load(Ordering::Relaxed) {
                return Err(Stopped);
            }
            let end = (start + self.rays).min(n);
            let begun = Instant::now();
            f(start..end);
            let took = begun.elapsed();
            if took > CALL * 2 {
                self.rays = (self.rays / 2).max(1);
            } else if took < CALL && end - start == self.rays {
                self.rays = (self.rays * 2).min(MOST);
            }
            start = end;
        }
        Ok(())
    }
}
