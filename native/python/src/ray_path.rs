// SPDX-License-Identifier: GPL-3.0-or-later
//! The path of a ray through a structure as a dictionary of arrays.

use crate::errors::raise;
use crate::hits::COLUMNS;
use crate::inspection::{points, set_faces};
use halfspace_base::Monitor;
use halfspace_inspect::leaf_cells::Faces;
use halfspace_inspect::ray_path::{RayPath, Visit, ray_path};
use halfspace_ray::{Ray, RayCounters};
use halfspace_structure::Structure;
use numpy::ToPyArray;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Implements `Structure.trace_path`.
pub fn path<'py>(
    py: Python<'py>,
    structure: &Structure,
    ray: &Ray,
    any: bool,
    monitor: &Monitor,
) -> PyResult<Bound<'py, PyDict>> {
    let path = py.detach(|| ray_path(structure, ray, any, monitor));
    let path = path.map_err(raise)?;
    let dict = PyDict::new(py);
    dict.set_item("t", path.hit.t)?;
    // The triangle index of a miss has all bits set and becomes -1.
    dict.set_item("triangle", path.hit.triangle.cast_signed())?;
    dict.set_item("u", path.hit.u)?;
    dict.set_item("v", path.hit.v)?;
    let counted = counters(py, &path.counters, structure.cases())?;
    dict.set_item("counters", counted)?;
    dict.set_item("visits", visits(py, structure, &path)?)?;
    dict.set_item("crossings", crossings(py, structure, &path)?)?;
    Ok(dict)
}

/// Returns the counters of the ray, with the names of `Hits.counters`.
fn counters<'py>(
    py: Python<'py>,
    counters: &RayCounters,
    cases: &[&str],
) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    for (name, get) in COLUMNS {
        dict.set_item(name, get(counters))?;
    }
    for (name, count) in cases.iter().zip(counters.cases) {
        dict.set_item(name, count)?;
    }
    Ok(dict)
}

/// Returns the visited leaves in order: faces of their cells, triangles, interval of the ray.
fn visits<'py>(
    py: Python<'py>,
    structure: &Structure,
    path: &RayPath,
) -> PyResult<Bound<'py, PyDict>> {
    // Collect the faces of the cells and the triangles of the leaves.
    let dict = PyDict::new(py);
    let leaves = structure.leaves();
    let mut faces = Faces::default();
    let (mut triangles, mut ends) = (Vec::new(), vec![0_u32]);
    for visit in &path.visits {
        faces.push(&visit.region.faces(), &structure.built().frame);
        triangles.extend(leaves.ids(visit.first, visit.count));
        ends.push(
            u32::try_from(triangles.len())
                .expect("fewer than 2^28 references, and each leaf is visited once"),
        );
    }
    set_faces(&dict, &faces)?;
    let corners: Vec<_> = triangles
        .iter()
        .flat_map(|&id| structure.scene().corners(id))
        .collect();
    dict.set_item("corners", points(py, &corners)?)?;
    // Add the interval, the depth and the test of each visited leaf.
    let column = |get: fn(&Visit) -> f64| {
        let values: Vec<_> = path.visits.iter().map(get).collect();
        values.to_pyarray(py)
    };
    dict.set_item("enter", column(|visit| visit.span.enter))?;
    dict.set_item("leave", column(|visit| visit.span.leave))?;
    let depths: Vec<_> = path.visits.iter().map(|visit| visit.depth as u32).collect();
    dict.set_item("depth", depths.to_pyarray(py))?;
    let tested: Vec<_> = path.visits.iter().map(|v| v.tested.is_some()).collect();
    dict.set_item("tested", tested.to_pyarray(py))?;
    let steps: Vec<_> = path.visits.iter().map(|v| v.tested.unwrap_or(0)).collect();
    dict.set_item("steps", steps.to_pyarray(py))?;
    dict.set_item("triangles", triangles.to_pyarray(py))?;
    dict.set_item("triangle_offsets", ends.to_pyarray(py))?;
    Ok(dict)
}

/// Returns the crossed split planes in order.
fn crossings<'py>(
    py: Python<'py>,
    structure: &Structure,
    path: &RayPath,
) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    let mut planes = Faces::default();
    for crossing in &path.crossings {
        let face = std::slice::from_ref(&crossing.face);
        planes.push(face, &structure.built().frame);
    }
    dict.set_item("vertices", points(py, &planes.vertices)?)?;
    dict.set_item("offsets", planes.offsets.to_pyarray(py))?;
    let times: Vec<_> = path.crossings.iter().map(|c| c.t).collect();
    dict.set_item("t", times.to_pyarray(py))?;
    let kinds: Vec<_> = path.crossings.iter().map(|c| c.kind).collect();
    dict.set_item("kind", kinds.to_pyarray(py))?;
    let depths: Vec<_> = path.crossings.iter().map(|c| c.depth as u32).collect();
    dict.set_item("depth", depths.to_pyarray(py))?;
    Ok(dict)
}
