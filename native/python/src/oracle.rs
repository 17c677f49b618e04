// SPDX-License-Identifier: GPL-3.0-or-later
//! The exact oracle, and the distance of results from it.

use crate::args::arrays;
use crate::args::integers::Threads;
use crate::args::rays::RayArrays;
use crate::errors::raise;
use crate::float_mode::DefaultMode;
use crate::hits::Hits;
use halfspace_base::error::Error;
use halfspace_oracle::exact_closest;
use halfspace_ray::Hit;
use halfspace_scene::Triangles;
use halfspace_structure::threads::{Shares, in_chunks};
use numpy::{PyReadonlyArray1, ToPyArray};
use pyo3::prelude::*;

/// The nearest hit by exact integer arithmetic, O(n) per ray: for small inputs.
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
    let _mode = DefaultMode::set(py)?;
    // Check the arguments while the GIL is held.
    let vertices = arrays::points("vertices", vertices).map_err(raise)?;
    let indices = arrays::indices("triangles", triangles, vertices.len()).map_err(raise)?;
    let arguments = RayArrays::new(origins, directions, t_min, t_max, "none").map_err(raise)?;
    let rays = arguments.rays();
    let (hits, on_boundary) = py
        .detach(|| {
            // Test each ray against all triangles.
            let scene = Triangles::new(vertices, indices)?;
            let blank = (Hit::MISS, false);
            let (answers, _) = in_chunks(
                rays,
                Shares::usual(threads.0),
                false,
                blank,
                |rays, answers, _| {
                    for (ray, answer) in rays.iter().zip(answers) {
                        let exact = exact_closest(&scene, ray);
                        *answer = (exact.hit, exact.on_boundary);
                    }
                },
            )?;
            Ok::<_, Error>(answers.into_iter().unzip::<_, _, Vec<_>, Vec<_>>())
        })
        .map_err(raise)?;
    Ok(Hits {
        hits,
        counts: None,
        on_boundary: Some(on_boundary),
    })
}

/// Returns the number of steps from one float to the other, counted through zero; `i64::MAX` between NaN and a number.
fn ulps(a: f32, b: f32) -> i64 {
    // Handle NaN, which the order of floats does not contain.
    if a.is_nan() || b.is_nan() {
        return if a.is_nan() && b.is_nan() {
            0
        } else {
            i64::MAX
        };
    }
    // Map the bits to integers that are ordered like the floats.
    let order = |x: f32| {
        let bits = i64::from(x.to_bits() & 0x7fff_ffff);
        if x.is_sign_negative() { -bits } else { bits }
    };
    (order(a) - order(b)).abs()
}

/// Number of float32 steps between a and b, (n,) each, counted through zero.
///
/// Two NaN are 0 apart, NaN and a number 2**63 - 1. Raises ShapeError if the lengths differ.
#[pyfunction]
fn ulp_distance<'py>(
    py: Python<'py>,
    a: PyReadonlyArray1<'_, f32>,
    b: PyReadonlyArray1<'_, f32>,
) -> PyResult<Bound<'py, PyAny>> {
    let (a, b) = (a.as_array(), b.as_array());
    if a.len() != b.len() {
        return Err(raise(Error::Shape(format!(
            "b: expected {} numbers, got {}",
            a.len(),
            b.len()
        ))));
    }
    let distances: Vec<_> = a.iter().zip(&b).map(|(&a, &b)| ulps(a, b)).collect();
    Ok(distances.to_pyarray(py).into_any())
}

/// Adds the oracle to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(exact, module)?)?;
    module.add_function(wrap_pyfunction!(ulp_distance, module)?)
}
