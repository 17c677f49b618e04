// SPDX-License-Identifier: GPL-3.0-or-later
//! Trees of bounding volumes: axis-aligned boxes, oriented boxes, polytopes of fixed directions.

pub mod box_corners;
pub mod box_tree;
pub mod dop_tree;
pub mod obb_tree;
pub mod object_tree;
pub mod plane_boxes;
