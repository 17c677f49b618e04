// SPDX-License-Identifier: GPL-3.0-or-later
//! Conversion of hits and counters to arrays.

use crate::args::arrays::converted;
use halfspace_ray::{Hit, RayCounters};
use numpy::{IntoPyArray, PyArray1, ToPyArray};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// The results of closest(), one per ray.
///
/// t: (n,) float32, distance in units of the direction, correctly rounded; inf = miss.
/// triangle: (n,) int32, -1 = miss; among triangles at the same t the one with the smallest index.
/// u, v: (n,) float32, weights of the second and third corner: the point is
/// (1 - u - v) a + u b + v c. Each access makes a new array.
/// counters: None, or per ray (n,) uint32 under "steps", "steps_axis", "steps_oblique", "steps_boxes", "leaves",
/// "leaves_empty", "visits", "tests", "tests_wasted", "verdicts", "spared" (1: answered without a traversal of its
/// own). "steps" are inner nodes: "steps_axis" of axis-aligned planes, "steps_oblique" of oblique planes or oriented
/// boxes, "steps_boxes" of boxes, intervals, octants or grid cells. "leaves" are visits of leaves with triangles,
/// "leaves_empty" of others. Rays that go together (packet, tile, beam, stream) visit a node once: the step or leaf is
/// counted for one of them, and "visits" counts the nodes and leaves of every ray. "tests_wasted" are those "tests" on
/// visits of leaves that did not improve the ray's answer; packets and tiles, which test for several rays at once,
/// count all their tests there. From TA-B also the cases of ray and split plane, "case_n1" to "case_n5" (origin below
/// the plane: 1 away from it, 2 along it, 3 towards it but the cell ends before, 4 through it inside the cell, 5
/// through it before the cell), "case_p1" to "case_p5" (above), "case_z1" (in the plane: upwards), "case_z2"
/// (downwards), "case_z3" (along); from beam-hh "beam_visits" (nodes visited by the beam whose first ray this is),
/// "beam_cuts" (number of times a polygon split the beam) and "beam_singles" (1: the ray was traced on its own); from
/// octree-beam with traversal=polygon "beams", "beam_clips" (of a polygon against a line), "beam_splits",
/// "beam_pixels" (found by scan conversion), "beam_singles" and "beam_empty" (visits of nodes by beams without a ray).
/// on_boundary: None, or from exact_closest (n,) bool: whether the ray passes exactly through an edge or a vertex
/// of the triangle it hits.
#[pyclass(frozen, module = "halfspace_native")]
pub struct Hits {
    /// The hits.
    pub(super) hits: Vec<Hit>,
    /// Names of the traversal's own cases, and the counters of each ray.
    pub(super) counts: Option<(&'static [&'static str], Vec<RayCounters>)>,
    /// Whether each ray passes through an edge or a vertex, if requested.
    pub(super) on_boundary: Option<Vec<bool>>,
}

#[pymethods]
impl Hits {
    #[getter]
    fn t<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        self.column(py, |h| h.t)
    }

    #[getter]
    fn triangle<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        // The triangle index of a miss has all bits set and becomes -1.
        self.column(py, |h| h.triangle.cast_signed())
    }

    #[getter]
    fn u<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        self.column(py, |h| h.u)
    }

    #[getter]
    fn v<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        self.column(py, |h| h.v)
    }

    #[getter]
    fn counters<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        self.counts
            .as_ref()
            .map(|(cases, counts)| counters(py, cases, counts))
            .transpose()
    }

    #[getter]
    fn on_boundary<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyAny>> {
        self.on_boundary
            .as_ref()
            .map(|flags| flags.to_pyarray(py).into_any())
    }

    fn __len__(&self) -> usize {
        self.hits.len()
    }
}

impl Hits {
    /// Makes an array with one value per hit.
    fn column<'py, T: numpy::Element + Copy + Send>(
        &self,
        py: Python<'py>,
        get: fn(&Hit) -> T,
    ) -> Bound<'py, PyAny> {
        column(py, &self.hits, get).into_any()
    }
}

/// Makes an array with one value per row, without the GIL if there are many.
fn column<'py, R: Sync, T: numpy::Element + Send>(
    py: Python<'py>,
    rows: &[R],
    get: impl Fn(&R) -> T + Send,
) -> Bound<'py, PyArray1<T>> {
    let values: Vec<T> = converted(py, rows.len(), || rows.iter().map(get).collect());
    values.into_pyarray(py)
}

/// A counter: its key, and its value for a ray.
type Column = (&'static str, fn(&RayCounters) -> u32);

/// The counters that every structure has.
pub const COLUMNS: [Column; 11] = [
    ("steps", RayCounters::steps),
    ("steps_axis", |c| c.steps_axis),
    ("steps_oblique", |c| c.steps_oblique),
    ("steps_boxes", |c| c.steps_boxes),
    ("leaves", |c| c.leaves),
    ("leaves_empty", |c| c.leaves_empty),
    ("visits", RayCounters::visits),
    ("tests", |c| c.tests),
    ("tests_wasted", |c| c.tests_wasted),
    ("verdicts", |c| c.verdicts),
    ("spared", |c| c.spared),
];

/// Returns the counters as a dictionary from name to (n,) uint32.
pub fn counters<'py>(
    py: Python<'py>,
    cases: &[&str],
    counters: &[RayCounters],
) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    for (name, get) in COLUMNS {
        dict.set_item(name, column(py, counters, get))?;
    }
    // The counters of this structure's traversal.
    for (i, name) in cases.iter().enumerate() {
        dict.set_item(name, column(py, counters, move |c| c.cases[i]))?;
    }
    Ok(dict)
}

/// Adds hits to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Hits>()
}
