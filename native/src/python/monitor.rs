// SPDX-License-Identifier: GPL-3.0-or-later
//! Builds watched and held to a limit.

use super::whole::MemoryLimit;
use crate::build::Monitor as BuildMonitor;
use crate::memory;
use pyo3::prelude::*;
use std::sync::Arc;

/// Progress of a build, 0 to 1, and a way to stop it; usable from any thread.
#[pyclass(frozen)]
pub struct Monitor(pub Arc<BuildMonitor>);

#[pymethods]
impl Monitor {
    #[new]
    fn new() -> Self {
        Self(Arc::new(BuildMonitor::new()))
    }

    /// The share of the work done.
    #[getter]
    fn progress(&self) -> f64 {
        self.0.progress()
    }

    /// Whether it was asked to stop.
    #[getter]
    fn cancelled(&self) -> bool {
        self.0.is_cancelled()
    }

    /// Asks the build to stop; it raises Cancelled within a tenth of a second.
    fn cancel(&self) {
        self.0.cancel();
    }
}

/// Bytes that a build may take.
pub fn memory_limit(asked: Option<MemoryLimit>) -> u64 {
    asked.map_or_else(memory::default_limit, |limit| limit.0)
}

/// The monitor of a build that may take `limit` bytes: the one given, or one that nobody looks at.
pub fn watching(given: Option<&Monitor>, limit: u64) -> Arc<BuildMonitor> {
    let monitor = given.map_or_else(|| Arc::new(BuildMonitor::new()), |m| m.0.clone());
    monitor.limit_memory(limit);
    monitor
}

/// Adds monitors to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Monitor>()
}
