// SPDX-License-Identifier: GPL-3.0-or-later
//! Rays traced for Python: nearest hits, in whichever order of rays is quickest, and any hits.

use super::hits::{Hits, counters};
use super::rays::{Finite, RayArrays, Rays};
use super::share::{CHUNK, in_chunks, share_out, wanted};
use super::whole::Threads;
use crate::error::Result;
use crate::geom::Aabb;
use crate::memory::check_room;
use crate::traverse::{Hit, Order, Tracer, reorder};
use numpy::ToPyArray;
use pyo3::prelude::*;

/// Nearest hits. `cases`: what the walks told apart.
pub fn closest(
    py: Python<'_>,
    (tracer, cases): (&dyn Tracer, &'static [&'static str]),
    rays: &RayArrays<'_>,
    threads: Threads,
    counters: bool,
) -> PyResult<Hits> {
    let rays = rays.rays();
    Ok(py.detach(|| nearest((tracer, cases), rays, threads.0, counters))?)
}

/// Any hits, or with `counting` a pair of them and what each ray cost. `cases` as for [`closest`].
pub fn occluded<'py>(
    py: Python<'py>,
    (tracer, cases): (&dyn Tracer, &[&str]),
    rays: &RayArrays<'_>,
    threads: Threads,
    counting: bool,
) -> PyResult<Bound<'py, PyAny>> {
    let rays = rays.rays();
    let (occluded, counts) = py.detach(|| {
        in_chunks(rays, threads.0, counting, false, |rays, answers, counts| {
            tracer.occluded(rays, answers, counts);
        })
    })?;
    let occluded = occluded.to_pyarray(py).into_any();
    match counts {
        None => Ok(occluded),
        Some(counts) => Ok((occluded, counters(py, cases, &counts)?)
            .into_pyobject(py)?
            .into_any()),
    }
}

fn nearest(
    (tracer, cases): (&dyn Tracer, &'static [&'static str]),
    rays: Rays<'_>,
    threads: usize,
    counters: bool,
) -> Result<Hits> {
    let order = rays.order;
    if !counters
        && order == Order::None
        && let Some(bounds) = tracer.near_rays()
        && reorder::scattered(rays.origins, &bounds)
    {
        return Ok(Hits {
            hits: nearest_reordered(tracer, rays, threads, &bounds)?,
            counts: None,
            on_boundary: None,
        });
    }
    let (hits, counts) = in_chunks(rays, threads, counters, Hit::MISS, |rays, hits, counts| {
        tracer.closest_ordered(rays, hits, counts, order);
    })?;
    Ok(Hits {
        hits,
        counts: counts.map(|counts| (cases, counts)),
        on_boundary: None,
    })
}

/// Nearest hits of rays in random order, which are walked in another: each thread puts its own share in order.
fn nearest_reordered(
    tracer: &dyn Tracer,
    rays: Rays<'_>,
    threads: usize,
    bounds: &Aabb,
) -> Result<Vec<Hit>> {
    let n = rays.origins.len();
    let window = reorder::window(n, wanted(threads));
    let in_order = n.min(window * wanted(threads)) * reorder::BYTES;
    check_room("origins", (n * size_of::<Hit>() + in_order) as u64)?;
    let mut hits = vec![Hit::MISS; n];
    let windows = hits.chunks_mut(window).enumerate().collect();
    let finite = Finite::default();
    share_out(
        windows,
        threads,
        |buffer, (i, hits): (usize, &mut [Hit])| {
            let own = rays.part(i * window..i * window + hits.len());
            if !finite.allows(&own, 0..hits.len()) {
                return;
            }
            let places = reorder::order(own.origins, own.directions, bounds);
            let mut found = vec![Hit::MISS; CHUNK];
            for places in places.chunks(CHUNK) {
                let (buffer, found) = (&mut buffer[..places.len()], &mut found[..places.len()]);
                own.put_those(places, buffer);
                tracer.closest(buffer, found, None);
                for (&place, hit) in places.iter().zip(found) {
                    hits[place as usize] = *hit;
                }
            }
        },
    )?;
    finite.end(&rays)?;
    Ok(hits)
}
