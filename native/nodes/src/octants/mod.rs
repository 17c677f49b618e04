// SPDX-License-Identifier: GPL-3.0-or-later
//! The cells of an octree on their grid, and the result of its builder.

pub mod octree_nodes;
mod views;

use halfspace_ray::frame::{Frame, U};

/// Largest depth: cells at this depth are a millionth of the root's side.
pub const MAX_DEPTH: u32 = 20;

/// Traversals from cell to cell are correct for origins within this multiple of the scene's largest coordinate;
/// see [`Cube::step_margin`]. Rays from farther origins start at the root.
pub const FAR: f32 = 4.0;

/// The root cell, and the grid of the smallest cells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cube {
    /// Smallest coordinates.
    pub corner: [f32; 3],
    /// Side length, a power of two.
    pub side: f32,
    /// Largest depth of a leaf; the smallest cell has side `side / 2^depth`.
    pub depth: u32,
}

impl Cube {
    /// Makes the cube around a scene, with at most `depth` levels. With `steps` the depth is also limited so that
    /// the smallest cell is at least four times [`Self::step_margin`].
    pub fn new(frame: &Frame, depth: u32, steps: bool) -> Self {
        let bounds = frame.bounds();
        if bounds.is_empty() {
            return Self {
                corner: [0.0; 3],
                side: 1.0,
                depth: 0,
            };
        }
        let magnitude = f64::from(bounds.magnitude());
        // The loop doubles this to the smallest power of two that is at least the extent.
        let extent = (0..3).map(|k| bounds.extent(k)).fold(0.0, f64::max);
        let mut side = 2.0_f64.powi(extent.log2().ceil() as i32 - 1);
        // Double the side until a cube at an exact multiple of the smallest cell contains the scene.
        loop {
            side *= 2.0;
            let mut cube = Self {
                corner: [0.0; 3],
                #[expect(clippy::cast_possible_truncation, reason = "a power of two")]
                side: side as f32,
                depth: depth.min(MAX_DEPTH),
            };
            // All planes are multiples of the smallest cell, by factors below 2^24: exact in f32.
            let coarse = |cube: &Self| {
                let unit = f64::from(cube.unit());
                magnitude + side > 16_777_216.0 * unit
                    || steps && 4.0 * f64::from(cube.step_margin(frame)) > unit
            };
            while cube.depth > 0 && coarse(&cube) {
                cube.depth -= 1;
            }
            let unit = f64::from(cube.unit());
            // Centre the cube on the scene, rounded down to a multiple of the smallest cell.
            let inside = (0..3).all(|k| {
                let (min, max) = (f64::from(bounds.min[k]), f64::from(bounds.max[k]));
                let corner = ((0.5 * (min + max - side)) / unit).floor() * unit;
                #[expect(clippy::cast_possible_truncation, reason = "few bits, see above")]
                let stored = corner as f32 + 0.0;
                cube.corner[k] = stored;
                f64::from(stored) == corner && corner <= min && max <= corner + side
            });
            if inside {
                return cube;
            }
        }
    }

    /// Returns the side of the smallest cells.
    #[inline(always)]
    pub fn unit(&self) -> f32 {
        self.side / (1_u32 << self.depth) as f32
    }

    /// Returns the side of the cells at a level.
    #[inline(always)]
    pub fn edge(&self, level: u32) -> f32 {
        self.side / (1_u32 << level) as f32
    }

    /// Returns the lowest corner of the smallest cell with these coordinates on the grid; exact.
    #[inline(always)]
    pub fn low(&self, cell: [u32; 3]) -> [f32; 3] {
        let unit = self.unit();
        std::array::from_fn(|k| self.corner[k] + cell[k] as f32 * unit)
    }

    /// Returns a bound, per axis, on the distance of a ray's point from the cell that a traversal from cell to
    /// cell assigns to it, for origins within [`FAR`].
    ///
    /// Such a traversal compares distances along the ray with plane distances, or coordinates with planes.
    /// Converted to coordinates, the former err by at most 8 u (|o| + M) ([`FrameRay::pad`]), the latter by at
    /// most u (|o| + M) + u M, and u side for the distance from the corner. Each distance is compared with each
    /// plane directly, never with an earlier result, so errors do not accumulate.
    ///
    /// [`FrameRay::pad`]: halfspace_ray::frame_ray::FrameRay::pad
    pub fn step_margin(&self, frame: &Frame) -> f32 {
        8.0 * U * (FAR + 1.0) * frame.bounds().magnitude() + 2.0 * U * self.side
    }
}

/// A node in preorder; an inner one is followed by its eight subtrees, octant by octant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Item {
    /// Inner node. Bit `k` of an octant's number is set on the upper side of axis `k`.
    Inner,
    /// Leaf with this number of triangle numbers.
    Leaf(u32),
}

/// A tree or subtree in preorder.
#[derive(Debug, Default)]
pub struct Octants {
    /// Nodes.
    pub items: Vec<Item>,
    /// Triangle numbers of the leaves, one leaf after another.
    pub ids: Vec<u32>,
}
