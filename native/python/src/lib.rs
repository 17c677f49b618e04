// SPDX-License-Identifier: GPL-3.0-or-later
//! The Python module `halfspace_native`: arrays in, arrays out. No other module uses pyo3 or numpy.
//! `halfspace_native/__init__.pyi` documents each function.

mod analysis;
mod args;
mod beam_path;
mod cases;
mod errors;
mod evaluation;
mod events;
mod float_mode;
mod hits;
mod inspection;
mod instances;
mod monitor;
mod oracle;
mod proximity;
mod ray_path;
mod recording;
mod registry;
mod render;
mod selective;
mod structure;
mod trace;
mod watched;

use crate::errors::raise;
use halfspace_base::simd;
use pyo3::prelude::*;

/// The SIMD level in use: avx512, avx2, sse4.2, neon or fallback.
#[pyfunction]
fn level() -> &'static str {
    simd::name()
}

/// Uses another SIMD level from now on in all threads of the process. Answers are the same at each level.
///
/// level: "best", or a level of this machine as level() names it. ValueError if it has none of this name.
#[pyfunction]
fn use_level(level: &str) -> PyResult<()> {
    simd::choose(level).map_err(raise)
}

/// Memory limit of a build that is given none, in bytes: seven eighths of what machine and process have free.
#[pyfunction]
fn free_memory() -> u64 {
    halfspace_base::memory::default_limit()
}

#[pymodule]
fn halfspace_native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_function(wrap_pyfunction!(level, module)?)?;
    module.add_function(wrap_pyfunction!(use_level, module)?)?;
    module.add_function(wrap_pyfunction!(free_memory, module)?)?;
    cases::register(module)?;
    errors::register(module)?;
    evaluation::register(module)?;
    events::register(module)?;
    instances::register(module)?;
    monitor::register(module)?;
    proximity::register(module)?;
    recording::register(module)?;
    registry::register(module)?;
    render::register(module)?;
    structure::register(module)?;
    hits::register(module)?;
    oracle::register(module)
}
