// SPDX-License-Identifier: GPL-3.0-or-later
//! Queries, a compile-time parameter of every traversal, so that nearest hit and any-hit share one source text.

use crate::frame_ray::FrameRay;
use crate::ray::{Hit, HitKey};
use crate::{BoundedRay, RayRef};
use halfspace_geom::bound::keep_min;
use halfspace_geom::verdict::verdict_within;
use std::marker::PhantomData;

pub use crate::counters::{Count, Counters, Log, NoCount, NoCountLate, join};

/// How a traversal tests the triangles of a leaf.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LeafTest {
    /// Eight at a time, in f32 with error bounds; candidates get the exact verdict.
    Eight,
    /// One at a time, in f32 with error bounds; candidates get the exact verdict.
    Scalar,
    /// One at a time as published, in f32 without an exact verdict.
    Published,
}

/// Kind of query: the nearest hit, or any hit.
pub trait Query: Send + Sync + std::fmt::Debug + 'static {
    /// Whether the first hit found, in any order, ends the traversal.
    const ANY: bool;

    /// How leaves are tested.
    const LEAF: LeafTest = LeafTest::Eight;

    /// Type of the result for a ray.
    type Answer: Copy + Send;

    /// Converts a hit or [`Hit::MISS`] to the result.
    fn answer(hit: Hit) -> Self::Answer;
}

/// The nearest hit.
#[derive(Debug)]
pub struct Closest;

/// Whether there is any hit.
#[derive(Debug)]
pub struct Any;

impl Query for Closest {
    const ANY: bool = false;
    type Answer = Hit;

    #[inline(always)]
    fn answer(hit: Hit) -> Hit {
        hit
    }
}

impl Query for Any {
    const ANY: bool = true;
    type Answer = bool;

    #[inline(always)]
    fn answer(hit: Hit) -> bool {
        hit.is_hit()
    }
}

/// The same query with triangles tested one at a time ([`LeafTest::Scalar`]).
#[derive(Debug)]
pub struct OneByOne<Q>(PhantomData<Q>);

impl<Q: Query> Query for OneByOne<Q> {
    const ANY: bool = Q::ANY;
    const LEAF: LeafTest = LeafTest::Scalar;
    type Answer = Q::Answer;

    #[inline(always)]
    fn answer(hit: Hit) -> Q::Answer {
        Q::answer(hit)
    }
}

/// The same query with triangles tested one at a time as published ([`LeafTest::Published`]).
#[derive(Debug)]
pub struct AsPublished<Q>(PhantomData<Q>);

impl<Q: Query> Query for AsPublished<Q> {
    const ANY: bool = Q::ANY;
    const LEAF: LeafTest = LeafTest::Published;
    type Answer = Q::Answer;

    #[inline(always)]
    fn answer(hit: Hit) -> Q::Answer {
        Q::answer(hit)
    }
}

/// A triangle that the ray certainly hits, and whose exact verdict is deferred.
#[derive(Clone, Copy)]
pub struct Deferred {
    /// Its number in the structure; [`Hit::NONE`] if no verdict is deferred.
    pub triangle: u32,
    /// Its vertices in the scene.
    pub corners: [[f32; 3]; 3],
    /// Lower bound on the distance, in the frame's units.
    pub low: f32,
}

impl Deferred {
    /// No triangle.
    const NOTHING: Self = Self {
        triangle: Hit::NONE,
        corners: [[0.0; 3]; 3],
        low: f32::INFINITY,
    };
}

/// The best hit of a traversal so far, and the distance up to which it must search.
pub struct Best {
    hit: Hit,
    /// A proven hit that may be better, with its verdict deferred.
    held: Deferred,
    /// Upper bound, in the frame's units, on the distance of any hit that could still be better.
    pub reach: f32,
}

impl Best {
    /// Makes the state at the start of a ray: no hit, or the one found before the traversal.
    #[inline(always)]
    pub fn new(ray: &FrameRay) -> Self {
        Self {
            hit: ray.known,
            held: Deferred::NOTHING,
            reach: ray.t_max,
        }
    }

    /// Makes a state without a hit, for traversals that keep `reach` elsewhere.
    #[inline(always)]
    pub fn blank() -> Self {
        Self {
            hit: Hit::MISS,
            held: Deferred::NOTHING,
            reach: f32::INFINITY,
        }
    }

    /// Makes the state after a final hit found elsewhere.
    #[inline(always)]
    pub fn known(hit: Hit) -> Self {
        Self {
            hit,
            held: Deferred::NOTHING,
            reach: f32::NEG_INFINITY,
        }
    }

    /// Applies the exact verdict to one candidate and returns whether the traversal may end.
    ///
    /// The vertices are those of the ray's space; if that is an instance's, the verdict transforms them into
    /// the scene. Distances are compared after rounding, so that ties are those the caller sees.
    #[inline(always)]
    pub fn offer<Q: Query, C: Counters>(
        &mut self,
        RayRef { ray, frame }: RayRef<'_>,
        id: u32,
        corners: impl FnOnce() -> [[f32; 3]; 3],
        counters: &mut C,
    ) -> bool {
        let id = frame.first + id;
        // A triangle in several leaves is a candidate in each.
        if id == self.hit.triangle {
            return false;
        }
        counters.verdict();
        // Transform the vertices of instances, then compute the exact hit.
        let best = HitKey::new(self.hit.t, self.hit.triangle);
        let span = [ray.t_min, keep_min(best.last_before(id), ray.t_max)];
        let corners = match frame.instance {
            None => corners(),
            Some(instance) => match instance.corners(corners()) {
                Some(corners) => corners,
                None => return false,
            },
        };
        let Some(found) = verdict_within(ray.o, ray.d, corners, span) else {
            return false;
        };
        let hit = Hit {
            t: found.t,
            triangle: id,
            u: found.u,
            v: found.v,
        };
        self.keep::<Q, C>(RayRef { ray, frame }, hit, counters)
    }

    /// Keeps a hit in the ray's interval if it is the best so far, and returns whether the traversal may end.
    #[inline(always)]
    pub fn keep<Q: Query, C: Counters>(
        &mut self,
        RayRef { ray, frame }: RayRef<'_>,
        hit: Hit,
        counters: &mut C,
    ) -> bool {
        if !ray.reaches(hit.t) {
            return false;
        }
        // Go on as if there were no hit where all hits are gathered, or where the ray does not see this one.
        if let Some(limit) = counters.set_aside(hit) {
            self.reach = keep_min(frame.reach(limit), self.reach);
            return false;
        }
        // Keep the hit if it is nearer, or as near with a smaller number.
        if HitKey::new(hit.t, hit.triangle).precedes(HitKey::new(self.hit.t, self.hit.triangle)) {
            self.hit = hit;
            self.reach = keep_min(frame.reach(hit.t), self.reach);
            counters.improved(self.hit);
        }
        Q::ANY
    }

    /// Defers the verdict on a triangle that the ray certainly hits between the distances `low` and `high`, in the
    /// frame's units. Returns whether the traversal may end, or `None` if the verdict cannot be deferred.
    ///
    /// If one of two such triangles is certainly nearer, however both distances are rounded, the other is
    /// dropped: for most rays only one triangle needs a verdict.
    #[inline(always)]
    pub fn defer<Q: Query>(
        &mut self,
        BoundedRay { ray, certain }: BoundedRay<'_>,
        id: u32,
        [low, high]: [f32; 2],
        corners: impl FnOnce() -> [[f32; 3]; 3],
    ) -> Option<bool> {
        let (RayRef { ray, frame }, [from, to]) = (ray, certain);
        // Prove the distance in range; NaN bounds make the comparison false.
        if !(low > from && high < to) {
            return None;
        }
        debug_assert_eq!(frame.first, 0, "not in an instance's space");
        if Q::ANY {
            // Store any distance: an any-hit query does not return it.
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
        // Return if the deferred triangle may be nearer; without one its lower bound is infinite.
        if far >= self.held.low {
            return None;
        }
        // Defer this triangle in place of the one before, which is certainly farther.
        self.held = Deferred {
            triangle: id,
            corners: corners(),
            low,
        };
        self.reach = keep_min(far, self.reach);
        Some(false)
    }

    /// Replaces the hit by a recorded one, if there is one; returns whether the traversal may end.
    #[inline(always)]
    pub fn take<Q: Query>(&mut self, frame: &FrameRay, hit: Option<Hit>) -> bool {
        let Some(hit) = hit else {
            return false;
        };
        self.hit = hit;
        self.reach = frame.reach(hit.t);
        Q::ANY
    }

    /// Returns the best hit of a traversal without deferred verdicts.
    #[inline(always)]
    pub fn hit(&self) -> Hit {
        debug_assert_eq!(self.held.triangle, Hit::NONE, "a verdict is deferred");
        self.hit
    }

    /// Returns whether a hit was found, with its verdict deferred or not, and certainly no farther than `leave` in the
    /// frame's units.
    #[inline(always)]
    pub fn is_found_before(&self, leave: f32) -> bool {
        (self.hit.is_hit() || self.held.triangle != Hit::NONE) && self.reach <= leave
    }

    /// Returns the triangle whose verdict is deferred, unless there is a decided hit.
    #[inline(always)]
    pub fn held(&self) -> Option<&Deferred> {
        (self.held.triangle != Hit::NONE && !self.hit.is_hit()).then_some(&self.held)
    }

    /// Decides the deferred verdict and returns the best hit, at the end of a traversal.
    #[inline(always)]
    pub fn answer(&mut self, ray: RayRef<'_>) -> Hit {
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
