// SPDX-License-Identifier: GPL-3.0-or-later
//! Everything that can go wrong, in words that name the argument at fault.

/// An error of this crate. Every message names the argument or key, the first bad index where
/// there is one, and what was expected.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// An array or a number of items has the wrong shape, size or range.
    #[error("{0}")]
    Shape(String),
    /// A coordinate is NaN or infinite where a finite one is needed.
    #[error("{0}")]
    NonFinite(String),
    /// A configuration string or a setting is not understood or out of range.
    #[error("{0}")]
    Spec(String),
    /// The caller asked to stop.
    #[error("cancelled")]
    Cancelled,
    /// The build would have needed more memory than it may use.
    #[error("{0}")]
    Memory(String),
}

/// The result type of this crate.
pub type Result<T> = std::result::Result<T, Error>;
