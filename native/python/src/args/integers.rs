// SPDX-License-Identifier: GPL-3.0-or-later
//! Integers as arguments. The messages name the argument, which those of pyo3 for integers out of range do not.

use crate::errors::raise;
use halfspace_base::error::Error;
use pyo3::exceptions::PyOverflowError;
use pyo3::prelude::*;

/// Largest number of threads: more are a typing error, and starting them can take minutes.
const MOST_THREADS: u64 = 1024;

/// Longest number that messages repeat.
const DIGITS: usize = 40;

/// Reads an integer; [`Error::Spec`] if it is below 0 or above `max`.
fn integer(name: &str, value: &Bound<'_, PyAny>, max: u64) -> PyResult<u64> {
    match value.extract() {
        Ok(number) if number <= max => return Ok(number),
        Ok(_) => {}
        Err(error) if error.is_instance_of::<PyOverflowError>(value.py()) => {}
        // Not an integer at all: pyo3 adds the argument's name.
        Err(error) => return Err(error),
    }
    // Python itself refuses to print numbers of thousands of digits.
    let text = value.str().map(|text| text.to_string());
    let got = text
        .ok()
        .filter(|text| text.len() <= DIGITS)
        .unwrap_or_else(|| format!("one of more than {DIGITS} digits"));
    Err(raise(Error::Spec(format!(
        "{name}: expected a whole number from 0 to {max}, got {got}"
    ))))
}

/// Declares an argument: its type, its name in messages and its largest value.
macro_rules! argument {
    ($(#[$doc:meta])* $type:ident($number:ty), $name:literal, $max:expr) => {
        $(#[$doc])*
        #[derive(Clone, Copy)]
        pub struct $type(pub $number);

        impl<'py> FromPyObject<'_, 'py> for $type {
            type Error = PyErr;

            fn extract(value: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
                let number = integer($name, &value, $max)?;
                Ok(Self(<$number>::try_from(number).expect("within the range")))
            }
        }
    };
}

argument!(
    /// A number of threads; 0 is one per core.
    Threads(usize), "threads", MOST_THREADS
);
argument!(
    /// Largest depth of nodes.
    MaxDepth(usize), "max_depth", usize::MAX as u64
);
argument!(
    /// Number of nodes up to which nothing is sampled.
    MaxNodes(usize), "max_nodes", usize::MAX as u64
);
argument!(
    /// Largest number of results.
    MaxCount(usize), "max_count", usize::MAX as u64
);
argument!(
    /// Largest number of hits per ray.
    MaxHits(usize), "max_hits", usize::MAX as u64
);
argument!(
    /// Smallest number of triangles.
    MinTriangles(usize), "min_triangles", usize::MAX as u64
);
argument!(
    /// Seed of random choices.
    Seed(u64), "seed", u64::MAX
);
argument!(
    /// Largest number of bytes of a build.
    MemoryLimit(u64), "memory_limit", u64::MAX
);
argument!(
    /// A duration.
    Milliseconds(u64), "milliseconds", u64::MAX
);

impl Threads {
    /// One per core.
    pub const ALL: Self = Self(0);
}
