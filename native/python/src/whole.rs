// SPDX-License-Identifier: GPL-3.0-or-later
//! Whole numbers as arguments. What pyo3 says of a number that does not fit names no argument; this does.

use crate::errors::raise;
use halfspace_base::error::Error;
use pyo3::exceptions::PyOverflowError;
use pyo3::prelude::*;

/// More threads than this are a slip of the keyboard, and starting them can take minutes.
const MOST_THREADS: u64 = 1024;

/// Longer numbers are not repeated in messages.
const DIGITS: usize = 40;

/// The whole number that an argument is; a [`Error::Spec`] when it is below 0 or above `most`.
fn whole(name: &str, value: &Bound<'_, PyAny>, most: u64) -> PyResult<u64> {
    match value.extract() {
        Ok(number) if number <= most => return Ok(number),
        Ok(_) => {}
        Err(error) if error.is_instance_of::<PyOverflowError>(value.py()) => {}
        // Not a whole number at all: pyo3 adds the argument's name.
        Err(error) => return Err(error),
    }
    // Python does not write out numbers of thousands of digits either.
    let text = value.str().map(|text| text.to_string());
    let got = text
        .ok()
        .filter(|text| text.len() <= DIGITS)
        .unwrap_or_else(|| format!("one of more than {DIGITS} digits"));
    Err(raise(Error::Spec(format!(
        "{name}: expected a whole number from 0 to {most}, got {got}"
    ))))
}

/// Declares an argument: its type, its name in messages and its largest value.
macro_rules! argument {
    ($(#[$doc:meta])* $type:ident($number:ty), $name:literal, $most:expr) => {
        $(#[$doc])*
        #[derive(Clone, Copy)]
        pub struct $type(pub $number);

        impl<'py> FromPyObject<'_, 'py> for $type {
            type Error = PyErr;

            fn extract(value: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
                let number = whole($name, &value, $most)?;
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
    /// How deep nodes may lie.
    MaxDepth(usize), "max_depth", usize::MAX as u64
);
argument!(
    /// Number of nodes up to which nothing is sampled.
    MaxNodes(usize), "max_nodes", usize::MAX as u64
);
argument!(
    /// How many are wanted at most.
    MaxCount(usize), "max_count", usize::MAX as u64
);
argument!(
    /// How many triangles are wanted at least.
    MinTriangles(usize), "min_triangles", usize::MAX as u64
);
argument!(
    /// What random choices begin with.
    Seed(u64), "seed", u64::MAX
);
argument!(
    /// Bytes that a build may take.
    MemoryLimit(u64), "memory_limit", u64::MAX
);
argument!(
    /// A time.
    Milliseconds(u64), "milliseconds", u64::MAX
);

impl Threads {
    /// One per core.
    pub const ALL: Self = Self(0);
}
