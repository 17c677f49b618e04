// SPDX-License-Identifier: GPL-3.0-or-later
//! A binary tree of objects as the builder emits it: nodes in preorder with their boxes. Every
//! layout of such a tree, by boxes or by planes, is made from this one.

use crate::error::{Error, Result};
use crate::geom::Aabb;

/// A node in preorder: the child below follows at once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Item {
    /// The box around its triangles.
    pub bounds: Aabb,
    /// How many items ahead the child above is; 0 for a leaf.
    above: u32,
    /// The axis of an inner node, the number of triangles of a leaf.
    word: u32,
}

/// What a node is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// An inner node.
    Inner {
        /// The axis along which it was parted.
        axis: usize,
        /// Places of the children, below and above.
        children: [usize; 2],
    },
    /// A leaf.
    Leaf {
        /// How many triangles it holds.
        count: usize,
    },
}

impl Item {
    /// An inner node, its children not yet linked.
    pub fn inner(axis: usize) -> Self {
        Self {
            bounds: Aabb::EMPTY,
            above: 0,
            word: u32::try_from(axis).expect("an axis"),
        }
    }

    /// A leaf.
    pub fn leaf(bounds: Aabb, count: usize) -> Self {
        Self {
            bounds,
            above: 0,
            word: u32::try_from(count).expect("bounded by the scene"),
        }
    }

    /// Completes the first of `items`: its child below is the next, its child above the one that is
    /// `distance` items ahead. Its box is that around theirs.
    pub fn link(items: &mut [Self], distance: usize) {
        items[0].bounds = items[1].bounds.union(&items[distance].bounds);
        items[0].above = u32::try_from(distance).expect("fewer than 2^30 nodes");
    }
}

/// A tree of objects in preorder.
#[derive(Debug, Clone, Default)]
pub struct ObjectTree {
    /// Nodes, the root first; never empty.
    pub items: Vec<Item>,
    /// Triangle numbers of the leaves, one leaf after another, in the order of the items.
    pub ids: Vec<u32>,
}

impl ObjectTree {
    /// How many items and ids there are.
    pub fn sizes(&self) -> (usize, usize) {
        (self.items.len(), self.ids.len())
    }

    /// What the node at `place` is.
    pub fn kind(&self, place: usize) -> Kind {
        let item = &self.items[place];
        if item.above == 0 {
            Kind::Leaf {
                count: item.word as usize,
            }
        } else {
            Kind::Inner {
                axis: item.word as usize,
                children: [place + 1, place + item.above as usize],
            }
        }
    }

    /// Where each item's leaf triangles begin in `ids`; that of an inner node is its first leaf's.
    pub fn firsts(&self) -> Vec<u32> {
        let mut next = 0;
        self.items
            .iter()
            .map(|item| {
                let first = next;
                next += if item.above == 0 { item.word } else { 0 };
                first
            })
            .collect()
    }

    /// How many levels lie below each item.
    pub fn heights(&self) -> Vec<u8> {
        let mut heights = vec![0; self.items.len()];
        for place in (0..self.items.len()).rev() {
            if let Kind::Inner {
                children: [below, above],
                ..
            } = self.kind(place)
            {
                heights[place] = 1 + u8::max(heights[below], heights[above]);
            }
        }
        heights
    }

    /// Passes trees whose leaf data 32-bit links can name: blocks cost at most 11 words a triangle.
    ///
    /// # Errors
    /// [`Error::Memory`].
    pub fn check_size(&self) -> Result<()> {
        if self.ids.len() >= 1 << 28 {
            return Err(Error::Memory(format!(
                "the tree would hold {} triangles; fewer than 2^28 are possible",
                self.ids.len()
            )));
        }
        Ok(())
    }
}
