// SPDX-License-Identifier: GPL-3.0-or-later
//! Memory layouts of trees. A layout is data: it neither builds itself nor traces rays.

pub mod box_corners;
pub mod box_tree;
pub mod cells;
pub mod check;
pub mod cost;
pub mod dop_tree;
pub mod grid;
pub mod lazy_tree;
pub mod nested;
pub mod next;
pub mod obb_tree;
pub mod object_tree;
pub mod octants;
pub mod octree_nodes;
pub mod plane_tree;
pub mod planes;
pub mod preorder;
pub mod ropes;
pub mod shape;
pub mod slab_node;
pub mod slab_tree;
pub mod slab_wide;
pub mod slant_tree;
pub mod slanted_tree;
pub mod tree;
pub mod views;
pub mod wide_tree;

pub use tree::Tree;
