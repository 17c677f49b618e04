// SPDX-License-Identifier: GPL-3.0-or-later
//! The common interface of object trees, for their shape, for validation and for drawing. Traversals do not use it.

use crate::cells::{Cells, NodeId, NodeView, SLAB};
use crate::check;
use crate::shape::{Measure, Shape};
use crate::tree::{Body, Tree, same};
use halfspace_geom::Aabb;
use halfspace_geom::cell::{Direction, Plane};
use halfspace_geom::region::Region;

/// Content of a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Content {
    /// A leaf.
    Leaf {
        /// Position of its first block.
        first: u32,
        /// Number of triangles.
        count: usize,
    },
    /// An inner node that stores the box of each child.
    Boxes,
    /// An inner node that stores, along one axis, the planes between which each child lies.
    Slabs {
        /// 0, 1 or 2.
        axis: usize,
    },
}

/// Reference to a node, in the terms of its layout.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NodeRef {
    /// Index of the node, or position of the leaf's first block.
    pub link: u32,
    /// The count that the layout stores with the link; 0 if it stores none.
    pub count: u32,
}

impl NodeRef {
    /// Makes a reference of an index alone.
    pub fn index(link: u32) -> Self {
        Self { link, count: 0 }
    }
}

/// A layout of an object tree.
pub trait Nested {
    /// Returns the reference to the root.
    fn top(&self) -> NodeRef;

    /// Returns the content of a node. Appends the children of an inner node, each with its region within `region`, that
    /// of the node itself.
    fn content(&self, node: NodeRef, region: &Aabb, children: &mut Vec<(NodeRef, Aabb)>)
    -> Content;

    /// Returns the size of the nodes in bytes.
    fn bytes(&self) -> usize;

    /// Returns whether the bounds that a node stores in addition to its region enclose those of its children.
    fn encloses_children(&self, node: NodeRef) -> bool {
        let _ = node;
        true
    }

    /// Returns whether the bounds that a leaf stores in addition to its region enclose a triangle.
    fn encloses(&self, leaf: NodeRef, corners: [[f32; 3]; 3]) -> bool {
        let _ = (leaf, corners);
        true
    }
}

/// A node on a visit of all nodes.
#[derive(Debug, Clone, Copy)]
pub struct Visit<'a> {
    /// The node.
    pub node: NodeRef,
    /// Its region.
    pub region: &'a Aabb,
    /// Depth; the root has depth 0.
    pub depth: usize,
    /// Its content.
    pub content: Content,
    /// The children and their regions.
    pub children: &'a [(NodeRef, Aabb)],
}

/// Visits all nodes below `bounds`, parents before children.
pub fn visit<T: Nested + ?Sized>(tree: &T, bounds: Aabb, mut see: impl FnMut(Visit<'_>)) {
    let mut stack = vec![(tree.top(), bounds, 0)];
    let mut children = Vec::new();
    while let Some((node, region, depth)) = stack.pop() {
        children.clear();
        let content = tree.content(node, &region, &mut children);
        see(Visit {
            node,
            region: &region,
            depth,
            content,
            children: &children,
        });
        let below = children.iter().rev();
        stack.extend(below.map(|&(node, region)| (node, region, depth + 1)));
    }
}

/// Measures a tree over a scene of these bounds.
pub fn shape<T: Nested + ?Sized>(tree: &T, bounds: Aabb) -> Shape {
    let mut measure = Measure::default();
    let root_area = bounds.area();
    visit(tree, bounds, |visit| {
        let share = if root_area > 0.0 && !visit.region.is_empty() {
            visit.region.area() / root_area
        } else {
            0.0
        };
        if let Content::Leaf { count, .. } = visit.content {
            measure.leaf(count, visit.depth, share);
        } else {
            measure.axis(share);
        }
    });
    measure.finish()
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
        visit(self, everywhere, |visit| {
            if let Content::Leaf { first, count } = visit.content {
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

/// Returns a reference as the name of a node.
fn id(node: NodeRef) -> NodeId {
    [node.link, node.count, 0, 0]
}

/// A node is named by its [`NodeRef`].
impl<T: Nested> Cells for T {
    fn root(&self, bounds: Aabb) -> (NodeId, Region) {
        (id(self.top()), Region::of_scene(bounds))
    }

    fn node(&self, [link, count, ..]: NodeId, region: &Region) -> NodeView {
        let mut children = Vec::new();
        let bounds = region.bounds().expect("a box within a tree of boxes");
        let content = self.content(NodeRef { link, count }, &bounds, &mut children);
        let planes = match content {
            Content::Leaf { first, count } => return NodeView::leaf(first, count),
            Content::Boxes => Vec::new(),
            // Only planes that cut space off the region are planes of this node.
            Content::Slabs { axis } => (children.iter())
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
        // Convert the boxes of the children to regions.
        let regions = children
            .into_iter()
            .map(|(node, bounds)| (id(node), region.part(bounds)));
        NodeView {
            planes,
            children: regions.collect(),
            boxes: content == Content::Boxes,
            leaf: None,
        }
    }
}
