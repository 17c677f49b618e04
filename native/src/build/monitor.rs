// SPDX-License-Identifier: GPL-3.0-or-later
//! Progress out of, and cancellation into, long work.

use crate::error::{Error, Result};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Fixed-point one: progress is summed in integers, so that its order does not matter.
const ONE: f64 = (1_u64 << 40) as f64;

/// Shared between the thread that waits and the threads that work.
#[derive(Debug, Default)]
pub struct Monitor {
    done: AtomicU64,
    cancelled: AtomicBool,
}

impl Monitor {
    /// Nothing done, not cancelled.
    pub fn new() -> Self {
        Self::default()
    }

    /// The share of the work done, from 0 to 1.
    pub fn progress(&self) -> f64 {
        (self.done.load(Ordering::Relaxed) as f64 / ONE).min(1.0)
    }

    /// Adds a share of the whole work.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "0 <= share <= 1"
    )]
    pub fn advance(&self, share: f64) {
        self.done.fetch_add((share * ONE) as u64, Ordering::Relaxed);
    }

    /// Asks the work to stop.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// Whether somebody asked the work to stop.
    pub fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    /// Passes unless somebody asked the work to stop.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    pub fn check(&self) -> Result<()> {
        if self.is_cancelled() {
            Err(Error::Cancelled)
        } else {
            Ok(())
        }
    }
}
