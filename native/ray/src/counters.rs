// SPDX-License-Identifier: GPL-3.0-or-later
//! Counters, a compile-time parameter of every traversal: one without counters contains no counting code.

use crate::cases::CASES;
use crate::path::PathLeaf;
use crate::ray::{Hit, RayCounters};
use crate::replay::Record;
use crate::selection::{Gathered, Sieve, Visible};

/// Observer of a traversal's events. By default each event is ignored.
pub trait Counters {
    /// Whether counts of tests and verdicts may differ from those of the plain algorithm: an any-hit ray then
    /// needs no verdict on a hit that f32 has proven.
    const QUICK: bool = false;
    /// Whether, in addition, the verdict on a hit that f32 has proven may be deferred to the end of the
    /// traversal, when no other hit can be nearer. The traversal then ends with [`Best::answer`].
    const LATE: bool = false;
    /// Whether events are counted; kernels of groups then count visits for each ray.
    const COUNTS: bool = false;

    /// An inner node with an axis-aligned split plane was visited.
    #[inline(always)]
    fn step_axis(&mut self) {}
    /// An inner node with an oblique split plane or with oriented boxes was visited.
    #[inline(always)]
    fn step_oblique(&mut self) {}
    /// An inner node with boxes, intervals or octants was visited, or a ray stepped to another cell of a grid.
    #[inline(always)]
    fn step_boxes(&mut self) {}
    /// The ray's group visited a node or a leaf, which is counted for another ray.
    #[inline(always)]
    fn joined(&mut self) {}
    /// A leaf with this many triangles was visited.
    #[inline(always)]
    fn leaf(&mut self, triangles: usize) {
        let _ = triangles;
    }
    /// This many triangles of the leaf last reported by [`Self::visit`] were tested in f32.
    #[inline(always)]
    fn tests(&mut self, triangles: usize) {
        let _ = triangles;
    }
    /// A triangle was tested without a visit of a leaf: a remembered blocker, a candidate of a shadow beam, or a
    /// triangle of an instance that no tree contains.
    #[inline(always)]
    fn test_alone(&mut self) {}
    /// The exact verdict was computed for a candidate.
    #[inline(always)]
    fn verdict(&mut self) {}
    /// A case of ray and plane occurred. The closure returns its index in [`RayCounters::cases`]; it is called only if
    /// cases are counted.
    #[inline(always)]
    fn case(&mut self, _: impl FnOnce() -> usize) {}

    /// Whether the ray has a mailbox: it then tests a triangle once, for all leaves that hold it.
    const MAILBOX: bool = false;
    /// Returns whether the mailbox holds a triangle; puts it there if not.
    #[inline(always)]
    fn is_known(&mut self, triangle: u32) -> bool {
        let _ = triangle;
        false
    }

    /// Whether leaves return recorded hits instead of testing their triangles.
    const REPLAY: bool = false;
    /// The triangles of a leaf, possibly empty, are about to be tested; its first block lies at word offset `first`.
    /// Kernels of groups report it for each of their rays.
    #[inline(always)]
    fn visit(&mut self, first: u32, triangles: usize) {
        let _ = (first, triangles);
    }
    /// A better hit was found.
    #[inline(always)]
    fn improved(&mut self, _: Hit) {}
    /// Decides whether a proven hit is set aside: `None` if it may become the answer, or the distance up to which the
    /// traversal goes on without it, in units of the direction.
    #[inline(always)]
    fn set_aside(&mut self, _: Hit) -> Option<f32> {
        None
    }
    /// Returns the recorded hit of the next leaf.
    #[inline(always)]
    fn replay(&mut self) -> Option<Hit> {
        None
    }

    /// The ray was decided without a traversal of its own.
    #[inline(always)]
    fn spared(&mut self) {}
}

/// Counts nothing.
#[derive(Clone, Copy, Default)]
pub struct NoCount;

impl Counters for NoCount {
    const QUICK: bool = true;
}

/// [`NoCount`] for traversals with deferred verdicts.
#[derive(Default)]
pub struct NoCountLate;

impl Counters for NoCountLate {
    const QUICK: bool = true;
    const LATE: bool = true;
}

/// Tasks of a traversal in addition to counting: it records its events, gathers all hits, or ignores hidden triangles.
/// A value and not a type parameter, so that all of these share one compiled traversal.
pub enum Log<'a> {
    /// Nothing.
    Nothing,
    /// The best hit of each leaf, for replays.
    Answers(&'a mut Record),
    /// The leaves with triangles.
    Leaves(&'a mut Vec<PathLeaf>),
    /// All hits; the traversal itself finds none.
    Hits(&'a mut Gathered),
    /// Nothing, but only triangles that the ray can see are hit.
    Visible(Visible<'a>),
    /// Nothing, but a filter decides on each hit.
    Filtered(Sieve<'a>),
}

impl Log<'_> {
    /// Borrows the same for a part of the traversal.
    pub fn reborrow(&mut self) -> Log<'_> {
        match self {
            Self::Nothing => Log::Nothing,
            Self::Answers(record) => Log::Answers(record),
            Self::Leaves(leaves) => Log::Leaves(leaves),
            Self::Hits(gathered) => Log::Hits(gathered),
            Self::Visible(visible) => Log::Visible(*visible),
            Self::Filtered(sieve) => Log::Filtered(*sieve),
        }
    }
}

/// Adds to the counters of one ray, and records.
pub struct Count<'a> {
    counters: &'a mut RayCounters,
    log: Log<'a>,
    /// Number of tests in the visit of the current leaf; `None` once one of them has improved the answer.
    wasted: Option<u32>,
}

impl<'a> Count<'a> {
    /// Makes a counter that records nothing else.
    pub fn new(counters: &'a mut RayCounters) -> Self {
        Self::with(counters, Log::Nothing)
    }

    /// Makes a counter that also records to `log`.
    pub fn with(counters: &'a mut RayCounters, log: Log<'a>) -> Self {
        Self {
            counters,
            log,
            wasted: Some(0),
        }
    }
}

/// Counts a visit as [`Counters::joined`] for all rays of a group but the first, whose step or leaf is counted
/// elsewhere. Bit `i` of the mask `rays` stands for `counters[i]`.
#[inline(always)]
pub fn join<C: Counters>(counters: &mut [C], rays: u64) {
    if C::COUNTS {
        let mut others = rays & rays.wrapping_sub(1);
        while others != 0 {
            counters[others.trailing_zeros() as usize].joined();
            others &= others - 1;
        }
    }
}

impl Counters for Count<'_> {
    const COUNTS: bool = true;

    #[inline(always)]
    fn step_axis(&mut self) {
        self.counters.steps_axis += 1;
    }
    #[inline(always)]
    fn step_oblique(&mut self) {
        self.counters.steps_oblique += 1;
    }
    #[inline(always)]
    fn step_boxes(&mut self) {
        self.counters.steps_boxes += 1;
    }
    #[inline(always)]
    fn joined(&mut self) {
        self.counters.joined += 1;
    }
    #[inline(always)]
    fn leaf(&mut self, triangles: usize) {
        if triangles == 0 {
            self.counters.leaves_empty += 1;
        } else {
            self.counters.leaves += 1;
        }
    }
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a leaf holds fewer than 2^29 triangles"
    )]
    fn tests(&mut self, triangles: usize) {
        let triangles = triangles as u32;
        self.counters.tests += triangles;
        if let Some(wasted) = &mut self.wasted {
            *wasted += triangles;
            self.counters.tests_wasted += triangles;
        }
    }
    #[inline(always)]
    fn test_alone(&mut self) {
        self.wasted = Some(0);
        self.tests(1);
    }
    #[inline(always)]
    fn verdict(&mut self) {
        self.counters.verdicts += 1;
    }
    #[inline(always)]
    fn case(&mut self, case: impl FnOnce() -> usize) {
        self.counters.cases[case() % CASES] += 1;
    }
    #[inline(always)]
    fn visit(&mut self, first: u32, triangles: usize) {
        self.wasted = Some(0);
        match &mut self.log {
            Log::Answers(record) => record.visit(),
            // Omit empty leaves: they have the same first block as the leaf after them.
            Log::Leaves(leaves) if triangles > 0 => leaves.push(PathLeaf {
                first,
                steps: self.counters.steps(),
            }),
            _ => {}
        }
    }
    #[inline(always)]
    fn improved(&mut self, hit: Hit) {
        if let Some(wasted) = self.wasted.take() {
            self.counters.tests_wasted -= wasted;
        }
        if let Log::Answers(record) = &mut self.log {
            record.improved(hit);
        }
    }
    #[inline(always)]
    fn set_aside(&mut self, hit: Hit) -> Option<f32> {
        match &mut self.log {
            Log::Hits(gathered) => {
                let limit = gathered.add(hit);
                self.improved(hit);
                Some(limit)
            }
            Log::Visible(visible) if !visible.sees(hit.triangle) => Some(f32::INFINITY),
            Log::Filtered(sieve) => sieve.beyond(&hit),
            _ => None,
        }
    }
    #[inline(always)]
    fn spared(&mut self) {
        self.counters.spared += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hit(t: f32) -> Hit {
        Hit { t, ..Hit::MISS }
    }

    #[test]
    fn tests_on_visits_without_a_better_hit_are_wasted() {
        let mut counters = RayCounters::default();
        let mut count = Count::new(&mut counters);
        // A leaf of two blocks, of which the first improves the answer, one without a hit, one with two hits.
        count.visit(0, 11);
        count.tests(8);
        count.improved(hit(3.0));
        count.tests(3);
        count.visit(100, 5);
        count.tests(5);
        count.visit(200, 4);
        count.tests(4);
        count.improved(hit(2.0));
        count.improved(hit(1.0));
        // A remembered blocker that does not block.
        count.test_alone();
        assert_eq!((counters.tests, counters.tests_wasted), (21, 6));
    }

    #[test]
    fn a_visit_of_a_group_counts_once_and_every_ray_has_visited() {
        let mut counters = [RayCounters::default(); 4];
        let mut counts: Vec<_> = counters.iter_mut().map(Count::new).collect();
        counts[1].step_axis();
        join(&mut counts, 0b1110);
        counts[2].leaf(3);
        join(&mut counts, 0b0100);
        assert_eq!(counters.map(|c| c.visits()), [0, 1, 2, 1]);
        let mut sum = RayCounters::default();
        counters.iter().for_each(|c| sum.add(c));
        assert_eq!((sum.steps(), sum.leaves, sum.joined), (1, 1, 2));
    }
}
