// SPDX-License-Identifier: GPL-3.0-or-later
//! A tree of nodes between parallel planes along thirteen directions, as its builder emits it.

use crate::dop_tree::NORMALS;
use crate::shape::{Measure, Shape};
use halfspace_geom::cell::Direction;

/// Number of directions.
pub const DIRECTIONS: usize = NORMALS.len();

/// Returns a direction by its index in [`NORMALS`].
pub fn direction(k: usize) -> Direction {
    if k < 3 {
        Direction::Axis(k)
    } else {
        Direction::Oblique(NORMALS[k])
    }
}

/// Kind of an item.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ItemKind {
    /// A leaf.
    Leaf {
        /// Number of triangles.
        count: usize,
    },
    /// An inner node with one child, the next item.
    Only {
        /// Index in [`NORMALS`].
        direction: usize,
        /// Heights at which the child begins and ends.
        planes: [f32; 2],
    },
    /// An inner node with two children; the child below is the next item.
    Pair {
        /// Index in [`NORMALS`].
        direction: usize,
        /// Heights at which the child below ends and the child above begins.
        planes: [f32; 2],
        /// Distance in items to the child above.
        above: usize,
    },
}

/// A node in preorder.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Item {
    /// Kind of the item.
    pub kind: ItemKind,
    /// Surface area of its region.
    pub area: f64,
}

/// A tree in preorder.
#[derive(Debug, Clone)]
pub struct SlantedTree {
    /// Nodes, the root first; never empty.
    pub items: Vec<Item>,
    /// Triangle numbers of the leaves, one leaf after another.
    pub ids: Vec<u32>,
}

impl SlantedTree {
    /// Returns the statistics of the tree.
    pub fn shape(&self) -> Shape {
        let mut measure = Measure::default();
        let whole = self.items[0].area;
        // Depths of the nodes still to come, the next one last.
        let mut depths = vec![0];
        for item in &self.items {
            let depth = depths.pop().expect("every item has a depth");
            let share = if whole > 0.0 { item.area / whole } else { 0.0 };
            // A node with one child has two planes, but counts as one step.
            let (direction, children) = match item.kind {
                ItemKind::Leaf { count } => {
                    measure.leaf(count, depth, share);
                    continue;
                }
                ItemKind::Only { direction, .. } => (direction, 1),
                ItemKind::Pair { direction, .. } => (direction, 2),
            };
            if direction < 3 {
                measure.axis(share);
            } else {
                measure.oblique(share);
            }
            depths.extend(std::iter::repeat_n(depth + 1, children));
        }
        measure.finish()
    }
}
