// SPDX-License-Identifier: GPL-3.0-or-later
//! Trees of split planes as [`Tree`] and as [`Cells`].

use super::plane_tree::{Node, PlaneTree};
use super::projected_tree::ProjectedTree;
use super::ropes::Ropes;
use super::wide_tree::WideTree;
use crate::axis_tree::SharedAxisTree;
use crate::cells::{Cells, NodeId, NodeView, OBLIQUE, axis_kind};
use crate::check;
use crate::tree::{Body, Tree, same};
use halfspace_geom::Aabb;
use halfspace_geom::cell::{Direction, Plane};
use halfspace_geom::region::Region;
use std::sync::Arc;

impl Tree for PlaneTree {
    fn bytes(&self) -> usize {
        PlaneTree::bytes(self)
    }

    fn cells(&self) -> Option<&dyn Cells> {
        Some(self)
    }

    fn leaves(&self, see: &mut dyn FnMut(u32, usize)) {
        self.visit(|_, node, _| {
            if let Node::Leaf { first, count } = node {
                see(first, count);
            }
        });
    }

    fn validate(&self, body: &Body<'_>, broken: &mut Vec<String>) {
        check::planes::planes(body, self, broken);
    }

    fn same(&self, other: &dyn Tree) -> bool {
        same(self, other)
    }
}

/// A node is named by its index.
impl Cells for PlaneTree {
    fn root(&self, bounds: Aabb) -> (NodeId, Region) {
        ([PlaneTree::root(self), 0, 0, 0], Region::of_scene(bounds))
    }

    fn node(&self, [index, ..]: NodeId, region: &Region) -> NodeView {
        let (direction, offset, children, kind) = match PlaneTree::node(self, index) {
            Node::Leaf { first, count } => return NodeView::leaf(first, count),
            Node::Axis {
                axis,
                split,
                children,
                ..
            } => (Direction::Axis(axis), split, children, axis_kind(axis)),
            Node::Oblique {
                normal,
                offset,
                children,
                ..
            } => (Direction::Oblique(normal), offset, children, OBLIQUE),
        };
        // Split the region by the plane.
        let plane = Plane { direction, offset };
        let [below, above] = region.split(plane);
        NodeView {
            planes: vec![(plane, kind)],
            children: vec![
                ([children, 0, 0, 0], below),
                ([children + 1, 0, 0, 0], above),
            ],
            ..NodeView::default()
        }
    }

    fn partitions(&self) -> bool {
        true
    }
}

/// Auxiliary data: its leaves are those of the binary tree.
impl Tree for WideTree {
    fn bytes(&self) -> usize {
        WideTree::bytes(self)
    }

    fn cells(&self) -> Option<&dyn Cells> {
        None
    }

    fn leaves(&self, _: &mut dyn FnMut(u32, usize)) {}

    fn validate(&self, _: &Body<'_>, _: &mut Vec<String>) {}

    fn same(&self, other: &dyn Tree) -> bool {
        (other.downcast_ref::<Self>()).is_some_and(|other| self.is_same(other))
    }
}

/// The nodes of a tree of planes with the numbers of their directions.
#[derive(Debug)]
pub struct Numbered {
    /// The tree.
    pub tree: Arc<PlaneTree>,
    /// Its nodes, numbered.
    pub nodes: Arc<ProjectedTree>,
}

/// Auxiliary data: its leaves are those of the tree.
impl Tree for Numbered {
    fn bytes(&self) -> usize {
        self.nodes.bytes()
    }

    fn cells(&self) -> Option<&dyn Cells> {
        None
    }

    fn leaves(&self, _: &mut dyn FnMut(u32, usize)) {}

    fn validate(&self, body: &Body<'_>, broken: &mut Vec<String>) {
        self.tree.visit(|index, node, _| {
            if body.monitor.is_cancelled() {
                return;
            }
            if !self.nodes.equals(index, node) {
                broken.push(format!(
                    "node {index} differs between the layouts: {node:?}, {:?}",
                    self.nodes.node(index)
                ));
            }
        });
    }

    fn same(&self, other: &dyn Tree) -> bool {
        (other.downcast_ref::<Self>()).is_some_and(|other| self.nodes == other.nodes)
    }
}

/// The links between the leaves of a tree of planes.
#[derive(Debug)]
pub struct Linked {
    /// The tree.
    pub tree: Arc<SharedAxisTree>,
    /// Its links.
    pub ropes: Arc<Ropes>,
}

/// Auxiliary data: its leaves are those of the tree.
impl Tree for Linked {
    fn bytes(&self) -> usize {
        self.ropes.bytes()
    }

    fn cells(&self) -> Option<&dyn Cells> {
        None
    }

    fn leaves(&self, _: &mut dyn FnMut(u32, usize)) {}

    fn validate(&self, body: &Body<'_>, broken: &mut Vec<String>) {
        check::ropes::ropes(body, self.tree.borrowed(), &self.ropes, broken);
    }

    fn same(&self, other: &dyn Tree) -> bool {
        (other.downcast_ref::<Self>()).is_some_and(|other| self.tree == other.tree)
    }
}
