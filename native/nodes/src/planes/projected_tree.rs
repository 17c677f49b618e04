// SPDX-License-Identifier: GPL-3.0-or-later
//! Plane trees whose nodes store the number of a direction and the plane's offset along it: 8 bytes per node, also
//! where the plane is oblique. A ray's origin and direction are projected onto the few directions once, and a step
//! costs what it costs in a kd-tree (Kammaje and Mora 2007; Budge et al. 2008).
//!
//! Word 0 is the offset of the plane, the first block of a leaf, or the index of a plane stored whole. Word 1 holds
//! the node's code in its low five bits ([`DIRECTIONS`] directions, [`WHOLE`], a leaf), the mask of children that are
//! empty leaves in the next two, and above them the number of the pair of children, or the number of triangles above
//! the code.

use crate::plane_tree::{Node, PlaneTree, link_of};
use halfspace_base::error::{Error, Result};
use halfspace_leaf::Leaf;
use std::collections::HashMap;

/// Largest number of directions, the axes included. The axes come first.
pub const DIRECTIONS: usize = 30;

/// Length of an array that every code can index.
pub const CODES: usize = 1 << CODE_BITS;

/// Code of a node whose plane is stored whole, because its direction is not among the directions.
const WHOLE: u32 = 30;
/// Code of a leaf.
const LEAF: u32 = 31;
/// Number of bits of a code.
const CODE_BITS: u32 = 5;
/// Number of bits below the number of a pair of children.
const LOW_BITS: u32 = 7;

/// A node, decoded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Projected {
    /// Split along one of the directions.
    Along {
        /// Number of the direction; 0, 1 and 2 are the axes.
        direction: usize,
        /// Height of the plane along it.
        offset: f32,
        /// Index of the child below; the one above follows.
        children: u32,
        /// Bit 0: the child below is an empty leaf; bit 1: the one above is.
        empty: u32,
    },
    /// Split by `normal . x = offset`, with a normal that is not among the directions.
    Whole {
        /// Normal of about unit length.
        normal: [f32; 3],
        /// Height of the plane along the normal.
        offset: f32,
        /// Index of the child below; the one above follows.
        children: u32,
        /// Bit 0: the child below is an empty leaf; bit 1: the one above is.
        empty: u32,
    },
    /// A leaf: that of the plane tree.
    Leaf(Leaf),
}

/// A tree of split planes with few directions. Its nodes have the indices of the plane tree's.
#[derive(Debug, Clone, PartialEq)]
pub struct ProjectedTree {
    nodes: Vec<[u32; 2]>,
    /// Directions by code, one array per coordinate; unused codes hold zeros.
    table: [[f32; CODES]; 3],
    /// Number of directions.
    count: usize,
    /// Normals and offsets of the planes that are stored whole.
    whole: Vec<[f32; 4]>,
}

/// Returns the normals of all oblique nodes with the number of their nodes, the most frequent first.
fn frequent(tree: &PlaneTree) -> Vec<([u32; 3], usize)> {
    let mut counts = HashMap::new();
    tree.visit(|_, node, _| {
        if let Node::Oblique { normal, .. } = node {
            *counts.entry(normal.map(f32::to_bits)).or_insert(0) += 1;
        }
    });
    let mut all: Vec<_> = counts.into_iter().collect();
    all.sort_unstable_by(|a, b| b.1.cmp(&a.1).then(a.0.cmp(&b.0)));
    all
}

impl ProjectedTree {
    /// Lays out a plane tree with a direction number in each node. If the tree has more directions than fit, the
    /// planes of the rarest ones are stored whole.
    ///
    /// # Errors
    /// [`Error::Memory`] when the tree has more nodes than the links can address.
    pub fn new(tree: &PlaneTree) -> Result<Self> {
        if tree.slots() > 1 << (33 - LOW_BITS) {
            return Err(Error::Memory(format!(
                "the tree has {} nodes; at most 2^26 are possible with traversal=projected",
                tree.slots()
            )));
        }
        // Number the directions: the axes, then the most frequent normals.
        let mut table = [[0.0; CODES]; 3];
        for (axis, row) in table.iter_mut().enumerate() {
            row[axis] = 1.0;
        }
        let mut codes = HashMap::new();
        for (code, (normal, _)) in (3..DIRECTIONS).zip(frequent(tree)) {
            for (row, bits) in table.iter_mut().zip(normal) {
                row[code] = f32::from_bits(bits);
            }
            codes.insert(normal, u32::try_from(code).expect("below 32"));
        }
        // Encode the nodes in their order.
        let mut projected = Self {
            nodes: Vec::with_capacity(tree.slots()),
            table,
            count: 3 + codes.len(),
            whole: Vec::new(),
        };
        for index in 0..u32::try_from(tree.slots()).expect("checked above") {
            let words = projected.encode(tree.node(index), &codes);
            projected.nodes.push(words);
        }
        projected.whole.shrink_to_fit();
        Ok(projected)
    }

    /// Returns the words of a node; stores its plane if its direction has no code.
    fn encode(&mut self, node: Node, codes: &HashMap<[u32; 3], u32>) -> [u32; 2] {
        // Children come in pairs at even indices.
        let link = |children: u32, empty: u32| children >> 1 << LOW_BITS | (empty & 3) << CODE_BITS;
        match node {
            Node::Axis {
                axis,
                split,
                children,
                empty,
                ..
            } => [split.to_bits(), link(children, empty) | axis as u32],
            Node::Oblique {
                normal,
                offset,
                children,
                empty,
            } => match codes.get(&normal.map(f32::to_bits)) {
                Some(code) => [offset.to_bits(), link(children, empty) | code],
                None => {
                    let [x, y, z] = normal;
                    self.whole.push([x, y, z, offset]);
                    let index = u32::try_from(self.whole.len() - 1).expect("fewer than the nodes");
                    [index, link(children, empty) | WHOLE]
                }
            },
            Node::Leaf { first, count } => {
                let count = u32::try_from(count).expect("a count of 27 bits");
                [first, count << CODE_BITS | LEAF]
            }
        }
    }

    /// Returns the index of the root.
    #[inline(always)]
    pub fn root(&self) -> u32 {
        0
    }

    /// Decodes the node with this index.
    #[inline(always)]
    pub fn node(&self, index: u32) -> Projected {
        let [word, link] = self.nodes[index as usize];
        let children = link >> LOW_BITS << 1;
        let empty = link >> CODE_BITS & 3;
        match link % CODES as u32 {
            LEAF => Projected::Leaf(Leaf {
                first: word,
                count: (link >> CODE_BITS) as usize,
            }),
            WHOLE => {
                let [x, y, z, offset] = self.whole[word as usize];
                Projected::Whole {
                    normal: [x, y, z],
                    offset,
                    children,
                    empty,
                }
            }
            code => Projected::Along {
                direction: code as usize,
                offset: f32::from_bits(word),
                children,
                empty,
            },
        }
    }

    /// Decodes the node with this index as that of the plane tree.
    #[inline(always)]
    pub fn as_plane_node(&self, index: u32) -> Node {
        match self.node(index) {
            Projected::Leaf(Leaf { first, count }) => Node::Leaf { first, count },
            Projected::Along {
                direction,
                offset,
                children,
                empty,
            } => {
                if direction < 3 {
                    return Node::Axis {
                        axis: direction,
                        split: offset,
                        children,
                        empty,
                        link: link_of(direction, children),
                    };
                }
                let normal = [0, 1, 2].map(|k: usize| self.table[k][direction % CODES]);
                Node::Oblique {
                    normal,
                    offset,
                    children,
                    empty,
                }
            }
            Projected::Whole {
                normal,
                offset,
                children,
                empty,
            } => Node::Oblique {
                normal,
                offset,
                children,
                empty,
            },
        }
    }

    /// Returns the directions by code, one array per coordinate, and their number.
    #[inline(always)]
    pub fn directions(&self) -> (&[[f32; CODES]; 3], usize) {
        (&self.table, self.count)
    }

    /// Returns whether the node with this index equals that of a plane tree.
    pub fn equals(&self, index: u32, node: Node) -> bool {
        // Compare normal, whether the plane is one of an axis, offset, children and empty children.
        let own = match self.node(index) {
            Projected::Leaf(Leaf { first, count }) => return node == Node::Leaf { first, count },
            Projected::Along {
                direction,
                offset,
                children,
                empty,
            } => {
                let normal = [0, 1, 2].map(|k: usize| self.table[k][direction]);
                (normal, direction < 3, offset, children, empty)
            }
            Projected::Whole {
                normal,
                offset,
                children,
                empty,
            } => (normal, false, offset, children, empty),
        };
        let other = match node {
            Node::Axis {
                axis,
                split,
                children,
                empty,
                ..
            } => {
                let normal = [0, 1, 2].map(|k| f32::from(u8::from(k == axis)));
                (normal, true, split, children, empty)
            }
            Node::Oblique {
                normal,
                offset,
                children,
                empty,
            } => (normal, false, offset, children, empty),
            Node::Leaf { .. } => return false,
        };
        own == other
    }

    /// Returns the size in bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.nodes) + size_of_val(&*self.whole) + size_of_val(&self.table)
    }
}
