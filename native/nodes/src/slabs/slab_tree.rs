// SPDX-License-Identifier: GPL-3.0-or-later
//! Bounding interval hierarchies: two parallel planes per node give the end of the child below and the start of
//! the child above (Wächter and Keller 2006).
//!
//! The traversal is that of a kd-tree whose split plane is pulled apart: it visits the near child, the far
//! child, both or, if the ray passes between the planes, neither. Nodes with one child are a fifth case. Planes
//! are coordinates of triangles and therefore exact; each distance is moved outwards by the frame's `slack`, so
//! no child is skipped in which the ray might hit.

use crate::nested::{Content, Nested, NodeRef};
use crate::object_tree::{ItemKind, ObjectTree};
use crate::plane_tree::MAX_DEPTH;
use crate::refit::{FitNode, FitTree};
use crate::slab_node::{MOST, SlabKind, SlabNode};
use halfspace_base::error::{Error, Result};
use halfspace_geom::Aabb;
use halfspace_geom::tighten::{Cut, Sides, Tighten};
use halfspace_leaf::leaves::Leaves;

/// A bounding interval hierarchy over a scene.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SlabTree<N> {
    /// Nodes; the root is the first.
    pub nodes: Vec<N>,
}

/// Share of a side below which [`Gaps::SplitAxis`] cuts: 1 / 1.3 (published by the renderer Sunflow).
const SHARE: f64 = 1.0 / 1.3;

/// How a node cuts off empty space.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Gaps {
    /// An empty leaf beyond one plane, along the axis that leaves the smallest surface.
    Leaf,
    /// A node of one child, along the axis that leaves the smallest surface.
    OneChild,
    /// A node of one child between two planes, along the axis of the node's own split and only there: where both ends of
    /// that side are empty and the rest takes less than 1 / 1.3 of it.
    SplitAxis,
}

/// The cut of [`Gaps::SplitAxis`] at an item.
fn along_split(binary: &ObjectTree, from: usize, region: &Aabb) -> Option<Cut> {
    let ItemKind::Inner { axis, .. } = binary.kind(from) else {
        return None;
    };
    let item = &binary.items[from].bounds;
    let (low, high) = (item.min[axis], item.max[axis]);
    let empty = low > region.min[axis] && high < region.max[axis];
    let mut inside = *region;
    (inside.min[axis], inside.max[axis]) = (low, high);
    (empty && inside.extent(axis) < SHARE * region.extent(axis)).then_some(Cut {
        axis,
        inside,
        full: 0,
    })
}

impl<N: SlabNode> SlabTree<N> {
    /// Lays out a binary tree over a scene with these bounds, its leaves in `leaves`. Where `tighten` finds it
    /// worthwhile, a node first cuts off empty space in the way of `gaps`; [`Gaps::SplitAxis`] has a threshold of its
    /// own, and needs nodes of two planes.
    ///
    /// # Errors
    /// [`Error::Memory`] if the tree has more nodes than links can address.
    pub fn new(
        binary: &ObjectTree,
        bounds: Aabb,
        tighten: Tighten,
        gaps: Gaps,
        leaves: &mut Leaves,
    ) -> Result<Self> {
        binary.check_size()?;
        let firsts = binary.firsts();
        let heights = binary.heights();
        let only = gaps != Gaps::Leaf;
        let sides = if only { N::ONLY } else { Sides::One };
        let mut nodes = Vec::with_capacity(binary.items.len() + binary.items.len() / 2);
        nodes.push(N::EMPTY);
        // Nodes to fill: number, index in `binary`, end of its triangles, region and depth.
        let mut open = vec![(0, 0, binary.ids.len(), bounds, 0)];
        while let Some((slot, from, end, region, depth)) = open.pop() {
            let link = nodes.len();
            if link + 2 > MOST {
                return Err(Error::Memory(format!("the tree would have {MOST} nodes")));
            }
            let item = &binary.items[from].bounds;
            let cut = if depth + usize::from(heights[from]) >= MAX_DEPTH {
                None
            } else if gaps == Gaps::SplitAxis {
                along_split(binary, from, &region)
            } else {
                tighten.cut(sides, &region, item)
            };
            // Cut off empty space first, and lay the same item out again inside.
            if let Some(cut) = cut {
                let (axis, child) = (cut.axis, (from, end, cut.inside, depth + 1));
                nodes[slot] = if only {
                    nodes.push(N::EMPTY);
                    open.push((link, child.0, child.1, child.2, child.3));
                    N::only(link, &cut)
                } else {
                    nodes.extend([N::EMPTY; 2]);
                    open.push((link + cut.full, child.0, child.1, child.2, child.3));
                    let mut children = [(*item, 0); 2];
                    // Put the empty side's plane where no ray reaches it.
                    (children[0].0.max[axis], children[1].0.min[axis]) = if cut.full == 0 {
                        (cut.inside.max[axis], f32::MAX)
                    } else {
                        (f32::MIN, cut.inside.min[axis])
                    };
                    N::pair(axis, link, &region, children)
                };
                continue;
            }
            // Lay out the item itself.
            nodes[slot] = match binary.kind(from) {
                ItemKind::Leaf { count } => N::leaf(leaves.push(firsts[from], count), count),
                ItemKind::Inner {
                    axis,
                    children: [below, above],
                } => {
                    nodes.extend([N::EMPTY; 2]);
                    // Count the triangles of both children, and fill the node.
                    let middle = firsts[above] as usize;
                    let children = [
                        (binary.items[below].bounds, middle - firsts[from] as usize),
                        (binary.items[above].bounds, end - middle),
                    ];
                    let node = N::pair(axis, link, &region, children);
                    let [low, high] = node.parts(axis, &region);
                    open.push((link + 1, above, end, high, depth + 1));
                    open.push((link, below, middle, low, depth + 1));
                    node
                }
            };
        }
        nodes.shrink_to_fit();
        Ok(Self { nodes })
    }
}

impl<N: SlabNode> Nested for SlabTree<N> {
    fn top(&self) -> NodeRef {
        NodeRef::index(0)
    }

    fn content(
        &self,
        node: NodeRef,
        region: &Aabb,
        children: &mut Vec<(NodeRef, Aabb)>,
    ) -> Content {
        let node = self.nodes[node.link as usize];
        match node.kind() {
            SlabKind::Leaf { first, count } => Content::Leaf { first, count },
            SlabKind::Only { axis, link } => {
                children.push((NodeRef::index(link), node.parts(axis, region)[0]));
                Content::Slabs { axis }
            }
            SlabKind::Pair { axis, link } => {
                let [below, above] = node.parts(axis, region);
                let [first, second] = [link, link + 1].map(NodeRef::index);
                children.extend([(first, below), (second, above)]);
                Content::Slabs { axis }
            }
        }
    }

    fn bytes(&self) -> usize {
        size_of_val(&*self.nodes)
    }
}

impl<N: SlabNode + FitNode> FitTree for SlabTree<N> {
    type Node = N;

    fn nodes(&self) -> &[N] {
        &self.nodes
    }

    fn of_nodes(nodes: Vec<N>) -> Self {
        Self { nodes }
    }
}
