// SPDX-License-Identifier: GPL-3.0-or-later
//! The floating-point mode of the calling thread.
//!
//! Rust requires rounding to nearest and subnormal numbers; with another mode error bounds and exact verdicts are
//! wrong. Other libraries change the mode: Embree recommends flushing subnormals to zero, a library compiled with
//! -ffast-math does so when it is loaded, and new threads inherit the mode.

use pyo3::exceptions::{PyException, PyRuntimeError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use std::ffi::CString;
use std::hint::black_box;

/// Whether this thread rounds to nearest and computes with subnormal numbers.
fn is_default() -> bool {
    // An eighth of a step is lost in both directions only by rounding to nearest.
    let (one, little) = (black_box(1.0_f32), black_box(f32::EPSILON / 16.0));
    let nearest = black_box(one + little) == one && black_box(one - little) == one;
    // Zero if the result, or the operand of the comparison, is flushed.
    let subnormal = black_box(black_box(f32::MIN_POSITIVE) * black_box(0.5));
    nearest && subnormal > 0.0
}

/// While it lives, the calling thread has the default mode; then the former one again.
pub struct DefaultMode {
    restore: Option<Py<PyAny>>,
}

impl DefaultMode {
    /// Sets the default mode on the calling thread, on which alone the value is dropped.
    ///
    /// Costs a few nanoseconds where the mode is the default one already.
    pub fn set(py: Python<'_>) -> PyResult<Self> {
        if is_default() {
            return Ok(Self { restore: None });
        }
        let failed = |error: PyErr| {
            // Ctrl-C is no failure.
            if !error.is_instance_of::<PyException>(py) {
                return error;
            }
            PyRuntimeError::new_err(format!(
                "this thread flushes subnormal numbers to zero or does not round to nearest, and the default \
                 floating-point mode cannot be set: {error}"
            ))
        };
        let (set, restore) = setters(py).map_err(failed)?;
        // The value restores the former mode even where the call fails.
        let mode = Self {
            restore: Some(restore),
        };
        set.call0(py).map_err(failed)?;
        if is_default() {
            return Ok(mode);
        }
        Err(failed(PyRuntimeError::new_err(
            "the C library did not set it",
        )))
    }
}

impl Drop for DefaultMode {
    fn drop(&mut self) {
        if let Some(restore) = self.restore.take() {
            Python::attach(|py| {
                if let Err(error) = restore.call0(py) {
                    error.write_unraisable(py, None);
                }
            });
        }
    }
}

/// The callables that set the default mode, and the mode of now.
fn setters(py: Python<'_>) -> PyResult<(Py<PyAny>, Py<PyAny>)> {
    static FUNCTION: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    let function = FUNCTION.get_or_try_init(py, || {
        let source = CString::new(include_str!("float_mode.py"))?;
        let module = PyModule::from_code(
            py,
            &source,
            c"float_mode.py",
            c"halfspace_native.float_mode",
        )?;
        Ok::<_, PyErr>(module.getattr("setters")?.unbind())
    })?;
    function.call0(py)?.extract(py)
}
