// SPDX-License-Identifier: GPL-3.0-or-later
//! numpy arrays in, checked: shapes, types, finiteness. Every message names the argument.

use crate::error::{Error, Result};
use crate::memory::check_room;
use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;

/// What an argument is, for messages: type and shape of an array, or the Python type.
pub fn describe(value: &Bound<'_, PyAny>) -> String {
    match value.cast::<PyUntypedArray>() {
        Ok(array) => {
            let shape: Vec<_> = array.shape().iter().map(ToString::to_string).collect();
            let comma = if shape.len() == 1 { "," } else { "" };
            format!(
                "{} array of shape ({}{comma})",
                array.dtype(),
                shape.join(", ")
            )
        }
        Err(_) => value
            .get_type()
            .name()
            .map_or_else(|_| "?".to_owned(), |n| n.to_string()),
    }
}

/// Passes when a copy of `array` with elements of `element` bytes fits into memory. An array may be larger than
/// its own memory: one row, broadcast, is any number of rows.
pub fn check_copy<'py>(
    name: &str,
    array: &impl PyUntypedArrayMethods<'py>,
    element: usize,
) -> Result<()> {
    let bytes = (array.len() as u64).saturating_mul(element as u64);
    check_room(name, bytes)
}

/// The rows of an (n, 3) array, converted by `convert`.
fn rows<T: numpy::Element + Copy, U>(
    array: &PyReadonlyArray2<'_, T>,
    convert: impl Fn(T) -> U + Copy,
) -> Option<Vec<[U; 3]>> {
    if array.shape()[1] != 3 {
        return None;
    }
    // A Fortran-ordered array is one slice too, of columns.
    Some(match array.as_slice() {
        Ok(flat) if array.is_c_contiguous() => flat
            .as_chunks::<3>()
            .0
            .iter()
            .map(|row| row.map(convert))
            .collect(),
        _ => array
            .as_array()
            .rows()
            .into_iter()
            .map(|r| [convert(r[0]), convert(r[1]), convert(r[2])])
            .collect(),
    })
}

/// Points or directions: (n, 3) float32, or float64 rounded to float32.
pub fn points(name: &str, value: &Bound<'_, PyAny>) -> Result<Vec<[f32; 3]>> {
    let found = if let Ok(array) = value.extract::<PyReadonlyArray2<'_, f32>>() {
        check_copy(name, &*array, size_of::<f32>())?;
        rows(&array, |x| x)
    } else if let Ok(array) = value.extract::<PyReadonlyArray2<'_, f64>>() {
        check_copy(name, &*array, size_of::<f32>())?;
        #[expect(
            clippy::cast_possible_truncation,
            reason = "coordinates are f32 from here on"
        )]
        rows(&array, |x| x as f32)
    } else {
        None
    };
    found.ok_or_else(|| {
        Error::Shape(format!(
            "{name}: expected an (n, 3) float32 or float64 array, got {}",
            describe(value)
        ))
    })
}

/// Points that a call only reads: borrowed where the array already is what the core wants.
pub enum Points<'py> {
    /// C-contiguous float32.
    Borrowed(PyReadonlyArray2<'py, f32>),
    /// Anything else.
    Owned(Vec<[f32; 3]>),
}

impl<'py> Points<'py> {
    /// Checks type and shape.
    pub fn new(name: &str, value: &Bound<'py, PyAny>) -> Result<Self> {
        if let Ok(array) = value.extract::<PyReadonlyArray2<'py, f32>>()
            && array.shape()[1] == 3
            && array.is_c_contiguous()
        {
            return Ok(Self::Borrowed(array));
        }
        points(name, value).map(Self::Owned)
    }

    /// The rows.
    pub fn rows(&self) -> &[[f32; 3]] {
        match self {
            Self::Borrowed(array) => {
                let flat = array.as_slice().expect("contiguity was checked");
                flat.as_chunks::<3>().0
            }
            Self::Owned(rows) => rows,
        }
    }
}

/// The first number with a property. Looks at many at once: nearly always there is none.
#[inline(always)]
fn first(numbers: &[f32], is: impl Fn(f32) -> bool) -> Option<usize> {
    const GROUP: usize = 256;
    numbers
        .chunks(GROUP)
        .position(|group| group.iter().fold(false, |any, &x| any | is(x)))
        .and_then(|group| {
            let before = group * GROUP;
            let found = numbers[before..].iter().position(|&x| is(x))?;
            Some(before + found)
        })
}

/// Whether all rows are finite.
pub fn are_finite(points: &[[f32; 3]]) -> bool {
    first(points.as_flattened(), |x| !x.is_finite()).is_none()
}

/// Passes when all rows are finite; names the first that is not.
pub fn check_finite(name: &str, points: &[[f32; 3]]) -> Result<()> {
    match first(points.as_flattened(), |x| !x.is_finite()).map(|i| i / 3) {
        None => Ok(()),
        Some(i) => Err(Error::NonFinite(format!(
            "{name}[{i}]: {:?} is not finite",
            points[i]
        ))),
    }
}

/// A number that may name a vertex.
trait Index: numpy::Element + Copy + Into<i64> {
    /// As an index; what is none becomes the largest, which names no vertex either.
    fn index(self) -> u32;
}

impl Index for i32 {
    #[inline(always)]
    fn index(self) -> u32 {
        u32::try_from(self).unwrap_or(u32::MAX)
    }
}

impl Index for u32 {
    #[inline(always)]
    fn index(self) -> u32 {
        self
    }
}

impl Index for i64 {
    #[inline(always)]
    fn index(self) -> u32 {
        u32::try_from(self).unwrap_or(u32::MAX)
    }
}

/// Converts the rows of an (m, 3) array of indices; names the first that is out of range.
fn indices_of<T: Index>(
    name: &str,
    array: &PyReadonlyArray2<'_, T>,
    vertices: usize,
) -> Result<Option<Vec<[u32; 3]>>> {
    check_copy(name, &**array, size_of::<u32>())?;
    let Some(found) = rows(array, T::index) else {
        return Ok(None);
    };
    let outside = |v: u32| v as usize >= vertices || v == u32::MAX;
    if !found
        .as_flattened()
        .iter()
        .max()
        .is_some_and(|&v| outside(v))
    {
        return Ok(Some(found));
    }
    let wrong = |row: &[u32; 3]| row.iter().any(|&v| outside(v));
    let i = found.iter().position(wrong).expect("one of them");
    let k = found[i].iter().position(|&v| outside(v)).expect("as asked");
    let index: i64 = array.as_array()[[i, k]].into();
    Err(Error::Shape(format!(
        "{name}[{i}]: index {index} is out of range for {vertices} vertices"
    )))
}

/// Vertex indices: (m, 3) int32, uint32 or int64.
pub fn indices(name: &str, value: &Bound<'_, PyAny>, vertices: usize) -> Result<Vec<[u32; 3]>> {
    let found = if let Ok(array) = value.extract::<PyReadonlyArray2<'_, i32>>() {
        indices_of(name, &array, vertices)?
    } else if let Ok(array) = value.extract::<PyReadonlyArray2<'_, u32>>() {
        indices_of(name, &array, vertices)?
    } else if let Ok(array) = value.extract::<PyReadonlyArray2<'_, i64>>() {
        indices_of(name, &array, vertices)?
    } else {
        None
    };
    found.ok_or_else(|| {
        Error::Shape(format!(
            "{name}: expected an (m, 3) int32, uint32 or int64 array, got {}",
            describe(value)
        ))
    })
}

/// One number for all rays, or one for each.
pub enum PerRay<'py> {
    /// The same for all.
    Same(f32),
    /// One each, borrowed where the array already is what the core wants.
    Borrowed(PyReadonlyArray1<'py, f32>),
    /// One each.
    Owned(Vec<f32>),
}

/// The same, free of Python.
#[derive(Clone, Copy)]
pub enum Limits<'a> {
    /// The same for all.
    Same(f32),
    /// One each.
    Each(&'a [f32]),
}

impl PerRay<'_> {
    /// The numbers.
    pub fn limits(&self) -> Limits<'_> {
        match self {
            Self::Same(x) => Limits::Same(*x),
            Self::Borrowed(array) => {
                Limits::Each(array.as_slice().expect("contiguity was checked"))
            }
            Self::Owned(xs) => Limits::Each(xs),
        }
    }
}

/// A number, or an (n,) array of numbers; infinite is allowed, NaN is not.
pub fn per_ray<'py>(name: &str, value: &Bound<'py, PyAny>, rays: usize) -> Result<PerRay<'py>> {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "distances are f32 from here on"
    )]
    let found = if let Ok(array) = value.extract::<PyReadonlyArray1<'py, f32>>() {
        if array.is_c_contiguous() {
            PerRay::Borrowed(array)
        } else {
            check_copy(name, &*array, size_of::<f32>())?;
            PerRay::Owned(array.as_array().iter().copied().collect())
        }
    } else if let Ok(array) = value.extract::<PyReadonlyArray1<'_, f64>>() {
        check_copy(name, &*array, size_of::<f32>())?;
        PerRay::Owned(array.as_array().iter().map(|&x| x as f32).collect())
    } else if let Ok(number) = value.extract::<f64>() {
        PerRay::Same(number as f32)
    } else {
        return Err(Error::Shape(format!(
            "{name}: expected a number or an ({rays},) float32 array, got {}",
            describe(value)
        )));
    };
    match found.limits() {
        Limits::Same(x) if x.is_nan() => {
            Err(Error::NonFinite(format!("{name}: NaN is no distance")))
        }
        Limits::Each(xs) if xs.len() != rays => Err(Error::Shape(format!(
            "{name}: expected a number or {rays} of them, got {}",
            describe(value)
        ))),
        Limits::Each(xs) => match first(xs, |x| x.is_nan()) {
            Some(i) => Err(Error::NonFinite(format!("{name}[{i}]: NaN is no distance"))),
            None => Ok(found),
        },
        Limits::Same(_) => Ok(found),
    }
}
