// SPDX-License-Identifier: GPL-3.0-or-later
//! Nearest triangles and overlaps, with the GIL released, and their oracle.

use crate::args::arrays::{self, PerRay};
use crate::errors::raise;
use crate::float_mode::DefaultMode;
use halfspace_base::error::{Result, caught};
use halfspace_nearest::threads::Work;
use halfspace_nearest::{Nearest, Surface};
use halfspace_oracle::{exact_nearest, exact_overlap};
use halfspace_ray::rays::{Limits, check_finite};
use halfspace_scene::Triangles;
use halfspace_structure::Structure;
use numpy::{PyArray1, PyArray2, PyArrayMethods, ToPyArray};
use pyo3::prelude::*;
use std::sync::OnceLock;

/// The boxes of a structure for nearest and overlap queries, made by the first.
#[derive(Default)]
pub struct LazySurface(OnceLock<Surface>);

impl LazySurface {
    /// Returns the boxes of `structure`, always the same.
    pub fn of(&self, structure: &Structure) -> Result<&Surface> {
        if self.0.get().is_none() {
            // Another thread may be faster; both results are equal.
            let _ = self.0.set(caught(|| Surface::new(structure))?);
        }
        Ok(self.0.get().expect("set above"))
    }
}

/// The results of closest_points() and points_within().
///
/// distance: (n,) float32, correctly rounded; inf = none found. triangle: (n,) int32, -1 = none; among triangles at the
/// same exact distance the one with the smallest index. point: (n, 3) float32, the closest point of that triangle, each
/// coordinate correctly rounded; NaN = none. Each access makes a new array.
#[pyclass(frozen, module = "halfspace_native")]
pub struct NearestPoints(Vec<Nearest>);

#[pymethods]
impl NearestPoints {
    #[getter]
    fn distance<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f32>> {
        let column: Vec<_> = self.0.iter().map(|one| one.distance).collect();
        column.to_pyarray(py)
    }

    #[getter]
    fn triangle<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i32>> {
        // The index of none has all bits set and becomes -1.
        let column = self.0.iter().map(|one| one.triangle.cast_signed());
        column.collect::<Vec<_>>().to_pyarray(py)
    }

    #[getter]
    fn point<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let rows: Vec<_> = self.0.iter().map(|one| one.point).collect();
        table(py, &rows)
    }

    fn __len__(&self) -> usize {
        self.0.len()
    }
}

/// Copies rows of `N` numbers to an array.
fn table<'py, T: numpy::Element + Copy, const N: usize>(
    py: Python<'py>,
    rows: &[[T; N]],
) -> PyResult<Bound<'py, PyArray2<T>>> {
    PyArray1::from_slice(py, rows.as_flattened()).reshape([rows.len(), N])
}

/// Finite points, and one distance for all or one for each.
struct Arguments<'py> {
    points: Vec<[f32; 3]>,
    distances: PerRay<'py>,
}

impl<'py> Arguments<'py> {
    /// Reads the arguments `points` and, as `name`, distances, without limit if not given.
    fn new(
        points: &Bound<'py, PyAny>,
        name: &str,
        distances: Option<&Bound<'py, PyAny>>,
    ) -> Result<Self> {
        let points = arrays::points("points", points)?;
        check_finite("points", &points)?;
        let distances = match distances {
            None => PerRay::Same(f32::INFINITY),
            Some(value) => arrays::per_ray(name, value, points.len())?,
        };
        Ok(Self { points, distances })
    }
}

/// Returns the distance of the point with this index.
fn of(distances: Limits<'_>, i: usize) -> f32 {
    match distances {
        Limits::Same(x) => x,
        Limits::Each(all) => all[i],
    }
}

/// The nearest triangle of each point.
pub fn closest_points(
    py: Python<'_>,
    surface: &Surface,
    points: &Bound<'_, PyAny>,
    max_distance: Option<&Bound<'_, PyAny>>,
    work: Work<'_>,
) -> PyResult<NearestPoints> {
    let _mode = DefaultMode::set(py)?;
    let arguments = Arguments::new(points, "max_distance", max_distance).map_err(raise)?;
    let (points, limits) = (&arguments.points, arguments.distances.limits());
    let found = py
        .detach(|| surface.nearest_of_each(points, |i| of(limits, i), work))
        .map_err(raise)?;
    Ok(NearestPoints(found))
}

/// The triangles near each point: the offsets of the points in the list, and the list.
pub fn points_within<'py>(
    py: Python<'py>,
    surface: &Surface,
    points: &Bound<'_, PyAny>,
    radius: &Bound<'_, PyAny>,
    work: Work<'_>,
) -> PyResult<(Bound<'py, PyArray1<i64>>, NearestPoints)> {
    let _mode = DefaultMode::set(py)?;
    let arguments = Arguments::new(points, "radius", Some(radius)).map_err(raise)?;
    let (points, radii) = (&arguments.points, arguments.distances.limits());
    let near = py
        .detach(|| surface.within(points, |i| of(radii, i), work))
        .map_err(raise)?;
    let offsets: Vec<_> = near.offsets.iter().map(|&offset| offset as i64).collect();
    Ok((offsets.to_pyarray(py), NearestPoints(near.found)))
}

/// The pairs of triangles that overlap.
pub fn overlaps<'py>(
    py: Python<'py>,
    one: &Surface,
    other: &Surface,
    work: Work<'_>,
) -> PyResult<Bound<'py, PyArray2<i32>>> {
    let _mode = DefaultMode::set(py)?;
    let pairs = py.detach(|| one.overlaps(other, work)).map_err(raise)?;
    let rows: Vec<_> = pairs
        .iter()
        .map(|pair| pair.map(u32::cast_signed))
        .collect();
    table(py, &rows)
}

/// The closest points by integer arithmetic alone, O(n) per point: for small inputs.
///
/// Arguments and errors as for build() and Structure.closest_points().
#[pyfunction]
#[pyo3(signature = (vertices, triangles, points, max_distance=None))]
fn exact_closest_points(
    py: Python<'_>,
    vertices: &Bound<'_, PyAny>,
    triangles: &Bound<'_, PyAny>,
    points: &Bound<'_, PyAny>,
    max_distance: Option<&Bound<'_, PyAny>>,
) -> PyResult<NearestPoints> {
    let _mode = DefaultMode::set(py)?;
    let vertices = arrays::points("vertices", vertices).map_err(raise)?;
    let indices = arrays::indices("triangles", triangles, vertices.len()).map_err(raise)?;
    let arguments = Arguments::new(points, "max_distance", max_distance).map_err(raise)?;
    let (points, limits) = (&arguments.points, arguments.distances.limits());
    let found = py
        .detach(|| {
            caught(|| {
                let scene = Triangles::new(vertices, indices)?;
                let each = points.iter().enumerate().map(|(i, &point)| {
                    let exact = exact_nearest(&scene, point, of(limits, i));
                    Nearest {
                        distance: exact.distance,
                        triangle: exact.triangle,
                        point: exact.point,
                    }
                });
                Ok(each.collect())
            })
        })
        .map_err(raise)?;
    Ok(NearestPoints(found))
}

/// Every pair of triangles of two scenes that have a point in common, by integer arithmetic alone: (k, 2) int32,
/// sorted. Compares all pairs: for small inputs.
///
/// Arguments and errors as for build(); triangles that are not finite have no pairs.
#[pyfunction]
#[pyo3(signature = (vertices, triangles, other_vertices, other_triangles))]
fn exact_overlaps<'py>(
    py: Python<'py>,
    vertices: &Bound<'_, PyAny>,
    triangles: &Bound<'_, PyAny>,
    other_vertices: &Bound<'_, PyAny>,
    other_triangles: &Bound<'_, PyAny>,
) -> PyResult<Bound<'py, PyArray2<i32>>> {
    let _mode = DefaultMode::set(py)?;
    let finite = |names: [&str; 2], arrays: [&Bound<'_, PyAny>; 2]| {
        let vertices = arrays::points(names[0], arrays[0])?;
        let indices = arrays::indices(names[1], arrays[1], vertices.len())?;
        let corners = indices.iter().map(|row| row.map(|v| vertices[v as usize]));
        let numbered = (0..).zip(corners);
        let all = numbered.filter(|(_, t)| t.as_flattened().iter().all(|x| x.is_finite()));
        Ok(all.collect::<Vec<(i32, _)>>())
    };
    let own = finite(["vertices", "triangles"], [vertices, triangles]).map_err(raise)?;
    let names = ["other_vertices", "other_triangles"];
    let others = finite(names, [other_vertices, other_triangles]).map_err(raise)?;
    let rows = py.detach(|| {
        let pairs = own.iter().flat_map(|(a, one)| {
            let met = others
                .iter()
                .filter(|(_, other)| exact_overlap(*one, *other));
            met.map(|(b, _)| [*a, *b])
        });
        pairs.collect::<Vec<_>>()
    });
    table(py, &rows)
}

/// Adds nearest triangles and overlaps to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<NearestPoints>()?;
    module.add_function(wrap_pyfunction!(exact_closest_points, module)?)?;
    module.add_function(wrap_pyfunction!(exact_overlaps, module)?)
}
