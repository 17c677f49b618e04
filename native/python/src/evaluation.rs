// SPDX-License-Identifier: GPL-3.0-or-later
//! Values of shading programs at given points.

use crate::args::arrays;
use crate::args::keys::Keys;
use crate::args::shader;
use crate::errors::raise;
use crate::float_mode::DefaultMode;
use halfspace_base::error::Result;
use halfspace_render::values::evaluate::Evaluation;
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// The result of a shading program at points that no ray meets, (n, 4) float32: a colour and its alpha, a vector,
/// or a number three times.
///
/// request: a dictionary of "positions" and "normals" (unit vectors), (n, 3) float32; "program" and "result", as the
/// program and an argument of a material of RenderScene; and, as for RenderScene, "images", "layers", (n, 3, 2 to
/// 4), of which the first corner of entry i belongs to point i, "objects", "object_index", (n,), and "origin". There
/// is no camera, and heights next to a point are those of the point.
///
/// Raises ShapeError, NonFiniteError and SpecError as RenderScene does. Releases the GIL while it computes.
#[pyfunction]
fn evaluate_program<'py>(
    py: Python<'py>,
    request: &Bound<'py, PyDict>,
) -> PyResult<Bound<'py, PyArray2<f32>>> {
    let _mode = DefaultMode::set(py)?;
    let evaluation = evaluation(request).map_err(raise)?;
    let rows = py.detach(|| evaluation.run()).map_err(raise)?;
    PyArray1::from_slice(py, rows.as_flattened()).reshape([rows.len(), 4])
}

/// Reads the program and its points.
fn evaluation(request: &Bound<'_, PyDict>) -> Result<Evaluation> {
    let known = [
        "positions",
        "normals",
        "program",
        "result",
        "images",
        "layers",
        "objects",
        "object_index",
        "origin",
    ];
    let keys = Keys::new(request, "evaluation".into(), &known)?;
    let found = |key: &str| keys.find(key);
    let origin = match found("origin") {
        None => None,
        Some(value) => Some(
            value
                .extract()
                .map_err(|_| keys.wrong("origin", "three floats", &value))?,
        ),
    };
    let result = keys.need("result")?;
    Ok(Evaluation {
        steps: shader::program(&keys)?,
        result: Some(shader::operand(&keys, "result", &result)?),
        images: shader::images(found("images").as_ref())?,
        varying: shader::varying(
            found("layers").as_ref(),
            found("objects").as_ref(),
            found("object_index").as_ref(),
            origin,
        )?,
        positions: arrays::points("positions", &keys.need("positions")?)?,
        normals: arrays::points("normals", &keys.need("normals")?)?,
    })
}

/// Adds the function to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(evaluate_program, module)?)
}
