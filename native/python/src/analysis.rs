// SPDX-License-Identifier: GPL-3.0-or-later
//! Statistics of a tree, and the tree itself, as dictionaries of arrays.

use crate::errors::raise;
use halfspace_base::Monitor;
use halfspace_inspect::analysis::{self, Charges};
use halfspace_inspect::export::{self, Lists};
use halfspace_structure::Structure;
use numpy::{Element, PyArray1, PyArrayMethods, ToPyArray};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Sets a histogram or a list of counts as int64.
fn set_counts(dict: &Bound<'_, PyDict>, name: &str, counts: &[u64]) -> PyResult<()> {
    let counts: Vec<_> = counts.iter().map(|count| count.cast_signed()).collect();
    dict.set_item(name, counts.to_pyarray(dict.py()))
}

/// Sets an array of rows as one of two dimensions.
fn set_rows<T: Element, const N: usize>(
    dict: &Bound<'_, PyDict>,
    name: &str,
    rows: &[[T; N]],
) -> PyResult<()> {
    let flat = PyArray1::from_slice(dict.py(), rows.as_flattened());
    dict.set_item(name, flat.reshape([rows.len(), N])?)
}

/// Sets the operations of a ray and their cost, each name with a prefix.
fn set_charges(dict: &Bound<'_, PyDict>, prefix: &str, charges: &Charges) -> PyResult<()> {
    let numbers = [
        ("steps_axis", charges.axis),
        ("steps_oblique", charges.oblique),
        ("tests", charges.tests),
        ("nodes", charges.nodes()),
        ("leaves", charges.leaves()),
    ];
    for (name, number) in numbers {
        dict.set_item(format!("{prefix}_{name}"), number)?;
    }
    Ok(())
}

/// Implements `Structure.analysis`.
pub fn analysis<'py>(
    py: Python<'py>,
    structure: &Structure,
    max_nodes: usize,
    monitor: &Monitor,
) -> PyResult<Bound<'py, PyDict>> {
    let found = py.detach(|| analysis::analysis(structure, max_nodes, monitor));
    let found = found.map_err(raise)?;
    let dict = PyDict::new(py);
    // Counts of leaves and nodes.
    let column = |k: usize| -> Vec<u64> { found.leaf_sizes.iter().map(|row| row[k]).collect() };
    dict.set_item("nodes", found.nodes)?;
    dict.set_item("leaves", found.leaf_depths.iter().sum::<u64>())?;
    set_counts(&dict, "leaf_depths", &found.leaf_depths)?;
    set_counts(&dict, "leaf_sizes", &column(0))?;
    set_counts(&dict, "leaf_size_counts", &column(1))?;
    set_counts(&dict, "children", &found.children)?;
    set_counts(&dict, "level_nodes", &found.levels.nodes)?;
    set_counts(&dict, "level_planes_axis", &found.levels.planes_axis)?;
    set_counts(&dict, "level_planes_oblique", &found.levels.planes_oblique)?;
    set_counts(
        &dict,
        "level_directions_axis",
        &found.levels.directions_axis,
    )?;
    set_counts(
        &dict,
        "level_directions_oblique",
        &found.levels.directions_oblique,
    )?;
    // Expected costs, and operations of which they consist.
    set_charges(&dict, "sah", &found.visits)?;
    set_charges(&dict, "epo", &found.overlap.charges)?;
    dict.set_item("epo", found.overlap.charges.cost())?;
    dict.set_item("epo_error", found.overlap.error)?;
    dict.set_item("epo_sample", found.overlap.sample)?;
    dict.set_item("epo_triangles", found.overlap.triangles)?;
    dict.set_item("beta", found.beta.all)?;
    dict.set_item("beta_axis", found.beta.axis)?;
    dict.set_item("beta_oblique", found.beta.oblique)?;
    Ok(dict)
}

/// Sets the offsets of lists.
fn set_offsets<T>(dict: &Bound<'_, PyDict>, name: &str, lists: &Lists<T>) -> PyResult<()> {
    dict.set_item(name, lists.offsets.to_pyarray(dict.py()))
}

/// Implements `Structure.export`.
pub fn export<'py>(
    py: Python<'py>,
    structure: &Structure,
    monitor: &Monitor,
) -> PyResult<Bound<'py, PyDict>> {
    let tree = py.detach(|| export::export(structure, monitor));
    let tree = tree.map_err(raise)?;
    let dict = PyDict::new(py);
    dict.set_item("node_kind", tree.kinds.to_pyarray(py))?;
    dict.set_item("node_parent", tree.parents.to_pyarray(py))?;
    dict.set_item("node_depth", tree.depths.to_pyarray(py))?;
    set_rows(&dict, "node_bounds", &tree.bounds)?;
    set_offsets(&dict, "child_offsets", &tree.children)?;
    dict.set_item("children", tree.children.entries.to_pyarray(py))?;
    set_offsets(&dict, "plane_offsets", &tree.planes)?;
    set_rows(&dict, "planes", &tree.planes.entries)?;
    dict.set_item("plane_kind", tree.plane_kinds.to_pyarray(py))?;
    set_offsets(&dict, "wall_offsets", &tree.walls)?;
    set_rows(&dict, "walls", &tree.walls.entries)?;
    set_offsets(&dict, "triangle_offsets", &tree.triangles)?;
    dict.set_item("triangles", tree.triangles.entries.to_pyarray(py))?;
    Ok(dict)
}
