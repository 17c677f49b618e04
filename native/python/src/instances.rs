// SPDX-License-Identifier: GPL-3.0-or-later
//! Instances of structures.

use crate::args::arrays::{check_copy, converted, describe, elements};
use crate::args::integers::{MaxHits, MemoryLimit, Threads};
use crate::args::rays::RayArrays;
use crate::errors::raise;
use crate::float_mode::DefaultMode;
use crate::hits::Hits;
use crate::monitor::{self, Monitor};
use crate::selective::{self, MaskArrays};
use crate::structure::Structure;
use crate::trace::{self, CountedTracer};
use halfspace_base::error::{Error, Result, caught};
use halfspace_geom::Transform;
use halfspace_structure::instances;
use halfspace_structure::instances::nested::{self, Part};
use halfspace_structure::instances::top::Top;
use numpy::ndarray::ArrayView2;
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Arc;

/// Instances of meshes in two levels: a tree over the instances above the structures of the meshes. Immutable; any
/// number of threads may trace it at once.
///
/// Results equal bit for bit those of a structure over flattened(), and triangles have the same indices: first
/// those of instance 0, then those of instance 1 and so on.
#[pyclass(frozen, module = "halfspace_native")]
pub struct Instances(pub Arc<instances::Instances>);

#[pymethods]
impl Instances {
    /// Number of instances and of meshes, and the bytes of both levels.
    fn __repr__(&self) -> String {
        format!(
            "<Instances: {} of {} meshes, {} bytes>",
            self.0.len(),
            self.0.meshes().len(),
            self.0.bytes()
        )
    }

    /// Like Structure.closest(). Steps include those of the tree over the instances.
    #[pyo3(signature = (origins, directions, t_min=None, t_max=None, *, order="none", threads=Threads::ALL, counters=false, triangle_mask=None, ray_mask=None, monitor=None), text_signature = "($self, origins, directions, t_min=None, t_max=None, *, order='none', threads=0, counters=False, triangle_mask=None, ray_mask=None, monitor=None)")]
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
        triangle_mask: Option<&Bound<'_, PyAny>>,
        ray_mask: Option<&Bound<'_, PyAny>>,
        monitor: Option<&Monitor>,
    ) -> PyResult<Hits> {
        let _mode = DefaultMode::set(py)?;
        let rays = RayArrays::new(origins, directions, t_min, t_max, order).map_err(raise)?;
        let masks = MaskArrays::new(triangle_mask, ray_mask, counters).map_err(raise)?;
        if let Some(masks) = masks {
            return selective::closest(py, &*self.0, &rays, threads, &masks, monitor);
        }
        trace::closest(py, self.counted(), &rays, threads, counters, monitor)
    }

    /// Like Structure.occluded().
    #[pyo3(signature = (origins, directions, t_min=None, t_max=None, *, order="none", threads=Threads::ALL, counters=false, triangle_mask=None, ray_mask=None, monitor=None), text_signature = "($self, origins, directions, t_min=None, t_max=None, *, order='none', threads=0, counters=False, triangle_mask=None, ray_mask=None, monitor=None)")]
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
        triangle_mask: Option<&Bound<'_, PyAny>>,
        ray_mask: Option<&Bound<'_, PyAny>>,
        monitor: Option<&Monitor>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let _mode = DefaultMode::set(py)?;
        let rays = RayArrays::new(origins, directions, t_min, t_max, order).map_err(raise)?;
        let masks = MaskArrays::new(triangle_mask, ray_mask, counters).map_err(raise)?;
        if let Some(masks) = masks {
            return selective::occluded(py, &*self.0, &rays, threads, &masks, monitor);
        }
        trace::occluded(py, self.counted(), &rays, threads, counters, monitor)
    }

    /// Like Structure.all_hits().
    #[pyo3(signature = (origins, directions, t_min=None, t_max=None, *, max_hits=None, threads=Threads::ALL, monitor=None), text_signature = "($self, origins, directions, t_min=None, t_max=None, *, max_hits=None, threads=0, monitor=None)")]
    #[expect(clippy::too_many_arguments, reason = "Python keywords")]
    fn all_hits<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'_, PyAny>,
        directions: &Bound<'_, PyAny>,
        t_min: Option<&Bound<'_, PyAny>>,
        t_max: Option<&Bound<'_, PyAny>>,
        max_hits: Option<MaxHits>,
        threads: Threads,
        monitor: Option<&Monitor>,
    ) -> PyResult<(Bound<'py, PyArray1<i64>>, Hits)> {
        let rays = RayArrays::new(origins, directions, t_min, t_max, "none").map_err(raise)?;
        selective::all_hits(py, &*self.0, &rays, threads, max_hits, monitor)
    }

    /// Like Structure.count_hits().
    #[pyo3(signature = (origins, directions, t_min=None, t_max=None, *, threads=Threads::ALL, monitor=None), text_signature = "($self, origins, directions, t_min=None, t_max=None, *, threads=0, monitor=None)")]
    #[expect(clippy::too_many_arguments, reason = "Python keywords")]
    fn count_hits<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'_, PyAny>,
        directions: &Bound<'_, PyAny>,
        t_min: Option<&Bound<'_, PyAny>>,
        t_max: Option<&Bound<'_, PyAny>>,
        threads: Threads,
        monitor: Option<&Monitor>,
    ) -> PyResult<Bound<'py, PyArray1<i64>>> {
        let rays = RayArrays::new(origins, directions, t_min, t_max, "none").map_err(raise)?;
        selective::count_hits(py, &*self.0, &rays, threads, monitor)
    }

    /// Number of instances, including dropped ones.
    fn __len__(&self) -> usize {
        self.0.len()
    }

    /// Statistics of the build and of the meshes.
    #[getter]
    fn statistics<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        use halfspace_ray::Tracer;
        let all = &*self.0;
        let mesh_bytes: usize = all.meshes().iter().map(|mesh| mesh.bytes()).sum();
        let dict = PyDict::new(py);
        dict.set_item("build_seconds", all.build_seconds())?;
        dict.set_item("bytes", mesh_bytes + all.bytes())?;
        dict.set_item("bytes_instances", all.bytes())?;
        dict.set_item("nodes_axis", all.nodes())?;
        dict.set_item("instances", all.len())?;
        dict.set_item("top", all.top().name())?;
        dict.set_item("meshes", all.meshes().len())?;
        dict.set_item("triangles", all.count())?;
        dict.set_item("copied_instances", all.copied())?;
        dict.set_item("dropped_instances", all.dropped().collect::<Vec<_>>())?;
        let dropped: usize = (all.places().iter())
            .map(|place| all.meshes()[place.mesh as usize].scene().dropped())
            .sum();
        dict.set_item("dropped_triangles", dropped)?;
        // Collect what the meshes leave out, without repetitions.
        let mut left_out = Vec::<String>::new();
        for mesh in all.meshes() {
            for line in mesh.left_out() {
                if !left_out.contains(&line) {
                    left_out.push(line);
                }
            }
        }
        dict.set_item("left_out", left_out)?;
        Ok(dict)
    }

    /// Vertices (n, 3) and triangles (m, 3) of the scene with all instances copied: a vertex becomes x * m[0] + y *
    /// m[1] + z * m[2] + m[3] for each row m of the matrix, in float64 and in this order, then rounded to float32.
    /// Mirrored instances swap the second and third corner of each triangle. Dropped instances have NaN vertices.
    /// Raises MemoryError.
    fn flattened<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let _mode = DefaultMode::set(py)?;
        let flattened = || {
            let (vertices, triangles) = self.0.flattened()?;
            let corners = triangles.into_iter().flatten().map(u32::cast_signed);
            let corners: Vec<i32> = corners.collect();
            Ok((vertices.into_flattened(), corners))
        };
        let (vertices, triangles) = py.detach(flattened).map_err(raise)?;
        let rows = |array: Bound<'py, PyAny>| array.call_method1("reshape", ((-1, 3),));
        Ok((
            rows(vertices.into_pyarray(py).into_any())?,
            rows(triangles.into_pyarray(py).into_any())?,
        ))
    }
}

impl Instances {
    /// The instances as a tracer without counters of its own.
    fn counted(&self) -> CountedTracer<'_> {
        CountedTracer {
            tracer: &*self.0,
            cases: &[],
        }
    }
}

/// Reads transforms from a (k, 4, 4) or (k, 3, 4) array of float64.
fn transforms(value: &Bound<'_, PyAny>) -> Result<Vec<Transform>> {
    // Check type and shape; the last row of a (4, 4) matrix is ignored.
    let wrong = || {
        Error::Shape(format!(
            "matrices: expected a (k, 4, 4) or (k, 3, 4) float64 array, got {}",
            describe(value)
        ))
    };
    let array: PyReadonlyArray3<'_, f64> = value.extract().map_err(|_| wrong())?;
    if !matches!(array.shape()[1..], [3 | 4, 4]) {
        return Err(wrong());
    }
    check_copy("matrices", &*array, size_of::<f64>())?;
    let view = array.as_array();
    let row = |m: &ArrayView2<'_, f64>, i: usize| [0, 1, 2, 3].map(|j| m[[i, j]]);
    let of = |m: ArrayView2<'_, f64>| Transform::from_rows([0, 1, 2].map(|i| row(&m, i)));
    Ok(converted(value.py(), view.len(), || {
        view.outer_iter().map(of).collect()
    }))
}

/// Builds a tree over instances; the structures of the meshes are shared, not copied.
///
/// structures: of the meshes, in mesh space, whose configurations may differ; in place of one, Instances are placed as a
/// whole, each as an instance of its mesh with the product of the matrices. mesh: (k,) int32, the index of what each
/// instance places. An instance so far from the origin that its vertices are rounded coarsely in the scene has a
/// structure of its own. Meshes are numbered part after part, for RenderScene too. matrices: (k, 4, 4) or (k, 3, 4)
/// float64, mesh to scene. top: how the tree over the instances is partitioned: "sah" by the surface area heuristic,
/// "grid" by a regular grid as in bih, "middle" or "median" along the longest side. threads, monitor, memory_limit: as
/// for build().
/// Instances whose matrix is singular, not finite or out of the range of float32 are dropped and listed in the
/// statistics. Raises ShapeError (also for more than 2**31 - 2 triangles), SpecError, Cancelled, MemoryError.
#[pyfunction]
#[pyo3(signature = (structures, mesh, matrices, *, top="sah", threads=Threads::ALL, monitor=None, memory_limit=None), text_signature = "(structures, mesh, matrices, *, top='sah', threads=0, monitor=None, memory_limit=None)")]
#[pyo3(name = "build_instances")]
#[expect(clippy::too_many_arguments, reason = "Python keywords")]
fn build(
    py: Python<'_>,
    structures: Vec<Bound<'_, PyAny>>,
    mesh: &Bound<'_, PyAny>,
    matrices: &Bound<'_, PyAny>,
    top: &str,
    threads: Threads,
    monitor: Option<&Monitor>,
    memory_limit: Option<MemoryLimit>,
) -> PyResult<Instances> {
    let _mode = DefaultMode::set(py)?;
    // Convert the arguments to what the build takes.
    let limit = monitor::memory_limit(memory_limit);
    let top = named_top(top).map_err(raise)?;
    let parts = (structures.iter().map(part).collect::<Result<Vec<_>>>()).map_err(raise)?;
    let numbers: PyReadonlyArray1<'_, i32> = mesh
        .extract()
        .map_err(|_| {
            Error::Shape(format!(
                "mesh: expected a (k,) int32 array, got {}",
                describe(mesh)
            ))
        })
        .map_err(raise)?;
    let transforms = transforms(matrices).map_err(raise)?;
    if numbers.len() != transforms.len() {
        return Err(raise(Error::Shape(format!(
            "matrices: expected one per instance, {}, got {}",
            numbers.len(),
            transforms.len()
        ))));
    }
    let instances: Vec<_> = (elements(&numbers).into_iter().zip(transforms))
        .map(|(mesh, transform)| instances::Instance {
            // A negative index becomes a huge one, which the build reports as out of range.
            mesh: mesh.cast_unsigned(),
            transform,
        })
        .collect();
    // Build on a pool of its own, without the GIL; a panic becomes an error.
    let monitor = monitor::with_limit(monitor, limit);
    let built = py
        .detach(|| {
            caught(|| {
                let pool = rayon::ThreadPoolBuilder::new()
                    .num_threads(threads.0)
                    .build()
                    .map_err(|e| Error::Memory(format!("threads: {e}")))?;
                let (meshes, expanded) = nested::expand(&parts, &instances)?;
                pool.install(|| instances::Instances::build_with(top, meshes, &expanded, &monitor))
            })
        })
        .map_err(raise)?;
    Ok(Instances(Arc::new(built)))
}

/// Returns the way of this name to build the tree over instances.
fn named_top(name: &str) -> Result<Top> {
    Top::of(name).ok_or_else(|| {
        let names = Top::NAMED.map(|(name, _)| name).join(", ");
        Error::Spec(format!("top: expected one of {names}, got {name}"))
    })
}

/// Reads a structure, or instances that are placed as one.
fn part(value: &Bound<'_, PyAny>) -> Result<Part> {
    if let Ok(group) = value.cast::<Instances>() {
        return Ok(Part::Group(Arc::clone(&group.get().0)));
    }
    let structure = value.cast::<Structure>().map_err(|_| {
        Error::Shape(format!(
            "structures: expected Structures or Instances, got {}",
            describe(value)
        ))
    })?;
    Ok(Part::Mesh(Arc::clone(&structure.get().0)))
}

/// Adds instances to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Instances>()?;
    module.add_function(wrap_pyfunction!(build, module)?)
}
