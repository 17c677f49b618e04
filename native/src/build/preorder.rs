// SPDX-License-Identifier: GPL-3.0-or-later
//! A plane tree as the builder emits it: nodes in preorder, so that subtrees built by different
//! threads are joined by appending, and the result does not depend on who built what.

use super::cell::Plane;
use super::lazy_tree::Unbuilt;

/// A node in preorder.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Item {
    /// An inner node; its two subtrees follow, first the one below the plane.
    Inner {
        /// The split plane.
        plane: Plane,
        /// The cell's share of the root's surface.
        share: f32,
    },
    /// A leaf.
    Leaf {
        /// How many of the triangle numbers are its own; they follow in order.
        count: u32,
        /// The cell's share of the root's surface.
        share: f32,
    },
    /// The root of a subtree that is built later; they follow in order too.
    Later,
}

/// A tree or subtree in preorder.
#[derive(Debug, Default)]
pub struct Preorder {
    /// Nodes.
    pub items: Vec<Item>,
    /// Triangle numbers of the leaves, one after another.
    pub ids: Vec<u32>,
    /// Nodes that tried their first directions only, as these were enough.
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
