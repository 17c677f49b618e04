// SPDX-License-Identifier: GPL-3.0-or-later
//! Interval hierarchies: nodes that store, along one direction, where each child begins or ends.

pub mod slab_boxes;
pub mod slab_node;
pub mod slab_tree;
pub mod slab_wide;
pub mod slant_tree;
pub mod slanted_tree;
mod views;
