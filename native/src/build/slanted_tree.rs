// SPDX-License-Identifier: GPL-3.0-or-later
//! A tree between parallel planes along thirteen directions, as its builder emits it.

use super::cell::Direction;
use super::shape::{Measure, Shape};
use crate::traverse::dop_tree::NORMALS;

/// How many directions there are.
pub const DIRECTIONS: usize = NORMALS.len();

/// A direction, by its place in [`NORMALS`].
pub fn direction(k: usize) -> Direction {
    if k < 3 {
        Direction::Axis(k)
    } else {
        Direction::Oblique(NORMALS[k])
    }
}

/// What a node is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// A leaf.
    Leaf {
        /// How many triangles it holds.
        count: usize,
    },
    /// An inner node with one child, the next.
    Only {
        /// A place in [`NORMALS`].
        direction: usize,
        /// Where the child begins and where it ends.
        planes: [f32; 2],
    },
    /// An inner node; the child below is the next.
    Pair {
        /// A place in [`NORMALS`].
        direction: usize,
        /// Where the child below ends and where the child above begins.
        planes: [f32; 2],
        /// How many items ahead the child above is.
        above: usize,
    },
}

/// A node in preorder.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Item {
    /// What it is.
    pub kind: Kind,
    /// The surface of its region.
    pub(super) area: f64,
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
    /// Its shape.
    pub fn shape(&self) -> Shape {
        let mut measure = Measure::default();
        let whole = self.items[0].area;
        // Where the subtrees end in which the item lies that is looked at.
        let mut depths = vec![0];
        for item in &self.items {
            let depth = depths.pop().expect("every item has its place");
            let share = if whole > 0.0 { item.area / whole } else { 0.0 };
            let (direction, children) = match item.kind {
                Kind::Leaf { count } => {
                    measure.leaf(count, depth, share);
                    continue;
                }
                Kind::Only { direction, .. } => (direction, 1),
                Kind::Pair { direction, .. } => (direction, 2),
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
