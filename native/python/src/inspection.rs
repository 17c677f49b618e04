// SPDX-License-Identifier: GPL-3.0-or-later
//! Visualization of a structure as dictionaries of arrays: split planes and cells of leaves.

use crate::errors::raise;
use halfspace_base::Monitor;
use halfspace_inspect::leaf_cells::{Faces, leaf_cells};
use halfspace_inspect::polygons;
use halfspace_structure::Structure;
use numpy::{PyArray1, PyArray2, ToPyArray};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Makes an (n, 3) float32 array.
pub fn points<'py>(py: Python<'py>, rows: &[[f32; 3]]) -> PyResult<Bound<'py, PyArray2<f32>>> {
    let flat = PyArray1::from_slice(py, rows.as_flattened());
    numpy::PyArrayMethods::reshape(&flat, [rows.len(), 3])
}

/// Sets the vertices, offsets and cells of faces.
pub fn set_faces(dict: &Bound<'_, PyDict>, faces: &Faces) -> PyResult<()> {
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
    monitor: &Monitor,
) -> PyResult<Bound<'py, PyDict>> {
    let polygons = py.detach(|| polygons::split_polygons(structure, max_depth, max_count, monitor));
    let polygons = polygons.map_err(raise)?;
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
    monitor: &Monitor,
) -> PyResult<Bound<'py, PyDict>> {
    let cells = py.detach(|| leaf_cells(structure, min_triangles, max_count, monitor));
    let cells = cells.map_err(raise)?;
    let dict = PyDict::new(py);
    set_faces(&dict, &cells.faces)?;
    dict.set_item("count", cells.counts.to_pyarray(py))?;
    dict.set_item("depth", cells.depths.to_pyarray(py))?;
    dict.set_item("hidden", cells.hidden)?;
    Ok(dict)
}
