// SPDX-License-Identifier: GPL-3.0-or-later
//! Built structures: a tree over a scene, and a plan that assigns a kernel to each kind of ray batch.

pub mod blurred;
pub mod coherence;
pub mod division;
pub mod effective;
pub mod footprint;
pub mod instances;
pub mod leaf_depth;
pub mod outline;
pub mod plan;
pub mod reorder;
pub mod row;
pub mod selective;
pub mod spec;
pub mod structure;
pub mod threads;
pub mod tracer;
pub mod way;
pub mod work;

pub use plan::Plan;
pub use row::Built;
pub use structure::Structure;
