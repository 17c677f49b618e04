// SPDX-License-Identifier: GPL-3.0-or-later
//! Each layout as a [`Tree`] and as [`Cells`].

use crate::box_tree::BoxTree;
use crate::cells::{Cells, NodeId, NodeView, OBLIQUE, OCTANT, SLAB};
use crate::check;
use crate::grid::Grid;
use crate::nested::{self, Look, Nested};
use crate::octree_nodes::Octree;
use crate::plane_tree::{Node, PlaneTree};
use crate::ropes::Ropes;
use crate::slant_tree::{Kind, SlantTree};
use crate::slanted_tree::direction;
use crate::tree::{Body, Tree, same};
use crate::wide_tree::WideTree;
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
}

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
                let (first, count) = node.blocks();
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
            let (first, count) = node.blocks();
            return NodeView::leaf(first, count);
        }
        let half = 1 << (self.cube().depth - node.level() - 1);
        let children = (0..8).map(|octant| {
            let [x, y, z] = std::array::from_fn(|k| corner[k] + half * (octant >> k & 1));
            let index = node.children() + octant;
            let cell = self.cell(Octree::node(self, index), [x, y, z]);
            ([index, x, y, z], region.part(cell))
        });
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
}

impl Tree for Grid {
    fn bytes(&self) -> usize {
        Grid::bytes(self)
    }

    fn cells(&self) -> Option<&dyn Cells> {
        Some(self)
    }

    fn leaves(&self, see: &mut dyn FnMut(u32, usize)) {
        self.visit(|_, (first, count)| see(first, count));
    }

    fn validate(&self, body: &Body<'_>, broken: &mut Vec<String>) {
        check::grid::grid(body, self, broken);
    }

    fn same(&self, other: &dyn Tree) -> bool {
        same(self, other)
    }
}

/// A grid as a tree of three levels: slices along x, in each of them rows along y, and in those the cells. A node is
/// named by its level and by one coordinate per level above it.
impl Cells for Grid {
    fn root(&self, bounds: Aabb) -> (NodeId, Region) {
        ([0; 4], Region::of_scene(bounds))
    }

    fn node(&self, [level, x, y, z]: NodeId, region: &Region) -> NodeView {
        let (axis, at) = (level as usize, [x, y, z]);
        if axis == 3 {
            let (first, count) = self.cell(at.map(|i| i as usize));
            return NodeView::leaf(first, count);
        }
        let bounds = region.bounds().expect("a box within a grid");
        let walls = self.walls(axis);
        let planes = walls[1..self.count(axis)].iter().map(|&offset| {
            let direction = Direction::Axis(axis);
            (Plane { direction, offset }, axis_kind(axis))
        });
        let children = (0_u32..).zip(walls.windows(2)).map(|(number, walls)| {
            let (mut at, mut part) = (at, bounds);
            at[axis] = number;
            (part.min[axis], part.max[axis]) = (walls[0], walls[1]);
            ([level + 1, at[0], at[1], at[2]], region.part(part))
        });
        NodeView {
            planes: planes.collect(),
            children: children.collect(),
            ..NodeView::default()
        }
    }
}

impl Tree for SlantTree {
    fn bytes(&self) -> usize {
        SlantTree::bytes(self)
    }

    fn cells(&self) -> Option<&dyn Cells> {
        Some(self)
    }

    fn leaves(&self, see: &mut dyn FnMut(u32, usize)) {
        let nodes = (0..u32::try_from(self.node_count()).expect("links are 32 bits wide"))
            .map(|index| self.kind(index));
        for kind in nodes {
            if let Kind::Leaf { first, count } = kind {
                see(first, count);
            }
        }
    }

    fn validate(&self, body: &Body<'_>, broken: &mut Vec<String>) {
        check::slanted::slanted(body, self, broken);
    }

    fn same(&self, other: &dyn Tree) -> bool {
        same(self, other)
    }
}

/// A node is named by its index.
impl Cells for SlantTree {
    fn root(&self, bounds: Aabb) -> (NodeId, Region) {
        ([0; 4], Region::of_scene(bounds))
    }

    fn node(&self, [index, ..]: NodeId, region: &Region) -> NodeView {
        let (k, alone, planes, link) = match self.kind(index) {
            Kind::Leaf { first, count } => return NodeView::leaf(first, count),
            Kind::Inner {
                direction,
                alone,
                planes,
                link,
            } => (direction, alone, planes, link),
        };
        let planes = planes.map(|offset| Plane {
            direction: direction(k),
            offset,
        });
        let children = if alone {
            let [_, above] = region.split(planes[0]);
            let [inside, _] = above.split(planes[1]);
            vec![([link, 0, 0, 0], inside)]
        } else {
            let ([below, _], [_, above]) = (region.split(planes[0]), region.split(planes[1]));
            vec![([link, 0, 0, 0], below), ([link + 1, 0, 0, 0], above)]
        };
        let kind = if k < 3 { SLAB } else { OBLIQUE };
        NodeView {
            planes: planes.map(|plane| (plane, kind)).to_vec(),
            children,
            ..NodeView::default()
        }
    }
}

/// Every layout of boxes or slabs.
impl<T: Nested + PartialEq + std::fmt::Debug + Send + Sync + 'static> Tree for T {
    fn bytes(&self) -> usize {
        Nested::bytes(self)
    }

    fn cells(&self) -> Option<&dyn Cells> {
        Some(self)
    }

    fn leaves(&self, see: &mut dyn FnMut(u32, usize)) {
        // Regions do not matter here; this one contains every node.
        let everywhere = Aabb {
            min: [f32::MIN; 3],
            max: [f32::MAX; 3],
        };
        nested::visit(self, everywhere, |_, _, look, _| {
            if let Look::Leaf { first, count } = look {
                see(first, count);
            }
        });
    }

    fn validate(&self, body: &Body<'_>, broken: &mut Vec<String>) {
        check::objects::object_tree(body, self, broken);
    }

    fn same(&self, other: &dyn Tree) -> bool {
        same(self, other)
    }
}

/// A node is named by its [`nested::Place`].
impl<T: Nested> Cells for T {
    fn root(&self, bounds: Aabb) -> (NodeId, Region) {
        let (a, b) = self.top();
        ([a, b, 0, 0], Region::of_scene(bounds))
    }

    fn node(&self, [a, b, ..]: NodeId, region: &Region) -> NodeView {
        let mut children = Vec::new();
        let bounds = region.bounds().expect("a box within a tree of boxes");
        let look = self.look((a, b), &bounds, &mut children);
        let planes = match look {
            Look::Leaf { first, count } => return NodeView::leaf(first, count),
            Look::Boxes => Vec::new(),
            // Only planes that cut something off the region are planes of this node.
            Look::Slabs { axis } => (children.iter())
                .filter(|(_, child)| !child.is_empty())
                .flat_map(|(_, child)| {
                    [
                        (bounds.min[axis], child.min[axis]),
                        (bounds.max[axis], child.max[axis]),
                    ]
                })
                .filter(|(whole, part)| whole != part)
                .map(|(_, offset)| {
                    let direction = Direction::Axis(axis);
                    (Plane { direction, offset }, SLAB)
                })
                .collect(),
        };
        let regions = children
            .into_iter()
            .map(|((a, b), bounds)| ([a, b, 0, 0], region.part(bounds)));
        NodeView {
            planes,
            children: regions.collect(),
            boxes: look == Look::Boxes,
            leaf: None,
        }
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

/// The links between the leaves of a tree of planes.
#[derive(Debug)]
pub struct Linked {
    /// The tree.
    pub tree: Arc<PlaneTree>,
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
        check::ropes::ropes(body, (&self.tree, &self.ropes), broken);
    }

    fn same(&self, other: &dyn Tree) -> bool {
        (other.downcast_ref::<Self>()).is_some_and(|other| self.tree == other.tree)
    }
}

/// The boxes that were made from the planes of a tree: a triangle may lie in several leaves.
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

/// The kind of a plane across an axis: the number of the axis.
#[expect(clippy::cast_possible_truncation, reason = "an axis")]
fn axis_kind(axis: usize) -> u8 {
    axis as u8
}
