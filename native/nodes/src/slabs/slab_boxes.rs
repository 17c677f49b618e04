// SPDX-License-Identifier: GPL-3.0-or-later
//! Interval hierarchies read as hierarchies of boxes: the box of a child is that of its parent with one or two faces
//! moved. Groups of rays derive one box per node for all of their rays, and keep no interval of any ray.

use crate::slab_node::{Double, SlabKind, SlabNode};
use crate::slab_tree::SlabTree;
use halfspace_geom::Aabb;
use halfspace_leaf::Leaf;
use std::sync::Arc;

/// An interval hierarchy with the box of its root.
#[derive(Debug, Clone)]
pub struct SlabBoxes {
    /// The hierarchy.
    pub tree: Arc<SlabTree<Double>>,
    /// Box of the scene, in the frame.
    pub bounds: Aabb,
}

/// A node and its box.
#[derive(Debug, Clone, Copy)]
pub struct BoxedNode {
    /// The node.
    pub node: Double,
    /// The box that contains its triangles.
    pub region: Aabb,
}

impl BoxedNode {
    /// Returns the leaf at this node, `None` for an inner node.
    #[inline(always)]
    pub fn leaf(&self) -> Option<Leaf> {
        match self.node.kind() {
            SlabKind::Leaf { first, count } => Some(Leaf { first, count }),
            _ => None,
        }
    }
}

impl SlabBoxes {
    /// Returns the root.
    #[inline(always)]
    pub fn root(&self) -> BoxedNode {
        BoxedNode {
            node: self.tree.nodes[0],
            region: self.bounds,
        }
    }

    /// Returns the children of an inner node, the far one first for rays that descend along the axes in `octant`.
    /// Empty leaves and the missing child of a node of one are `None`.
    #[inline(always)]
    pub fn children(&self, own: &BoxedNode, octant: usize) -> [Option<BoxedNode>; 2] {
        let child = |index: usize, region: Aabb| {
            let node = self.tree.nodes[index];
            let empty = matches!(node.kind(), SlabKind::Leaf { count: 0, .. });
            (!empty).then_some(BoxedNode { node, region })
        };
        match own.node.kind() {
            SlabKind::Pair { axis, link } => {
                let parts = own.node.parts(axis, &own.region);
                let near = octant >> axis & 1;
                [near ^ 1, near].map(|side| child(link as usize + side, parts[side]))
            }
            SlabKind::Only { axis, link } => {
                let [inside, _] = own.node.parts(axis, &own.region);
                [None, child(link as usize, inside)]
            }
            SlabKind::Leaf { .. } => [None; 2],
        }
    }
}
