// SPDX-License-Identifier: GPL-3.0-or-later
//! Conversion of numpy arrays, with checks of shape, type and finiteness. Every message names the argument.

use halfspace_base::error::{Error, Result};
use halfspace_base::memory::check_room;
use halfspace_ray::rays::{Limits, first};
use numpy::ndarray::{ArrayView2, Dimension};
use numpy::{
    PyReadonlyArray, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArray,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use std::array;

/// Describes an argument for messages: type and shape of an array, or its Python type.
pub fn describe(value: &Bound<'_, PyAny>) -> String {
    match value.cast::<PyUntypedArray>() {
        Ok(array) => {
            // Format the shape as Python does: a single number is followed by a comma.
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

/// Checks that a copy of `array` with elements of `element` bytes fits into memory. A broadcast array can be far
/// larger than its own memory.
pub fn check_copy<'py>(
    name: &str,
    array: &impl PyUntypedArrayMethods<'py>,
    element: usize,
) -> Result<()> {
    let bytes = (array.len() as u64).saturating_mul(element as u64);
    check_room(name, bytes)
}

/// Number of elements from which an array is converted without the GIL (chosen): for fewer, releasing it costs more.
const MANY: usize = 1 << 14;

/// Converts an array of `count` elements by `convert`, without the GIL if there are many.
pub fn converted<T: Send>(py: Python<'_>, count: usize, convert: impl FnOnce() -> T + Send) -> T {
    if count < MANY {
        convert()
    } else {
        py.detach(convert)
    }
}

/// Returns the elements of an array of any layout, in the order of its axes, copied without the GIL.
pub fn elements<T: numpy::Element + Copy + Send + Sync, D: Dimension>(
    array: &PyReadonlyArray<'_, T, D>,
) -> Vec<T> {
    let view = array.as_array();
    converted(array.py(), view.len(), || view.iter().copied().collect())
}

/// Returns the (m, R, C) numbers of an array as m times R rows, copied without the GIL; `None` for another shape.
pub fn blocks<T: numpy::Element + Copy + Send + Sync, const R: usize, const C: usize>(
    array: &PyReadonlyArray3<'_, T>,
) -> Option<Vec<[[T; C]; R]>> {
    if array.shape()[1..] != [R, C] {
        return None;
    }
    let view = array.as_array();
    Some(converted(array.py(), view.len(), || {
        if let Some(flat) = view.as_slice() {
            return flat.as_chunks::<C>().0.as_chunks::<R>().0.to_vec();
        }
        let block = |m: ArrayView2<'_, T>| array::from_fn(|r| array::from_fn(|c| m[[r, c]]));
        view.outer_iter().map(block).collect()
    }))
}

/// Returns the rows of an (n, 3) array, converted by `convert`; `None` for another shape.
fn rows<T: numpy::Element + Copy + Send + Sync, U: Send>(
    array: &PyReadonlyArray2<'_, T>,
    convert: impl Fn(T) -> U + Copy + Send + Sync,
) -> Option<Vec<[U; 3]>> {
    if array.shape()[1] != 3 {
        return None;
    }
    let view = array.as_array();
    Some(converted(array.py(), view.len(), || {
        match view.as_slice() {
            Some(flat) => (flat.as_chunks::<3>().0.iter())
                .map(|row| row.map(convert))
                .collect(),
            None => (view.rows().into_iter())
                .map(|r| [convert(r[0]), convert(r[1]), convert(r[2])])
                .collect(),
        }
    }))
}

/// Returns points or directions from an (n, 3) array of float32, or of float64 rounded to float32.
pub fn points(name: &str, value: &Bound<'_, PyAny>) -> Result<Vec<[f32; 3]>> {
    // Try the element types in turn; anything else is a shape error.
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

/// Points that a call only reads, borrowed if the array has the layout of the core.
pub enum Points<'py> {
    /// C-contiguous float32.
    Borrowed(PyReadonlyArray2<'py, f32>),
    /// Any other array, converted.
    Owned(Vec<[f32; 3]>),
}

impl<'py> Points<'py> {
    /// Borrows or converts an array, after checking type and shape.
    pub fn new(name: &str, value: &Bound<'py, PyAny>) -> Result<Self> {
        if let Ok(array) = value.extract::<PyReadonlyArray2<'py, f32>>()
            && array.shape()[1] == 3
            && array.is_c_contiguous()
        {
            return Ok(Self::Borrowed(array));
        }
        points(name, value).map(Self::Owned)
    }

    /// Returns the rows.
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

/// An integer type of vertex indices.
trait Index: numpy::Element + Copy + Into<i64> + Send + Sync {
    /// Converts to u32; values out of range become the largest, which is never a valid vertex.
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

/// Converts an (m, 3) array of indices; the message names the first that is out of range. `None` for another shape.
fn indices_of<T: Index>(
    name: &str,
    array: &PyReadonlyArray2<'_, T>,
    vertices: usize,
) -> Result<Option<Vec<[u32; 3]>>> {
    check_copy(name, &**array, size_of::<u32>())?;
    let Some(found) = rows(array, T::index) else {
        return Ok(None);
    };
    // Test the largest index first: nearly always it is within range.
    let outside = |v: u32| v as usize >= vertices || v == u32::MAX;
    let largest = converted(array.py(), 3 * found.len(), || {
        found.as_flattened().iter().copied().max()
    });
    if !largest.is_some_and(outside) {
        return Ok(Some(found));
    }
    // Find the row and the original value of the first wrong index for the message.
    let wrong = |row: &[u32; 3]| row.iter().any(|&v| outside(v));
    let i = found.iter().position(wrong).expect("one of them");
    let k = found[i]
        .iter()
        .position(|&v| outside(v))
        .expect("the row has one");
    let index: i64 = array.as_array()[[i, k]].into();
    Err(Error::Shape(format!(
        "{name}[{i}]: index {index} is out of range for {vertices} vertices"
    )))
}

/// Returns vertex indices from an (m, 3) array of int32, uint32 or int64.
pub fn indices(name: &str, value: &Bound<'_, PyAny>, vertices: usize) -> Result<Vec<[u32; 3]>> {
    // Try the element types in turn; anything else is a shape error.
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

/// One number for all rays, or one per ray.
pub enum PerRay<'py> {
    /// The same number for all rays.
    Same(f32),
    /// One number per ray, borrowed if the array has the layout of the core.
    Borrowed(PyReadonlyArray1<'py, f32>),
    /// One number per ray, converted.
    Owned(Vec<f32>),
}

impl PerRay<'_> {
    /// Returns the numbers.
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

/// Reads a number, or an (n,) array with one per ray; infinity is allowed, NaN is an error.
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
            PerRay::Owned(elements(&array))
        }
    } else if let Ok(array) = value.extract::<PyReadonlyArray1<'_, f64>>() {
        check_copy(name, &*array, size_of::<f32>())?;
        let view = array.as_array();
        let convert = || view.iter().map(|&x| x as f32).collect();
        PerRay::Owned(converted(value.py(), view.len(), convert))
    } else if let Ok(number) = value.extract::<f64>() {
        PerRay::Same(number as f32)
    } else {
        return Err(Error::Shape(format!(
            "{name}: expected a number or an ({rays},) float32 array, got {}",
            describe(value)
        )));
    };
    // Check the length and exclude NaN.
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
