// SPDX-License-Identifier: GPL-3.0-or-later
//! Beams: tiles of camera rays that traverse a tree as one convex region, and shadow rays of one light.

pub mod bundle;
pub mod frame_rows;
pub mod kernel;
pub mod light_cube;
pub mod octants;
pub mod planes;
pub mod shadow;
pub mod shaft;
pub mod shaft_tree;
