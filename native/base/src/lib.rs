// SPDX-License-Identifier: GPL-3.0-or-later
//! Errors, memory limits, progress and cancellation, instruction sets.

pub mod error;
pub mod footprint;
pub mod memory;
pub mod monitor;
pub mod simd;

pub use monitor::{Held, Monitor};
