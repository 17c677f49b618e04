// SPDX-License-Identifier: GPL-3.0-or-later
//! Geometry independent of any tree: vectors, boxes, transforms, and the exact verdict on one ray and one
//! triangle.

pub mod bound;
pub mod cell;
pub mod clip;
pub mod clip_area;
pub mod oblique_part;
pub mod overlap;
pub mod polytope;
pub mod profile;
pub mod region;
pub mod tighten;
pub mod view;

pub mod aabb;
pub mod exact;
pub mod transform;
pub mod vec3;
pub mod verdict;

pub use aabb::Aabb;
pub use transform::Transform;
