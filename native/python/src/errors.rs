// SPDX-License-Identifier: GPL-3.0-or-later
//! The crate's errors as Python exceptions.

use halfspace_base::error::Error;
use pyo3::create_exception;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;

create_exception!(
    halfspace_native,
    ShapeError,
    PyValueError,
    "An array has the wrong shape or type, or an index is out of range."
);
create_exception!(
    halfspace_native,
    NonFiniteError,
    PyValueError,
    "A number is NaN, or infinite where a finite one is needed."
);
create_exception!(
    halfspace_native,
    SpecError,
    PyValueError,
    "A configuration string or a setting is not understood or out of range."
);
create_exception!(
    halfspace_native,
    RefitError,
    PyValueError,
    "A structure cannot be fitted to these moved vertices: it must be built again."
);
create_exception!(
    halfspace_native,
    Cancelled,
    PyRuntimeError,
    "The work was cancelled through its monitor."
);

/// The exception for an error of the crates below.
pub fn raise(error: Error) -> PyErr {
    let message = error.to_string();
    match error {
        Error::Shape(_) => ShapeError::new_err(message),
        Error::NonFinite(_) => NonFiniteError::new_err(message),
        Error::Spec(_) => SpecError::new_err(message),
        Error::Refit(_) => RefitError::new_err(message),
        Error::Cancelled => Cancelled::new_err(message),
        Error::Internal(_) => PyRuntimeError::new_err(message),
        Error::Memory(_) => pyo3::exceptions::PyMemoryError::new_err(message),
    }
}

/// Adds the exceptions to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    module.add("ShapeError", py.get_type::<ShapeError>())?;
    module.add("NonFiniteError", py.get_type::<NonFiniteError>())?;
    module.add("SpecError", py.get_type::<SpecError>())?;
    module.add("RefitError", py.get_type::<RefitError>())?;
    module.add("Cancelled", py.get_type::<Cancelled>())
}
