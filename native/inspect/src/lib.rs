// SPDX-License-Identifier: GPL-3.0-or-later
//! Inspection of structures: validation, statistics, drawing, paths of rays and beams, export.

pub mod analysis;
pub mod beam_path;
pub mod export;
pub mod leaf_cells;
pub mod polygons;
pub mod ray_path;
pub mod validate;
