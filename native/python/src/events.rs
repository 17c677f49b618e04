// SPDX-License-Identifier: GPL-3.0-or-later
//! Events that the processor and the system count while a function runs: misses of the last cache, instructions.

use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Names of the events.
const NAMES: [&str; 5] = [
    "cache_misses",
    "cache_references",
    "instructions",
    "page_faults",
    "task_clock",
];

/// Counts events while a function runs, on the calling thread and on those that it starts meanwhile.
///
/// function: called without arguments; its result is dropped. names: of "cache_misses" and "cache_references" (of the
/// last cache), "instructions", "page_faults", "task_clock" (nanoseconds). Returns the number of each, without the
/// system's own work; where events share a counter of the processor, an estimate from its part of the time. Raises
/// ValueError for other names; OSError, with one sentence, where the system does not count an event, as on all systems but
/// Linux.
#[pyfunction]
fn count_events<'py>(
    py: Python<'py>,
    function: &Bound<'py, PyAny>,
    names: Vec<String>,
) -> PyResult<Bound<'py, PyDict>> {
    if let Some(other) = names.iter().find(|name| !NAMES.contains(&name.as_str())) {
        return Err(PyValueError::new_err(format!(
            "names: expected some of {}, got {other:?}",
            NAMES.join(", ")
        )));
    }
    let mut counters = names
        .iter()
        .map(|name| system::Counter::new(name))
        .collect::<Result<Vec<_>, _>>()
        .map_err(PyOSError::new_err)?;
    // Count, and stop before an exception is passed on.
    let started = counters.iter_mut().try_for_each(system::Counter::start);
    let called = started
        .map_err(PyOSError::new_err)
        .map(|()| function.call0());
    let counts: Result<Vec<_>, _> = counters.iter_mut().map(system::Counter::stop).collect();
    called??;
    let dict = PyDict::new(py);
    for (name, count) in names.iter().zip(counts.map_err(PyOSError::new_err)?) {
        dict.set_item(name, count)?;
    }
    Ok(dict)
}

/// Adds the function to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(count_events, module)?)
}

#[cfg(target_os = "linux")]
mod system {
    use perf_event::Builder;
    use perf_event::events::{Event, Hardware, Software};
    use std::io::{Error, ErrorKind};

    /// A counter of one event.
    pub struct Counter {
        name: String,
        counter: perf_event::Counter,
    }

    impl Counter {
        /// Opens a counter; returns a sentence where that fails.
        pub fn new(name: &str) -> Result<Self, String> {
            let event: Event = match name {
                "cache_misses" => Hardware::CACHE_MISSES.into(),
                "cache_references" => Hardware::CACHE_REFERENCES.into(),
                "instructions" => Hardware::INSTRUCTIONS.into(),
                "page_faults" => Software::PAGE_FAULTS.into(),
                _ => Software::TASK_CLOCK.into(),
            };
            let mut builder = Builder::new().kind(event);
            builder.inherit(true);
            let name = name.replace('_', " ");
            match builder.build() {
                Ok(counter) => Ok(Self { name, counter }),
                Err(error) => Err(refused(&name, &error)),
            }
        }

        /// Begins to count.
        pub fn start(&mut self) -> Result<(), String> {
            self.counter
                .enable()
                .map_err(|error| refused(&self.name, &error))
        }

        /// Ends, and returns the number of events.
        pub fn stop(&mut self) -> Result<f64, String> {
            let read = self
                .counter
                .disable()
                .and_then(|()| self.counter.read_count_and_time());
            let found = read.map_err(|error| refused(&self.name, &error))?;
            if found.time_running == 0 {
                return Err(format!(
                    "the processor had no free counter of {}",
                    self.name
                ));
            }
            let share = found.time_enabled as f64 / found.time_running as f64;
            Ok(found.count as f64 * share)
        }
    }

    /// Why an event is not counted.
    fn refused(name: &str, error: &Error) -> String {
        match error.kind() {
            ErrorKind::PermissionDenied => format!(
                "the system does not permit to count {name}; kernel.perf_event_paranoid = 2 does"
            ),
            ErrorKind::NotFound | ErrorKind::Unsupported => {
                format!("the processor, or the virtual machine, has no counter of {name}")
            }
            _ => format!("{name} cannot be counted: {error}"),
        }
    }
}

#[cfg(not(target_os = "linux"))]
mod system {
    /// No counter.
    pub struct Counter;

    impl Counter {
        pub fn new(name: &str) -> Result<Self, String> {
            let name = name.replace('_', " ");
            Err(format!("{name} are counted on Linux alone"))
        }

        pub fn start(&mut self) -> Result<(), String> {
            Ok(())
        }

        pub fn stop(&mut self) -> Result<f64, String> {
            Ok(0.0)
        }
    }
}
