// SPDX-License-Identifier: GPL-3.0-or-later
//! The invariants of each layout, checked from outside: what holds whatever built the tree.

pub mod boxes;
pub mod grid;
pub mod objects;
pub mod octree;
pub mod planes;
pub mod ropes;
pub mod slanted;
