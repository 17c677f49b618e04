// SPDX-License-Identifier: GPL-3.0-or-later
//! Traversal of incoherent batches, which tiles cannot help: several rays are in flight, and those whose next
//! steps are of one kind take them one after another.
//!
//! A single ray waits for its own arithmetic and memory, and the processor cannot predict whether a node or a
//! leaf comes next. Sorted by the kind of their next step, rays run through loops without that branch, and the
//! work of one ray fills the latency of another. The next node or leaf of a ray is prefetched as soon as it is
//! known: a mispredicted branch would otherwise wait for memory before it is resolved, and hold up the other
//! rays.
//!
//! Through boxes that gains over streams only where no cache holds the tree and rays have no order, through wide planes
//! on more scenes: `bench --structures bvh-sah:traversal=stream,bvh-sah:traversal=flight` measures both.

pub mod kernel;

use crate::Run;
use fearless_simd::{Simd, dispatch};
use halfspace_nodes::next::{KINDS, Next};
use halfspace_ray::query::{Best, NoCount, NoCountLate, Query};
use halfspace_ray::{FrameRay, Hit, RayRef};
use halfspace_single::steps::Steps;
use halfspace_trace::late::Late;
use halfspace_trace::shadow_cache::ShadowCache;

/// Number of rays in flight. Fewer leave latency exposed, more evict one another from the L1 cache. Measured on
/// five scenes: 24 rays are within 2 %.
const FLIGHT: usize = 16;

/// Once more rays than this wait at a leaf or have ended, all leaves are tested; until then the others step on.
const LEAVES: usize = 8;

/// Nodes of trees up to this size in bytes are not prefetched, because they come from a near cache. Measured:
/// prefetching them in a small tree made diffuse rays 2 to 6 % slower.
const CLOSE: usize = 4 << 20;

/// A ray in flight.
struct Flight<'a, T: Steps> {
    /// Index of the ray in the batch; `usize::MAX` for none.
    index: usize,
    frame: FrameRay<'a>,
    best: Best,
    state: T::State,
}

/// Queues of rays in flight, one for each kind of next step.
struct Queues {
    rays: [u8; KINDS * FLIGHT],
    count: [usize; KINDS],
}

impl Queues {
    /// Appends a ray to the queue of its kind.
    #[inline(always)]
    fn push(&mut self, Next(kind): Next, ray: u8) {
        let count = &mut self.count[kind % KINDS];
        self.rays[(kind * FLIGHT + *count) % (KINDS * FLIGHT)] = ray;
        *count += 1;
    }

    /// Empties a queue and returns its previous length. Its rays stay readable as long as no more rays are
    /// pushed than have been read.
    #[inline(always)]
    fn take(&mut self, Next(kind): Next) -> usize {
        std::mem::take(&mut self.count[kind])
    }

    /// The ray at index `i` of a queue, emptied or not.
    #[inline(always)]
    fn ray(&self, Next(kind): Next, i: usize) -> u8 {
        self.rays[kind * FLIGHT + i % FLIGHT]
    }

    /// The length of a queue.
    #[inline(always)]
    fn count(&self, Next(kind): Next) -> usize {
        self.count[kind]
    }
}

/// Steps the rays of the queue of plain nodes, or of the second kind if `GENERAL`. Prefetches their nodes first if they
/// are far from the processor.
#[inline(always)]
fn step_queue<const GENERAL: bool, S: Simd, T: Steps>(
    simd: S,
    steps: &T,
    far: bool,
    flights: &mut [Flight<'_, T>],
    queues: &mut Queues,
) {
    let kind = if GENERAL { Next::GENERAL } else { Next::PLAIN };
    let count = queues.take(kind);
    for i in 0..if far { count } else { 0 } {
        let state = &flights[queues.ray(kind, i) as usize].state;
        if GENERAL {
            steps.fetch_general(state);
        } else {
            steps.fetch_plain(state);
        }
    }
    for i in 0..count {
        let ray = queues.ray(kind, i);
        let flight = &mut flights[ray as usize];
        let reach = flight.best.reach;
        if GENERAL {
            steps.general(simd, &flight.frame, &mut flight.state, reach);
        } else {
            steps.plain(simd, &mut flight.state, reach);
        }
        queues.push(steps.next(&flight.state), ray);
    }
}

impl<'a> Run<'a> {
    /// Finds the nearest hits (or any hits) of the rays, several at a time, and passes each with the ray's
    /// index to `write`, in no particular order.
    pub fn in_flight<T: Steps, Q: Query>(&self, steps: &T, mut write: impl FnMut(usize, Hit)) {
        dispatch!(self.level, simd => self.flying::<_, _, Q>(simd, steps, &mut write));
    }

    /// [`Self::in_flight`] for one instruction set.
    #[inline(always)]
    fn flying<S: Simd, T: Steps, Q: Query>(
        &self,
        simd: S,
        steps: &T,
        write: &mut impl FnMut(usize, Hit),
    ) {
        let mut cache = self.cache::<Q>();
        let mut late = Late::default();
        let far = steps.bytes() > CLOSE;
        let mut following = 0;
        let mut flights: Vec<Flight<'a, T>> = Vec::with_capacity(FLIGHT);
        let mut queues = Queues {
            rays: [0; KINDS * FLIGHT],
            count: [0; KINDS],
        };
        // At first all slots are free: their rays count as ended.
        for i in 0..FLIGHT.min(self.rays.len()) {
            flights.push(Flight {
                index: usize::MAX,
                frame: FrameRay::NOTHING,
                best: Best::blank(),
                state: steps.blank(),
            });
            #[expect(clippy::cast_possible_truncation, reason = "a few")]
            queues.push(Next::OVER, i as u8);
        }
        loop {
            // Report the answers of rays that have ended, and start new rays in their slots.
            for i in 0..queues.take(Next::OVER) {
                let ray = queues.ray(Next::OVER, i);
                let flight = &mut flights[ray as usize];
                self.report::<S, T, Q>(simd, flight, &mut late, &mut cache, write);
                if self.start_next::<T, Q>(steps, &mut following, flight, &cache, write) {
                    queues.push(steps.next(&flight.state), ray);
                }
            }
            // Step rays through inner nodes, kind by kind, until enough of them have come to leaves.
            let mut fetched = 0;
            loop {
                step_queue::<false, S, T>(simd, steps, far, &mut flights, &mut queues);
                step_queue::<true, S, T>(simd, steps, far, &mut flights, &mut queues);
                // Prefetch leaves as soon as they are known, so that steps of other rays cover the latency.
                for i in fetched..queues.count(Next::LEAF) {
                    let ray = queues.ray(Next::LEAF, i);
                    steps.fetch_leaf(self.blocks, &flights[ray as usize].state);
                }
                fetched = queues.count(Next::LEAF);
                let inner = queues.count(Next::PLAIN) + queues.count(Next::GENERAL);
                // Do not wait for the last rays: some take many steps to their next leaf.
                if inner == 0 || queues.count(Next::LEAF) + queues.count(Next::OVER) > LEAVES {
                    break;
                }
            }
            self.test_leaves::<S, T, Q>(simd, steps, &mut flights, &mut queues);
            // End once no ray is in flight.
            if queues.count == [0; KINDS] {
                late.settle(simd, self.rays, write);
                return;
            }
        }
    }

    /// Tests the leaves of all rays that have come to one.
    #[inline(always)]
    fn test_leaves<S: Simd, T: Steps, Q: Query>(
        &self,
        simd: S,
        steps: &T,
        flights: &mut [Flight<'a, T>],
        queues: &mut Queues,
    ) {
        let leaves = queues.take(Next::LEAF);
        for i in 0..leaves {
            let ray = queues.ray(Next::LEAF, i);
            let flight = &mut flights[ray as usize];
            let own = RayRef {
                ray: &self.rays[flight.index],
                frame: &flight.frame,
            };
            let (state, best) = (&mut flight.state, &mut flight.best);
            steps.leaf::<S, Q, _>(simd, self.job(), own, state, best, &mut NoCountLate);
            queues.push(steps.next(&flight.state), ray);
        }
    }

    /// Reports the answer of a ray that has ended, or collects it in `late`.
    #[inline(always)]
    fn report<S: Simd, T: Steps, Q: Query>(
        &self,
        simd: S,
        flight: &mut Flight<'a, T>,
        late: &mut Late,
        cache: &mut Option<ShadowCache>,
        write: &mut impl FnMut(usize, Hit),
    ) {
        let Some(own) = self.rays.get(flight.index) else {
            return;
        };
        // Batch the exact tests of proven hits; answer all other rays at once.
        match flight.best.held() {
            Some(held) if self.frame.is_unscaled() => {
                late.push(simd, flight.index, self.rays, &flight.frame, held, write);
            }
            _ => {
                let hit = flight.best.answer(RayRef {
                    ray: own,
                    frame: &flight.frame,
                });
                if Q::ANY
                    && let Some(cache) = cache
                {
                    cache.remember(cache.entry(own), &hit);
                }
                write(flight.index, hit);
            }
        }
    }

    /// Starts the next ray that needs a traversal, and answers the rays before it that do not. Returns whether
    /// there was one.
    #[inline(always)]
    fn start_next<T: Steps, Q: Query>(
        &self,
        steps: &T,
        following: &mut usize,
        flight: &mut Flight<'a, T>,
        cache: &Option<ShadowCache>,
        write: &mut impl FnMut(usize, Hit),
    ) -> bool {
        while let Some(ray) = self.rays.get(*following) {
            // Answer rays that miss the scene's box.
            let index = *following;
            *following += 1;
            let Some(frame) = self.framed(index) else {
                write(index, Hit::MISS);
                continue;
            };
            // Answer shadow rays that the cached blocker stops.
            let own = RayRef { ray, frame: &frame };
            if Q::ANY
                && let Some(hit) = self.cached(cache, own, &mut NoCount)
            {
                write(index, hit);
                continue;
            }
            // Start the traversal.
            flight.index = index;
            flight.best = Best::new(&frame);
            steps.start(&frame, &mut flight.state);
            flight.frame = frame;
            return true;
        }
        false
    }
}
