// SPDX-License-Identifier: GPL-3.0-or-later
//! What a walk is asked and what it counts: compile-time parameters of every walk, so that closest
//! hit and any hit are one text and an uncounted walk has no trace of counting.

use super::bound::keep_min;
use super::cases::CASES;
use super::frame::FrameRay;
use super::ray::{Hit, Ray, RayCounters};
use super::replay::Record;
use crate::geom::verdict::verdict_within;

/// The question put to a walk.
pub trait Query: Sync {
    /// Whether the first hit found, in any order, ends the walk.
    const ANY: bool;
}

/// The nearest hit.
pub struct Closest;

/// Any hit at all.
pub struct Any;

impl Query for Closest {
    const ANY: bool = false;
}

impl Query for Any {
    const ANY: bool = true;
}

/// What happens during a walk, reported when it happens. Of what a counter does not say otherwise it takes no note.
pub trait Counters {
    /// Whether nobody asks which triangles were tested and which put to the verdict: a shadow ray then needs no
    /// verdict where f32 is sure of a hit.
    const QUICK: bool = false;
    /// Whether, beyond that, the verdict on a triangle that f32 is sure of may wait until it is known that no
    /// other is nearer. The walk then ends with [`Best::answer`].
    const LATE: bool = false;

    /// An inner node with an axis-aligned plane, a box, a slab pair or an octant was visited.
    #[inline(always)]
    fn step_axis(&mut self) {}
    /// An inner node with an oblique plane was visited.
    #[inline(always)]
    fn step_oblique(&mut self) {}
    /// A leaf with this many triangles was visited.
    #[inline(always)]
    fn leaf(&mut self, triangles: usize) {
        let _ = triangles;
    }
    /// This many triangles were tested in f32.
    #[inline(always)]
    fn tests(&mut self, triangles: usize) {
        let _ = triangles;
    }
    /// A candidate was put to the exact verdict.
    #[inline(always)]
    fn verdict(&mut self) {}
    /// A walk that tells cases apart met this one, by its place in [`RayCounters::cases`]; it is worked out
    /// only when it is counted.
    #[inline(always)]
    fn case(&mut self, _: impl FnOnce() -> usize) {}

    /// Whether leaves answer from a recording instead of their triangles.
    const REPLAY: bool = false;
    /// The triangles of the leaf whose blocks begin at `first`, of none too, are about to be tested.
    #[inline(always)]
    fn visit(&mut self, first: u32, triangles: usize) {
        let _ = (first, triangles);
    }
    /// The best hit so far, whenever there is a better one.
    #[inline(always)]
    fn improved(&mut self, _: Hit) {}
    /// What the next leaf answered when the walk was recorded.
    #[inline(always)]
    fn replay(&mut self) -> Option<Hit> {
        None
    }

    /// The answer came without a walk of the ray's own.
    #[inline(always)]
    fn spared(&mut self) {}
}

/// Counts nothing, costs nothing.
#[derive(Clone, Copy)]
pub struct NoCount;

impl Counters for NoCount {
    const QUICK: bool = true;
}

/// The same for walks that pass their verdicts late.
pub struct NoCountLate;

impl Counters for NoCountLate {
    const QUICK: bool = true;
    const LATE: bool = true;
}

/// What is noted of a walk beside its counters. A value, not a type of counters each: what counts, records or follows
/// rays is then one compiled walk.
pub enum Notes<'a> {
    /// Nothing.
    Nothing,
    /// What the leaves answer.
    Answers(&'a mut Record),
    /// The leaves whose triangles are tested: where their blocks begin, and how many triangles they hold.
    Leaves(&'a mut Vec<(u32, usize)>),
}

/// Counts into the counters of one ray, and takes notes.
pub struct Count<'a>(pub &'a mut RayCounters, pub Notes<'a>);

impl Counters for Count<'_> {
    #[inline(always)]
    fn step_axis(&mut self) {
        self.0.steps_axis += 1;
    }
    #[inline(always)]
    fn step_oblique(&mut self) {
        self.0.steps_oblique += 1;
    }
    #[inline(always)]
    fn leaf(&mut self, triangles: usize) {
        if triangles == 0 {
            self.0.leaves_empty += 1;
        } else {
            self.0.leaves += 1;
        }
    }
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a leaf holds fewer than 2^29 triangles"
    )]
    fn tests(&mut self, triangles: usize) {
        self.0.tests += triangles as u32;
    }
    #[inline(always)]
    fn verdict(&mut self) {
        self.0.verdicts += 1;
    }
    #[inline(always)]
    fn case(&mut self, case: impl FnOnce() -> usize) {
        self.0.cases[case() % CASES] += 1;
    }
    #[inline(always)]
    fn visit(&mut self, first: u32, triangles: usize) {
        match &mut self.1 {
            Notes::Answers(record) => record.visit(),
            // An empty leaf begins where the next one does.
            Notes::Leaves(leaves) if triangles > 0 => leaves.push((first, triangles)),
            _ => {}
        }
    }
    #[inline(always)]
    fn improved(&mut self, hit: Hit) {
        if let Notes::Answers(record) = &mut self.1 {
            record.improved(hit);
        }
    }
    #[inline(always)]
    fn spared(&mut self) {
        self.0.spared += 1;
    }
}

/// A triangle that a ray certainly hits, and on which there is no verdict yet.
#[derive(Clone, Copy)]
pub struct Deferred {
    /// Its number in the structure; [`Hit::NONE`] if there is none.
    pub triangle: u32,
    /// Its corners in the scene.
    pub corners: [[f32; 3]; 3],
    /// Lower bound on its distance in the frame's units.
    pub low: f32,
}

impl Deferred {
    const NOTHING: Self = Self {
        triangle: Hit::NONE,
        corners: [[0.0; 3]; 3],
        low: f32::INFINITY,
    };
}

/// The best hit of a walk so far, and how far the walk still has to look.
pub struct Best {
    hit: Hit,
    /// What may be a better one.
    held: Deferred,
    /// Upper bound, in the frame's units, on the distance of anything that could still win.
    pub reach: f32,
}

impl Best {
    /// Nothing found yet, or what the ray has found elsewhere.
    #[inline(always)]
    pub fn new(ray: &FrameRay) -> Self {
        Self {
            hit: ray.known,
            held: Deferred::NOTHING,
            reach: ray.t_max,
        }
    }

    /// Nothing found yet, by a walk that keeps its own reach.
    #[inline(always)]
    pub fn blank() -> Self {
        Self {
            hit: Hit::MISS,
            held: Deferred::NOTHING,
            reach: f32::INFINITY,
        }
    }

    /// An answer found elsewhere.
    #[inline(always)]
    pub fn known(hit: Hit) -> Self {
        Self {
            hit,
            held: Deferred::NOTHING,
            reach: f32::NEG_INFINITY,
        }
    }

    /// Puts one candidate, number and corners, to the verdict; says whether the walk may end. Where the ray
    /// is in an instance's space, so are they, and the verdict sees them where they stand in the scene.
    ///
    /// Distances are compared after rounding, so that equal means equal to the caller too.
    #[inline(always)]
    pub fn offer<Q: Query, C: Counters>(
        &mut self,
        (ray, frame): (&Ray, &FrameRay),
        id: u32,
        corners: impl FnOnce() -> [[f32; 3]; 3],
        counters: &mut C,
    ) -> bool {
        let id = frame.first + id;
        // A triangle that reaches into several leaves is met again in each.
        if id == self.hit.triangle {
            return false;
        }
        counters.verdict();
        let span = [ray.t_min, keep_min(self.hit.t, ray.t_max)];
        let corners = match frame.place {
            None => corners(),
            Some(place) => match place.corners(corners()) {
                Some(corners) => corners,
                None => return false,
            },
        };
        let Some(found) = verdict_within(ray.o, ray.d, corners, span) else {
            return false;
        };
        if !ray.reaches(found.t) {
            return false;
        }
        if Hit::precedes((found.t, id), (self.hit.t, self.hit.triangle)) {
            self.hit = Hit {
                t: found.t,
                triangle: id,
                u: found.u,
                v: found.v,
            };
            self.reach = keep_min(frame.reach(found.t), self.reach);
            counters.improved(self.hit);
        }
        Q::ANY
    }

    /// Takes a triangle that the ray certainly hits, between these distances in the frame's units; `certain` is
    /// [`FrameRay::certain`]. Says whether the walk may end; `None` when only the verdict can tell what comes of it.
    ///
    /// Of two such triangles one may be certainly nearer, however both distances are rounded: the other one is
    /// forgotten, and of most rays only one triangle is ever put to the verdict.
    #[inline(always)]
    pub fn hold<Q: Query>(
        &mut self,
        (ray, frame, [from, to]): (&Ray, &FrameRay, [f32; 2]),
        id: u32,
        [low, high]: [f32; 2],
        corners: impl FnOnce() -> [[f32; 3]; 3],
    ) -> Option<bool> {
        // Written so that nothing is certain of what is not a number.
        if !(low > from && high < to) {
            return None;
        }
        debug_assert_eq!(frame.first, 0, "not in an instance's space");
        if Q::ANY {
            // Nobody asks how far away it is.
            self.hit = Hit {
                t: ray.t_max,
                triangle: id,
                u: 0.0,
                v: 0.0,
            };
            return Some(true);
        }
        if id == self.hit.triangle || id == self.held.triangle {
            return Some(false);
        }
        let far = frame.beyond(high);
        // While nothing is held its lower bound is infinite, and every triangle is nearer than that.
        if far >= self.held.low {
            return None;
        }
        self.held = Deferred {
            triangle: id,
            corners: corners(),
            low,
        };
        self.reach = keep_min(far, self.reach);
        Some(false)
    }

    /// Takes a hit from a recording; says whether the walk may end.
    #[inline(always)]
    pub fn take<Q: Query>(&mut self, frame: &FrameRay, hit: Option<Hit>) -> bool {
        let Some(hit) = hit else {
            return false;
        };
        self.hit = hit;
        self.reach = frame.reach(hit.t);
        Q::ANY
    }

    /// The answer of a walk that puts its candidates to the verdict at once.
    #[inline(always)]
    pub fn hit(&self) -> Hit {
        debug_assert_eq!(self.held.triangle, Hit::NONE, "a verdict is still to come");
        self.hit
    }

    /// The triangle on which there is no verdict yet, where that is all that is known.
    #[inline(always)]
    pub fn held(&self) -> Option<&Deferred> {
        (self.held.triangle != Hit::NONE && !self.hit.is_hit()).then_some(&self.held)
    }

    /// The answer at the end of a walk, after the verdict that may have waited for it.
    #[inline(always)]
    pub fn answer(&mut self, ray: (&Ray, &FrameRay)) -> Hit {
        if self.held.triangle != Hit::NONE {
            let Deferred {
                triangle, corners, ..
            } = std::mem::replace(&mut self.held, Deferred::NOTHING);
            self.offer::<Closest, _>(ray, triangle, || corners, &mut NoCount);
            debug_assert!(self.hit.is_hit(), "the ray certainly hits it");
        }
        self.hit
    }
}
