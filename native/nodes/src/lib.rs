// SPDX-License-Identifier: GPL-3.0-or-later
//! Memory layouts of trees. A layout is data: it neither builds itself nor traces rays.
//!
//! | folder | layouts |
//! | --- | --- |
//! | [`planes`] | trees of split planes: 8 bytes per node, numbered directions, wide nodes, parts built on demand, ropes |
//! | [`boxes`] | trees of boxes, of oriented boxes and of polytopes with fixed directions |
//! | [`slabs`] | interval hierarchies, of axis-aligned and of oblique planes |
//! | [`octants`] | octrees |
//! | [`grid`] | uniform grids |
//! | [`check`] | the invariants of each layout |
//!
//! The files on top belong to all layouts: [`tree`] and [`cells`] are their common interface, [`nested`] that of trees
//! of boxes and intervals, [`refit`] that of layouts that follow moved triangles, [`shape`] and [`cost`] their statistics.

pub mod boxes;
pub mod cells;
pub mod check;
pub mod cost;
pub mod grid;
pub mod nested;
pub mod next;
pub mod octants;
pub mod planes;
pub mod refit;
pub mod shape;
pub mod slabs;
pub mod tree;

pub use boxes::{box_corners, box_tree, dop_tree, obb_tree, object_tree, plane_boxes};
pub use octants::octree_nodes;
pub use planes::{axis_tree, lazy_tree, plane_tree, preorder, projected_tree, ropes, wide_tree};
pub use slabs::{slab_boxes, slab_node, slab_tree, slab_wide, slant_tree, slanted_tree};
pub use tree::Tree;
