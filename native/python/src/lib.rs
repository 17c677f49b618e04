// SPDX-License-Identifier: GPL-3.0-or-later
//! The Python module `halfspace_native`: arrays in, arrays out. No other module uses pyo3 or numpy.
//! `halfspace_native.pyi` documents each function.

mod analysis;
mod args;
mod cases;
mod errors;
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

use fearless_simd::Level;
use pyo3::prelude::*;

/// The SIMD level chosen for this machine: avx512, avx2, sse4.2, neon or fallback.
#[pyfunction]
fn level() -> &'static str {
    let level = Level::new();
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    {
        if level.as_avx512().is_some() {
            return "avx512";
        }
        if level.as_avx2().is_some() {
            return "avx2";
        }
        if level.as_sse4_2().is_some() {
            return "sse4.2";
        }
    }
    #[cfg(target_arch = "aarch64")]
    if level.as_neon().is_some() {
        return "neon";
    }
    let _ = level;
    "fallback"
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
    module.add_function(wrap_pyfunction!(free_memory, module)?)?;
    cases::register(module)?;
    errors::register(module)?;
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
