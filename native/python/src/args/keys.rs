// SPDX-License-Identifier: GPL-3.0-or-later
//! Dictionaries as arguments: values are read by key and type, and every message names the key.

use crate::args::arrays::describe;
use halfspace_base::error::{Error, Result};
use numpy::{PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// A dictionary argument.
pub struct Keys<'a, 'py> {
    dict: &'a Bound<'py, PyDict>,
    /// Name of the argument in messages.
    pub name: String,
}

impl<'a, 'py> Keys<'a, 'py> {
    /// Makes a reader of the dictionary. Rejects keys that are not among `known`, which are misspellings.
    pub fn new(dict: &'a Bound<'py, PyDict>, name: String, known: &[&str]) -> Result<Self> {
        for (key, _) in dict.iter() {
            let key = key.to_string();
            if !known.contains(&key.as_str()) {
                return Err(Error::Spec(format!(
                    "{name}['{key}'] is not a key; known are {}",
                    known.join(", ")
                )));
            }
        }
        Ok(Self { dict, name })
    }

    /// Makes the error for a value of the wrong type.
    pub fn wrong(&self, key: &str, expected: &str, value: &Bound<'_, PyAny>) -> Error {
        Error::Spec(format!(
            "{}['{key}']: expected {expected}, got {}",
            self.name,
            describe(value)
        ))
    }

    /// Returns the value of a key that may be missing or `None`.
    pub fn find(&self, key: &str) -> Option<Bound<'py, PyAny>> {
        let value = self.dict.get_item(key).ok().flatten();
        value.filter(|v| !v.is_none())
    }

    /// Returns the value of a required key.
    pub fn need(&self, key: &str) -> Result<Bound<'py, PyAny>> {
        self.find(key)
            .ok_or_else(|| Error::Spec(format!("{}['{key}'] is missing", self.name)))
    }

    /// Returns a number.
    pub fn number(&self, key: &str) -> Result<f64> {
        let value = self.need(key)?;
        value
            .extract()
            .map_err(|_| self.wrong(key, "a number", &value))
    }

    /// Returns a number, or the default for a missing key.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "beyond f32 becomes infinite, which later checks reject"
    )]
    pub fn number_or(&self, key: &str, default: f32) -> Result<f32> {
        match self.find(key) {
            None => Ok(default),
            Some(_) => self.number(key).map(|x| x as f32),
        }
    }

    /// Returns a whole number of at least 0.
    pub fn count(&self, key: &str) -> Result<u32> {
        let value = self.need(key)?;
        let number: i64 = value
            .extract()
            .map_err(|_| self.wrong(key, "a whole number", &value))?;
        u32::try_from(number).map_err(|_| {
            Error::Spec(format!(
                "{}['{key}'] must lie in 0..4294967295, got {number}",
                self.name
            ))
        })
    }

    /// Returns a truth value, or the default for a missing key.
    pub fn flag_or(&self, key: &str, default: bool) -> Result<bool> {
        match self.find(key) {
            None => Ok(default),
            Some(v) => v
                .extract()
                .map_err(|_| self.wrong(key, "True or False", &v)),
        }
    }

    /// Returns a string.
    pub fn text(&self, key: &str) -> Result<String> {
        let value = self.need(key)?;
        value
            .extract()
            .map_err(|_| self.wrong(key, "a string", &value))
    }

    /// Returns the numbers of an array or a sequence of exactly this shape, row by row.
    pub fn numbers(&self, key: &str, shape: &[usize]) -> Result<Vec<f64>> {
        let value = self.need(key)?;
        let dims: Vec<_> = shape.iter().map(ToString::to_string).collect();
        let expected = format!("numbers of shape ({})", dims.join(", "));
        let array = value
            .py()
            .import("numpy")
            .and_then(|np| np.call_method1("asarray", (&value, "float64")))
            .map_err(|_| self.wrong(key, &expected, &value))?;
        let array: PyReadonlyArrayDyn<'_, f64> = array
            .extract()
            .map_err(|_| self.wrong(key, &expected, &value))?;
        if array.shape() != shape {
            let got = describe(array.as_any());
            return Err(Error::Shape(format!(
                "{}['{key}']: expected {expected}, got {got}",
                self.name
            )));
        }
        Ok(array.as_array().iter().copied().collect())
    }

    /// Returns the rows of a 4 x 4 matrix.
    pub fn matrix(&self, key: &str) -> Result<[[f64; 4]; 4]> {
        let flat = self.numbers(key, &[4, 4])?;
        let mut out = [[0.0; 4]; 4];
        for (value, slot) in flat.iter().zip(out.as_flattened_mut()) {
            *slot = *value;
        }
        Ok(out)
    }

    /// Returns a linear colour.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "beyond f32 becomes infinite, which later checks reject"
    )]
    pub fn color(&self, key: &str) -> Result<[f32; 3]> {
        let c = self.numbers(key, &[3])?;
        Ok([c[0] as f32, c[1] as f32, c[2] as f32])
    }

    /// Returns the value that a string names, one of `options`.
    pub fn choice<T>(&self, key: &str, options: &[(&str, T)]) -> Result<T>
    where
        T: Copy,
    {
        let text = self.text(key)?;
        options
            .iter()
            .find(|(name, _)| *name == text)
            .map(|(_, value)| *value)
            .ok_or_else(|| {
                let known: Vec<_> = options.iter().map(|(name, _)| *name).collect();
                Error::Spec(format!(
                    "{}['{key}']: expected one of {}, got '{text}'",
                    self.name,
                    known.join(", ")
                ))
            })
    }
}

/// Reads a list of dictionaries by `read`, which gets each dictionary with its index; a missing list is empty.
pub fn list<'py, T>(
    name: &str,
    value: Option<&Bound<'py, PyAny>>,
    read: impl Fn(&Bound<'py, PyDict>, usize) -> Result<T>,
) -> Result<Vec<T>> {
    let Some(value) = value.filter(|v| !v.is_none()) else {
        return Ok(Vec::new());
    };
    let wrong = || {
        Error::Spec(format!(
            "{name}: expected a list of dictionaries, got {}",
            describe(value)
        ))
    };
    let mut out = Vec::new();
    for (index, item) in value.try_iter().map_err(|_| wrong())?.enumerate() {
        let item = item.map_err(|_| wrong())?;
        let dict = item.cast::<PyDict>().map_err(|_| {
            Error::Spec(format!(
                "{name}[{index}]: expected a dictionary, got {}",
                describe(&item)
            ))
        })?;
        out.push(read(dict, index)?);
    }
    Ok(out)
}
