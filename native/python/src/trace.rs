// SPDX-License-Identifier: GPL-3.0-or-later
//! Traces rays with the GIL released.

use crate::args::integers::Threads;
use crate::args::rays::RayArrays;
use crate::errors::raise;
use crate::hits::{Hits, counters};
use crate::monitor::{self, Monitor};
use crate::watched::Watched;
use halfspace_base::Monitor as BaseMonitor;
use halfspace_ray::Tracer;
use halfspace_structure::Structure;
use halfspace_structure::instances::Instances;
use halfspace_structure::threads;
use numpy::IntoPyArray;
use pyo3::prelude::*;

/// A tracer that can be cancelled while it counts.
pub trait Cancellable: Tracer {
    /// The same tracer, whose kernels read a monitor while they count.
    fn watched<'a>(&'a self, monitor: Option<&'a BaseMonitor>) -> Box<dyn Tracer + 'a>;
}

impl Cancellable for Structure {
    fn watched<'a>(&'a self, monitor: Option<&'a BaseMonitor>) -> Box<dyn Tracer + 'a> {
        Box::new(Self::watched(self, monitor))
    }
}

impl Cancellable for Instances {
    fn watched<'a>(&'a self, monitor: Option<&'a BaseMonitor>) -> Box<dyn Tracer + 'a> {
        Box::new(Self::watched(self, monitor))
    }
}

/// A tracer, and the names of the counters that are particular to its traversal.
#[derive(Clone, Copy)]
pub struct CountedTracer<'a> {
    /// Traces the rays.
    pub tracer: &'a dyn Cancellable,
    /// Names of the counters.
    pub cases: &'static [&'static str],
}

/// Traces nearest hits with the GIL released; with `counters`, counts the work of each ray.
pub fn closest(
    py: Python<'_>,
    CountedTracer { tracer, cases }: CountedTracer<'_>,
    rays: &RayArrays<'_>,
    threads: Threads,
    counters: bool,
    monitor: Option<&Monitor>,
) -> PyResult<Hits> {
    let monitor = monitor::of(monitor);
    let rays = rays.rays().watched(monitor);
    let (hits, counts) = py
        .detach(|| {
            if counters {
                return threads::closest(&*tracer.watched(monitor), rays, threads.0, true);
            }
            threads::closest(&Watched::new(tracer, monitor), rays, threads.0, false)
        })
        .map_err(raise)?;
    Ok(Hits {
        hits,
        counts: counts.map(|counts| (cases, counts)),
        on_boundary: None,
    })
}

/// Traces any-hit rays with the GIL released: returns an array of bool, with `counting` a pair of it and the counters.
pub fn occluded<'py>(
    py: Python<'py>,
    CountedTracer { tracer, cases }: CountedTracer<'_>,
    rays: &RayArrays<'_>,
    threads: Threads,
    counting: bool,
    monitor: Option<&Monitor>,
) -> PyResult<Bound<'py, PyAny>> {
    let monitor = monitor::of(monitor);
    let rays = rays.rays().watched(monitor);
    let (occluded, counts) = py
        .detach(|| {
            if counting {
                return threads::occluded(&*tracer.watched(monitor), rays, threads.0, true);
            }
            threads::occluded(&Watched::new(tracer, monitor), rays, threads.0, false)
        })
        .map_err(raise)?;
    let occluded = occluded.into_pyarray(py).into_any();
    match counts {
        None => Ok(occluded),
        Some(counts) => Ok((occluded, counters(py, cases, &counts)?)
            .into_pyobject(py)?
            .into_any()),
    }
}
