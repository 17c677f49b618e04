// SPDX-License-Identifier: GPL-3.0-or-later
//! Batches of rays on several threads, for callers in Rust, the benches and Python.

use crate::reorder;
use halfspace_base::error::{Result, caught};
use halfspace_base::memory::check_room;
use halfspace_geom::Aabb;
use halfspace_ray::rays::{BLANK, Finite};
use halfspace_ray::{Hit, Order, Ray, RayCounters, Rays, Tracer};
use std::num::NonZero;
use std::sync::Mutex;
use std::thread::Builder;

/// Number of rays that a worker takes at once: those of a stream. Measured: half of it hides the cost of the queue, and
/// suffices for the success rate of tiles, so tiles and shadow rays are as fast with half.
pub const CHUNK: usize = halfspace_trace::batch::USUAL;

/// Number of chunks of a large batch, for kernels that take a whole chunk at once (chosen: enough for the threads of most
/// machines; each chunk begins with beams of its own).
const PARTS: usize = 8;

/// How many rays a worker takes at once, and how many workers there are.
#[derive(Debug, Clone, Copy)]
pub struct Shares {
    /// Number of threads; 0 means one per processor.
    pub threads: usize,
    /// Number of rays in a chunk.
    pub chunk: usize,
}

impl Shares {
    /// Chunks of the usual size.
    pub fn usual(threads: usize) -> Self {
        Self {
            threads,
            chunk: CHUNK,
        }
    }

    /// Chunks for a kernel that takes up to `most` rays at once: as large as [`PARTS`] of them allow, whatever the number
    /// of threads, so that what the kernel counts does not depend on it.
    fn large(threads: usize, rays: usize, most: Option<usize>) -> Self {
        let chunk = most.map_or(CHUNK, |most| {
            let share = rays.div_ceil(PARTS).next_multiple_of(CHUNK);
            share.clamp(CHUNK, most.max(CHUNK))
        });
        Self { threads, chunk }
    }
}

/// Runs `work` on chunks of rays, their answers and their counters.
///
/// # Errors
/// [`Error::Memory`] if the answers do not fit the memory, [`Error::NonFinite`] with the first ray that is not finite,
/// [`Error::Cancelled`] once their monitor is cancelled.
///
/// [`Error::Memory`]: halfspace_base::error::Error::Memory
/// [`Error::NonFinite`]: halfspace_base::error::Error::NonFinite
/// [`Error::Cancelled`]: halfspace_base::error::Error::Cancelled
pub fn in_chunks<T: Clone + Send>(
    rays: Rays<'_>,
    shares: Shares,
    counted: bool,
    blank: T,
    work: impl Fn(&[Ray], &mut [T], Option<&mut [RayCounters]>) + Sync,
) -> Result<Answers<T>> {
    let n = rays.origins.len();
    let counter = if counted { size_of::<RayCounters>() } else { 0 };
    check_room("origins", (n * (size_of::<T>() + counter)) as u64)?;
    let mut answers = vec![blank; n];
    let mut counts = if counted {
        vec![RayCounters::default(); n]
    } else {
        Vec::new()
    };
    // Divide answers and counters into chunks.
    let mut counts_left = counts.as_mut_slice();
    let chunks: Vec<_> = answers
        .chunks_mut(shares.chunk)
        .enumerate()
        .map(|(i, answers)| {
            let own = if counted { answers.len() } else { 0 };
            let (counts, rest) = std::mem::take(&mut counts_left).split_at_mut(own);
            counts_left = rest;
            (i * shares.chunk, answers, counts)
        })
        .collect();
    let finite = Finite::default();
    share_out(chunks, shares, |buffer, (first, answers, counts)| {
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

/// Runs `work` on all parts, on threads that each have memory for a chunk of rays.
pub fn share_out<P: Send>(
    parts: Vec<P>,
    shares: Shares,
    work: impl Fn(&mut [Ray], P) + Sync,
) -> Result<()> {
    let threads = wanted(shares.threads).min(parts.len()).max(1);
    let queue = Mutex::new(parts.into_iter());
    let worker = || {
        let mut buffer = vec![BLANK; shares.chunk];
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
                // If no more threads can start, the running ones do all the work.
                if Builder::new().spawn_scoped(scope, worker).is_err() {
                    break;
                }
            }
            worker();
        });
        Ok(())
    })
}

/// Number of threads to start; 0 means one per processor.
pub fn wanted(threads: usize) -> usize {
    if threads == 0 {
        std::thread::available_parallelism().map_or(1, NonZero::get)
    } else {
        threads
    }
}

/// Answers, one per ray, and counters, one per ray or none.
pub type Answers<T> = (Vec<T>, Option<Vec<RayCounters>>);

/// Nearest hits on `threads` threads, 0 for one per processor. Many rays in random order are traced in an order in which
/// near rays follow one another, where that is faster.
///
/// # Errors
/// [`Error::Memory`] if the answers do not fit the memory, [`Error::NonFinite`] with the first ray that is not finite,
/// [`Error::Cancelled`] once their monitor is cancelled.
///
/// [`Error::Memory`]: halfspace_base::error::Error::Memory
/// [`Error::NonFinite`]: halfspace_base::error::Error::NonFinite
/// [`Error::Cancelled`]: halfspace_base::error::Error::Cancelled
pub fn closest(
    tracer: &dyn Tracer,
    rays: Rays<'_>,
    threads: usize,
    counted: bool,
) -> Result<Answers<Hit>> {
    let order = rays.order;
    if !counted
        && order == Order::None
        && let Some(bounds) = tracer.near_rays(false)
        && reorder::scattered(rays.origins, &bounds)
    {
        let trace = |rays: &[Ray], hits: &mut [Hit]| tracer.closest(rays, hits, None);
        return Ok((reordered(rays, threads, &bounds, Hit::MISS, trace)?, None));
    }
    let shares = Shares::large(threads, rays.origins.len(), tracer.batch(order, false));
    in_chunks(rays, shares, counted, Hit::MISS, |rays, hits, counts| {
        tracer.closest_ordered(rays, hits, counts, order);
    })
}

/// Whether each ray hits anything, on `threads` threads, 0 for one per processor.
///
/// # Errors
/// As [`closest`].
pub fn occluded(
    tracer: &dyn Tracer,
    rays: Rays<'_>,
    threads: usize,
    counted: bool,
) -> Result<Answers<bool>> {
    if !counted
        && let Some(bounds) = tracer.near_rays(true)
        && reorder::scattered(rays.origins, &bounds)
    {
        let trace = |rays: &[Ray], answers: &mut [bool]| tracer.occluded(rays, answers, None);
        return Ok((reordered(rays, threads, &bounds, false, trace)?, None));
    }
    let shares = Shares::large(threads, rays.origins.len(), tracer.batch(rays.order, true));
    in_chunks(rays, shares, counted, false, |rays, answers, counts| {
        tracer.occluded(rays, answers, counts);
    })
}

/// Answers of rays in random order, reordered by each thread for its own share.
fn reordered<T: Copy + Send + Sync>(
    rays: Rays<'_>,
    threads: usize,
    bounds: &Aabb,
    blank: T,
    trace: impl Fn(&[Ray], &mut [T]) + Sync,
) -> Result<Vec<T>> {
    let n = rays.origins.len();
    let window = reorder::window(n, wanted(threads));
    let reordering = n.min(window * wanted(threads)) * reorder::BYTES;
    check_room("origins", (n * size_of::<T>() + reordering) as u64)?;
    let mut answers = vec![blank; n];
    let windows = answers.chunks_mut(window).enumerate().collect();
    let finite = Finite::default();
    share_out(
        windows,
        Shares::usual(threads),
        |buffer, (i, answers): (usize, &mut [T])| {
            let own = rays.part(i * window..i * window + answers.len());
            if !finite.allows(&own, 0..answers.len()) {
                return;
            }
            // Trace the window in the new order, chunk by chunk, and store each answer at the ray's own index.
            let order = reorder::order(own.origins, own.directions, bounds);
            let mut found = vec![blank; CHUNK.min(answers.len())];
            for indices in order.chunks(CHUNK) {
                if rays.is_cancelled() {
                    return;
                }
                let (buffer, found) = (&mut buffer[..indices.len()], &mut found[..indices.len()]);
                own.gather(indices, buffer);
                trace(buffer, found);
                for (&index, answer) in indices.iter().zip(found) {
                    answers[index as usize] = *answer;
                }
            }
        },
    )?;
    finite.end(&rays)?;
    Ok(answers)
}
