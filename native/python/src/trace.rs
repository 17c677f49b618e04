// SPDX-License-Identifier: GPL-3.0-or-later
//! Rays traced for Python, with the interpreter released.

use crate::errors::raise;
use crate::hits::{Hits, counters};
use crate::rays::RayArrays;
use crate::whole::Threads;
use halfspace_ray::Tracer;
use halfspace_trace::threads;
use numpy::ToPyArray;
use pyo3::prelude::*;

/// Nearest hits. `cases`: the names of the counters that only this structure has.
pub fn closest(
    py: Python<'_>,
    (tracer, cases): (&dyn Tracer, &'static [&'static str]),
    rays: &RayArrays<'_>,
    threads: Threads,
    counters: bool,
) -> PyResult<Hits> {
    let rays = rays.rays();
    let (hits, counts) = py
        .detach(|| threads::closest(tracer, rays, threads.0, counters))
        .map_err(raise)?;
    Ok(Hits {
        hits,
        counts: counts.map(|counts| (cases, counts)),
        on_boundary: None,
    })
}

/// Any hits; with `counting`, a pair of them and the cost of each ray. `cases` as for [`closest`].
pub fn occluded<'py>(
    py: Python<'py>,
    (tracer, cases): (&dyn Tracer, &[&str]),
    rays: &RayArrays<'_>,
    threads: Threads,
    counting: bool,
) -> PyResult<Bound<'py, PyAny>> {
    let rays = rays.rays();
    let (occluded, counts) = py
        .detach(|| threads::occluded(tracer, rays, threads.0, counting))
        .map_err(raise)?;
    let occluded = occluded.to_pyarray(py).into_any();
    match counts {
        None => Ok(occluded),
        Some(counts) => Ok((occluded, counters(py, cases, &counts)?)
            .into_pyobject(py)?
            .into_any()),
    }
}
