// SPDX-License-Identifier: GPL-3.0-or-later
//! Nodes of any layout as convex regions, for drawing, statistics and ray paths. Traversals do not use this.

use halfspace_geom::Aabb;
use halfspace_geom::cell::Plane;
use halfspace_geom::region::Region;
use std::convert::Infallible;

/// Kind of an oblique plane. Kinds 0, 1 and 2 are planes perpendicular to that axis.
pub const OBLIQUE: u8 = 3;
/// Kind of a plane that bounds a child of an interval hierarchy.
pub const SLAB: u8 = 4;
/// Kind of a plane through the centre of an octree node.
pub const OCTANT: u8 = 5;
/// Kind of a face of a box.
pub const BOX: u8 = 6;

/// Returns the kind of a plane perpendicular to an axis: the number of the axis.
#[expect(clippy::cast_possible_truncation, reason = "an axis")]
pub fn axis_kind(axis: usize) -> u8 {
    axis as u8
}

/// Identifier of a node within its tree; each layout defines its four words.
pub type NodeId = [u32; 4];

/// A node in terms common to all layouts.
#[derive(Debug, Clone, Default)]
pub struct NodeView {
    /// For a leaf, the word offset of its first block and its number of triangles.
    pub leaf: Option<(u32, usize)>,
    /// For an inner node, the planes that it stores, each with its kind.
    pub planes: Vec<(Plane, u8)>,
    /// The children and their regions.
    pub children: Vec<(NodeId, Region)>,
    /// Whether the node stores the boxes of its children rather than planes.
    pub boxes: bool,
}

impl NodeView {
    /// Makes a leaf of `count` triangles.
    pub fn leaf(first: u32, count: usize) -> Self {
        Self {
            leaf: Some((first, count)),
            ..Self::default()
        }
    }
}

/// Number of steps that a ray takes at a node: comparisons with planes, or one test of all boxes of a node.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Steps {
    /// Axis-aligned steps.
    pub axis: u32,
    /// Oblique steps.
    pub oblique: u32,
}

/// A tree whose nodes cover convex regions, in the frame of the tree.
pub trait Cells {
    /// Returns the root and its region; `bounds` is the box of the scene in the frame of the tree.
    fn root(&self, bounds: Aabb) -> (NodeId, Region);

    /// Returns the node `id`, whose region is `region`.
    fn node(&self, id: NodeId, region: &Region) -> NodeView;

    /// Returns whether the children of a node cover it without common inner points, so that a leaf contains every
    /// triangle that overlaps its region.
    fn partitions(&self) -> bool {
        false
    }

    /// Returns the steps that [`crate::shape::Shape::sah_cost`] charges for a node: one for an inner node, none for a
    /// leaf.
    fn steps(&self, node: &NodeView) -> Steps {
        if node.leaf.is_some() {
            return Steps::default();
        }
        let oblique = node.planes.iter().any(|&(_, kind)| kind == OBLIQUE);
        Steps {
            axis: u32::from(!oblique),
            oblique: u32::from(oblique),
        }
    }
}

/// A leaf on a visit of all leaves.
#[derive(Debug, Clone, Copy)]
pub struct LeafCell<'a> {
    /// Word offset of its first block.
    pub first: u32,
    /// Number of triangles.
    pub count: usize,
    /// Depth; the root has depth 0.
    pub depth: usize,
    /// The cell.
    pub region: &'a Region,
}

/// A node on a visit of all nodes.
#[derive(Debug, Clone, Copy)]
pub struct NodeCell<'a> {
    /// Position in preorder; the root is 0.
    pub index: u32,
    /// Position of the parent; `None` for the root.
    pub parent: Option<u32>,
    /// Depth; the root has depth 0.
    pub depth: usize,
    /// The cell.
    pub region: &'a Region,
    /// The node.
    pub view: &'a NodeView,
}

/// Calls `visit` for all nodes in preorder, children in the order of the tree.
pub fn each_node(tree: &dyn Cells, bounds: Aabb, mut visit: impl FnMut(NodeCell<'_>)) {
    let Ok(()) = try_each_node(tree, bounds, |node| {
        visit(node);
        Ok::<_, Infallible>(())
    });
}

/// As [`each_node`], until `visit` returns an error.
///
/// # Errors
/// That of `visit`.
pub fn try_each_node<E>(
    tree: &dyn Cells,
    bounds: Aabb,
    mut visit: impl FnMut(NodeCell<'_>) -> Result<(), E>,
) -> Result<(), E> {
    let (root, whole) = tree.root(bounds);
    let mut open = vec![(root, whole, None, 0)];
    let mut index = 0;
    while let Some((id, region, parent, depth)) = open.pop() {
        let view = tree.node(id, &region);
        visit(NodeCell {
            index,
            parent,
            depth,
            region: &region,
            view: &view,
        })?;
        // Push the children in reverse, so that the first one is visited next.
        let children = view.children.into_iter().rev();
        open.extend(children.map(|(id, region)| (id, region, Some(index), depth + 1)));
        index += 1;
    }
    Ok(())
}

/// Calls `visit` for all leaves in the order of the tree.
pub fn each_leaf(tree: &dyn Cells, bounds: Aabb, mut visit: impl FnMut(LeafCell<'_>)) {
    let Ok(()) = try_each_leaf(tree, bounds, |leaf| {
        visit(leaf);
        Ok::<_, Infallible>(())
    });
}

/// As [`each_leaf`], until `visit` returns an error.
///
/// # Errors
/// That of `visit`.
pub fn try_each_leaf<E>(
    tree: &dyn Cells,
    bounds: Aabb,
    mut visit: impl FnMut(LeafCell<'_>) -> Result<(), E>,
) -> Result<(), E> {
    try_each_node(tree, bounds, |node| {
        let Some((first, count)) = node.view.leaf else {
            return Ok(());
        };
        visit(LeafCell {
            first,
            count,
            depth: node.depth,
            region: node.region,
        })
    })
}
