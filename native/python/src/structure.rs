// SPDX-License-Identifier: GPL-3.0-or-later
//! Structures: building, tracing, statistics, validation, inspection.

use crate::args::arrays;
use crate::args::integers::{
    MaxCount, MaxDepth, MaxHits, MaxNodes, MemoryLimit, MinTriangles, Threads,
};
use crate::args::rays::RayArrays;
use crate::errors::raise;
use crate::float_mode::DefaultMode;
use crate::hits::Hits;
use crate::monitor::{self, Monitor};
use crate::proximity::{self, LazySurface, NearestPoints};
use crate::recording::Recording;
use crate::selective::{self, MaskArrays};
use crate::trace::{self, CountedTracer};
use crate::{analysis, beam_path, inspection, ray_path};
use halfspace_base::error::{Error, caught};
use halfspace_inspect::validate;
use halfspace_nearest::Surface;
use halfspace_ray::Ray;
use halfspace_scene::Triangles;
use halfspace_structure::structure;
use halfspace_trees::registry;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Arc;

/// A structure built over triangles. Immutable; any number of threads may trace rays through it.
#[pyclass(frozen, weakref, module = "halfspace_native")]
pub struct Structure(pub Arc<structure::Structure>, LazySurface);

#[pymethods]
impl Structure {
    /// Specification, triangles and bytes.
    fn __repr__(&self) -> String {
        format!(
            "<Structure {}: {} triangles, {} bytes>",
            self.0.config().canonical(),
            self.0.scene().live().len(),
            self.0.bytes()
        )
    }

    /// The configuration, with only what differs from the defaults.
    #[getter]
    fn spec(&self) -> String {
        self.0.config().canonical()
    }

    /// Name of the traversal of single rays, which counters count where rays are traced together but not counted
    /// together.
    #[getter]
    fn counted_as(&self) -> &'static str {
        self.0.counted_as()
    }

    /// Which kernel answers each kind of batch: "single", "closest", "tiles" (rays with order="tile8"), "shadow".
    ///
    /// Each is a dictionary: "nodes", what rays are tested against; "rays", how they go together; "counted", whether
    /// counters are those of this kernel, and not of single rays.
    #[getter]
    fn routes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        for route in self.0.routes() {
            let entry = PyDict::new(py);
            entry.set_item("nodes", route.nodes)?;
            entry.set_item("rays", route.rays.name())?;
            entry.set_item("counted", route.counted)?;
            dict.set_item(route.batch, entry)?;
        }
        Ok(dict)
    }

    /// The nearest triangle that each ray hits; the same bits for every structure.
    ///
    /// origins, directions: (n, 3), scene frame; directions of any length, a zero direction hits
    /// nothing. t_min, t_max: the closed interval that counts, in units of the direction, one
    /// number or (n,), negative behind the origin; 0 and inf when not given. A hit whose distance
    /// overflows float32 is a miss. order: "tile8" promises that every 64 consecutive
    /// rays are an 8x8-pixel tile. threads: 0 = one per core.
    /// triangle_mask: (m,) uint32, ray_mask: one number or (n,) uint32, all bits when not given: a ray meets only the
    /// triangles with which it shares a bit. Such rays are traced singly, and are not counted.
    /// monitor: to cancel the call, read between slices of at most 1024 rays; counted rays are traced in whole batches.
    /// It counts no progress.
    /// Raises ShapeError, NonFiniteError (NaN or infinite rays, found as they are traced; NaN distances), SpecError
    /// (order; counters with masks), Cancelled.
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

    /// Whether each ray hits anything at all: (n,) bool; with counters=True a pair of that
    /// and the counters of Hits. Arguments and errors as for closest().
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

    /// Every triangle that each ray hits, nearest first; of equal distances, the smallest index first. The same for
    /// every structure, to the bit.
    ///
    /// Returns (offsets, hits): offsets, (n + 1,) int64, where the hits of each ray begin, and the number of all hits;
    /// hits, those of one ray after another. max_hits: largest number of hits of a ray, the nearest; None = no limit.
    /// Rays are traced singly. Other arguments and errors as for closest(); MemoryError if the hits do not fit.
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

    /// The number of triangles that each ray hits: (n,) int64. Arguments and errors as for closest().
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

    /// The point of the triangles that is closest to each point, and its triangle. Exact: integers decide where f64 cannot.
    ///
    /// points: (n, 3). max_distance: one number or (n,), only triangles at most that far away count; None = inf. Triangles
    /// without area count as segments or points, those that are not finite do not count. The first call copies the nodes.
    /// monitor: to cancel the queries.
    /// Raises ShapeError, NonFiniteError; SpecError unless the structure is a "bvh-sah"; Cancelled; MemoryError.
    #[pyo3(signature = (points, max_distance=None, *, threads=Threads::ALL, monitor=None), text_signature = "($self, points, max_distance=None, *, threads=0, monitor=None)")]
    fn closest_points(
        &self,
        py: Python<'_>,
        points: &Bound<'_, PyAny>,
        max_distance: Option<&Bound<'_, PyAny>>,
        threads: Threads,
        monitor: Option<&Monitor>,
    ) -> PyResult<NearestPoints> {
        let work = monitor::work(threads, monitor);
        proximity::closest_points(py, self.surface(py)?, points, max_distance, work)
    }

    /// Every triangle at most `radius` away from each point, nearest first; of equal distances, the smallest index first.
    ///
    /// radius: one number or (n,). Returns (offsets, found): offsets, (n + 1,) int64, where the triangles of each point
    /// begin, and the number of all; found, those of one point after another. Other arguments and errors as for
    /// closest_points().
    #[pyo3(signature = (points, radius, *, threads=Threads::ALL, monitor=None), text_signature = "($self, points, radius, *, threads=0, monitor=None)")]
    fn points_within<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'_, PyAny>,
        radius: &Bound<'_, PyAny>,
        threads: Threads,
        monitor: Option<&Monitor>,
    ) -> PyResult<(Bound<'py, PyArray1<i64>>, NearestPoints)> {
        let work = monitor::work(threads, monitor);
        proximity::points_within(py, self.surface(py)?, points, radius, work)
    }

    /// Every pair of a triangle of this structure and one of the other that have a point in common: (k, 2) int32, sorted.
    /// Exact: triangles that touch in a vertex are a pair.
    ///
    /// With the structure itself, pairs are of different triangles that share no edge; those that share a vertex have a
    /// further point in common. Each is found in both orders. Errors as for closest_points().
    #[pyo3(signature = (other, *, threads=Threads::ALL, monitor=None), text_signature = "($self, other, *, threads=0, monitor=None)")]
    fn overlaps<'py>(
        &self,
        py: Python<'py>,
        other: &Self,
        threads: Threads,
        monitor: Option<&Monitor>,
    ) -> PyResult<Bound<'py, PyArray2<i32>>> {
        let work = monitor::work(threads, monitor);
        proximity::overlaps(py, self.surface(py)?, other.surface(py)?, work)
    }

    /// Returns a new structure, fitted to moved vertices: the same nodes around the triangles where they are now.
    /// Its answers are those of a structure built anew, which takes longer.
    ///
    /// vertices: (n, 3), those of build() in their order; triangles that they leave without area or not finite are not
    /// hit until they can be again. triangles: those of build(), to have them compared; None = not compared.
    /// threads: 0 = one per core. monitor: to cancel the fit; it counts no progress. statistics has the cost now and at
    /// the build: rays take longer in the proportion.
    /// Raises RefitError unless the structure is one of boxes ("bvh-sah") or intervals ("bih" and those like it), and
    /// where a triangle can be hit that could not be when the structure was built; ShapeError for other numbers of
    /// vertices and for other triangles; Cancelled; MemoryError.
    #[pyo3(signature = (vertices, triangles=None, *, threads=Threads::ALL, monitor=None), text_signature = "($self, vertices, triangles=None, *, threads=0, monitor=None)")]
    fn refit(
        &self,
        py: Python<'_>,
        vertices: &Bound<'_, PyAny>,
        triangles: Option<&Bound<'_, PyAny>>,
        threads: Threads,
        monitor: Option<&Monitor>,
    ) -> PyResult<Self> {
        let _mode = DefaultMode::set(py)?;
        let vertices = arrays::points("vertices", vertices).map_err(raise)?;
        if let Some(triangles) = triangles {
            let before = self.0.scene();
            let now = arrays::indices("triangles", triangles, before.vertices().len());
            if now.map_err(raise)? != before.indices() {
                let message =
                    "triangles: other than those of build(); the structure must be built again";
                return Err(raise(Error::Shape(message.to_owned())));
            }
        }
        let monitor = monitor::given(monitor);
        let fitted = py.detach(|| caught(|| self.0.refit(vertices, threads.0, &monitor)));
        Ok(Self(
            Arc::new(fitted.map_err(raise)?),
            LazySurface::default(),
        ))
    }

    /// Traces the rays one by one, on one thread, and records the answer of every leaf, so that the
    /// traversals can be repeated without triangle tests.
    ///
    /// any_hit: as occluded() does, else as closest(). Arguments and errors as for closest(); also
    /// SpecError for "brute", which has no traversal.
    #[pyo3(signature = (origins, directions, t_min=None, t_max=None, *, any_hit=false, monitor=None))]
    #[expect(clippy::too_many_arguments, reason = "Python keywords")]
    fn record(
        &self,
        py: Python<'_>,
        origins: &Bound<'_, PyAny>,
        directions: &Bound<'_, PyAny>,
        t_min: Option<&Bound<'_, PyAny>>,
        t_max: Option<&Bound<'_, PyAny>>,
        any_hit: bool,
        monitor: Option<&Monitor>,
    ) -> PyResult<Recording> {
        let _mode = DefaultMode::set(py)?;
        let arguments = RayArrays::new(origins, directions, t_min, t_max, "none").map_err(raise)?;
        let monitor = monitor::of(monitor);
        let rays = arguments.rays().all().map_err(raise)?;
        let recording = py.detach(|| self.0.record(rays, any_hit, monitor));
        let recording = recording.map_err(raise)?;
        Ok(Recording::new(self.0.clone(), recording))
    }

    /// Statistics of the build.
    #[getter]
    fn statistics<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let _mode = DefaultMode::set(py)?;
        let dict = PyDict::new(py);
        let progress = self.0.progress();
        let shape = self.0.shape();
        dict.set_item("build_seconds", self.0.build_seconds())?;
        let refitted = self.0.refitted();
        dict.set_item("refits", refitted.times)?;
        dict.set_item("refit_seconds", refitted.seconds)?;
        dict.set_item("sah_cost_built", refitted.cost_built)?;
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
        dict.set_item("parts_waiting", progress.unbuilt)?;
        dict.set_item("left_out", self.0.left_out())?;
        dict.set_item("dropped_triangles", self.0.scene().dropped())?;
        Ok(dict)
    }

    /// Descriptions of broken invariants; empty for a valid structure. Slow, for tests.
    ///
    /// monitor: to cancel the check. Raises Cancelled.
    #[pyo3(signature = (*, monitor=None))]
    fn validate(&self, py: Python<'_>, monitor: Option<&Monitor>) -> PyResult<Vec<String>> {
        let _mode = DefaultMode::set(py)?;
        let monitor = monitor::given(monitor);
        py.detach(|| validate::watched(&self.0, &monitor))
            .map_err(raise)
    }

    /// Statistics of the tree: leaves, levels, children, expected cost, end-point overlap, beta.
    ///
    /// max_nodes: end-point overlap of a tree of more nodes is estimated from a sample of the triangles,
    /// fewer by the same factor but at least 1024, with a fixed seed. Takes time in proportion to the nodes.
    /// monitor: to cancel it. Raises SpecError for numbers below 0, Cancelled.
    #[pyo3(signature = (max_nodes=MaxNodes(200_000), *, monitor=None), text_signature = "($self, max_nodes=200000, *, monitor=None)")]
    fn analysis<'py>(
        &self,
        py: Python<'py>,
        max_nodes: MaxNodes,
        monitor: Option<&Monitor>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let _mode = DefaultMode::set(py)?;
        analysis::analysis(py, &self.0, max_nodes.0, &monitor::given(monitor))
    }

    /// The whole tree as flat arrays; numpy.savez(path, **structure.export()) stores it.
    ///
    /// monitor: to cancel it. Raises Cancelled.
    #[pyo3(signature = (*, monitor=None))]
    fn export<'py>(
        &self,
        py: Python<'py>,
        monitor: Option<&Monitor>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let _mode = DefaultMode::set(py)?;
        analysis::export(py, &self.0, &monitor::given(monitor))
    }

    /// The split planes of nodes down to max_depth, at most max_count of them, breadth first.
    ///
    /// monitor: to cancel it. Raises SpecError for numbers below 0, Cancelled.
    #[pyo3(signature = (max_depth=MaxDepth(60), max_count=MaxCount(20_000), *, monitor=None), text_signature = "($self, max_depth=60, max_count=20000, *, monitor=None)")]
    fn split_polygons<'py>(
        &self,
        py: Python<'py>,
        max_depth: MaxDepth,
        max_count: MaxCount,
        monitor: Option<&Monitor>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let _mode = DefaultMode::set(py)?;
        let monitor = monitor::given(monitor);
        inspection::planes(py, &self.0, max_depth.0, max_count.0, &monitor)
    }

    /// The cells of leaves with at least min_triangles, the fullest first, at most max_count.
    ///
    /// monitor: to cancel it. Raises SpecError for numbers below 0, Cancelled.
    #[pyo3(signature = (min_triangles=MinTriangles(1), max_count=MaxCount(20_000), *, monitor=None), text_signature = "($self, min_triangles=1, max_count=20000, *, monitor=None)")]
    fn leaf_cells<'py>(
        &self,
        py: Python<'py>,
        min_triangles: MinTriangles,
        max_count: MaxCount,
        monitor: Option<&Monitor>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let _mode = DefaultMode::set(py)?;
        let monitor = monitor::given(monitor);
        inspection::cells(py, &self.0, min_triangles.0, max_count.0, &monitor)
    }

    /// The path of one ray to its nearest hit: the nodes, leaves and triangles that its traversal tested.
    ///
    /// origin, direction: three numbers each, scene frame. t_min, t_max: as for closest(); inf when not given.
    /// any_hit: the path of a ray of occluded(), to the hit that ends it. monitor: to cancel it. Raises NonFiniteError,
    /// Cancelled.
    #[pyo3(signature = (origin, direction, t_min=0.0, t_max=f64::INFINITY, *, any_hit=false, monitor=None), text_signature = "($self, origin, direction, t_min=0.0, t_max=..., *, any_hit=False, monitor=None)")]
    #[expect(clippy::too_many_arguments, reason = "Python keywords")]
    fn trace_path<'py>(
        &self,
        py: Python<'py>,
        origin: [f64; 3],
        direction: [f64; 3],
        t_min: f64,
        t_max: f64,
        any_hit: bool,
        monitor: Option<&Monitor>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let _mode = DefaultMode::set(py)?;
        // The arguments are rounded in this mode only from here on.
        let [origin, direction] = [origin, direction].map(|point| point.map(|x| x as f32));
        let (t_min, t_max) = (t_min as f32, t_max as f32);
        for (name, limit) in [("t_min", t_min), ("t_max", t_max)] {
            if limit.is_nan() {
                return Err(raise(Error::NonFinite(format!(
                    "{name}: NaN is no distance"
                ))));
            }
        }
        halfspace_ray::rays::check_finite("origin", &[origin]).map_err(raise)?;
        halfspace_ray::rays::check_finite("direction", &[direction]).map_err(raise)?;
        let ray = Ray {
            o: origin,
            d: direction,
            t_min,
            t_max,
        };
        ray_path::path(py, &self.0, &ray, any_hit, &monitor::given(monitor))
    }
    /// Traces rays that go together as beams of polygons, and records the way of the beams through the octree.
    ///
    /// origins, directions, t_min, t_max: as for closest(), at most 524,288 rays; those of a common origin, or of a common
    /// direction, go together. any_hit: rays of occluded(), whose beams begin at their light. monitor: to cancel it. A
    /// step is a beam in a node. The rays of a step that need another node are divided among the steps that come from
    /// it. Raises SpecError unless the structure is an "octree-beam" with traversal=polygon, for any_hit also
    /// shadow=beam; ShapeError, NonFiniteError, Cancelled.
    #[pyo3(signature = (origins, directions, t_min=None, t_max=None, *, any_hit=false, monitor=None))]
    #[expect(clippy::too_many_arguments, reason = "Python keywords")]
    fn trace_beam<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'_, PyAny>,
        directions: &Bound<'_, PyAny>,
        t_min: Option<&Bound<'_, PyAny>>,
        t_max: Option<&Bound<'_, PyAny>>,
        any_hit: bool,
        monitor: Option<&Monitor>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let _mode = DefaultMode::set(py)?;
        let arguments = RayArrays::new(origins, directions, t_min, t_max, "none").map_err(raise)?;
        let rays = arguments.rays().all().map_err(raise)?;
        beam_path::path(py, &self.0, &rays, any_hit, &monitor::given(monitor))
    }
}

impl Structure {
    /// The boxes that nearest and overlap queries traverse.
    fn surface(&self, py: Python<'_>) -> PyResult<&Surface> {
        let _mode = DefaultMode::set(py)?;
        py.detach(|| self.1.of(&self.0)).map_err(raise)
    }

    /// The structure as a tracer with counters of its own.
    fn counted(&self) -> CountedTracer<'_> {
        CountedTracer {
            tracer: &*self.0,
            cases: self.0.cases(),
        }
    }
}

/// Builds a structure over triangles.
///
/// vertices: (n, 3). triangles: (m, 3) indices; those without area or not finite are dropped and
/// counted, and the others keep their indices. spec: "id" or "id:key=value,...", see structures(). The
/// result is a function of these alone, on any number of threads; 0 = one per core.
/// memory_limit: bytes that the build may use besides the scene, counted while it runs; None = seven
/// eighths of the free memory of the machine when it begins. With lazy=1 the parts built later, by rays, are estimated.
/// Raises SpecError, ShapeError, Cancelled, and MemoryError when the limit is exceeded or the tree cannot be
/// addressed; RuntimeError for an internal error.
#[pyfunction]
#[pyo3(signature = (vertices, triangles, spec="kd", *, threads=Threads::ALL, monitor=None, memory_limit=None), text_signature = "(vertices, triangles, spec='kd', *, threads=0, monitor=None, memory_limit=None)")]
fn build(
    py: Python<'_>,
    vertices: &Bound<'_, PyAny>,
    triangles: &Bound<'_, PyAny>,
    spec: &str,
    threads: Threads,
    monitor: Option<&Monitor>,
    memory_limit: Option<MemoryLimit>,
) -> PyResult<Structure> {
    let _mode = DefaultMode::set(py)?;
    let limit = monitor::memory_limit(memory_limit);
    let config = registry::parse(spec).map_err(raise)?;
    let vertices = arrays::points("vertices", vertices).map_err(raise)?;
    let indices = arrays::indices("triangles", triangles, vertices.len()).map_err(raise)?;
    let monitor = monitor::with_limit(monitor, limit);
    let built = py
        .detach(|| {
            caught(|| {
                let scene = Arc::new(Triangles::new(vertices, indices)?);
                structure::Structure::build(scene, config, threads.0, &monitor)
            })
        })
        .map_err(raise)?;
    Ok(Structure(Arc::new(built), LazySurface::default()))
}

/// Adds building to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Structure>()?;
    module.add_function(wrap_pyfunction!(build, module)?)
}
