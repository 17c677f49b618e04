// SPDX-License-Identifier: GPL-3.0-or-later
//! A tree between parallel planes along thirteen directions, as its builder emits it.

use super::cell::Direction;
use super::plane_tree::Shape;
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
        let mut shape = Shape::default();
        let whole = self.items[0].area;
        let mut depth_sum = 0;
        // Where the subtrees end in which the item lies that is looked at.
        let mut depths = vec![0];
        for item in &self.items {
            let depth = depths.pop().expect("every item has its place");
            let share = if whole > 0.0 { item.area / whole } else { 0.0 };
            let mut step = |direction: usize| {
                let oblique = direction >= 3;
                shape.nodes_axis += usize::from(!oblique);
                shape.nodes_oblique += usize::from(oblique);
                shape.sah_cost += if oblique { 5.0 } else { 1.0 } * share;
            };
            match item.kind {
                Kind::Leaf { count } => {
                    shape.leaves += 1;
                    shape.leaves_empty += usize::from(count == 0);
                    shape.references += count;
                    shape.leaf_max = shape.leaf_max.max(count);
                    shape.depth_max = shape.depth_max.max(depth);
                    shape.sah_cost += 80.0 * share * count as f64;
                    depth_sum += depth;
                }
                Kind::Only { direction, .. } => {
                    step(direction);
                    depths.push(depth + 1);
                }
                Kind::Pair { direction, .. } => {
                    step(direction);
                    depths.extend([depth + 1; 2]);
                }
            }
        }
        shape.depth_mean = depth_sum as f64 / shape.leaves.max(1) as f64;
        shape
    }
}
