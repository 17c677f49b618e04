// SPDX-License-Identifier: GPL-3.0-or-later
//! Structures seen by people and tests: validation, drawing, ray paths.

pub mod leaf_cells;
pub mod polygons;
pub mod ray_path;
pub mod validate;
