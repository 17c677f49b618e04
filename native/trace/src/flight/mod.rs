// SPDX-License-Identifier: GPL-3.0-or-later
//! Traversal of incoherent batches, which tiles cannot help: several rays are in flight, and those whose next
//! steps are of one kind take them one after another.
//!
//! A single ray waits for its own arithmetic and memory, and the processor cannot predict whether a node or a
//! leaf comes next. Sorted by the kind of their next step, rays run through loops without that branch, and the
//! work of one ray fills the latency of another. The next node or leaf of a ray is prefetched as soon as it is
//! known: a mispredicted branch would otherwise wait for memory before it is resolved, and hold up the other
//! rays.

pub mod boxes;
pub mod kernel;
pub mod late;
pub mod planes;

use crate::batch::{self, Launch};
use crate::flight::late::Late;
use crate::shadow_cache::ShadowCache;
use fearless_simd::{Simd, dispatch};
use halfspace_leaf::Job;
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::next::{KINDS, Next};
use halfspace_ray::query::{Best, Counters, NoCount, NoCountLate, Query};
use halfspace_ray::{FrameRay, Hit, RayRef};

/// Number of rays in flight. Fewer leave latency exposed, more evict one another from the L1 cache. Measured on
/// five scenes: 24 rays are within 2 %.
const FLIGHT: usize = 16;

/// Leaves are tested once more rays than this wait at one or have ended; until then the others step on.
const LEAVES: usize = 8;

/// Nodes of trees up to this size in bytes are not prefetched, because they come from a near cache. Measured:
/// prefetching them in a small tree made diffuse rays 2 to 6 % slower.
const CLOSE: usize = 4 << 20;

/// The index of the topmost stack entry that starts within `reach`; entries above it are dropped.
///
/// Entry 0 is a sentinel that starts at negative infinity and ends the traversal, so the loop needs no check
/// for an empty stack.
#[inline(always)]
pub fn topmost(enter: &[f32], waiting: usize, reach: f32) -> usize {
    let mut top = waiting - 1;
    while enter[top] > reach {
        top -= 1;
    }
    top
}

/// A traversal that can be interrupted after each step.
pub trait Steps: Sync {
    /// The traversal state of one ray.
    type Course;

    /// The state of no ray, for allocation.
    fn course(&self) -> Self::Course;

    /// Starts the traversal of a ray at the root.
    fn begin(&self, ray: &FrameRay, course: &mut Self::Course);

    /// The kind of the ray's next step.
    fn next(&self, course: &Self::Course) -> Next;

    /// Counts a step through a plain node.
    #[inline(always)]
    fn count_plain<C: Counters>(&self, counters: &mut C) {
        counters.step_axis();
    }

    /// Steps through a plain node and selects the next child that starts within `reach`.
    fn plain<S: Simd>(&self, simd: S, course: &mut Self::Course, reach: f32);

    /// Steps through a node of the second kind; does nothing in trees of one kind.
    #[inline(always)]
    fn general<S: Simd>(&self, simd: S, ray: &FrameRay, course: &mut Self::Course, reach: f32) {
        let _ = (simd, ray, course, reach);
    }

    /// Size of the nodes in bytes.
    fn bytes(&self) -> usize;

    /// Prefetches the plain node of the ray's next step.
    fn fetch_plain(&self, course: &Self::Course);

    /// Prefetches the node, of the second kind, of the ray's next step.
    #[inline(always)]
    fn fetch_general(&self, course: &Self::Course) {
        let _ = course;
    }

    /// Prefetches the leaf that the ray is to test next.
    fn fetch_leaf(&self, blocks: &Blocks, course: &Self::Course);

    /// Tests the triangles of the ray's next leaf, and selects the next child or ends the traversal.
    fn leaf<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        triangles: Job<'_>,
        ray: RayRef<'_>,
        course: (&mut Self::Course, &mut Best),
        counters: &mut C,
    );
}

/// A traversal by steps, run to its end for one ray at a time.
pub struct Alone<W>(pub W);

impl<W: Steps> batch::Walk for Alone<W> {
    type Scratch = W::Course;

    fn scratch(&self) -> Self::Scratch {
        self.0.course()
    }

    #[inline(always)]
    fn cast<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        triangles: Job<'_>,
        ray: RayRef<'_>,
        course: &mut Self::Scratch,
        counters: &mut C,
    ) -> Hit {
        let walk = &self.0;
        let mut best = Best::new(ray.frame);
        walk.begin(ray.frame, course);
        loop {
            // Take the steps one after another; nothing is sorted for a single ray.
            match walk.next(course) {
                Next::PLAIN => {
                    walk.count_plain(counters);
                    walk.plain(simd, course, best.reach);
                }
                Next::GENERAL => {
                    counters.step_oblique();
                    walk.general(simd, ray.frame, course, best.reach);
                }
                Next::LEAF => {
                    walk.leaf::<S, Q, C>(simd, triangles, ray, (course, &mut best), counters);
                }
                _ => return best.hit(),
            }
        }
    }
}

/// A ray in flight.
struct Flight<'a, W: Steps> {
    /// Index of the ray in the batch; `usize::MAX` for none.
    place: usize,
    frame: FrameRay<'a>,
    best: Best,
    course: W::Course,
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

impl<'a> Launch<'a> {
    /// Finds the nearest hits (or any hits) of the rays, several at a time, and passes each with the ray's
    /// index to `write`, in no particular order.
    pub fn fly<W: Steps, Q: Query>(&self, walk: &W, mut write: impl FnMut(usize, Hit)) {
        dispatch!(self.level, simd => self.flying::<_, _, Q>(simd, walk, &mut write));
    }

    /// [`Self::fly`] for one instruction set.
    #[inline(always)]
    fn flying<S: Simd, W: Steps, Q: Query>(
        &self,
        simd: S,
        walk: &W,
        write: &mut impl FnMut(usize, Hit),
    ) {
        let triangles = Job {
            scene: self.scene,
            blocks: self.blocks,
        };
        let mut cache = self.cache::<Q>();
        let mut late = Late::default();
        let far = walk.bytes() > CLOSE;
        let mut following = 0;
        let mut flights: Vec<Flight<'a, W>> = Vec::with_capacity(FLIGHT);
        let mut queues = Queues {
            rays: [0; KINDS * FLIGHT],
            count: [0; KINDS],
        };
        // At first all slots are free: their rays count as ended.
        for i in 0..FLIGHT.min(self.rays.len()) {
            flights.push(Flight {
                place: usize::MAX,
                frame: FrameRay::NOTHING,
                best: Best::blank(),
                course: walk.course(),
            });
            #[expect(clippy::cast_possible_truncation, reason = "a few")]
            queues.push(Next::OVER, i as u8);
        }
        loop {
            // Report the answers of rays that have ended, and start new rays in their slots.
            for i in 0..queues.take(Next::OVER) {
                let ray = queues.ray(Next::OVER, i);
                let flight = &mut flights[ray as usize];
                if let Some(own) = self.rays.get(flight.place) {
                    // Batch the exact tests of proven hits; answer all other rays at once.
                    match flight.best.held() {
                        Some(held) if self.frame.is_scene() => {
                            let ray = (flight.place, self.rays);
                            late.push(simd, ray, &flight.frame, held, write);
                        }
                        _ => {
                            let hit = flight.best.answer(RayRef {
                                ray: own,
                                frame: &flight.frame,
                            });
                            if Q::ANY
                                && let Some(cache) = &mut cache
                            {
                                cache.remember(cache.entry(own), &hit);
                            }
                            write(flight.place, hit);
                        }
                    }
                }
                if self.embark::<W, Q>(walk, &mut following, flight, &cache, write) {
                    queues.push(walk.next(&flight.course), ray);
                }
            }
            // Step rays through inner nodes, kind by kind, until enough of them wait at leaves.
            let mut fetched = 0;
            loop {
                let plain = queues.take(Next::PLAIN);
                for i in 0..if far { plain } else { 0 } {
                    let ray = queues.ray(Next::PLAIN, i);
                    walk.fetch_plain(&flights[ray as usize].course);
                }
                for i in 0..plain {
                    let ray = queues.ray(Next::PLAIN, i);
                    let flight = &mut flights[ray as usize];
                    walk.plain(simd, &mut flight.course, flight.best.reach);
                    queues.push(walk.next(&flight.course), ray);
                }
                let general = queues.take(Next::GENERAL);
                for i in 0..if far { general } else { 0 } {
                    let ray = queues.ray(Next::GENERAL, i);
                    walk.fetch_general(&flights[ray as usize].course);
                }
                for i in 0..general {
                    let ray = queues.ray(Next::GENERAL, i);
                    let flight = &mut flights[ray as usize];
                    let reach = flight.best.reach;
                    walk.general(simd, &flight.frame, &mut flight.course, reach);
                    queues.push(walk.next(&flight.course), ray);
                }
                // Prefetch leaves as soon as they are known, so that steps of other rays cover the latency.
                for i in fetched..queues.count(Next::LEAF) {
                    let ray = queues.ray(Next::LEAF, i);
                    walk.fetch_leaf(self.blocks, &flights[ray as usize].course);
                }
                fetched = queues.count(Next::LEAF);
                let inner = queues.count(Next::PLAIN) + queues.count(Next::GENERAL);
                // Do not wait for the last rays: some take many steps to their next leaf.
                if inner == 0 || queues.count(Next::LEAF) + queues.count(Next::OVER) > LEAVES {
                    break;
                }
            }
            // Test the leaves of all rays that wait at one.
            let leaves = queues.take(Next::LEAF);
            for i in 0..leaves {
                let ray = queues.ray(Next::LEAF, i);
                let flight = &mut flights[ray as usize];
                let own = RayRef {
                    ray: &self.rays[flight.place],
                    frame: &flight.frame,
                };
                let course = (&mut flight.course, &mut flight.best);
                walk.leaf::<S, Q, _>(simd, triangles, own, course, &mut NoCountLate);
                queues.push(walk.next(&flight.course), ray);
            }
            // End once no ray is in flight.
            if queues.count == [0; KINDS] {
                late.settle(simd, self.rays, write);
                return;
            }
        }
    }

    /// Starts the next ray that needs a traversal, and answers the rays before it that do not. Returns whether
    /// there was one.
    #[inline(always)]
    fn embark<W: Steps, Q: Query>(
        &self,
        walk: &W,
        following: &mut usize,
        flight: &mut Flight<'a, W>,
        cache: &Option<ShadowCache>,
        write: &mut impl FnMut(usize, Hit),
    ) -> bool {
        while let Some(ray) = self.rays.get(*following) {
            // Answer rays that miss the scene's box.
            let place = *following;
            *following += 1;
            let Some(framed) = self.framed(place) else {
                write(place, Hit::MISS);
                continue;
            };
            // Answer shadow rays that the cached blocker stops.
            if Q::ANY
                && let Some(hit) = self.cached(
                    cache,
                    RayRef {
                        ray,
                        frame: &framed,
                    },
                    &mut NoCount,
                )
            {
                write(place, hit);
                continue;
            }
            // Start the traversal.
            flight.place = place;
            flight.best = Best::new(&framed);
            walk.begin(&framed, &mut flight.course);
            flight.frame = framed;
            return true;
        }
        false
    }
}
