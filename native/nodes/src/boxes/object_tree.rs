// SPDX-License-Identifier: GPL-3.0-or-later
//! A binary tree of objects as its builder emits it: nodes in preorder with their boxes. All layouts of object
//! trees, by boxes or by planes, are made from it.

use halfspace_base::error::{Error, Result};
use halfspace_geom::Aabb;

/// A node in preorder: the child below follows directly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Item {
    /// The box around its triangles.
    pub bounds: Aabb,
    /// Distance in items to the child above; 0 for a leaf.
    above: u32,
    /// Axis of an inner node, or number of triangles of a leaf.
    word: u32,
}

/// A decoded item.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ItemKind {
    /// An inner node.
    Inner {
        /// Axis along which it was partitioned.
        axis: usize,
        /// Indices of the children, below and above.
        children: [usize; 2],
    },
    /// A leaf.
    Leaf {
        /// Number of triangles.
        count: usize,
    },
}

impl Item {
    /// Makes an inner node whose children are not linked yet.
    pub fn inner(axis: usize) -> Self {
        Self {
            bounds: Aabb::EMPTY,
            above: 0,
            word: u32::try_from(axis).expect("an axis"),
        }
    }

    /// Makes a leaf.
    pub fn leaf(bounds: Aabb, count: usize) -> Self {
        Self {
            bounds,
            above: 0,
            word: u32::try_from(count).expect("bounded by the scene"),
        }
    }

    /// Completes the first of `items`: its child below is the next item, its child above lies `distance` items
    /// ahead, and its box is the union of theirs.
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

/// Lengths of the lists of an [`ObjectTree`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sizes {
    /// Number of items.
    pub items: usize,
    /// Number of triangle numbers.
    pub ids: usize,
}

impl ObjectTree {
    /// Returns the lengths of both lists.
    pub fn sizes(&self) -> Sizes {
        Sizes {
            items: self.items.len(),
            ids: self.ids.len(),
        }
    }

    /// Decodes an item.
    pub fn kind(&self, index: usize) -> ItemKind {
        let item = &self.items[index];
        if item.above == 0 {
            ItemKind::Leaf {
                count: item.word as usize,
            }
        } else {
            ItemKind::Inner {
                axis: item.word as usize,
                children: [index + 1, index + item.above as usize],
            }
        }
    }

    /// Returns the index in `ids` of each item's first triangle; for an inner node that of its first leaf.
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

    /// Returns the number of levels below each item.
    pub fn heights(&self) -> Vec<u8> {
        let mut heights = vec![0; self.items.len()];
        for index in (0..self.items.len()).rev() {
            if let ItemKind::Inner {
                children: [below, above],
                ..
            } = self.kind(index)
            {
                heights[index] = 1 + u8::max(heights[below], heights[above]);
            }
        }
        heights
    }

    /// Checks that 32-bit links can address the leaf data: blocks take at most 11 words per triangle.
    ///
    /// # Errors
    /// [`Error::Memory`], for 2^28 triangles or more.
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
