// SPDX-License-Identifier: GPL-3.0-or-later
//! Plane trees as traversals read them: 8 bytes per node.
//!
//! Word 0 is the height of an axis node's plane, the index of an oblique node's plane, or the word offset of a leaf's
//! first block. Word 1 holds the node's kind in its low three bits (0, 1, 2: an axis; 3: a leaf; 4: oblique), a mask of
//! children that are empty leaves in the next two, and above them the index of the first of two consecutive children,
//! which is even, or the number of triangles. The indices of siblings therefore differ in one bit, a cache line holds
//! four pairs, only oblique nodes need the 16 bytes of an oblique plane, and a ray can skip an empty child without
//! reading it.

use crate::axis_tree::AxisNode;
use crate::preorder::{Item, Preorder};
use halfspace_base::error::{Error, Result};
use halfspace_geom::cell::Direction;
use halfspace_leaf::Leaf;
use halfspace_leaf::blocks::Blocks;
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;
use prefetch_index::prefetch_index;

/// Largest depth of a tree. Traversals keep at most one child per level on their stack.
pub const MAX_DEPTH: usize = 60;

/// Number of triangles of a leaf that stands for a subtree that is built later; the leaf's first block is then the
/// subtree's index among those of the tree.
pub const ENTRANCE: usize = (1 << (32 - LOW_BITS)) - 1;

/// Kind of a leaf.
const LEAF: u32 = 3;
/// Kind of an oblique node.
const OBLIQUE: u32 = 4;
/// Mask of the kind.
const KIND: u32 = 7;
/// Flag of an inner node whose lower child is an empty leaf; shifted by one for the upper child.
const EMPTY: u32 = 8;
/// Number of bits below the index of the children.
const LOW_BITS: u32 = 5;

/// A node, decoded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Node {
    /// Split by `x[axis] = split`.
    Axis {
        /// Axis of the plane: 0, 1 or 2.
        axis: usize,
        /// Height of the plane.
        split: f32,
        /// Index of the child below; the one above follows.
        children: u32,
        /// Bit 0: the child below is an empty leaf; bit 1: the one above is.
        empty: u32,
        /// Word 1 of the node, for [`near_child`].
        link: u32,
    },
    /// Split by `normal . x = offset`.
    Oblique {
        /// Normal of about unit length.
        normal: [f32; 3],
        /// Height of the plane along the normal.
        offset: f32,
        /// Index of the child below; the one above follows.
        children: u32,
        /// Bit 0: the child below is an empty leaf; bit 1: the one above is.
        empty: u32,
    },
    /// A leaf.
    Leaf {
        /// Word offset of its first block.
        first: u32,
        /// Number of triangles.
        count: usize,
    },
}

/// A node as it is stored. Traversals that keep it on the stack in place of its index read both children of a node
/// together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Words([u32; 2]);

impl Words {
    /// Returns the leaf, `None` for an inner node.
    #[inline(always)]
    pub fn leaf(self) -> Option<Leaf> {
        let Self([first, link]) = self;
        (link & KIND == LEAF).then_some(Leaf {
            first,
            count: (link >> LOW_BITS) as usize,
        })
    }
}

/// A tree of split planes over a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct PlaneTree {
    nodes: Vec<[u32; 2]>,
    /// Normals and heights of the oblique planes.
    planes: Vec<[f32; 4]>,
}

/// Returns the child of an axis node that a ray enters first; the index of the other differs in its lowest bit. `signs`
/// holds the ray's sign bits as bits 0, 1 and 2 of each byte.
///
/// The address of the next node depends on this at every step, so it uses neither a table nor a mask: the shift count
/// is the low five bits of the link, which are the axis plus a multiple of 8.
#[inline(always)]
pub fn near_child(link: u32, signs: u32) -> u32 {
    (link >> LOW_BITS) ^ (signs.wrapping_shr(link) & 1)
}

/// Returns word 1 of an axis node, for [`near_child`].
#[inline(always)]
pub(crate) fn link_of(axis: usize, children: u32) -> u32 {
    children << LOW_BITS | axis as u32
}

impl PlaneTree {
    /// Lays out a tree and writes the triangles of its leaves to `blocks`.
    ///
    /// # Errors
    /// [`Error::Memory`] when the tree has more nodes or leaf data than its links can address.
    pub fn new(
        preorder: &Preorder,
        scene: &Triangles,
        frame: &Frame,
        blocks: &mut Blocks,
    ) -> Result<Self> {
        let (nodes, references) = (preorder.items.len(), preorder.ids.len());
        if nodes >= 1 << 27 || references >= 1 << 28 {
            return Err(Error::Memory(format!(
                "the tree would have {nodes} nodes and {references} references; fewer than 2^27 and 2^28 \
                 are possible"
            )));
        }
        // Start with a pair whose second node is unused, so that all pairs start at even indices.
        let mut tree = Self {
            nodes: vec![[0; 2]; 2],
            planes: Vec::new(),
        };
        let mut ids = preorder.ids.as_slice();
        let mut parts = 0;
        // Nodes still to fill, with their parent; the next one last, because preorder visits below before above.
        let mut stack = vec![(0_usize, None)];
        for item in &preorder.items {
            let (slot, parent) = stack.pop().expect("preorder: every node has a slot");
            match *item {
                Item::Leaf { count, .. } => {
                    // Mark an empty leaf in its parent, so that rays can skip it.
                    if let (0, Some(parent)) = (count, parent) {
                        let parent: &mut [u32; 2] = &mut tree.nodes[parent];
                        parent[1] |= EMPTY << (slot & 1);
                    }
                    // Write the triangles of the leaf.
                    let (own, rest) = ids.split_at(count as usize);
                    ids = rest;
                    let first = blocks.push_leaf(scene, frame, own);
                    tree.nodes[slot] = [first, count << LOW_BITS | LEAF];
                }
                Item::Later => {
                    tree.nodes[slot] = [parts, (ENTRANCE as u32) << LOW_BITS | LEAF];
                    parts += 1;
                }
                Item::Inner { plane, .. } => {
                    // Reserve a pair for the children.
                    let children = tree.nodes.len();
                    tree.nodes.extend([[0; 2]; 2]);
                    stack.extend([(children + 1, Some(slot)), (children, Some(slot))]);
                    let link = u32::try_from(children).expect("bounded by the budget") << LOW_BITS;
                    // Store an axis-aligned plane in the node, an oblique one in a separate list.
                    tree.nodes[slot] = match plane.direction {
                        Direction::Axis(axis) => [plane.offset.to_bits(), link | axis as u32],
                        Direction::Oblique([x, y, z]) => {
                            tree.planes.push([x, y, z, plane.offset]);
                            let index = tree.planes.len() - 1;
                            let index = u32::try_from(index).expect("fewer than the nodes");
                            [index, link | OBLIQUE]
                        }
                    };
                }
            }
        }
        blocks.seal();
        tree.nodes.shrink_to_fit();
        tree.planes.shrink_to_fit();
        Ok(tree)
    }

    /// Returns the index of the root.
    #[inline(always)]
    pub fn root(&self) -> u32 {
        0
    }

    /// Returns the words of a node.
    #[inline(always)]
    pub fn words(&self, index: u32) -> Words {
        Words(self.nodes[index as usize])
    }

    /// Returns the words of a child; `None` if it is an empty leaf by the mask `empty` of its parent.
    #[inline(always)]
    pub fn held(&self, child: u32, empty: u32) -> Option<Words> {
        (empty >> (child & 1) & 1 == 0).then(|| self.words(child))
    }

    /// Prefetches the children of an inner node, and the plane of an oblique one.
    #[inline(always)]
    pub fn fetch_children(&self, Words([word, link]): Words) {
        prefetch_index(&self.nodes, (link >> LOW_BITS) as usize);
        if link & KIND == OBLIQUE {
            prefetch_index(&self.planes, word as usize);
        }
    }

    /// Decodes the node with this index.
    #[inline(always)]
    pub fn node(&self, index: u32) -> Node {
        self.decode(self.words(index))
    }

    /// Decodes a node.
    #[inline(always)]
    pub fn decode(&self, Words([word, link]): Words) -> Node {
        match link & KIND {
            axis @ 0..=2 => Node::Axis {
                axis: axis as usize,
                split: f32::from_bits(word),
                children: link >> LOW_BITS,
                empty: (link / EMPTY) & 3,
                link,
            },
            OBLIQUE => {
                // The first word is the index of the plane.
                let [x, y, z, offset] = self.planes[word as usize];
                Node::Oblique {
                    normal: [x, y, z],
                    offset,
                    children: link >> LOW_BITS,
                    empty: (link / EMPTY) & 3,
                }
            }
            _ => Node::Leaf {
                first: word,
                count: (link >> LOW_BITS) as usize,
            },
        }
    }

    /// Returns whether each plane is perpendicular to an axis.
    pub fn is_axis_aligned(&self) -> bool {
        self.planes.is_empty()
    }

    /// Decodes a node of a tree without oblique planes.
    #[inline(always)]
    pub(crate) fn axis_node(&self, index: u32) -> AxisNode {
        let Words([word, link]) = self.words(index);
        match link & KIND {
            axis @ 0..=2 => AxisNode::Axis {
                axis: axis as usize,
                split: f32::from_bits(word),
                children: link >> LOW_BITS,
                empty: (link / EMPTY) & 3,
                link,
            },
            _ => AxisNode::Leaf {
                first: word,
                count: (link >> LOW_BITS) as usize,
            },
        }
    }

    /// Returns the number of node slots; the one next to the root is unused.
    pub fn slots(&self) -> usize {
        self.nodes.len()
    }

    /// Returns the size in bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.nodes) + size_of_val(&*self.planes)
    }

    /// Calls `see` for all nodes, the child below first, with index, node and depth.
    pub fn visit(&self, mut see: impl FnMut(u32, Node, usize)) {
        let mut stack = vec![(self.root(), 0)];
        while let Some((index, depth)) = stack.pop() {
            let node = self.node(index);
            see(index, node, depth);
            if let Node::Axis { children, .. } | Node::Oblique { children, .. } = node {
                stack.extend([(children + 1, depth + 1), (children, depth + 1)]);
            }
        }
    }
}
