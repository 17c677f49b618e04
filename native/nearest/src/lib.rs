// SPDX-License-Identifier: GPL-3.0-or-later
//! Closest points on triangles and overlaps of triangles, decided exactly.
//!
//! The answers are defined on the f32 inputs alone. The nearest triangle is the one whose exact distance is smallest;
//! of equal ones, that with the smallest index. Distance and closest point are rounded once. Triangles without area are
//! segments or points; only triangles that are not finite have no answer. Two triangles overlap if they have a point
//! in common, be it a vertex.
//!
//! - [`feature`]: the part of a triangle that is closest to a point, in any arithmetic;
//! - [`number`]: the arithmetics: f64, f64 with an error bound, integers;
//! - [`span`]: an interval in f64 around the exact squared distance;
//! - [`verdict`]: the order of two triangles by distance, and the rounded answer;
//! - [`surface`]: the tree of boxes that the queries traverse;
//! - [`closest`]: the nearest triangle, and all triangles within a distance;
//! - [`meeting`]: whether two triangles have a point in common;
//! - [`overlap`]: all such pairs of two surfaces.

pub mod closest;
pub mod feature;
pub mod meeting;
pub mod number;
pub mod overlap;
pub mod span;
pub mod surface;
pub mod verdict;

mod exact;
pub mod threads;

#[cfg(test)]
mod tests;

pub use closest::Nearest;
pub use surface::Surface;
