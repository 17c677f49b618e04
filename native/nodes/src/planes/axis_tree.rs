// SPDX-License-Identifier: GPL-3.0-or-later
//! Plane trees without oblique planes: checked once, so that traversals of these trees have no case for oblique nodes.

use crate::plane_tree::{Node, PlaneTree};
use halfspace_base::error::{Error, Result};
use std::sync::Arc;

/// A node, decoded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum AxisNode {
    /// Split by `x[axis] = split`; the fields are those of [`Node::Axis`].
    Axis {
        /// Axis of the plane: 0, 1 or 2.
        axis: usize,
        /// Height of the plane.
        split: f32,
        /// Index of the child below; the one above follows.
        children: u32,
        /// Bit 0: the child below is an empty leaf; bit 1: the one above is.
        empty: u32,
        /// Word 1 of the node, for [`crate::plane_tree::near_child`].
        link: u32,
    },
    /// A leaf.
    Leaf {
        /// Word offset of its first block.
        first: u32,
        /// Number of triangles.
        count: usize,
    },
}

/// A plane tree without oblique planes.
#[derive(Debug, Clone, Copy)]
pub struct AxisTree<'a>(&'a PlaneTree);

impl<'a> AxisTree<'a> {
    /// Checks a tree; `None` if it has an oblique plane.
    pub fn new(tree: &'a PlaneTree) -> Option<Self> {
        tree.is_axis_aligned().then_some(Self(tree))
    }

    /// Returns the tree.
    #[inline(always)]
    pub fn tree(self) -> &'a PlaneTree {
        self.0
    }

    /// Returns the index of the root.
    #[inline(always)]
    pub fn root(self) -> u32 {
        self.0.root()
    }

    /// Decodes the node with this index.
    #[inline(always)]
    pub fn node(self, index: u32) -> AxisNode {
        self.0.axis_node(index)
    }
}

/// An [`AxisTree`] that shares the ownership of its tree, for kernels.
#[derive(Debug, Clone, PartialEq)]
pub struct SharedAxisTree(Arc<PlaneTree>);

impl SharedAxisTree {
    /// Checks a tree.
    ///
    /// # Errors
    /// [`Error::Spec`] if it has an oblique plane.
    pub fn new(tree: &Arc<PlaneTree>) -> Result<Self> {
        if tree.is_axis_aligned() {
            Ok(Self(tree.clone()))
        } else {
            let message = "the traversal is for trees whose planes are perpendicular to the axes";
            Err(Error::Spec(message.to_owned()))
        }
    }

    /// Borrows the tree.
    #[inline(always)]
    pub fn borrowed(&self) -> AxisTree<'_> {
        AxisTree(&self.0)
    }
}

impl From<AxisNode> for Node {
    fn from(node: AxisNode) -> Self {
        match node {
            AxisNode::Axis {
                axis,
                split,
                children,
                empty,
                link,
            } => Self::Axis {
                axis,
                split,
                children,
                empty,
                link,
            },
            AxisNode::Leaf { first, count } => Self::Leaf { first, count },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::preorder::{Item, Preorder};
    use halfspace_geom::cell::{Direction, Plane};
    use halfspace_leaf::blocks::Blocks;
    use halfspace_ray::frame::Frame;
    use halfspace_scene::Triangles;

    /// A tree of one plane and two empty leaves.
    fn split(direction: Direction) -> PlaneTree {
        let scene = Triangles::new(Vec::new(), Vec::new()).unwrap();
        let plane = Plane {
            direction,
            offset: 0.5,
        };
        let mut preorder = Preorder::default();
        let (share, leaf) = (
            1.0,
            Item::Leaf {
                count: 0,
                share: 0.5,
            },
        );
        preorder.items = vec![Item::Inner { plane, share }, leaf, leaf];
        let frame = Frame::new(scene.bounds());
        PlaneTree::new(&preorder, &scene, &frame, &mut Blocks::new()).unwrap()
    }

    #[test]
    fn oblique_trees_are_refused_and_others_decoded_alike() {
        let oblique = split(Direction::Oblique([0.6, 0.8, 0.0]));
        assert!(AxisTree::new(&oblique).is_none());
        let oblique = SharedAxisTree::new(&Arc::new(oblique));
        assert!(matches!(oblique, Err(Error::Spec(_))));
        let straight = split(Direction::Axis(1));
        let tree = AxisTree::new(&straight).unwrap();
        for index in [tree.root(), 2, 3] {
            assert_eq!(Node::from(tree.node(index)), straight.node(index));
        }
    }
}
