// SPDX-License-Identifier: GPL-3.0-or-later
//! The oracle's generated scenes as dictionaries of arrays.

use crate::args::integers::Seed;
use crate::errors::raise;
use crate::float_mode::DefaultMode;
use halfspace_base::error::{Error, Result};
use halfspace_oracle::cases::{self, Case, Size};
use numpy::{PyArray1, PyArray2, PyArrayMethods, ToPyArray};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

/// Makes an (n, 3) array of rows.
fn table<'py, T: numpy::Element + Copy>(
    py: Python<'py>,
    rows: &[[T; 3]],
) -> PyResult<Bound<'py, PyArray2<T>>> {
    PyArray1::from_slice(py, rows.as_flattened()).reshape([rows.len(), 3])
}

/// Converts a case to a dictionary.
fn dictionary<'py>(py: Python<'py>, case: &Case) -> PyResult<Bound<'py, PyDict>> {
    // Columns and rows over all rays of the case.
    let dict = PyDict::new(py);
    let column = |get: fn(&halfspace_ray::ray::Ray) -> f32| {
        let numbers: Vec<_> = case.rays.iter().map(get).collect();
        numbers.to_pyarray(py)
    };
    let rows = |get: fn(&halfspace_ray::ray::Ray) -> [f32; 3]| {
        let rows: Vec<_> = case.rays.iter().map(get).collect();
        table(py, &rows)
    };
    dict.set_item("name", case.name)?;
    dict.set_item("summary", case.summary)?;
    dict.set_item("extremes", case.extremes)?;
    dict.set_item("vertices", table(py, case.scene.vertices())?)?;
    dict.set_item("triangles", table(py, case.scene.indices())?)?;
    dict.set_item("origins", rows(|ray| ray.o)?)?;
    dict.set_item("directions", rows(|ray| ray.d)?)?;
    dict.set_item("t_min", column(|ray| ray.t_min))?;
    dict.set_item("t_max", column(|ray| ray.t_max))?;
    Ok(dict)
}

/// Parses the size of the cases.
fn size_of(name: &str) -> Result<Size> {
    match name {
        "small" => Ok(Size::Small),
        "large" => Ok(Size::Large),
        _ => Err(Error::Spec(format!(
            "size: expected small or large, got {name}"
        ))),
    }
}

/// The generated scenes and rays for which every structure must return the hits of brute force.
///
/// size: "small": hundreds of triangles and rays per case; "large": tens of thousands. seed: 0 to 2**64 - 1, seeds
/// the random parts. Raises SpecError if either is out of range.
#[pyfunction]
#[pyo3(name = "cases", signature = (size="small", *, seed=Seed(7)), text_signature = "(size='small', *, seed=7)")]
fn all<'py>(py: Python<'py>, size: &str, seed: Seed) -> PyResult<Bound<'py, PyList>> {
    let _mode = DefaultMode::set(py)?;
    let size = size_of(size).map_err(raise)?;
    let made = py.detach(|| cases::cases(size, seed.0));
    let list = PyList::empty(py);
    for case in &made {
        list.append(dictionary(py, case)?)?;
    }
    Ok(list)
}

/// Adds `cases` to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(all, module)?)
}
