// SPDX-License-Identifier: GPL-3.0-or-later
//! The content of scenes: triangles, and the transforms of instances.

pub mod instance;
pub mod triangles;

pub use instance::MeshInstance;
pub use triangles::Triangles;
