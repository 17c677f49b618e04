// SPDX-License-Identifier: GPL-3.0-or-later
//! Arguments: arrays, numbers and dictionaries from Python, checked and converted. Every message names the argument
//! or the key.

pub mod arrays;
pub mod camera_settings;
pub mod closures;
pub mod integers;
pub mod keys;
pub mod points;
pub mod rays;
pub mod scene;
pub mod shader;
pub mod steps;
pub mod surface;
pub mod textures;
pub mod volume;
