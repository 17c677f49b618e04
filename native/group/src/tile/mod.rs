// SPDX-License-Identifier: GPL-3.0-or-later
//! Tiles of rays with a common origin, with the bounds that a traversal needs of all of them: the range of
//! their directions, and the pyramid that contains them.
//!
//! A tile is a set of rays and does not depend on a camera. Distances to planes are intervals over the tile
//! (the ranges of MLRTA, Reshetov et al. 2005), measured from the origin, so directions of both signs need no
//! special case. Rays with another origin and irregular rays are left to single-ray traversals.

pub mod boxes;
pub mod kernel;
pub mod leaf;
pub mod nearest;
pub mod nodes;
pub mod planes;
pub mod shadow;
pub mod slab_boxes;
pub mod traversal;
pub mod verdict;

mod candidate;
mod deferred;
mod fill;
mod prepare;
mod pyramid;
mod rays;
mod row;
mod success;

pub use candidate::{Candidate, Limits, Quotient, StoredTriangle};
pub use deferred::Deferred;
pub use halfspace_trace::row::{LANES, Row, bits, load, splat};
pub use pyramid::Pyramid;
pub use rays::{Pace, Tile};
pub use row::{Numbers, bitwise_equal};
pub use success::{Backoff, SuccessRate};

/// The index of the ray in this lane of this row. A row is a square of 4 by 4 pixels among the 8 by 8 of 64
/// consecutive rays, which keeps its rays close together.
#[inline(always)]
pub const fn ray_index(row: usize, lane: usize) -> usize {
    row / 4 * 64 + (row % 4 / 2 * 4 + lane / 4) * 8 + row % 2 * 4 + lane % 4
}

/// The row and lane of a ray; inverse of [`ray_index`].
#[inline(always)]
pub const fn row_and_lane(ray: usize) -> (usize, usize) {
    let (x, y) = (ray % 8, ray / 8 % 8);
    (ray / 64 * 4 + y / 4 * 2 + x / 4, y % 4 * 4 + x % 4)
}
