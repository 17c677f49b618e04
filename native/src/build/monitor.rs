// SPDX-License-Identifier: GPL-3.0-or-later
//! Progress out of, and cancellation and a memory limit into, long work.

use crate::error::{Error, Result};
use crate::memory::megabytes;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Fixed-point one: progress is summed in integers, so that its order does not matter.
const ONE: f64 = (1_u64 << 40) as f64;

/// Bytes that a thread gathers before it tells: threads that told of every leaf would wait for each other.
const GATHERED: usize = 1 << 18;

/// Shared between the thread that waits and the threads that work.
#[derive(Debug)]
pub struct Monitor {
    done: AtomicU64,
    /// The bits of an f64: how much of the whole the work at hand is.
    scale: AtomicU64,
    cancelled: AtomicBool,
    used: AtomicU64,
    limit: AtomicU64,
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

/// Memory that is needed for a while: given back when this is dropped.
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
    /// Nothing done, not cancelled, no limit.
    pub fn new() -> Self {
        Self::default()
    }

    /// The share of the work done, from 0 to 1.
    pub fn progress(&self) -> f64 {
        (self.done.load(Ordering::Relaxed) as f64 / ONE).min(1.0)
    }

    /// Does a part of the work, which is this share of the whole: what advances meanwhile are shares of the part. One part
    /// at a time.
    pub fn during<T>(&self, share: f64, work: impl FnOnce() -> T) -> T {
        self.scale.store(share.to_bits(), Ordering::Relaxed);
        let done = work();
        self.scale.store(1.0_f64.to_bits(), Ordering::Relaxed);
        done
    }

    /// What all shares add up to, one or not.
    #[cfg(test)]
    pub fn told(&self) -> f64 {
        self.done.load(Ordering::Relaxed) as f64 / ONE
    }

    /// Adds a share of the work at hand: of the whole, unless it is done [`Self::during`] a part.
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

    /// Asks the work to stop.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// Whether somebody asked the work to stop.
    pub fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    /// Passes unless somebody asked the work to stop, or it has met its limit on another thread.
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

    /// Sets how many bytes the work may take, and forgets what earlier work took.
    pub fn limit_memory(&self, bytes: u64) {
        self.limit.store(bytes, Ordering::Relaxed);
        self.used.store(0, Ordering::Relaxed);
        self.exhausted.store(false, Ordering::Relaxed);
    }

    /// How many more bytes the work may take.
    pub fn room(&self) -> u64 {
        let used = self.used.load(Ordering::Relaxed);
        self.limit.load(Ordering::Relaxed).saturating_sub(used)
    }

    /// As [`Self::take`], in larger steps: `gathered` is the thread's own sum of what it has not told yet,
    /// and told by [`Self::take`] in the end.
    ///
    /// # Errors
    /// As there.
    #[inline(always)]
    pub fn charge(&self, gathered: &mut usize, bytes: usize) -> Result<()> {
        *gathered += bytes;
        if *gathered < GATHERED {
            return Ok(());
        }
        self.take(std::mem::take(gathered))
    }

    /// Tells that the work needs `bytes` more until the returned value is dropped.
    ///
    /// # Errors
    /// [`Error::Memory`] when that is more than the work may take.
    pub fn hold(&self, bytes: usize) -> Result<Held<'_>> {
        self.take(bytes)?;
        Ok(Held {
            monitor: self,
            bytes: bytes as u64,
        })
    }

    /// Tells that the work keeps `bytes` more until its end.
    ///
    /// # Errors
    /// [`Error::Memory`] when that is more than the work may take.
    pub fn take(&self, bytes: usize) -> Result<()> {
        let bytes = bytes as u64;
        let used = self.used.fetch_add(bytes, Ordering::Relaxed);
        if used.saturating_add(bytes) <= self.limit.load(Ordering::Relaxed) {
            return Ok(());
        }
        self.exhausted.store(true, Ordering::Relaxed);
        Err(self.refusal())
    }

    fn refusal(&self) -> Error {
        Error::Memory(format!(
            "memory_limit: the build needs more than the {} it may take; a smaller depth limit, larger leaves, \
             walks through planes alone (traversal=dir) or another structure need less",
            megabytes(self.limit.load(Ordering::Relaxed))
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::oracle::cases::{grid, soup};
    use crate::registry;
    use crate::spec::Config;
    use crate::structure::Structure;

    #[test]
    fn what_advances_during_a_part_is_a_share_of_that() {
        let monitor = Monitor::new();
        monitor.during(0.75, || monitor.advance(1.0));
        assert!((monitor.told() - 0.75).abs() < 1e-9);
        let refused: Result<()> = monitor.during(0.25, || {
            monitor.advance(0.5);
            Err(Error::Cancelled)
        });
        assert!(refused.is_err() && (monitor.told() - 0.875).abs() < 1e-9);
        monitor.advance(1.0);
        assert!((monitor.told() - 1.875).abs() < 1e-9 && monitor.progress() == 1.0);
    }

    #[test]
    fn every_build_tells_of_all_its_work_once() {
        let scene = soup(grid(8, 0.3));
        for tree in registry::TREES.iter().filter(|tree| tree.id != "brute") {
            let walks = tree
                .traversals()
                .iter()
                .map(|walk| format!("{}:traversal={walk}", tree.id));
            for spec in walks.chain([tree.id.to_owned()]) {
                let monitor = Monitor::new();
                let config = Config::parse(&spec).unwrap();
                Structure::build(scene.clone(), config, 2, &monitor).unwrap();
                let told = monitor.told();
                assert!((told - 1.0).abs() < 1e-6, "{spec}: {told}");
            }
        }
    }
}
