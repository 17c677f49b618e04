// SPDX-License-Identifier: GPL-3.0-or-later
//! Checks of the invariants of each layout, for any builder.

pub mod boxes;
pub mod grid;
pub mod objects;
pub mod octree;
pub mod planes;
pub mod ropes;
pub mod slanted;
