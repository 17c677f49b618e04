// SPDX-License-Identifier: GPL-3.0-or-later
//! Rays shared out among threads.

use super::rays::{BLANK, Finite, Rays};
use crate::error::{Result, caught};
use crate::memory::check_room;
use crate::traverse::{Ray, RayCounters, STREAM};
use std::num::NonZero;
use std::sync::Mutex;
use std::thread::Builder;

/// Rays handed to a worker at once: as many as walk together in a stream. Tiles and shadow rays are as quick with half as
/// many, enough to forget the cost of handing them over and to learn whether they go well in tiles.
pub const CHUNK: usize = STREAM;

/// Runs `work` on chunks of rays, their answers and their counters, on `threads` threads.
///
/// # Errors
/// [`crate::error::Error::Memory`] where answers find no room, [`crate::error::Error::NonFinite`] naming the first ray that
/// is not finite.
pub fn in_chunks<T: Clone + Send>(
    rays: Rays<'_>,
    threads: usize,
    counted: bool,
    blank: T,
    work: impl Fn(&[Ray], &mut [T], Option<&mut [RayCounters]>) + Sync,
) -> Result<(Vec<T>, Option<Vec<RayCounters>>)> {
    let n = rays.origins.len();
    let counter = if counted { size_of::<RayCounters>() } else { 0 };
    check_room("origins", (n * (size_of::<T>() + counter)) as u64)?;
    let mut answers = vec![blank; n];
    let mut counts = if counted {
        vec![RayCounters::default(); n]
    } else {
        Vec::new()
    };
    let mut counts_left = counts.as_mut_slice();
    let chunks: Vec<_> = answers
        .chunks_mut(CHUNK)
        .enumerate()
        .map(|(i, answers)| {
            let own = if counted { answers.len() } else { 0 };
            let (counts, rest) = std::mem::take(&mut counts_left).split_at_mut(own);
            counts_left = rest;
            (i * CHUNK, answers, counts)
        })
        .collect();
    let finite = Finite::default();
    share_out(chunks, threads, |buffer, (first, answers, counts)| {
        if !finite.allows(&rays, first..first + answers.len()) {
            return;
        }
        let buffer = &mut buffer[..answers.len()];
        rays.put(first, buffer);
        work(buffer, answers, counted.then_some(counts));
    })?;
    finite.end(&rays)?;
    Ok((answers, counted.then_some(counts)))
}

/// Runs `work` on all parts, on `threads` threads, each with room for [`CHUNK`] rays.
pub fn share_out<P: Send>(
    parts: Vec<P>,
    threads: usize,
    work: impl Fn(&mut [Ray], P) + Sync,
) -> Result<()> {
    let threads = wanted(threads).min(parts.len()).max(1);
    let queue = Mutex::new(parts.into_iter());
    let worker = || {
        let mut buffer = vec![BLANK; CHUNK];
        loop {
            let next = queue
                .lock()
                .unwrap_or_else(std::sync::PoisonError::into_inner)
                .next();
            let Some(part) = next else {
                return;
            };
            work(&mut buffer, part);
        }
    };
    caught(|| {
        std::thread::scope(|scope| {
            for _ in 1..threads {
                // Where no more threads can start, those that did do all the work.
                if Builder::new().spawn_scoped(scope, worker).is_err() {
                    break;
                }
            }
            worker();
        });
        Ok(())
    })
}

/// How many threads are asked for; 0: as many as there are processors.
pub fn wanted(threads: usize) -> usize {
    if threads == 0 {
        std::thread::available_parallelism().map_or(1, NonZero::get)
    } else {
        threads
    }
}
