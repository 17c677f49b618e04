// SPDX-License-Identifier: GPL-3.0-or-later
//! Visualization of a structure as dictionaries of arrays: split planes, cells of leaves, the path of a ray.

use crate::hits::COLUMNS;
use halfspace_inspect::leaf_cells::{Faces, leaf_cells};
use halfspace_inspect::polygons;
use halfspace_inspect::ray_path::ray_path;
use halfspace_ray::Ray;
use halfspace_structure::Structure;
use numpy::{PyArray1, PyArray2, ToPyArray};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Makes an (n, 3) float32 array.
fn points<'py>(py: Python<'py>, rows: &[[f32; 3]]) -> PyResult<Bound<'py, PyArray2<f32>>> {
    let flat = PyArray1::from_slice(py, rows.as_flattened());
    numpy::PyArrayMethods::reshape(&flat, [rows.len(), 3])
}

/// Sets the vertices, offsets and cells of faces.
fn set_faces(dict: &Bound<'_, PyDict>, faces: &Faces) -> PyResult<()> {
    let py = dict.py();
    dict.set_item("vertices", points(py, &faces.vertices)?)?;
    dict.set_item("offsets", faces.offsets.to_pyarray(py))?;
    dict.set_item("cells", faces.cells.to_pyarray(py))
}

/// Implements `Structure.split_polygons`.
pub fn planes<'py>(
    py: Python<'py>,
    structure: &Structure,
    max_depth: usize,
    max_count: usize,
) -> PyResult<Bound<'py, PyDict>> {
    let polygons = py.detach(|| polygons::split_polygons(structure, max_depth, max_count));
    let dict = PyDict::new(py);
    dict.set_item("vertices", points(py, &polygons.vertices)?)?;
    dict.set_item("offsets", polygons.offsets.to_pyarray(py))?;
    dict.set_item("depth", polygons.depths.to_pyarray(py))?;
    dict.set_item("kind", polygons.kinds.to_pyarray(py))?;
    dict.set_item("hidden", polygons.hidden)?;
    Ok(dict)
}

/// Implements `Structure.leaf_cells`.
pub fn cells<'py>(
    py: Python<'py>,
    structure: &Structure,
    min_triangles: usize,
    max_count: usize,
) -> PyResult<Bound<'py, PyDict>> {
    let cells = py.detach(|| leaf_cells(structure, min_triangles, max_count));
    let dict = PyDict::new(py);
    set_faces(&dict, &cells.faces)?;
    dict.set_item("count", cells.counts.to_pyarray(py))?;
    dict.set_item("depth", cells.depths.to_pyarray(py))?;
    dict.set_item("hidden", cells.hidden)?;
    Ok(dict)
}

/// Implements `Structure.trace_path`.
pub fn path<'py>(
    py: Python<'py>,
    structure: &Structure,
    ray: &Ray,
) -> PyResult<Bound<'py, PyDict>> {
    // The hit, as in `Hits`.
    let path = py.detach(|| ray_path(structure, ray));
    let built = structure.built();
    let dict = PyDict::new(py);
    dict.set_item("t", path.hit.t)?;
    // The triangle index of a miss has all bits set and becomes -1.
    dict.set_item("triangle", path.hit.triangle.cast_signed())?;
    dict.set_item("u", path.hit.u)?;
    dict.set_item("v", path.hit.v)?;
    // Counters of the ray, with the names that `Hits.counters` uses.
    let counters = path.counters;
    let counted = PyDict::new(py);
    for (name, get) in COLUMNS {
        counted.set_item(name, get(&counters))?;
    }
    for (name, count) in structure.cases().iter().zip(counters.cases) {
        counted.set_item(name, count)?;
    }
    dict.set_item("counters", counted)?;

    // Visited leaves in order: faces of their cells, triangles, interval of the ray.
    let visited = PyDict::new(py);
    let leaves = structure.leaves_traversed();
    let mut faces = Faces::default();
    let (mut triangles, mut ends) = (Vec::new(), vec![0_u32]);
    for visit in &path.visits {
        faces.push(&visit.region.faces(), &built.frame);
        triangles.extend(leaves.ids(visit.first, visit.count));
        ends.push(
            u32::try_from(triangles.len())
                .expect("fewer than 2^28 references, and each leaf is visited once"),
        );
    }
    set_faces(&visited, &faces)?;
    let corners: Vec<_> = triangles
        .iter()
        .flat_map(|&id| structure.scene().corners(id))
        .collect();
    visited.set_item("corners", points(py, &corners)?)?;
    // Interval, depth and test of each visited leaf.
    let column = |get: fn(&halfspace_inspect::ray_path::Visit) -> f64| {
        let values: Vec<_> = path.visits.iter().map(get).collect();
        values.to_pyarray(py)
    };
    visited.set_item("enter", column(|visit| visit.span.0))?;
    visited.set_item("leave", column(|visit| visit.span.1))?;
    let depths: Vec<_> = path.visits.iter().map(|visit| visit.depth as u32).collect();
    visited.set_item("depth", depths.to_pyarray(py))?;
    let tested: Vec<_> = path.visits.iter().map(|visit| visit.tested).collect();
    visited.set_item("tested", tested.to_pyarray(py))?;
    visited.set_item("triangles", triangles.to_pyarray(py))?;
    visited.set_item("triangle_offsets", ends.to_pyarray(py))?;
    dict.set_item("visits", visited)?;

    // Crossed split planes in order.
    let crossed = PyDict::new(py);
    let mut planes = Faces::default();
    for crossing in &path.crossings {
        planes.push(std::slice::from_ref(&crossing.face), &built.frame);
    }
    crossed.set_item("vertices", points(py, &planes.vertices)?)?;
    crossed.set_item("offsets", planes.offsets.to_pyarray(py))?;
    let times: Vec<_> = path.crossings.iter().map(|c| c.t).collect();
    crossed.set_item("t", times.to_pyarray(py))?;
    let kinds: Vec<_> = path.crossings.iter().map(|c| c.kind).collect();
    crossed.set_item("kind", kinds.to_pyarray(py))?;
    let depths: Vec<_> = path.crossings.iter().map(|c| c.depth as u32).collect();
    crossed.set_item("depth", depths.to_pyarray(py))?;
    dict.set_item("crossings", crossed)?;
    Ok(dict)
}
