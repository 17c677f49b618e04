// SPDX-License-Identifier: GPL-3.0-or-later
//! Mailboxes: a triangle in several leaves is tested once per ray (Amanatides and Woo 1987; Arnaldi, Priol and Bouatouch
//! 1987). As published each triangle keeps the number of the last ray; here each ray keeps the numbers of its last
//! triangles, at the places of their lowest bits, so that threads share nothing (Benthin 2006).
//!
//! A triangle whose place another has taken is tested again, with the same result: answers do not depend on the mailbox.

use crate::ta_b::TaBTraversal;
use crate::ta_b_1997::PublishedTaB;
use fearless_simd::Simd;
use halfspace_leaf::Job;
use halfspace_nodes::axis_tree::SharedAxisTree;
use halfspace_nodes::plane_tree::PlaneTree;
use halfspace_ray::cases::{self, BEHIND};
use halfspace_ray::query::{Best, Counters, NoCount, Query};
use halfspace_ray::{Hit, RayRef};
use halfspace_single::planes::dir::PlaneTraversal;
use halfspace_single::{Published, Scalar, single_rays};
use halfspace_trace::batch::SingleTraversal;

/// Number of triangles in a mailbox, a power of two (chosen: 256 bytes per ray).
const ROOM: usize = 64;

/// Name of the counter of tests that mailboxes saved.
const SAVED: &str = "tests_saved";

/// Names of the counters of [`dir()`].
pub const NAMES: [&str; 1] = [SAVED];

/// Names of the counters of [`ta_b()`]: the cases, and behind them the tests saved.
pub const TA_B_NAMES: [&str; BEHIND + 1] = {
    let mut names = [SAVED; BEHIND + 1];
    let mut i = 0;
    while i < BEHIND {
        names[i] = cases::NAMES[i];
        i += 1;
    }
    names
};

/// A traversal whose rays have mailboxes, and count the tests that these save in the counter with index `SAVED`.
pub struct Mailboxed<T, const SAVED: usize>(T);

impl<T: SingleTraversal, const SAVED: usize> SingleTraversal for Mailboxed<T, SAVED> {
    type Scratch = T::Scratch;
    type Uncounted = NoCount;

    fn scratch(&self) -> Self::Scratch {
        self.0.scratch()
    }

    #[inline(always)]
    fn cast<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        job: Job<'_>,
        ray: RayRef<'_>,
        scratch: &mut Self::Scratch,
        counters: &mut C,
    ) -> Best {
        let mut counters = Mailbox::<_, SAVED> {
            counters,
            triangles: [Hit::NONE; ROOM],
        };
        (self.0).cast::<S, Q, _>(simd, job, ray, scratch, &mut counters)
    }
}

/// The counters of a ray, and its mailbox.
struct Mailbox<'a, C, const SAVED: usize> {
    counters: &'a mut C,
    triangles: [u32; ROOM],
}

impl<C: Counters, const SAVED: usize> Counters for Mailbox<'_, C, SAVED> {
    const QUICK: bool = C::QUICK;
    const LATE: bool = C::LATE;
    const COUNTS: bool = C::COUNTS;
    const REPLAY: bool = C::REPLAY;
    const MAILBOX: bool = true;

    #[inline(always)]
    fn is_known(&mut self, triangle: u32) -> bool {
        let held = &mut self.triangles[triangle as usize % ROOM];
        let known = *held == triangle;
        *held = triangle;
        if known {
            self.counters.case(|| SAVED);
        }
        known
    }

    #[inline(always)]
    fn step_axis(&mut self) {
        self.counters.step_axis();
    }
    #[inline(always)]
    fn step_oblique(&mut self) {
        self.counters.step_oblique();
    }
    #[inline(always)]
    fn step_boxes(&mut self) {
        self.counters.step_boxes();
    }
    #[inline(always)]
    fn joined(&mut self) {
        self.counters.joined();
    }
    #[inline(always)]
    fn leaf(&mut self, triangles: usize) {
        self.counters.leaf(triangles);
    }
    #[inline(always)]
    fn tests(&mut self, triangles: usize) {
        self.counters.tests(triangles);
    }
    #[inline(always)]
    fn test_alone(&mut self) {
        self.counters.test_alone();
    }
    #[inline(always)]
    fn verdict(&mut self) {
        self.counters.verdict();
    }
    #[inline(always)]
    fn case(&mut self, case: impl FnOnce() -> usize) {
        self.counters.case(case);
    }
    #[inline(always)]
    fn visit(&mut self, first: u32, triangles: usize) {
        self.counters.visit(first, triangles);
    }
    #[inline(always)]
    fn improved(&mut self, hit: Hit) {
        self.counters.improved(hit);
    }
    #[inline(always)]
    fn set_aside(&mut self, hit: Hit) -> Option<f32> {
        self.counters.set_aside(hit)
    }
    #[inline(always)]
    fn replay(&mut self) -> Option<Hit> {
        self.counters.replay()
    }
    #[inline(always)]
    fn spared(&mut self) {
        self.counters.spared();
    }
}

single_rays! {
    /// Single rays by plane distances in the order of the direction.
    fn dir(PlaneTree) -> Mailboxed<PlaneTraversal<&'a PlaneTree>, 0>, with Scalar {
        |kernel| Mailboxed(PlaneTraversal(&*kernel.tree))
    }
}

single_rays! {
    /// Single rays by plane distances, as published.
    fn published_dir(PlaneTree) -> Mailboxed<PlaneTraversal<&'a PlaneTree>, 0>, with Published {
        |kernel| Mailboxed(PlaneTraversal(&*kernel.tree))
    }
}

single_rays! {
    /// Single rays by TA-B.
    fn ta_b(SharedAxisTree) -> Mailboxed<TaBTraversal<'a>, BEHIND>, with Scalar {
        |kernel| Mailboxed(TaBTraversal(kernel.tree.borrowed()))
    }
}

single_rays! {
    /// Single rays by TA-B, as published.
    fn published_ta_b(SharedAxisTree) -> Mailboxed<PublishedTaB<'a>, BEHIND>, with Published {
        |kernel| Mailboxed(PublishedTaB(kernel.tree.borrowed()))
    }
}
