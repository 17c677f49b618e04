// SPDX-License-Identifier: GPL-3.0-or-later
//! Monitoring of builds and of traced rays, and the memory limit of builds.

use crate::args::integers::{MemoryLimit, Threads};
use halfspace_base::memory;
use halfspace_base::monitor::Monitor as BuildMonitor;
use halfspace_nearest::threads::Work;
use pyo3::prelude::*;
use std::sync::Arc;

/// Progress of a build, and cancellation of builds and of traced rays; usable from any thread.
#[pyclass(frozen, module = "halfspace_native")]
pub struct Monitor(pub Arc<BuildMonitor>);

#[pymethods]
impl Monitor {
    #[new]
    fn new() -> Self {
        Self(Arc::new(BuildMonitor::new()))
    }

    /// Fraction of the work that is done, 0..1.
    #[getter]
    fn progress(&self) -> f64 {
        self.0.progress()
    }

    /// Whether cancel() was called.
    #[getter]
    fn cancelled(&self) -> bool {
        self.0.is_cancelled()
    }

    /// Requests the work to stop; a build raises Cancelled within a tenth of a second.
    fn cancel(&self) {
        self.0.cancel();
    }
}

/// Returns the memory limit of a build in bytes.
pub fn memory_limit(given: Option<MemoryLimit>) -> u64 {
    given.map_or_else(memory::default_limit, |limit| limit.0)
}

/// Returns the given monitor, or a new one.
pub fn given(monitor: Option<&Monitor>) -> Arc<BuildMonitor> {
    monitor.map_or_else(|| Arc::new(BuildMonitor::new()), |m| m.0.clone())
}

/// Returns the given monitor, or a new one, with this memory limit.
pub fn with_limit(monitor: Option<&Monitor>, limit: u64) -> Arc<BuildMonitor> {
    let monitor = given(monitor);
    monitor.limit_memory(limit);
    monitor
}

/// Returns the monitor of the core.
pub fn of(monitor: Option<&Monitor>) -> Option<&BuildMonitor> {
    monitor.map(|monitor| &*monitor.0)
}

/// Returns how many threads answer queries, until the monitor is cancelled, if one is given.
pub fn work(threads: Threads, monitor: Option<&Monitor>) -> Work<'_> {
    Work {
        threads: threads.0,
        monitor: of(monitor),
    }
}

/// Adds monitors to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Monitor>()
}
