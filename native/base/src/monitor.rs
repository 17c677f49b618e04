// SPDX-License-Identifier: GPL-3.0-or-later
//! Progress, cancellation and memory limit of long work, shared between threads.

use crate::error::{Error, Result};
use crate::memory::megabytes;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Fixed-point representation of the whole work: progress is summed in integers, so that the sum does not depend on the
/// order of the threads.
const ONE: f64 = (1_u64 << 40) as f64;

/// Bytes that a thread accumulates before it updates the shared counter: an update per leaf would make threads
/// contend for it.
const BATCH: usize = 1 << 18;

/// State shared between the thread that waits and the threads that work.
#[derive(Debug)]
pub struct Monitor {
    /// Share of the work that is done, in units of 1 / [`ONE`].
    done: AtomicU64,
    /// Bits of an f64: the share of the whole that the current part of the work has.
    scale: AtomicU64,
    cancelled: AtomicBool,
    /// Bytes counted as used.
    used: AtomicU64,
    /// Limit of `used` in bytes.
    limit: AtomicU64,
    /// Whether `used` has exceeded the limit.
    exhausted: AtomicBool,
}

impl Default for Monitor {
    fn default() -> Self {
        Self {
            done: AtomicU64::new(0),
            scale: AtomicU64::new(1.0_f64.to_bits()),
            cancelled: AtomicBool::new(false),
            used: AtomicU64::new(0),
            limit: AtomicU64::new(u64::MAX),
            exhausted: AtomicBool::new(false),
        }
    }
}

/// Bytes counted as used until this value is dropped.
#[derive(Debug)]
pub struct Held<'a> {
    monitor: &'a Monitor,
    bytes: u64,
}

impl Drop for Held<'_> {
    fn drop(&mut self) {
        self.monitor.used.fetch_sub(self.bytes, Ordering::Relaxed);
    }
}

impl Monitor {
    /// Makes a monitor without progress, cancellation or limit.
    pub fn new() -> Self {
        Self::default()
    }

    /// Returns the share of the work that is done, from 0 to 1.
    pub fn progress(&self) -> f64 {
        (self.done.load(Ordering::Relaxed) as f64 / ONE).min(1.0)
    }

    /// Runs `work` as a part with this share of the whole: calls of [`Self::advance`] in it count as shares of the
    /// part. Only one part may run at a time.
    pub fn during<T>(&self, share: f64, work: impl FnOnce() -> T) -> T {
        self.scale.store(share.to_bits(), Ordering::Relaxed);
        let done = work();
        self.scale.store(1.0_f64.to_bits(), Ordering::Relaxed);
        done
    }

    /// Returns the sum of all shares, without the limit of [`Self::progress`]: tests check that a build adds up to one.
    pub fn advanced(&self) -> f64 {
        self.done.load(Ordering::Relaxed) as f64 / ONE
    }

    /// Adds a share of the current work: of the part that runs in [`Self::during`], otherwise of the whole.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "0 <= share <= 1"
    )]
    pub fn advance(&self, share: f64) {
        let scale = f64::from_bits(self.scale.load(Ordering::Relaxed));
        let done = (share * scale * ONE) as u64;
        if done > 0 {
            self.done.fetch_add(done, Ordering::Relaxed);
        }
    }

    /// Requests cancellation.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// Returns whether cancellation was requested.
    pub fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    /// Returns an error if cancellation was requested or any thread has exceeded the memory limit.
    ///
    /// # Errors
    /// [`Error::Cancelled`], [`Error::Memory`].
    pub fn check(&self) -> Result<()> {
        if self.is_cancelled() {
            Err(Error::Cancelled)
        } else if self.exhausted.load(Ordering::Relaxed) {
            Err(self.refusal())
        } else {
            Ok(())
        }
    }

    /// Sets the memory limit in bytes, and resets the count of used bytes.
    pub fn limit_memory(&self, bytes: u64) {
        self.limit.store(bytes, Ordering::Relaxed);
        self.used.store(0, Ordering::Relaxed);
        self.exhausted.store(false, Ordering::Relaxed);
    }

    /// Returns the bytes left below the limit.
    pub fn room(&self) -> u64 {
        let used = self.used.load(Ordering::Relaxed);
        self.limit.load(Ordering::Relaxed).saturating_sub(used)
    }

    /// Like [`Self::take`], but updates the shared count rarely: `gathered` accumulates the bytes of one thread, which
    /// passes the remainder to [`Self::take`] at the end.
    ///
    /// # Errors
    /// Those of [`Self::take`].
    #[inline(always)]
    pub fn charge(&self, gathered: &mut usize, bytes: usize) -> Result<()> {
        *gathered += bytes;
        if *gathered < BATCH {
            return Ok(());
        }
        self.take(std::mem::take(gathered))
    }

    /// Counts `bytes` as used until the returned value is dropped.
    ///
    /// # Errors
    /// [`Error::Memory`] when that exceeds the limit.
    pub fn hold(&self, bytes: usize) -> Result<Held<'_>> {
        self.take(bytes)?;
        Ok(Held {
            monitor: self,
            bytes: bytes as u64,
        })
    }

    /// Counts `bytes` as used until the end of the work.
    ///
    /// # Errors
    /// [`Error::Memory`] when that exceeds the limit.
    pub fn take(&self, bytes: usize) -> Result<()> {
        let bytes = bytes as u64;
        let used = self.used.fetch_add(bytes, Ordering::Relaxed);
        if used.saturating_add(bytes) <= self.limit.load(Ordering::Relaxed) {
            return Ok(());
        }
        self.exhausted.store(true, Ordering::Relaxed);
        Err(self.refusal())
    }

    /// Makes the error of an exceeded limit.
    fn refusal(&self) -> Error {
        Error::Memory(format!(
            "memory_limit: the build needs more than the {} it may take; a smaller depth limit, larger leaves, \
             traversals of planes alone (traversal=dir) or another structure need less",
            megabytes(self.limit.load(Ordering::Relaxed))
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn progress_within_a_part_counts_as_a_share_of_the_part() {
        let monitor = Monitor::new();
        monitor.during(0.75, || monitor.advance(1.0));
        assert!((monitor.advanced() - 0.75).abs() < 1e-9);
        let refused: Result<()> = monitor.during(0.25, || {
            monitor.advance(0.5);
            Err(Error::Cancelled)
        });
        assert!(refused.is_err() && (monitor.advanced() - 0.875).abs() < 1e-9);
        monitor.advance(1.0);
        assert!((monitor.advanced() - 1.875).abs() < 1e-9 && monitor.progress() == 1.0);
    }
}
