// SPDX-License-Identifier: GPL-3.0-or-later
//! The exact oracle, and how far answers are from it.

use super::arrays;
use super::hits::Hits;
use super::rays::RayArrays;
use super::share::in_chunks;
use super::whole::Threads;
use crate::error::Error;
use crate::oracle::exact_closest;
use crate::scene::Triangles;
use crate::traverse::Hit;
use numpy::{PyReadonlyArray1, ToPyArray};
use pyo3::prelude::*;

/// The nearest triangle by exact integer arithmetic alone, O(n) per ray: for small inputs.
///
/// Arguments and errors as for build() and Structure.closest().
#[pyfunction]
#[pyo3(name = "exact_closest", signature = (vertices, triangles, origins, directions, t_min=None, t_max=None, *, threads=Threads::ALL), text_signature = "(vertices, triangles, origins, directions, t_min=None, t_max=None, *, threads=0)")]
#[expect(clippy::too_many_arguments, reason = "Python keywords")]
fn exact(
    py: Python<'_>,
    vertices: &Bound<'_, PyAny>,
    triangles: &Bound<'_, PyAny>,
    origins: &Bound<'_, PyAny>,
    directions: &Bound<'_, PyAny>,
    t_min: Option<&Bound<'_, PyAny>>,
    t_max: Option<&Bound<'_, PyAny>>,
    threads: Threads,
) -> PyResult<Hits> {
    let vertices = arrays::points("vertices", vertices)?;
    let indices = arrays::indices("triangles", triangles, vertices.len())?;
    let arguments = RayArrays::new(origins, directions, t_min, t_max, "none")?;
    let rays = arguments.rays();
    let (hits, on_boundary) = py.detach(|| {
        let scene = Triangles::new(vertices, indices)?;
        let blank = (Hit::MISS, false);
        let (answers, _) = in_chunks(rays, threads.0, false, blank, |rays, answers, _| {
            for (ray, answer) in rays.iter().zip(answers) {
                let exact = exact_closest(&scene, ray);
                *answer = (exact.hit, exact.on_boundary);
            }
        })?;
        Ok::<_, Error>(answers.into_iter().unzip::<_, _, Vec<_>, Vec<_>>())
    })?;
    Ok(Hits {
        hits,
        counts: None,
        on_boundary: Some(on_boundary),
    })
}

/// How many floats lie between two of the same sign, counted through zero; NaN is far from all.
fn ulps(a: f32, b: f32) -> i64 {
    if a.is_nan() || b.is_nan() {
        return if a.is_nan() && b.is_nan() {
            0
        } else {
            i64::MAX
        };
    }
    let order = |x: f32| {
        let bits = i64::from(x.to_bits() & 0x7fff_ffff);
        if x.is_sign_negative() { -bits } else { bits }
    };
    (order(a) - order(b)).abs()
}

/// How many float32 steps lie between a and b, (n,) each, counted through zero.
///
/// Two NaN are 0 apart, NaN and a number 2**63 - 1. Raises ShapeError when the lengths differ.
#[pyfunction]
fn ulp_distance<'py>(
    py: Python<'py>,
    a: PyReadonlyArray1<'_, f32>,
    b: PyReadonlyArray1<'_, f32>,
) -> PyResult<Bound<'py, PyAny>> {
    let (a, b) = (a.as_array(), b.as_array());
    if a.len() != b.len() {
        return Err(
            Error::Shape(format!("b: expected {} numbers, got {}", a.len(), b.len())).into(),
        );
    }
    let distances: Vec<_> = a.iter().zip(&b).map(|(&a, &b)| ulps(a, b)).collect();
    Ok(distances.to_pyarray(py).into_any())
}

/// Adds the oracle to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(exact, module)?)?;
    module.add_function(wrap_pyfunction!(ulp_distance, module)?)
}
