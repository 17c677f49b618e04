// SPDX-License-Identifier: GPL-3.0-or-later
//! Ropes: links from each leaf of an axis-aligned tree to its neighbours across each of the six faces, so that a
//! ray need not return to the root (MacDonald and Booth 1990).
//!
//! A rope leads to the smallest node that covers the face. A rope tree splits the face itself (Havran, Bittner and
//! Žára 1998): of the nodes below the rope's it keeps those whose planes cut the face, and of their leaves those
//! that touch it, so that a ray evaluates only the planes that matter.

use crate::axis_tree::{AxisNode, AxisTree};
use halfspace_base::Monitor;
use halfspace_base::error::{Error, Result};
use halfspace_geom::Aabb;

/// Link across a face of the scene's box.
pub const OUTSIDE: u32 = u32::MAX;

/// Flag of a link to a node of a rope tree; other links lead to a node of the tree.
const ROPE_NODE: u32 = 1 << 31;

/// Kind of the links across a face.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LinkKind {
    /// To the smallest node that covers the face.
    Ropes,
    /// To a tree of the leaves that touch the face.
    RopeTrees,
}

/// A node of a rope tree.
#[derive(Debug, Clone, Copy, PartialEq)]
struct RopeNode {
    axis: u32,
    split: f32,
    /// Links below and above.
    children: [u32; 2],
}

/// Target of a link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Step {
    /// A plane that splits the rest of the face.
    Plane {
        /// Axis of the plane: 0, 1 or 2.
        axis: usize,
        /// Height of the plane.
        split: f32,
        /// Links below and above.
        children: [u32; 2],
    },
    /// A leaf of the tree.
    Leaf {
        /// Index of its first block.
        first: u32,
        /// Number of triangles.
        count: usize,
    },
}

/// Links and walls of all leaves of a tree.
#[derive(Debug, Clone, PartialEq)]
pub struct Ropes {
    /// Index among the leaves of each node that is a leaf, [`OUTSIDE`] for other nodes.
    leaf_of: Vec<u32>,
    /// Per leaf and axis the wall below and the wall above; infinite at the border of the scene.
    walls: Vec<[[f32; 2]; 3]>,
    /// Per leaf and axis the links below and above.
    links: Vec<[[u32; 2]; 3]>,
    /// Nodes of all rope trees.
    nodes: Vec<RopeNode>,
}

/// A node still to visit: its box, and the nodes across its faces.
#[derive(Clone, Copy)]
struct OpenNode {
    node: u32,
    cell: Aabb,
    across: [[u32; 2]; 3],
}

impl OpenNode {
    /// Returns the child on one side of the split plane, 0 below and 1 above. The other child lies across the plane.
    fn child(&self, axis: usize, split: f32, children: u32, side: u32) -> Self {
        let (mut cell, mut across) = (self.cell, self.across);
        across[axis][1 - side as usize] = children + (1 - side);
        if side == 0 {
            cell.max[axis] = split;
        } else {
            cell.min[axis] = split;
        }
        Self {
            node: children + side,
            cell,
            across,
        }
    }
}

/// A face of a leaf. A leaf at the border of the scene extends to infinity: no ray is certain to have crossed the
/// border, so a plane in the border must still be evaluated.
#[derive(Clone, Copy)]
pub struct Face<'a> {
    /// Box of the leaf.
    pub cell: &'a Aabb,
    /// Axis perpendicular to the face.
    pub axis: usize,
    /// 0 for the lower face, 1 for the upper.
    pub side: usize,
}

impl Face<'_> {
    /// Returns the children, of a node across the face, that the face touches; the same one twice if it touches
    /// only one. A cell without thickness lies in the first child that matches.
    fn touched(&self, axis: usize, split: f32, children: u32) -> [u32; 2] {
        let (below, above) = (children, children + 1);
        if axis == self.axis {
            [children + u32::from(self.side == 0); 2]
        } else if split >= self.cell.max[axis] {
            [below; 2]
        } else if split <= self.cell.min[axis] {
            [above; 2]
        } else {
            [below, above]
        }
    }
}

impl Ropes {
    /// Links the leaves of a tree over a scene with this box.
    ///
    /// # Errors
    /// [`Error::Cancelled`] and [`Error::Memory`] as the monitor returns them; [`Error::Memory`] also for rope
    /// trees with more nodes than links can address.
    pub fn new(
        tree: AxisTree<'_>,
        bounds: Aabb,
        kind: LinkKind,
        monitor: &Monitor,
    ) -> Result<Self> {
        let nodes = tree.tree().slots();
        let leaves = nodes / 2;
        monitor.take(nodes * size_of::<u32>() + leaves * 2 * size_of::<[[f32; 2]; 3]>())?;
        let mut ropes = Self {
            leaf_of: vec![OUTSIDE; nodes],
            walls: Vec::with_capacity(leaves),
            links: Vec::with_capacity(leaves),
            nodes: Vec::new(),
        };
        let mut gathered = 0;
        let mut stack = vec![OpenNode {
            node: tree.root(),
            cell: bounds,
            across: [[OUTSIDE; 2]; 3],
        }];
        // Visit the tree with the box of each node and the nodes across its faces.
        while let Some(open) = stack.pop() {
            match tree.node(open.node) {
                AxisNode::Axis {
                    axis,
                    split,
                    children,
                    ..
                } => stack.extend([1, 0].map(|side| open.child(axis, split, children, side))),
                AxisNode::Leaf { .. } => {
                    monitor.check()?;
                    let before = ropes.nodes.len();
                    ropes.leaf(tree, open, kind)?;
                    // A growing vector reserves room in advance, and copies its contents.
                    let more = ropes.nodes.len() - before;
                    monitor.charge(&mut gathered, more * 3 * size_of::<RopeNode>())?;
                }
            }
        }
        monitor.take(gathered)?;
        ropes.nodes.shrink_to_fit();
        Ok(ropes)
    }

    /// Appends the walls and the links of a leaf.
    fn leaf(&mut self, tree: AxisTree<'_>, leaf: OpenNode, kind: LinkKind) -> Result<()> {
        let OpenNode {
            node,
            mut cell,
            across,
        } = leaf;
        #[expect(clippy::cast_possible_truncation, reason = "fewer than 2^27 nodes")]
        let index = self.links.len() as u32;
        // Number the leaves in the order of the visit.
        self.leaf_of[node as usize] = index;
        // Extend leaves at the border to infinity.
        for (k, [below, above]) in across.into_iter().enumerate() {
            if below == OUTSIDE {
                cell.min[k] = f32::NEG_INFINITY;
            }
            if above == OUTSIDE {
                cell.max[k] = f32::INFINITY;
            }
        }
        // Narrow the links to the nodes that touch the face.
        let mut links = across;
        for (axis, ends) in links.iter_mut().enumerate() {
            for (side, link) in ends.iter_mut().enumerate() {
                if *link == OUTSIDE {
                    continue;
                }
                let cell = &cell;
                let face = Face { cell, axis, side };
                *link = match kind {
                    LinkKind::Ropes => covering(tree, face, *link),
                    LinkKind::RopeTrees => self.rope_tree(tree, face, *link)?,
                };
            }
        }
        self.walls
            .push([0, 1, 2].map(|k| [cell.min[k], cell.max[k]]));
        self.links.push(links);
        Ok(())
    }

    /// Appends the rope tree of the part of a face that `node` covers, and returns the link to it.
    fn rope_tree(&mut self, tree: AxisTree<'_>, face: Face<'_>, node: u32) -> Result<u32> {
        let AxisNode::Axis {
            axis,
            split,
            children,
            ..
        } = tree.node(node)
        else {
            return Ok(node);
        };
        // Skip planes that do not cut the face.
        let [below, above] = face.touched(axis, split, children);
        if below == above {
            return self.rope_tree(tree, face, below);
        }
        // Build the children first, so that the node can store their links.
        let children = [
            self.rope_tree(tree, face, below)?,
            self.rope_tree(tree, face, above)?,
        ];
        // Append the node.
        let index = self.nodes.len();
        if index >= (ROPE_NODE - 1) as usize {
            return Err(Error::Memory(
                "the rope trees would have more than 2^31 nodes".to_owned(),
            ));
        }
        #[expect(clippy::cast_possible_truncation, reason = "checked and an axis")]
        let (link, axis) = (index as u32 | ROPE_NODE, axis as u32);
        self.nodes.push(RopeNode {
            axis,
            split,
            children,
        });
        Ok(link)
    }

    /// Returns the target of a link.
    #[inline(always)]
    pub fn step(&self, tree: AxisTree<'_>, link: u32) -> Step {
        // A node of a rope tree.
        if link & ROPE_NODE != 0 {
            let node = self.nodes[(link & !ROPE_NODE) as usize];
            return Step::Plane {
                axis: node.axis as usize % 3,
                split: node.split,
                children: node.children,
            };
        }
        // A node of the tree itself: the face may be smaller than the node.
        match tree.node(link) {
            AxisNode::Axis {
                axis,
                split,
                children,
                ..
            } => Step::Plane {
                axis,
                split,
                children: [children, children + 1],
            },
            AxisNode::Leaf { first, count } => Step::Leaf { first, count },
        }
    }

    /// Returns the walls of a leaf, given by its node: per axis below and above, infinite at the border of the
    /// scene.
    #[inline(always)]
    pub fn walls(&self, leaf: u32) -> &[[f32; 2]; 3] {
        &self.walls[self.leaf_of[leaf as usize] as usize]
    }

    /// Returns the links of a leaf, given by its node: per axis below and above, [`OUTSIDE`] at the border of the
    /// scene.
    #[inline(always)]
    pub fn links(&self, leaf: u32) -> &[[u32; 2]; 3] {
        &self.links[self.leaf_of[leaf as usize] as usize]
    }

    /// Returns the number of links, without those out of the scene.
    pub fn count(&self) -> usize {
        let all = self.links.as_flattened().as_flattened();
        all.iter().filter(|link| **link != OUTSIDE).count()
    }

    /// Returns the size in bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.leaf_of)
            + size_of_val(&*self.walls)
            + size_of_val(&*self.links)
            + size_of_val(&*self.nodes)
    }
}

/// Returns the smallest node at or below `node` that covers the face.
fn covering(tree: AxisTree<'_>, face: Face<'_>, mut node: u32) -> u32 {
    while let AxisNode::Axis {
        axis,
        split,
        children,
        ..
    } = tree.node(node)
    {
        // Descend while only one child touches the face.
        let [below, above] = face.touched(axis, split, children);
        if below != above {
            break;
        }
        node = below;
    }
    node
}
