// SPDX-License-Identifier: GPL-3.0-or-later
//! Building, statistics, validation, what there is to see.

use super::arrays::{self, Threads};
use super::seeing;
use super::trace::{self, Hits};
use crate::build::Monitor as BuildMonitor;
use crate::error::{Error, Result, caught};
use crate::memory;
use crate::scene::Triangles;
use crate::spec::Config;
use crate::structure;
use crate::traverse::{Ray, replay};
use crate::validate;
use numpy::{PyArray1, ToPyArray};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Arc;

/// Progress and cancellation of a build.
#[pyclass(frozen)]
pub struct Monitor(pub Arc<BuildMonitor>);

#[pymethods]
impl Monitor {
    #[new]
    fn new() -> Self {
        Self(Arc::new(BuildMonitor::new()))
    }

    #[getter]
    fn progress(&self) -> f64 {
        self.0.progress()
    }

    #[getter]
    fn cancelled(&self) -> bool {
        self.0.is_cancelled()
    }

    fn cancel(&self) {
        self.0.cancel();
    }
}

/// Rays whose walks through a structure were recorded.
#[pyclass(frozen)]
pub struct Recording {
    structure: Arc<structure::Structure>,
    recording: replay::Recording,
}

#[pymethods]
impl Recording {
    #[getter]
    fn counters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        trace::counters(py, self.structure.cases(), &self.recording.counters)
    }

    fn replay<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let (seconds, strayed) = py.detach(|| self.structure.replay(&self.recording));
        if strayed > 0 {
            return Err(PyRuntimeError::new_err(format!(
                "{strayed} rays did not visit the leaves that were recorded"
            )));
        }
        Ok(seconds.to_pyarray(py))
    }

    fn __len__(&self) -> usize {
        self.recording.rays.len()
    }
}

/// A built structure.
#[pyclass(frozen, weakref)]
pub struct Structure(pub Arc<structure::Structure>);

#[pymethods]
impl Structure {
    #[getter]
    fn spec(&self) -> String {
        self.0.config().canonical()
    }

    #[pyo3(signature = (origins, directions, t_min=None, t_max=None, *, order="none", threads=Threads::ALL, counters=false))]
    #[expect(clippy::too_many_arguments, reason = "Python keywords")]
    fn closest(
        &self,
        py: Python<'_>,
        origins: &Bound<'_, PyAny>,
        directions: &Bound<'_, PyAny>,
        t_min: Option<&Bound<'_, PyAny>>,
        t_max: Option<&Bound<'_, PyAny>>,
        order: &str,
        threads: Threads,
        counters: bool,
    ) -> PyResult<Hits> {
        let arguments = trace::RayArrays::new(origins, directions, t_min, t_max, order)?;
        let rays = arguments.rays();
        let tracer = (&*self.0, self.0.cases());
        Ok(py.detach(|| trace::closest((tracer.0, tracer.1), rays, threads.0, counters))?)
    }

    #[pyo3(signature = (origins, directions, t_min=None, t_max=None, *, order="none", threads=Threads::ALL, counters=false))]
    #[expect(clippy::too_many_arguments, reason = "Python keywords")]
    fn occluded<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'_, PyAny>,
        directions: &Bound<'_, PyAny>,
        t_min: Option<&Bound<'_, PyAny>>,
        t_max: Option<&Bound<'_, PyAny>>,
        order: &str,
        threads: Threads,
        counters: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let arguments = trace::RayArrays::new(origins, directions, t_min, t_max, order)?;
        let rays = arguments.rays();
        let (occluded, counts) =
            py.detach(|| trace::occluded(&*self.0, rays, threads.0, counters))?;
        trace::occluded_answer(py, &occluded, counts, self.0.cases())
    }

    #[pyo3(signature = (origins, directions, t_min=None, t_max=None, *, any_hit=false))]
    fn record(
        &self,
        py: Python<'_>,
        origins: &Bound<'_, PyAny>,
        directions: &Bound<'_, PyAny>,
        t_min: Option<&Bound<'_, PyAny>>,
        t_max: Option<&Bound<'_, PyAny>>,
        any_hit: bool,
    ) -> PyResult<Recording> {
        let arguments = trace::RayArrays::new(origins, directions, t_min, t_max, "none")?;
        let rays = arguments.rays().all();
        let recording = py.detach(|| self.0.record(rays, any_hit))?;
        Ok(Recording {
            structure: self.0.clone(),
            recording,
        })
    }

    #[getter]
    fn statistics<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        let progress = self.0.progress();
        let shape = progress.shape;
        dict.set_item("build_seconds", self.0.build_seconds())?;
        dict.set_item("bytes", self.0.bytes())?;
        dict.set_item("nodes_axis", shape.nodes_axis)?;
        dict.set_item("nodes_oblique", shape.nodes_oblique)?;
        dict.set_item("leaves", shape.leaves)?;
        dict.set_item("leaves_empty", shape.leaves_empty)?;
        dict.set_item("leaf_max", shape.leaf_max)?;
        dict.set_item("leaves_large", shape.leaves_large)?;
        dict.set_item("references", shape.references)?;
        dict.set_item("links", shape.links)?;
        dict.set_item("depth_max", shape.depth_max)?;
        dict.set_item("depth_mean", shape.depth_mean)?;
        dict.set_item("sah_cost", shape.sah_cost)?;
        dict.set_item("parts_built", progress.built)?;
        dict.set_item("parts_waiting", progress.waiting)?;
        dict.set_item("left_out", self.0.left_out())?;
        dict.set_item("dropped_triangles", self.0.scene().dropped())?;
        Ok(dict)
    }

    fn validate(&self, py: Python<'_>) -> Vec<String> {
        py.detach(|| validate::validate(&self.0))
    }

    #[pyo3(signature = (max_depth=60, max_count=20_000))]
    fn split_polygons<'py>(
        &self,
        py: Python<'py>,
        max_depth: usize,
        max_count: usize,
    ) -> PyResult<Bound<'py, PyDict>> {
        seeing::planes(py, &self.0, max_depth, max_count)
    }

    #[pyo3(signature = (min_triangles=1, max_count=20_000))]
    fn leaf_cells<'py>(
        &self,
        py: Python<'py>,
        min_triangles: usize,
        max_count: usize,
    ) -> PyResult<Bound<'py, PyDict>> {
        seeing::cells(py, &self.0, min_triangles, max_count)
    }

    #[pyo3(signature = (origin, direction, t_min=0.0, t_max=f32::INFINITY))]
    fn trace_path<'py>(
        &self,
        py: Python<'py>,
        origin: [f32; 3],
        direction: [f32; 3],
        t_min: f32,
        t_max: f32,
    ) -> PyResult<Bound<'py, PyDict>> {
        arrays::check_finite("origin", &[origin])?;
        arrays::check_finite("direction", &[direction])?;
        let ray = Ray {
            o: origin,
            d: direction,
            t_min,
            t_max,
        };
        seeing::path(py, &self.0, &ray)
    }
}

/// Bytes that a build may take.
pub fn memory_limit(bytes: Option<i64>) -> Result<u64> {
    match bytes.map(u64::try_from) {
        None => Ok(memory::default_limit()),
        Some(Ok(bytes)) => Ok(bytes),
        Some(Err(_)) => Err(Error::Spec(
            "memory_limit: expected a number of bytes of at least 0".to_owned(),
        )),
    }
}

#[pyfunction]
#[pyo3(signature = (vertices, triangles, spec="kd", *, threads=Threads::ALL, monitor=None, memory_limit=None))]
fn build(
    py: Python<'_>,
    vertices: &Bound<'_, PyAny>,
    triangles: &Bound<'_, PyAny>,
    spec: &str,
    threads: Threads,
    monitor: Option<&Monitor>,
    memory_limit: Option<i64>,
) -> PyResult<Structure> {
    let limit = self::memory_limit(memory_limit)?;
    let config = Config::parse(spec)?;
    let vertices = arrays::points("vertices", vertices)?;
    let indices = arrays::indices("triangles", triangles, vertices.len())?;
    let monitor = monitor.map_or_else(|| Arc::new(BuildMonitor::new()), |m| m.0.clone());
    monitor.limit_memory(limit);
    let built = py.detach(|| {
        caught(|| {
            let scene = Arc::new(Triangles::new(vertices, indices)?);
            structure::Structure::build(scene, config, threads.0, &monitor)
        })
    })?;
    Ok(Structure(Arc::new(built)))
}

/// Adds building to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Monitor>()?;
    module.add_class::<Structure>()?;
    module.add_class::<Recording>()?;
    module.add_function(wrap_pyfunction!(build, module)?)
}
