// SPDX-License-Identifier: GPL-3.0-or-later
//! A plane tree as its builder emits it: nodes in preorder, so that subtrees built by different threads are joined
//! by appending, and the result does not depend on the assignment of threads.

use crate::lazy_tree::Unbuilt;
use halfspace_geom::cell::Plane;

/// A node in preorder.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Item {
    /// An inner node; its two subtrees follow, the one below the plane first.
    Inner {
        /// The split plane.
        plane: Plane,
        /// Surface area of the cell divided by that of the root.
        share: f32,
    },
    /// A leaf.
    Leaf {
        /// Number of the leaf's triangle numbers, which follow in order.
        count: u32,
        /// Surface area of the cell divided by that of the root.
        share: f32,
    },
    /// The root of a subtree that is built later; these follow in order too.
    Later,
}

/// A tree or subtree in preorder.
#[derive(Debug, Default)]
pub struct Preorder {
    /// Nodes.
    pub items: Vec<Item>,
    /// Triangle numbers of the leaves, one leaf after another.
    pub ids: Vec<u32>,
    /// Number of nodes that tried their first directions only, because one of those was cheap enough.
    pub first_only: usize,
    /// Subtrees that are built later.
    pub parts: Vec<Unbuilt>,
}

impl Preorder {
    /// Appends a leaf.
    pub fn leaf(&mut self, ids: impl IntoIterator<Item = u32>, share: f32) {
        let before = self.ids.len();
        self.ids.extend(ids);
        let count = u32::try_from(self.ids.len() - before).expect("bounded by the scene");
        self.items.push(Item::Leaf { count, share });
    }

    /// Appends a subtree that is built later.
    pub fn later(&mut self, part: Unbuilt) {
        self.items.push(Item::Later);
        self.parts.push(part);
    }

    /// Appends another subtree.
    pub fn append(&mut self, mut other: Self) {
        self.items.append(&mut other.items);
        self.ids.append(&mut other.ids);
        self.first_only += other.first_only;
        self.parts.append(&mut other.parts);
    }
}
