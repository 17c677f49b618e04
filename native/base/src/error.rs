// SPDX-License-Identifier: GPL-3.0-or-later
//! The error type of all crates, and the conversion of panics to it.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// An error of the native crates. Every message names the argument or key, the first bad index where there is one,
/// and the expected value.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// An array or a number of items has the wrong shape, size or range.
    #[error("{0}")]
    Shape(String),
    /// A coordinate is NaN or infinite where a finite one is needed.
    #[error("{0}")]
    NonFinite(String),
    /// A configuration string or a setting cannot be parsed or is out of range.
    #[error("{0}")]
    Spec(String),
    /// A structure cannot follow moved triangles; building it again can.
    #[error("{0}")]
    Refit(String),
    /// The caller cancelled the work.
    #[error("cancelled")]
    Cancelled,
    /// The work needs more memory than its limit allows.
    #[error("{0}")]
    Memory(String),
    /// A bug in the native crates, caught as a panic.
    #[error("internal error: {0}")]
    Internal(String),
}

/// The result type of the native crates.
pub type Result<T> = std::result::Result<T, Error>;

/// Runs `work` and converts any panic in it, or on a thread it joins, to an error.
///
/// # Errors
/// [`Error::Internal`] with the panic's message, or any error that `work` returns.
pub fn caught<T>(work: impl FnOnce() -> Result<T>) -> Result<T> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| Err(Error::of_panic(&*panic)))
}

impl Error {
    /// Converts the payload of a panic to an error with the panic's message.
    pub fn of_panic(panic: &(dyn Any + Send)) -> Self {
        let text = panic
            .downcast_ref::<&str>()
            .map(ToString::to_string)
            .or_else(|| panic.downcast_ref::<String>().cloned());
        Self::Internal(text.unwrap_or_else(|| "unknown".to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rayon::prelude::*;

    #[test]
    fn a_panic_on_any_thread_becomes_an_error_with_its_message() {
        let here = || -> Result<()> { panic!("here {}", 1) };
        let pool = || -> Result<()> {
            let fail = |i: usize| assert!(i < 500, "in the pool");
            (0..1000).into_par_iter().for_each(fail);
            Ok(())
        };
        let scoped = || -> Result<()> {
            std::thread::scope(|scope| {
                scope.spawn(|| panic!("in a scope"));
            });
            Ok(())
        };
        for (message, error) in [
            ("internal error: here 1", caught(here)),
            ("internal error: in the pool", caught(pool)),
            ("internal error: a scoped thread panicked", caught(scoped)),
        ] {
            assert_eq!(error.unwrap_err().to_string(), message);
        }
        assert_eq!(caught(|| Ok(1)), Ok(1));
        assert_eq!(
            caught::<()>(|| Err(Error::Cancelled)),
            Err(Error::Cancelled)
        );
    }
}
