// SPDX-License-Identifier: GPL-3.0-or-later
//! The Python module `halfspace_peers`: other people's ray tracers with one interface, for the benchmark.
//!
//! A tracer is a type with [`Tracer`], and a row of [`peers`]. Its rays are converted to its own form by a call of its
//! own, so that a timed call only traces.

mod embree;
mod peers;

use std::any::Any;

use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;

/// A ray: origin, direction of any length but 0, and the end of its interval in lengths of the direction.
#[derive(Clone, Copy)]
pub struct Ray {
    /// Where the interval begins.
    pub origin: [f32; 3],
    /// Towards where it goes.
    pub direction: [f32; 3],
    /// Where the interval ends; may be infinite.
    pub t_max: f32,
}

/// A hit: distance in lengths of the direction, triangle, and the barycentric weights of its second and third vertex,
/// which are 0 where a tracer reports none.
#[derive(Clone, Copy)]
pub struct Hit {
    /// Infinite for a miss.
    pub t: f32,
    /// `NONE` for a miss.
    pub triangle: u32,
    /// The weight of the second vertex.
    pub u: f32,
    /// The weight of the third vertex.
    pub v: f32,
}

/// The triangle of a miss.
pub const NONE: u32 = u32::MAX;

/// The answer to a ray that hits nothing.
pub const MISS: Hit = Hit {
    t: f32::INFINITY,
    triangle: NONE,
    u: 0.0,
    v: 0.0,
};

/// The triangles of a scene.
pub struct Mesh {
    /// Positions.
    pub vertices: Vec<[f32; 3]>,
    /// Indices of three positions each.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// The corners of all triangles.
    pub fn corners(&self) -> impl Iterator<Item = [[f32; 3]; 3]> + '_ {
        self.triangles
            .iter()
            .map(|triangle| triangle.map(|vertex| self.vertices[vertex as usize]))
    }
}

/// A ray tracer of triangles.
pub trait Tracer: Sized + Send + Sync + 'static {
    /// Rays as the tracer takes them.
    type Rays: Send + Sync + 'static;

    /// Builds its structure.
    ///
    /// # Errors
    ///
    /// The tracer's own words.
    fn build(mesh: Mesh) -> Result<Self, String>;

    /// Converts rays.
    fn rays(rays: &[Ray]) -> Self::Rays;

    /// The nearest hit of each ray.
    fn closest(&self, rays: &Self::Rays) -> Vec<Hit>;

    /// Whether each ray hits anything.
    fn occluded(&self, rays: &Self::Rays) -> Vec<bool>;
}

/// A tracer without its type.
trait AnyTracer: Send + Sync {
    fn rays(&self, rays: &[Ray]) -> Box<dyn Any + Send + Sync>;
    fn closest(&self, rays: &(dyn Any + Send + Sync)) -> Option<Vec<Hit>>;
    fn occluded(&self, rays: &(dyn Any + Send + Sync)) -> Option<Vec<bool>>;
}

impl<T: Tracer> AnyTracer for T {
    fn rays(&self, rays: &[Ray]) -> Box<dyn Any + Send + Sync> {
        Box::new(T::rays(rays))
    }

    fn closest(&self, rays: &(dyn Any + Send + Sync)) -> Option<Vec<Hit>> {
        rays.downcast_ref().map(|rays| Tracer::closest(self, rays))
    }

    fn occluded(&self, rays: &(dyn Any + Send + Sync)) -> Option<Vec<bool>> {
        rays.downcast_ref().map(|rays| Tracer::occluded(self, rays))
    }
}

/// A row: name, what it is, and how it is built.
struct Row(
    &'static str,
    &'static str,
    fn(Mesh) -> Result<Box<dyn AnyTracer>, String>,
);

/// Builds a tracer and forgets its type.
fn built<T: Tracer>(mesh: Mesh) -> Result<Box<dyn AnyTracer>, String> {
    Ok(Box::new(T::build(mesh)?))
}

/// All tracers.
static ROWS: &[Row] = &[
    Row(
        "tinybvh-bvh",
        "tinybvh 1.6, binary, binned",
        built::<peers::TinyBinary>,
    ),
    #[cfg(target_feature = "avx2")]
    Row(
        "tinybvh-bvh8",
        "tinybvh 1.6, eight children, binned",
        built::<peers::TinyWide<false>>,
    ),
    #[cfg(target_feature = "avx2")]
    Row(
        "tinybvh-bvh8-splits",
        "tinybvh 1.6, eight children, spatial splits",
        built::<peers::TinyWide<true>>,
    ),
    Row(
        "obvhs-bvh2",
        "obvhs 0.4, binary, slow build",
        built::<peers::ObvhsBinary>,
    ),
    Row(
        "obvhs-cwbvh",
        "obvhs 0.4, eight compressed children, slow build",
        built::<peers::ObvhsWide>,
    ),
    Row(
        "bvh-rs",
        "bvh 0.13, binary, binned",
        built::<peers::BvhCrate>,
    ),
    Row("parry", "parry3d 0.31", built::<peers::Parry>),
    Row(
        "embree-packets",
        "Embree, packets of 8, robust",
        built::<embree::Packets<false>>,
    ),
    Row(
        "embree-best",
        "Embree, packets of 8, high-quality build, not robust",
        built::<embree::Packets<true>>,
    ),
];

/// Name and description of each tracer.
#[pyfunction]
fn names() -> Vec<(&'static str, &'static str)> {
    ROWS.iter().map(|row| (row.0, row.1)).collect()
}

/// The path of the library of Embree 4 that the tracers of Embree open.
#[pyfunction]
fn use_embree(path: &str) -> PyResult<()> {
    embree::open(path).map_err(PyRuntimeError::new_err)
}

/// A structure of a tracer over triangles.
#[pyclass(frozen)]
struct Structure(Box<dyn AnyTracer>);

/// Rays in the form of one tracer.
#[pyclass(frozen)]
struct Rays(Box<dyn Any + Send + Sync>);

/// Build the tracer `name` over (n, 3) float32 vertices and (m, 3) int32 triangles. Raises ValueError for an unknown
/// name or an index that is not one of a vertex, RuntimeError if the tracer refuses the scene.
#[pyfunction]
fn build(
    py: Python<'_>,
    name: &str,
    vertices: PyReadonlyArray2<'_, f32>,
    triangles: PyReadonlyArray2<'_, i32>,
) -> PyResult<Structure> {
    let row = ROWS.iter().find(|row| row.0 == name);
    let row = row.ok_or_else(|| PyValueError::new_err(format!("no peer is called {name}")))?;
    let vertices = triples(&vertices)?;
    let indices = triples(&triangles)?;
    let within = |index: i32| {
        u32::try_from(index)
            .ok()
            .filter(|&index| (index as usize) < vertices.len())
    };
    let triangles: Option<Vec<_>> = indices
        .iter()
        .map(|t| Some([within(t[0])?, within(t[1])?, within(t[2])?]))
        .collect();
    let triangles = triangles
        .ok_or_else(|| PyValueError::new_err("triangles: an index is not one of a vertex"))?;
    let made = py.detach(|| {
        (row.2)(Mesh {
            vertices,
            triangles,
        })
    });
    made.map(Structure).map_err(PyRuntimeError::new_err)
}

/// Runs a tracer without the GIL. Raises RuntimeError where it panics.
fn guarded<T: Send>(py: Python<'_>, run: impl FnOnce() -> T + Send) -> PyResult<T> {
    let run = std::panic::AssertUnwindSafe(run);
    py.detach(|| std::panic::catch_unwind(run))
        .map_err(|_| PyRuntimeError::new_err("the tracer panicked"))
}

/// The rows of an (n, 3) array.
fn triples<T: numpy::Element + Copy>(array: &PyReadonlyArray2<'_, T>) -> PyResult<Vec<[T; 3]>> {
    let view = array.as_array();
    if view.ncols() != 3 {
        return Err(PyValueError::new_err("an array of shape (n, 3) is needed"));
    }
    Ok(view
        .rows()
        .into_iter()
        .map(|row| [row[0], row[1], row[2]])
        .collect())
}

type Arrays<'py> = (
    Bound<'py, PyArray1<f32>>,
    Bound<'py, PyArray1<i32>>,
    Bound<'py, PyArray1<f32>>,
    Bound<'py, PyArray1<f32>>,
);

#[pymethods]
impl Structure {
    /// Convert (n, 3) origins, (n, 3) directions and (n,) ends of the rays' intervals, all float32.
    fn rays(
        &self,
        origins: PyReadonlyArray2<'_, f32>,
        directions: PyReadonlyArray2<'_, f32>,
        t_max: PyReadonlyArray1<'_, f32>,
    ) -> PyResult<Rays> {
        let (origins, directions) = (triples(&origins)?, triples(&directions)?);
        let ends = t_max.as_array();
        if origins.len() != directions.len() || origins.len() != ends.len() {
            return Err(PyValueError::new_err(
                "origins, directions and t_max differ in length",
            ));
        }
        let bad = |d: &[f32; 3]| d == &[0.0; 3] || d.iter().any(|x| !x.is_finite());
        if directions.iter().any(bad) || origins.iter().flatten().any(|x| !x.is_finite()) {
            return Err(PyValueError::new_err(
                "rays are finite, with directions other than 0",
            ));
        }
        let all = origins.into_iter().zip(directions).zip(ends);
        let rays: Vec<_> = all
            .map(|((origin, direction), &t_max)| Ray {
                origin,
                direction,
                t_max,
            })
            .collect();
        Ok(Rays(self.0.rays(&rays)))
    }

    /// Distances (inf for a miss), triangles (-1 for a miss) and weights of the second and third vertices.
    fn closest<'py>(&self, py: Python<'py>, rays: &Rays) -> PyResult<Arrays<'py>> {
        let hits = guarded(py, || self.0.closest(&*rays.0))?.ok_or_else(foreign)?;
        let column = |of: fn(&Hit) -> f32| hits.iter().map(of).collect::<Vec<_>>().into_pyarray(py);
        let triangles: Vec<_> = hits.iter().map(|hit| hit.triangle.cast_signed()).collect();
        Ok((
            column(|hit| hit.t),
            triangles.into_pyarray(py),
            column(|hit| hit.u),
            column(|hit| hit.v),
        ))
    }

    /// Whether each ray hits anything.
    fn occluded<'py>(&self, py: Python<'py>, rays: &Rays) -> PyResult<Bound<'py, PyArray1<bool>>> {
        Ok(py
            .detach(|| self.0.occluded(&*rays.0))
            .ok_or_else(foreign)?
            .into_pyarray(py))
    }

    /// Trace the nearest hits and drop them: what is timed.
    fn trace_closest(&self, py: Python<'_>, rays: &Rays) -> PyResult<usize> {
        Ok(py
            .detach(|| self.0.closest(&*rays.0))
            .ok_or_else(foreign)?
            .len())
    }
}

/// The error of rays that another tracer has converted.
fn foreign() -> PyErr {
    PyValueError::new_err("these rays were converted for another tracer")
}

#[pymodule]
fn halfspace_peers(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(names, module)?)?;
    module.add_function(wrap_pyfunction!(use_embree, module)?)?;
    module.add_function(wrap_pyfunction!(build, module)?)?;
    module.add_class::<Structure>()?;
    module.add_class::<Rays>()
}
