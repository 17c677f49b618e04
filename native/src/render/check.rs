// SPDX-License-Identifier: GPL-3.0-or-later
//! Checks whose messages name the key at fault.

pub use crate::error::{Error, Result};

/// Whether all numbers are finite.
///
/// # Errors
/// [`Error::NonFinite`] with the name and the index of the first that is not.
pub fn finite<T: Copy + Into<f64>>(values: &[T], name: impl Fn() -> String) -> Result<()> {
    for (i, &v) in values.iter().enumerate() {
        let v: f64 = v.into();
        if !v.is_finite() {
            return Err(Error::NonFinite(format!(
                "{}[{i}] must be finite, got {v}",
                name()
            )));
        }
    }
    Ok(())
}

/// Whether a number is finite and within bounds.
///
/// # Errors
/// [`Error::NonFinite`] or [`Error::Spec`] with the name and the bounds.
pub fn within(value: f64, low: f64, high: f64, name: impl Fn() -> String) -> Result<()> {
    if !value.is_finite() {
        return Err(Error::NonFinite(format!(
            "{} must be finite, got {value}",
            name()
        )));
    }
    if value < low || value > high {
        return Err(Error::Spec(format!(
            "{} must lie in {low}..{high}, got {value}",
            name()
        )));
    }
    Ok(())
}
