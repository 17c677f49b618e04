// SPDX-License-Identifier: GPL-3.0-or-later
//! The ground: errors, memory limits, progress and cancellation.

pub mod error;
pub mod footprint;
pub mod memory;
pub mod monitor;

pub use monitor::{Held, Monitor};
