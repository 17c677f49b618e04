// SPDX-License-Identifier: GPL-3.0-or-later
//! Procedural textures, with the values of Blender's.

pub mod fractal;
pub mod fractal_lanes;
pub mod gabor;
mod hash;
pub mod pattern;
mod perlin;
mod perlin_lanes;
pub mod radial;
pub mod voronoi;

pub use crate::values::texture::hash::{color, unit};
