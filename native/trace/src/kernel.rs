// SPDX-License-Identifier: GPL-3.0-or-later
//! Kernels: each is one compiled way to answer a batch of rays over one tree. One virtual call answers a batch; no call
//! inside it is virtual.

use crate::batch::{Batch, Write};
use halfspace_base::error::Result;
use halfspace_ray::beam_path::BeamPath;
use halfspace_ray::path::Path;
use halfspace_ray::query::{Any, Closest, Count, Log, Query};
use halfspace_ray::replay::{Record, Recording};
use halfspace_ray::selection::{HitFilter, Sieve};
use halfspace_ray::{Hit, RayCounters};
use std::fmt::Debug;

/// Answers batches of rays: [`Closest`] for the nearest hits, [`Any`] for any hits.
pub trait Kernel<Q: Query>: Debug + Send + Sync {
    /// Answers each ray of the batch; `answers` has one entry per ray.
    fn trace(&self, batch: &Batch<'_>, answers: &mut [Q::Answer]);

    /// Does the same and adds to each ray's counters what this kernel spent on it. Returns `false`, and does nothing,
    /// where no counting version of the kernel is compiled; the batch is then counted by single rays.
    fn count(
        &self,
        batch: &Batch<'_>,
        answers: &mut [Q::Answer],
        counters: &mut [RayCounters],
    ) -> bool {
        let _ = (batch, answers, counters);
        false
    }

    /// Finds the hits that answer the rays, as [`Self::count`] does, and records the way of each beam of polygons; `None`
    /// from kernels without such beams. `hits` begin as [`Hit::MISS`].
    fn record_beams(
        &self,
        batch: &Batch<'_>,
        hits: &mut [Hit],
        counters: &mut [RayCounters],
    ) -> Option<BeamPath> {
        let _ = (batch, hits, counters);
        None
    }

    /// Whether [`Self::count`] counts what this kernel does.
    fn counts(&self) -> bool {
        false
    }

    /// The largest number of rays that are worth tracing at once; `None` if batches beyond the usual size gain nothing.
    fn batch(&self) -> Option<usize> {
        None
    }

    /// Bytes that rays in random order read from, if the kernel gains from near rays following one another; `None` if
    /// it does not.
    fn working_set(&self) -> Option<usize> {
        None
    }
}

/// A traversal that sends rays one by one. It also counts, shows and records what it does.
pub trait SingleRays: Kernel<Closest> + Kernel<Any> {
    /// Finds the nearest hits, or any hits, of rays that may have been transformed into the space of an instance
    /// ([`Batch::placed`]), and passes each to `write` with the index of its ray.
    fn cast(
        &self,
        batch: &Batch<'_>,
        any: bool,
        write: Write<'_>,
        counters: Option<&mut [RayCounters]>,
    );

    /// Finds the nearest hits, or any hits, and passes each to `write`; `count` returns the counters of each ray, which
    /// may also gather all hits or hide triangles ([`halfspace_ray::counters::Log`]). It is called once per ray, in
    /// their order.
    fn observe<'c>(
        &self,
        batch: &Batch<'_>,
        any: bool,
        write: Write<'_>,
        count: &mut dyn FnMut(usize) -> Count<'c>,
    );

    /// Finds the nearest of the hits that a filter keeps, and passes it to `write`; what a ray that it ends has found means
    /// nothing.
    fn sift(&self, batch: &Batch<'_>, write: Write<'_>, filter: HitFilter<'_>) {
        filtered(self, batch, write, filter);
    }

    /// The nearest hit of the only ray of the batch, or its hit as an any-hit ray, and the leaves on its path.
    ///
    /// # Panics
    /// When the batch does not hold exactly one ray.
    fn path(&self, batch: &Batch<'_>, any: bool) -> (Hit, Path);

    /// Traces the rays one by one and records the answer of each leaf, for [`Self::replay`].
    ///
    /// # Errors
    /// [`halfspace_base::error::Error::Spec`] for brute force, which has no leaves to record.
    fn record(
        &self,
        batch: &Batch<'_>,
        any: bool,
        counters: &mut [RayCounters],
        record: &mut Record,
    ) -> Result<()>;

    /// Traces recorded rays once more through the same nodes, with the recorded answers in place of triangle tests.
    /// Returns the seconds that each chunk of rays took, and the number of rays that did not visit the recorded leaves,
    /// which is 0 unless there is a bug.
    fn replay(&self, batch: &Batch<'_>, recording: &Recording) -> (Vec<f64>, usize);
}

/// [`SingleRays::sift`] by the compiled traversal that counts.
pub fn filtered<K: SingleRays + ?Sized>(
    kernel: &K,
    batch: &Batch<'_>,
    write: Write<'_>,
    filter: HitFilter<'_>,
) {
    let mut unused = vec![RayCounters::default(); batch.rays.len()];
    let mut unused = unused.iter_mut();
    kernel.observe(batch, false, write, &mut |ray| {
        let log = Log::Filtered(Sieve { filter, ray });
        Count::with(unused.next().expect("one set of counters per ray"), log)
    });
}

/// Stores the answer of ray `i` in `answers[i]`.
pub fn store<Q: Query>(answers: &mut [Q::Answer]) -> impl FnMut(usize, Hit) + '_ {
    |i, hit| answers[i] = Q::answer(hit)
}
