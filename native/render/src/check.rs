// SPDX-License-Identifier: GPL-3.0-or-later
//! Input checks whose errors name the key at fault.

pub use halfspace_base::error::{Error, Result};

/// Checks that all numbers are finite. `name`: makes the name of the array for the message.
///
/// # Errors
/// [`Error::NonFinite`] with the name and the index of the first number that is not finite.
pub fn finite<T: Copy + Into<f64>>(values: &[T], name: impl Fn() -> String) -> Result<()> {
    for (i, &v) in values.iter().enumerate() {
        // Widen, so that one code path serves f32 and f64.
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

/// Checks that a number is finite and within `low..=high`. `name`: makes its name for the message.
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
    // NaN and infinity are excluded by now, so the comparisons decide.
    if value < low || value > high {
        return Err(Error::Spec(format!(
            "{} must lie in {low}..{high}, got {value}",
            name()
        )));
    }
    Ok(())
}
