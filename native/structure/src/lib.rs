// SPDX-License-Identifier: GPL-3.0-or-later
//! A built structure: the tree over its scene, and the plan that assigns kernels to rays.

pub mod instances;
pub mod leaf_depth;
pub mod outline;
pub mod plan;
pub mod row;
pub mod spec;
pub mod structure;
pub mod tracer;
pub mod way;

pub use plan::Plan;
pub use row::Built;
pub use structure::Structure;
