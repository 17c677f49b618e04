// SPDX-License-Identifier: GPL-3.0-or-later
//! Bounding interval hierarchies whose two planes may be oblique: perpendicular to the axes, to the diagonals
//! of the cube or to those of its faces.
//!
//! Wächter and Keller 2006 call oblique planes undesirable, since they doubt that dot products can be trusted
//! as coordinates are. Here the planes' heights are rounded outwards when the tree is built, and each distance
//! is moved outwards by its error bound during the traversal, which [`crate::dop_tree`] derives. No hit is
//! lost; oblique planes affect speed only.

use crate::dop_tree::NORMALS;
use crate::slanted_tree::{ItemKind, SlantedTree};
use halfspace_base::error::{Error, Result};
use halfspace_leaf::leaves::Leaves;

/// Stands in place of the direction in leaves.
const LEAF: u32 = 15;

/// Flag of a node with one child.
const ALONE: u32 = 16;

/// Number of bits below the link. The link is the number of the first child, whose sibling is the next node, or
/// a leaf's number of triangles.
const LOW_BITS: u32 = 5;

/// Largest number of nodes in a tree, from the bits of the link.
const MOST: usize = 1 << (32 - LOW_BITS);

/// A node of twelve bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Node {
    /// Kind or axis in the low bits, the link above them.
    pub word: u32,
    /// Bits of two f32 heights; in a leaf the first is its first block.
    pub planes: [u32; 2],
}

/// A decoded node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SlantKind {
    /// A leaf.
    Leaf {
        /// First block of its triangles.
        first: u32,
        /// Number of triangles.
        count: usize,
    },
    /// An inner node.
    Inner {
        /// Index of the planes' normal in [`NORMALS`].
        direction: usize,
        /// Whether the node has one child, which lies between the planes. Otherwise the child below ends at the
        /// first plane, and the child above, the next node, begins at the second.
        alone: bool,
        /// Heights of the planes along the normal.
        planes: [f32; 2],
        /// The only child, or the child below.
        link: u32,
    },
}

impl Node {
    /// An empty leaf.
    const EMPTY: Self = Self {
        word: LEAF,
        planes: [0; 2],
    };

    /// Makes an inner node.
    fn inner(direction: usize, alone: bool, link: usize, planes: [f32; 2]) -> Self {
        let low = u32::try_from(direction).expect("one of thirteen");
        let alone = if alone { ALONE } else { 0 };
        Self {
            word: u32::try_from(link).expect("checked by the layout") << LOW_BITS | low | alone,
            planes: planes.map(f32::to_bits),
        }
    }

    /// Decodes the node.
    #[inline(always)]
    pub fn kind(&self) -> SlantKind {
        let link = self.word >> LOW_BITS;
        if self.word & LEAF == LEAF {
            return SlantKind::Leaf {
                first: self.planes[0],
                count: link as usize,
            };
        }
        SlantKind::Inner {
            direction: (self.word & LEAF) as usize,
            alone: self.word & ALONE != 0,
            planes: self.planes.map(f32::from_bits),
            link,
        }
    }
}

/// An interval hierarchy over a scene.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SlantTree {
    /// Nodes; the root is the first.
    pub nodes: Vec<Node>,
}

impl SlantTree {
    /// Lays out a tree, its leaves in `leaves`.
    ///
    /// # Errors
    /// [`Error::Memory`] if the tree has more nodes or triangles than links can address.
    pub fn new(tree: &SlantedTree, leaves: &mut Leaves) -> Result<Self> {
        if tree.items.len() >= MOST || tree.ids.len() >= 1 << 27 {
            return Err(Error::Memory(format!(
                "the tree would have {} nodes and {} triangles; at most 2^27 are possible",
                tree.items.len(),
                tree.ids.len()
            )));
        }
        let mut nodes = Vec::with_capacity(tree.items.len());
        nodes.push(Node::EMPTY);
        let mut open = vec![(0, 0)];
        let mut next = 0;
        // Fill the nodes in preorder, the order of the items and of the triangles of their leaves.
        while let Some((slot, from)) = open.pop() {
            let link = nodes.len();
            nodes[slot] = match tree.items[from].kind {
                ItemKind::Leaf { count } => {
                    let first = leaves.push(next, count);
                    let count = u32::try_from(count).expect("checked above");
                    next += count;
                    Node {
                        word: count << LOW_BITS | LEAF,
                        planes: [first, 0],
                    }
                }
                ItemKind::Only { direction, planes } => {
                    // Reserve the only child.
                    nodes.push(Node::EMPTY);
                    open.push((link, from + 1));
                    Node::inner(direction, true, link, planes)
                }
                ItemKind::Pair {
                    direction,
                    planes,
                    above,
                } => {
                    // Reserve both children; the child below is laid out first.
                    nodes.extend([Node::EMPTY; 2]);
                    open.push((link + 1, from + above));
                    open.push((link, from + 1));
                    Node::inner(direction, false, link, planes)
                }
            };
        }
        Ok(Self { nodes })
    }

    /// Decodes the node with this index; the root is 0.
    pub fn kind(&self, index: u32) -> SlantKind {
        self.nodes[index as usize].kind()
    }

    /// Returns the number of nodes.
    pub fn node_count(&self) -> usize {
        self.nodes.len()
    }

    /// Returns the size of the nodes in bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.nodes)
    }
}

/// One side of a plane of a node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlantSide {
    /// Index of the plane's normal in [`NORMALS`].
    pub direction: usize,
    /// Height of the plane.
    pub height: f32,
    /// Whether the side lies above the plane.
    pub above: bool,
}

/// Returns whether a triangle lies on these sides of all planes.
pub fn between(sides: &[SlantSide], corners: [[f32; 3]; 3]) -> bool {
    sides.iter().all(|side| {
        corners.iter().all(|p| {
            let n = NORMALS[side.direction];
            let height: f64 = (0..3).map(|i| f64::from(n[i]) * f64::from(p[i])).sum();
            if side.above {
                height >= f64::from(side.height)
            } else {
                height <= f64::from(side.height)
            }
        })
    })
}
