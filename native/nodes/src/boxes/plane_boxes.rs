// SPDX-License-Identifier: GPL-3.0-or-later
//! [`Tree`] for boxes that are made from the planes of a tree.

use super::box_tree::BoxTree;
use crate::cells::Cells;
use crate::check;
use crate::nested::Nested;
use crate::tree::{Body, Tree};
use std::sync::Arc;

/// A box tree that is made from the planes of a tree, so that a triangle may lie in several leaves.
#[derive(Debug)]
pub struct PlaneBoxTree(pub Arc<BoxTree<8>>);

impl Tree for PlaneBoxTree {
    fn bytes(&self) -> usize {
        Nested::bytes(&*self.0)
    }

    fn cells(&self) -> Option<&dyn Cells> {
        Some(&*self.0)
    }

    fn leaves(&self, see: &mut dyn FnMut(u32, usize)) {
        Tree::leaves(&*self.0, see);
    }

    fn validate(&self, body: &Body<'_>, broken: &mut Vec<String>) {
        check::boxes::boxes(body, &self.0, broken);
    }

    fn same(&self, other: &dyn Tree) -> bool {
        (other.downcast_ref::<Self>()).is_some_and(|other| self.0 == other.0)
    }
}
