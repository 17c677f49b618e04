// SPDX-License-Identifier: GPL-3.0-or-later
//! Geometry that knows no tree: vectors, boxes, and the verdict on one ray and one triangle.

pub mod aabb;
pub mod exact;
#[cfg(test)]
pub mod strategies;
pub mod transform;
pub mod vec3;
pub mod verdict;

pub use aabb::Aabb;
pub use transform::Transform;
