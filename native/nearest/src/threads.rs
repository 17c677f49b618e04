// SPDX-License-Identifier: GPL-3.0-or-later
//! Queries on several threads.

use halfspace_base::error::{Error, Result, caught};
use rayon::prelude::*;

/// Number of queries that a task takes at once; fewer run on the calling thread (chosen: starting threads takes as long
/// as some dozens of queries).
const TASK: usize = 64;

/// Returns `answer` of each item, in order, computed on `threads` threads; 0 means one per processor.
pub fn each<T: Sync, A: Send>(
    items: &[T],
    threads: usize,
    answer: impl Fn(usize, &T) -> A + Sync,
) -> Result<Vec<A>> {
    let one = |(i, item)| answer(i, item);
    if threads == 1 || items.len() <= TASK {
        return caught(|| Ok(items.iter().enumerate().map(one).collect()));
    }
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|e| Error::Memory(format!("threads: {e}")))?;
    caught(|| {
        Ok(pool.install(|| {
            let all = items.par_iter().enumerate().with_min_len(TASK);
            all.map(one).collect()
        }))
    })
}
