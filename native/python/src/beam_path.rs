// SPDX-License-Identifier: GPL-3.0-or-later
//! The way of beams of polygons as a dictionary of arrays.

use crate::errors::raise;
use crate::hits::Hits;
use halfspace_base::Monitor;
use halfspace_inspect::beam_path::{Beams, beams};
use halfspace_ray::Ray;
use halfspace_ray::beam_path::{BeamAction, BeamStep};
use halfspace_structure::Structure;
use numpy::{PyArray1, PyArrayMethods, ToPyArray};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// The numbers of the actions in `Structure.trace_beam`.
const ACTIONS: [BeamAction; 6] = [
    BeamAction::Ended,
    BeamAction::Singles,
    BeamAction::HandedOn,
    BeamAction::Clipped,
    BeamAction::Split,
    BeamAction::Left,
];

/// Implements `Structure.trace_beam`.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    reason = "numbers of rays and nodes have 31 bits, and faces and actions are less than 8"
)]
pub fn path<'py>(
    py: Python<'py>,
    structure: &Structure,
    rays: &[Ray],
    any: bool,
    monitor: &Monitor,
) -> PyResult<Bound<'py, PyDict>> {
    let found = py.detach(|| beams(structure, rays, any, monitor));
    let Beams {
        hits,
        counters,
        path,
    } = found.map_err(raise)?;
    let dict = PyDict::new(py);
    let hits = Hits {
        hits,
        counts: Some((structure.cases(), counters)),
        on_boundary: None,
    };
    dict.set_item("hits", Bound::new(py, hits)?)?;
    // Add one row per step.
    let integers = |get: fn(&BeamStep) -> i32| {
        let values: Vec<_> = path.steps.iter().map(get).collect();
        values.to_pyarray(py)
    };
    dict.set_item(
        "parent",
        integers(|step| step.parent.map_or(-1, |parent| parent as i32)),
    )?;
    dict.set_item("node", integers(|step| step.node as i32))?;
    dict.set_item("level", integers(|step| step.level as i32))?;
    dict.set_item(
        "face",
        integers(|step| {
            step.face
                .map_or(-1, |[axis, side]| (2 * axis + side) as i32)
        }),
    )?;
    dict.set_item(
        "action",
        integers(|step| {
            ACTIONS
                .iter()
                .position(|action| *action == step.action)
                .unwrap_or(0) as i32
        }),
    )?;
    let tested: Vec<_> = path.steps.iter().map(|step| step.tested).collect();
    dict.set_item("tested", tested.to_pyarray(py))?;
    for (name, which) in [("low", 0), ("high", 1)] {
        let corners: Vec<_> = path.steps.iter().map(|step| step.corners[which]).collect();
        dict.set_item(name, points(py, &corners)?)?;
    }
    // Add the polygons and the rays, and where those of each step begin.
    let offsets = |end: fn(&BeamStep) -> usize| {
        let ends = path.steps.iter().map(|step| end(step) as i64);
        let offsets: Vec<_> = std::iter::once(0).chain(ends).collect();
        offsets.to_pyarray(py)
    };
    dict.set_item("vertices", points(py, &path.vertices)?)?;
    dict.set_item("offsets", offsets(|step| step.vertices_end))?;
    let rays: Vec<_> = path.rays.iter().map(|ray| ray.cast_signed()).collect();
    dict.set_item("rays", rays.to_pyarray(py))?;
    dict.set_item("ray_offsets", offsets(|step| step.rays_end))?;
    Ok(dict)
}

/// Makes an (n, 3) float64 array.
fn points<'py>(py: Python<'py>, rows: &[[f64; 3]]) -> PyResult<Bound<'py, PyAny>> {
    let flat = PyArray1::from_slice(py, rows.as_flattened());
    Ok(flat.reshape([rows.len(), 3])?.into_any())
}
