// SPDX-License-Identifier: GPL-3.0-or-later
//! An octree as [`Tree`] and as [`Cells`].

use super::octree_nodes::Octree;
use crate::cells::{Cells, NodeId, NodeView, OCTANT, Steps};
use crate::check;
use crate::tree::{Body, Tree, same};
use halfspace_geom::Aabb;
use halfspace_geom::cell::{Direction, Plane};
use halfspace_geom::region::Region;
use halfspace_leaf::Leaf;

impl Tree for Octree {
    fn bytes(&self) -> usize {
        Octree::bytes(self)
    }

    fn cells(&self) -> Option<&dyn Cells> {
        Some(self)
    }

    fn leaves(&self, see: &mut dyn FnMut(u32, usize)) {
        self.visit(|_, node, _| {
            if !node.is_inner() {
                let Leaf { first, count } = node.blocks();
                see(first, count);
            }
        });
    }

    fn validate(&self, body: &Body<'_>, broken: &mut Vec<String>) {
        check::octree::octree(body, self, broken);
    }

    fn same(&self, other: &dyn Tree) -> bool {
        same(self, other)
    }
}

/// A node is named by its index and by its lowest corner in units of the smallest cell.
impl Cells for Octree {
    fn root(&self, _: Aabb) -> (NodeId, Region) {
        let root = Octree::node(self, 0);
        ([0; 4], Region::of_scene(self.cell(root, [0; 3])))
    }

    fn node(&self, [index, x, y, z]: NodeId, region: &Region) -> NodeView {
        let (node, corner) = (Octree::node(self, index), [x, y, z]);
        if !node.is_inner() {
            let Leaf { first, count } = node.blocks();
            return NodeView::leaf(first, count);
        }
        // Compute the cell of each octant.
        let half = 1 << (self.cube().depth - node.level() - 1);
        let children = (0..8).map(|octant| {
            let [x, y, z] = std::array::from_fn(|k| corner[k] + half * (octant >> k & 1));
            let index = node.children() + octant;
            let cell = self.cell(Octree::node(self, index), [x, y, z]);
            ([index, x, y, z], region.part(cell))
        });
        // The three middle planes separate the octants.
        let bounds = self.cell(node, corner);
        let planes = (0..3).map(|k| {
            let plane = Plane {
                direction: Direction::Axis(k),
                offset: bounds.min[k] + 0.5 * (bounds.max[k] - bounds.min[k]),
            };
            (plane, OCTANT)
        });
        NodeView {
            planes: planes.collect(),
            children: children.collect(),
            ..NodeView::default()
        }
    }

    fn partitions(&self) -> bool {
        true
    }

    /// An inner node compares with three planes.
    fn steps(&self, node: &NodeView) -> Steps {
        Steps {
            axis: if node.leaf.is_some() { 0 } else { 3 },
            oblique: 0,
        }
    }
}
