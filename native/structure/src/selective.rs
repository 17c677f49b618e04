// SPDX-License-Identifier: GPL-3.0-or-later
//! All hits of rays, and hits with the triangles that rays can see, on several threads.

use crate::threads::{CHUNK, Shares, share_out};
use halfspace_base::error::{Error, Result};
use halfspace_base::memory::check_room;
use halfspace_ray::counters::Log;
use halfspace_ray::query::Query;
use halfspace_ray::rays::Finite;
use halfspace_ray::selection::{Gathered, Visible};
use halfspace_ray::{Hit, Ray, Rays, SelectiveTracer};
use std::slice;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The hits of many rays.
#[derive(Debug, Clone, PartialEq)]
pub struct AllHits {
    /// Index in [`Self::hits`] of the first hit of each ray, then the number of all hits: one entry more than rays.
    pub offsets: Vec<usize>,
    /// The hits of one ray after another, nearest first; of equal distances, the smallest triangle number first.
    pub hits: Vec<Hit>,
}

/// A mask of bits for each ray.
#[derive(Clone, Copy)]
pub enum RayMasks<'a> {
    /// The same for all rays.
    Same(u32),
    /// One per ray.
    Each(&'a [u32]),
}

impl RayMasks<'_> {
    /// The mask of the ray with this index.
    fn of(&self, i: usize) -> u32 {
        match self {
            Self::Same(mask) => *mask,
            Self::Each(masks) => masks[i],
        }
    }
}

/// Which rays see which triangles: those whose masks share a bit.
#[derive(Clone, Copy)]
pub struct Masks<'a> {
    /// The mask of each triangle.
    pub triangles: &'a [u32],
    /// The masks of the rays.
    pub rays: RayMasks<'a>,
}

/// Finds every triangle that each ray hits, at most the `most` nearest, on `threads` threads, 0 for one per processor.
/// The first hit of a ray is its nearest hit, bit for bit.
///
/// # Errors
/// [`Error::Memory`] if the hits do not fit the memory, [`Error::NonFinite`] with the first ray that is not finite,
/// [`Error::Cancelled`] once their monitor is cancelled.
pub fn all_hits(
    tracer: &dyn SelectiveTracer,
    rays: Rays<'_>,
    threads: usize,
    most: usize,
) -> Result<AllHits> {
    // Gather the hits of each ray, as long as all of them fit the memory.
    let (count, full) = (AtomicUsize::new(0), OnceLock::new());
    let lists = chunk_by_chunk(&rays, threads, Vec::new(), |_, rays, lists| {
        if full.get().is_some() {
            return;
        }
        let mut gathered = vec![Gathered::new(most); rays.len()];
        let mut each = gathered.iter_mut();
        tracer.observe(rays, false, &mut |_, _| (), &mut |_| {
            Log::Hits(each.next().expect("one list per ray"))
        });
        let mut found = 0;
        for (list, gathered) in lists.iter_mut().zip(gathered) {
            *list = gathered.finish();
            list.shrink_to_fit();
            found += list.len();
        }
        let all = count.fetch_add(found, Ordering::Relaxed) + found;
        // Twice: the list of all hits is made while the lists of the rays still exist.
        if let Err(error) = check_room("all hits", (2 * all * size_of::<Hit>()) as u64) {
            let _ = full.set(error);
        }
    })?;
    if let Some(error) = full.into_inner() {
        return Err(error);
    }
    // Join the lists.
    let mut offsets = Vec::with_capacity(lists.len() + 1);
    let mut hits = Vec::with_capacity(count.into_inner());
    offsets.push(0);
    for list in lists {
        hits.extend(list);
        offsets.push(hits.len());
    }
    Ok(AllHits { offsets, hits })
}

/// Counts the triangles that each ray hits, on `threads` threads, 0 for one per processor.
///
/// # Errors
/// As [`all_hits`].
pub fn count_hits(
    tracer: &dyn SelectiveTracer,
    rays: Rays<'_>,
    threads: usize,
) -> Result<Vec<u32>> {
    chunk_by_chunk(&rays, threads, 0, |_, rays, counts| {
        // Count ray by ray: the lists of a chunk may not fit the memory.
        for (ray, count) in rays.iter().zip(counts) {
            let mut gathered = Gathered::new(usize::MAX);
            let mut list = Some(&mut gathered);
            tracer.observe(slice::from_ref(ray), false, &mut |_, _| (), &mut |_| {
                Log::Hits(list.take().expect("one ray"))
            });
            let found = gathered.finish().len();
            *count = u32::try_from(found).expect("fewer than triangles");
        }
    })
}

/// Answers rays as if the triangles that they do not see were not there, on `threads` threads, 0 for one per processor.
///
/// # Errors
/// [`Error::Shape`] unless there is one mask per triangle, and per ray if those differ; [`Error::Memory`] if the
/// answers do not fit the memory, [`Error::NonFinite`] with the first ray that is not finite,
/// [`Error::Cancelled`] once their monitor is cancelled.
pub fn visible<Q: Query>(
    tracer: &dyn SelectiveTracer,
    rays: Rays<'_>,
    threads: usize,
    masks: Masks<'_>,
) -> Result<Vec<Q::Answer>> {
    let expect = |name: &str, of: &str, wanted: usize, got: usize| {
        let message = format!("{name}: expected one per {of}, {wanted}, got {got}");
        (wanted == got).then_some(()).ok_or(Error::Shape(message))
    };
    let triangles = masks.triangles;
    expect("triangle_mask", "triangle", tracer.count(), triangles.len())?;
    if let RayMasks::Each(masks) = masks.rays {
        expect("ray_mask", "ray", rays.origins.len(), masks.len())?;
    }
    let miss = Q::answer(Hit::MISS);
    chunk_by_chunk(&rays, threads, miss, |first, rays, answers| {
        let mut write = |i: usize, hit: Hit| answers[i] = Q::answer(hit);
        tracer.observe(rays, Q::ANY, &mut write, &mut |i| {
            let ray = masks.rays.of(first + i);
            Log::Visible(Visible { triangles, ray })
        });
    })
}

/// Runs `work` on chunks of rays and their answers, with the index of the first, on `threads` threads.
fn chunk_by_chunk<T: Clone + Send>(
    rays: &Rays<'_>,
    threads: usize,
    blank: T,
    work: impl Fn(usize, &[Ray], &mut [T]) + Sync,
) -> Result<Vec<T>> {
    let n = rays.origins.len();
    check_room("origins", (n * size_of::<T>()) as u64)?;
    let mut answers = vec![blank; n];
    let chunks = answers.chunks_mut(CHUNK).enumerate().collect();
    let finite = Finite::default();
    share_out(
        chunks,
        Shares::usual(threads),
        |buffer, (i, answers): (usize, &mut [T])| {
            let first = i * CHUNK;
            if !finite.allows(rays, first..first + answers.len()) {
                return;
            }
            let buffer = &mut buffer[..answers.len()];
            rays.put(first, buffer);
            work(first, buffer, answers);
        },
    )?;
    finite.end(rays)?;
    Ok(answers)
}
