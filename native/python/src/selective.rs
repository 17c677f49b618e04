// SPDX-License-Identifier: GPL-3.0-or-later
//! All hits, and hits with visible triangles only, with the GIL released.

use crate::args::arrays::describe;
use crate::args::integers::{MaxHits, Threads};
use crate::args::rays::RayArrays;
use crate::errors::raise;
use crate::hits::Hits;
use crate::monitor::{self, Monitor};
use crate::watched::Watched;
use halfspace_base::error::{Error, Result};
use halfspace_ray::SelectiveTracer;
use halfspace_ray::query::{Any, Closest};
use halfspace_structure::selective::{self, Masks, RayMasks};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;

/// The masks of a call: those of the triangles, and of the rays.
pub struct MaskArrays<'py> {
    triangles: PyReadonlyArray1<'py, u32>,
    rays: RayMaskArray<'py>,
}

/// One mask for all rays, or one per ray.
enum RayMaskArray<'py> {
    Same(u32),
    Each(PyReadonlyArray1<'py, u32>),
}

impl<'py> MaskArrays<'py> {
    /// Reads the arguments `triangle_mask` and `ray_mask`; `None` where neither is given.
    pub fn new(
        triangles: Option<&Bound<'py, PyAny>>,
        rays: Option<&Bound<'py, PyAny>>,
        counters: bool,
    ) -> Result<Option<Self>> {
        let Some(triangles) = triangles else {
            let unused = Error::Spec("ray_mask: needs triangle_mask".to_owned());
            return rays.map_or(Ok(None), |_| Err(unused));
        };
        if counters {
            let message = "counters: not with triangle_mask, whose rays go one by one";
            return Err(Error::Spec(message.to_owned()));
        }
        let rays = match rays {
            None => RayMaskArray::Same(u32::MAX),
            Some(value) => match value.extract::<u32>() {
                Ok(mask) => RayMaskArray::Same(mask),
                Err(_) => RayMaskArray::Each(masks("ray_mask", "one number or an (n,)", value)?),
            },
        };
        Ok(Some(Self {
            triangles: masks("triangle_mask", "an (m,)", triangles)?,
            rays,
        }))
    }

    /// The masks, independent of Python. Raises ShapeError for arrays with gaps.
    fn masks(&self) -> Result<Masks<'_>> {
        Ok(Masks {
            triangles: contiguous("triangle_mask", &self.triangles)?,
            rays: match &self.rays {
                RayMaskArray::Same(mask) => RayMasks::Same(*mask),
                RayMaskArray::Each(masks) => RayMasks::Each(contiguous("ray_mask", masks)?),
            },
        })
    }
}

/// Reads an array of masks.
fn masks<'py>(
    name: &str,
    expected: &str,
    value: &Bound<'py, PyAny>,
) -> Result<PyReadonlyArray1<'py, u32>> {
    value.extract().map_err(|_| {
        Error::Shape(format!(
            "{name}: expected {expected} uint32 array, got {}",
            describe(value)
        ))
    })
}

/// The elements of an array without gaps.
fn contiguous<'a>(name: &str, array: &'a PyReadonlyArray1<'_, u32>) -> Result<&'a [u32]> {
    array
        .as_slice()
        .map_err(|_| Error::Shape(format!("{name}: expected a contiguous array")))
}

/// Every hit of each ray: the offsets of the rays in the list of hits, and the list.
pub fn all_hits<'py>(
    py: Python<'py>,
    tracer: &dyn SelectiveTracer,
    rays: &RayArrays<'_>,
    threads: Threads,
    most: Option<MaxHits>,
    monitor: Option<&Monitor>,
) -> PyResult<(Bound<'py, PyArray1<i64>>, Hits)> {
    let monitor = monitor::of(monitor);
    let watched = Watched::new(tracer, monitor);
    let rays = rays.rays().watched(monitor);
    let most = most.map_or(usize::MAX, |most| most.0);
    let found = py
        .detach(|| selective::all_hits(&watched, rays, threads.0, most))
        .map_err(raise)?;
    let offsets: Vec<_> = found.offsets.iter().map(|&offset| offset as i64).collect();
    let hits = Hits {
        hits: found.hits,
        counts: None,
        on_boundary: None,
    };
    Ok((offsets.into_pyarray(py), hits))
}

/// The number of hits of each ray.
pub fn count_hits<'py>(
    py: Python<'py>,
    tracer: &dyn SelectiveTracer,
    rays: &RayArrays<'_>,
    threads: Threads,
    monitor: Option<&Monitor>,
) -> PyResult<Bound<'py, PyArray1<i64>>> {
    let monitor = monitor::of(monitor);
    let watched = Watched::new(tracer, monitor);
    let rays = rays.rays().watched(monitor);
    let counts = py
        .detach(|| selective::count_hits(&watched, rays, threads.0))
        .map_err(raise)?;
    let counts: Vec<_> = counts.into_iter().map(i64::from).collect();
    Ok(counts.into_pyarray(py))
}

/// The nearest visible hits.
pub fn closest(
    py: Python<'_>,
    tracer: &dyn SelectiveTracer,
    rays: &RayArrays<'_>,
    threads: Threads,
    masks: &MaskArrays<'_>,
    monitor: Option<&Monitor>,
) -> PyResult<Hits> {
    let monitor = monitor::of(monitor);
    let watched = Watched::new(tracer, monitor);
    let (rays, masks) = (rays.rays().watched(monitor), masks.masks().map_err(raise)?);
    let hits = py
        .detach(|| selective::visible::<Closest>(&watched, rays, threads.0, masks))
        .map_err(raise)?;
    Ok(Hits {
        hits,
        counts: None,
        on_boundary: None,
    })
}

/// Whether each ray hits a visible triangle.
pub fn occluded<'py>(
    py: Python<'py>,
    tracer: &dyn SelectiveTracer,
    rays: &RayArrays<'_>,
    threads: Threads,
    masks: &MaskArrays<'_>,
    monitor: Option<&Monitor>,
) -> PyResult<Bound<'py, PyAny>> {
    let monitor = monitor::of(monitor);
    let watched = Watched::new(tracer, monitor);
    let (rays, masks) = (rays.rays().watched(monitor), masks.masks().map_err(raise)?);
    let occluded = py
        .detach(|| selective::visible::<Any>(&watched, rays, threads.0, masks))
        .map_err(raise)?;
    Ok(occluded.into_pyarray(py).into_any())
}
