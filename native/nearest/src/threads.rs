// SPDX-License-Identifier: GPL-3.0-or-later
//! Queries on several threads.

use halfspace_base::Monitor;
use halfspace_base::error::{Error, Result, caught};
use rayon::prelude::*;

/// Number of queries that a task takes at once; fewer run on the calling thread (chosen: starting threads takes as long
/// as some dozens of queries).
const TASK: usize = 64;

/// How many threads answer, and what ends them.
#[derive(Debug, Clone, Copy)]
pub struct Work<'a> {
    /// Number of threads; 0 means one per processor.
    pub threads: usize,
    /// Once it is cancelled, no further item is answered.
    pub monitor: Option<&'a Monitor>,
}

impl Work<'_> {
    /// Returns whether no further item should be answered.
    pub fn is_cancelled(&self) -> bool {
        self.monitor.is_some_and(Monitor::is_cancelled)
    }
}

impl From<usize> for Work<'_> {
    fn from(threads: usize) -> Self {
        Self {
            threads,
            monitor: None,
        }
    }
}

/// Returns `answer` of each item, in order.
///
/// # Errors
/// [`Error::Cancelled`], and [`Error::Memory`] if no threads can start.
pub fn each<T: Sync, A: Send>(
    items: &[T],
    work: Work<'_>,
    answer: impl Fn(usize, &T) -> A + Sync,
) -> Result<Vec<A>> {
    let threads = work.threads;
    let one = |(i, item)| {
        if work.is_cancelled() {
            Err(Error::Cancelled)
        } else {
            Ok(answer(i, item))
        }
    };
    if threads == 1 || items.len() <= TASK {
        return caught(|| items.iter().enumerate().map(one).collect());
    }
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|e| Error::Memory(format!("threads: {e}")))?;
    caught(|| {
        pool.install(|| {
            let all = items.par_iter().enumerate().with_min_len(TASK);
            all.map(one).collect()
        })
    })
}
