// SPDX-License-Identifier: GPL-3.0-or-later
//! Values that vary over a surface: shading programs, and the data and functions that their operations read.

mod bump;
pub mod evaluate;
pub mod ies;
pub mod image;
pub mod linking;
pub mod math_nodes;
pub mod normal_map;
pub mod program;
pub mod rays;
pub mod shading_point;
pub mod spectrum;
pub mod texture;
pub mod varying;
pub mod view;
pub mod visibility;
pub mod voxels;
