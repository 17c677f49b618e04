// SPDX-License-Identifier: GPL-3.0-or-later
//! Recorded rays, which can be traced again without triangle tests.

use crate::float_mode::DefaultMode;
use crate::hits;
use halfspace_ray::replay;
use halfspace_structure::structure;
use numpy::{PyArray1, ToPyArray};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Arc;

/// Rays and the answers of the leaves that they visited, from Structure.record().
#[pyclass(frozen, module = "halfspace_native")]
pub struct Recording {
    structure: Arc<structure::Structure>,
    recording: replay::Recording,
}

impl Recording {
    /// Makes a recording of rays through `structure`.
    pub fn new(structure: Arc<structure::Structure>, recording: replay::Recording) -> Self {
        Self {
            structure,
            recording,
        }
    }
}

#[pymethods]
impl Recording {
    /// The counters of each ray when it was recorded, as Hits.counters.
    #[getter]
    fn counters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        hits::counters(py, self.structure.cases(), &self.recording.counters)
    }

    /// Traces the rays again on the calling thread, through the same nodes in the same order but with
    /// the recorded answers in place of triangle tests.
    ///
    /// Returns the seconds of each 1024 rays, the last for the rest: the time of traversal alone, from the ray
    /// in the structure's frame to the last leaf. To compare traversals on a busy machine, take the median of
    /// each chunk over several replays, interleaved, and add them up. RuntimeError if a ray visits
    /// other leaves than recorded, which is a bug.
    fn replay<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let _mode = DefaultMode::set(py)?;
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

/// Adds recordings to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Recording>()
}
