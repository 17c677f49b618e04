// SPDX-License-Identifier: GPL-3.0-or-later
//! What every structure indexes: triangles, and the transforms of instances.

pub mod place;
pub mod triangles;

pub use place::Place;
pub use triangles::Triangles;
