// SPDX-License-Identifier: GPL-3.0-or-later
//! Batches of rays that have nothing in common, which tiles cannot help: several are in flight, and those
//! that need the same kind of step take it one after another.
//!
//! A single ray waits for its own arithmetic and fetches, and the processor cannot guess what comes next, a
//! node or a leaf. Sorted by what they need, rays run through loops without such a question, and one ray's
//! work fills the time in which another waits. What a ray needs next is asked for as soon as that is known: guessing
//! wrong, the processor would else wait for memory before it found out, and for nothing of the other rays meanwhile.

use super::batch::{self, Batch};
use super::blocks::Blocks;
use super::frame::FrameRay;
use super::late::Late;
use super::query::{Best, Counters, NoCount, NoCountLate, Query};
use super::ray::{Hit, Ray};
use super::shadow_cache::ShadowCache;
use crate::scene::Triangles;
use fearless_simd::{Simd, dispatch};

/// Rays in flight. Fewer leave the processor waiting, more push one another out of its closest cache.
const FLIGHT: usize = 16;

/// While no more rays than these wait before leaves, the others go on.
const LEAVES: usize = 8;

/// Nodes of no more bytes than this are not asked for ahead: they lie in caches from which they come soon enough.
const CLOSE: usize = 4 << 20;

/// What a ray needs next: the two highest bits of a word that names a node. A number, for rays are queued
/// by it, which must not take a branch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Next(usize);

/// Kinds of [`Next`].
const KINDS: usize = 4;

impl Next {
    /// A step through a plain node.
    pub const PLAIN: Self = Self(0);
    /// A step through a node of the other kind, if there is one.
    pub const GENERAL: Self = Self(1);
    /// The triangles of a leaf.
    pub const LEAF: Self = Self(2);
    /// Nothing: its walk is over.
    pub const OVER: Self = Self(3);

    /// The bits of a word.
    pub const fn word(self) -> u32 {
        (self.0 as u32) << 30
    }

    /// What a word says.
    #[inline(always)]
    pub const fn of(word: u32) -> Self {
        Self((word >> 30) as usize)
    }
}

/// The place on a stack of the last that waits and is entered no farther away than `reach`. The lowest is entered at
/// once, and ends the walk: there is no question whether any waits.
#[inline(always)]
pub(super) fn topmost(enter: &[f32], waiting: usize, reach: f32) -> usize {
    let mut top = waiting - 1;
    while enter[top] > reach {
        top -= 1;
    }
    top
}

/// A way of walking a tree that can be interrupted after each step.
pub trait Steps: Sync {
    /// How far a ray has come.
    type Course;

    /// Of no ray.
    fn course(&self) -> Self::Course;

    /// A ray sets out.
    fn begin(&self, ray: &FrameRay, course: &mut Self::Course);

    /// What the ray needs next.
    fn next(&self, course: &Self::Course) -> Next;

    /// A step through a plain node, then to what lies nearer than `reach`.
    fn plain<S: Simd>(&self, simd: S, course: &mut Self::Course, reach: f32);

    /// A step through a node of the other kind; in trees of one kind there is nothing to do.
    #[inline(always)]
    fn general<S: Simd>(&self, simd: S, ray: &FrameRay, course: &mut Self::Course, reach: f32) {
        let _ = (simd, ray, course, reach);
    }

    /// Size of the nodes in bytes.
    fn bytes(&self) -> usize;

    /// Asks for the plain node that the ray needs next.
    fn fetch_plain(&self, course: &Self::Course);

    /// Asks for the node of the other kind that the ray needs next.
    #[inline(always)]
    fn fetch_general(&self, course: &Self::Course) {
        let _ = course;
    }

    /// Asks for the leaf that the ray needs next.
    fn fetch_leaf(&self, blocks: &Blocks, course: &Self::Course);

    /// Tests the triangles of a leaf.
    fn leaf<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        triangles: (&Triangles, &Blocks),
        ray: (&Ray, &FrameRay),
        course: (&mut Self::Course, &mut Best),
        counters: &mut C,
    );
}

/// A walk by steps as one of single rays.
pub struct Alone<'a, W>(pub &'a W);

impl<W: Steps> batch::Walk for Alone<'_, W> {
    type Scratch = W::Course;

    fn scratch(&self) -> Self::Scratch {
        self.0.course()
    }

    #[inline(always)]
    fn cast<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        triangles: (&Triangles, &Blocks),
        ray: (&Ray, &FrameRay),
        course: &mut Self::Scratch,
        counters: &mut C,
    ) -> Hit {
        let walk = self.0;
        let mut best = Best::new(ray.1);
        walk.begin(ray.1, course);
        loop {
            match walk.next(course) {
                Next::PLAIN => {
                    counters.step_axis();
                    walk.plain(simd, course, best.reach);
                }
                Next::GENERAL => {
                    counters.step_oblique();
                    walk.general(simd, ray.1, course, best.reach);
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
    /// The ray's place in the batch.
    place: usize,
    frame: FrameRay<'a>,
    best: Best,
    course: W::Course,
}

/// Rays in flight by what they need next.
struct Queues {
    rays: [u8; KINDS * FLIGHT],
    count: [usize; KINDS],
}

impl Queues {
    /// Queues a ray.
    #[inline(always)]
    fn push(&mut self, Next(kind): Next, ray: u8) {
        let count = &mut self.count[kind % KINDS];
        self.rays[(kind * FLIGHT + *count) % (KINDS * FLIGHT)] = ray;
        *count += 1;
    }

    /// Empties a queue: how many rays it had. They stay readable while no more are queued than were read.
    #[inline(always)]
    fn take(&mut self, Next(kind): Next) -> usize {
        std::mem::take(&mut self.count[kind])
    }

    /// A ray of a queue that was emptied.
    #[inline(always)]
    fn ray(&self, Next(kind): Next, i: usize) -> u8 {
        self.rays[kind * FLIGHT + i % FLIGHT]
    }

    #[inline(always)]
    fn count(&self, Next(kind): Next) -> usize {
        self.count[kind]
    }
}

impl<'a> Batch<'a> {
    /// Walks the rays, several at a time, and hands each answer to `write` with the ray's place, in no
    /// particular order.
    pub fn fly<W: Steps, Q: Query>(&self, walk: &W, mut write: impl FnMut(usize, Hit)) {
        dispatch!(self.level, simd => self.flying::<_, _, Q>(simd, walk, &mut write));
    }

    #[inline(always)]
    fn flying<S: Simd, W: Steps, Q: Query>(
        &self,
        simd: S,
        walk: &W,
        write: &mut impl FnMut(usize, Hit),
    ) {
        let triangles = (self.scene, self.blocks);
        let mut cache = self.cache::<Q>();
        let mut late = Late::new();
        let far = walk.bytes() > CLOSE;
        let mut following = 0;
        let mut flights: Vec<Flight<'a, W>> = Vec::with_capacity(FLIGHT);
        let mut queues = Queues {
            rays: [0; KINDS * FLIGHT],
            count: [0; KINDS],
        };
        // At first all places are free.
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
            for i in 0..queues.take(Next::OVER) {
                let ray = queues.ray(Next::OVER, i);
                let flight = &mut flights[ray as usize];
                if let Some(own) = self.rays.get(flight.place) {
                    match flight.best.held() {
                        Some(held) if self.frame.is_scene() => {
                            let ray = (flight.place, self.rays);
                            late.push(simd, ray, &flight.frame, held, write);
                        }
                        _ => {
                            let hit = flight.best.answer((own, &flight.frame));
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
                // The sooner leaves are asked for, the more steps of other rays lie between.
                for i in fetched..queues.count(Next::LEAF) {
                    let ray = queues.ray(Next::LEAF, i);
                    walk.fetch_leaf(self.blocks, &flights[ray as usize].course);
                }
                fetched = queues.count(Next::LEAF);
                let inner = queues.count(Next::PLAIN) + queues.count(Next::GENERAL);
                // Leaves are long in coming.
                if inner == 0 || queues.count(Next::LEAF) + queues.count(Next::OVER) > LEAVES {
                    break;
                }
            }
            let leaves = queues.take(Next::LEAF);
            for i in 0..leaves {
                let ray = queues.ray(Next::LEAF, i);
                let flight = &mut flights[ray as usize];
                let own = (&self.rays[flight.place], &flight.frame);
                let course = (&mut flight.course, &mut flight.best);
                walk.leaf::<S, Q, _>(simd, triangles, own, course, &mut NoCountLate);
                queues.push(walk.next(&flight.course), ray);
            }
            if queues.count == [0; KINDS] {
                late.settle(simd, self.rays, write);
                return;
            }
        }
    }

    /// Sends the next ray off that has to be walked, if there is one, and answers those before it.
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
            let place = *following;
            *following += 1;
            let Some(framed) = self.framed(place) else {
                write(place, Hit::MISS);
                continue;
            };
            if Q::ANY
                && let Some(hit) = self.cached(cache, (ray, &framed), &mut NoCount)
            {
                write(place, hit);
                continue;
            }
            flight.place = place;
            flight.best = Best::new(&framed);
            walk.begin(&framed, &mut flight.course);
            flight.frame = framed;
            return true;
        }
        false
    }
}
