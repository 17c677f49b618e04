// SPDX-License-Identifier: GPL-3.0-or-later
//! Inspection of structures: validation, statistics, drawing, ray paths, export.

pub mod analysis;
pub mod export;
pub mod leaf_cells;
pub mod polygons;
pub mod ray_path;
pub mod validate;
