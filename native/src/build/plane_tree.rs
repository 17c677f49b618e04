// SPDX-License-Identifier: GPL-3.0-or-later
//! Plane trees as rays see them: 8 bytes a node.
//!
//! Word 0 is the split of an axis node, the place of an oblique node's plane, or the place of a
//! leaf's triangles. Word 1 holds in its low three bits what the node is (0, 1, 2: an axis; 3: a
//! leaf; 4: oblique), in the next two which children are empty leaves, and above them the first of
//! the two children, which stand side by side at an even place, or the number of triangles. So the
//! child on the other side is one bit away, a cache line holds four pairs, an oblique plane costs
//! its 16 bytes only where there is one, and a ray that would enter an empty child on its way
//! need not go there to learn it.

use super::cell::Direction;
use super::preorder::{Item, Preorder};
use crate::error::{Error, Result};
use crate::scene::Triangles;
use crate::traverse::blocks::Blocks;
use crate::traverse::frame::Frame;

/// No tree is deeper. Walks keep at most one waiting child per level.
pub const MAX_DEPTH: usize = 60;

/// Instead of a leaf's number of triangles: here a subtree begins that is built later, and the place of the
/// leaf's triangles is its number among those of its tree.
pub const ENTRANCE: usize = (1 << (32 - LOW_BITS)) - 1;

const LEAF: u32 = 3;
const OBLIQUE: u32 = 4;
const KIND: u32 = 7;
/// Set for an inner node whose child below is an empty leaf; shifted by one, above.
const EMPTY: u32 = 8;
const LOW_BITS: u32 = 5;

/// A node, decoded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Node {
    /// Split by `x[axis] = split`.
    Axis {
        /// 0, 1 or 2.
        axis: usize,
        /// Height of the plane.
        split: f32,
        /// The child below; the one above is the next.
        children: u32,
        /// Bit 0: the child below is an empty leaf; bit 1: the one above is.
        empty: u32,
        /// The stored link, for [`near_child`].
        link: u32,
    },
    /// Split by `normal . x = offset`.
    Oblique {
        /// Of about unit length.
        normal: [f32; 3],
        /// Height of the plane along the normal.
        offset: f32,
        /// The child below; the one above is the next.
        children: u32,
        /// Bit 0: the child below is an empty leaf; bit 1: the one above is.
        empty: u32,
    },
    /// A leaf.
    Leaf {
        /// Where its blocks begin.
        first: u32,
        /// How many triangles it holds.
        count: usize,
    },
}

/// A tree of split planes over a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct PlaneTree {
    nodes: Vec<[u32; 2]>,
    planes: Vec<[f32; 4]>,
}

/// The child of an axis node that a ray enters first; the other is one bit away. `signs` has the
/// ray's sign bits as bits 0, 1 and 2 of each byte.
///
/// The next node's address hangs on this, step after step. The shift takes the low five bits of the
/// link, axis and empty children alike, as its count, so no table and no mask stand in between.
#[inline(always)]
pub fn near_child(link: u32, signs: u32) -> u32 {
    (link >> LOW_BITS) ^ (signs.wrapping_shr(link) & 1)
}

impl PlaneTree {
    /// Lays out a tree, its leaves' triangles in `blocks`.
    ///
    /// # Errors
    /// [`Error::Memory`] when the tree has more nodes or leaf data than its links can name.
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
        let mut tree = Self {
            nodes: vec![[0; 2]; 2],
            planes: Vec::new(),
        };
        let mut ids = preorder.ids.as_slice();
        let mut parts = 0;
        // Places still to fill, the next one last: preorder visits below before above.
        let mut places = vec![(0_usize, None)];
        for item in &preorder.items {
            let (place, parent) = places.pop().expect("preorder: every node has a place");
            match *item {
                Item::Leaf { count, .. } => {
                    if let (0, Some(parent)) = (count, parent) {
                        let parent: &mut [u32; 2] = &mut tree.nodes[parent];
                        parent[1] |= EMPTY << (place & 1);
                    }
                    let (own, rest) = ids.split_at(count as usize);
                    ids = rest;
                    let first = blocks.push_leaf(scene, frame, own);
                    tree.nodes[place] = [first, count << LOW_BITS | LEAF];
                }
                Item::Later => {
                    tree.nodes[place] = [parts, (ENTRANCE as u32) << LOW_BITS | LEAF];
                    parts += 1;
                }
                Item::Inner { plane, .. } => {
                    let children = tree.nodes.len();
                    tree.nodes.extend([[0; 2]; 2]);
                    places.extend([(children + 1, Some(place)), (children, Some(place))]);
                    let link = u32::try_from(children).expect("bounded by the budget") << LOW_BITS;
                    tree.nodes[place] = match plane.direction {
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

    /// The root.
    #[inline(always)]
    pub fn root(&self) -> u32 {
        0
    }

    /// A node.
    #[inline(always)]
    pub fn node(&self, index: u32) -> Node {
        let [word, link] = self.nodes[index as usize];
        match link & KIND {
            axis @ 0..=2 => Node::Axis {
                axis: axis as usize,
                split: f32::from_bits(word),
                children: link >> LOW_BITS,
                empty: (link / EMPTY) & 3,
                link,
            },
            OBLIQUE => {
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

    /// How many places there are for nodes; one beside the root stays free.
    pub fn places(&self) -> usize {
        self.nodes.len()
    }

    /// Size in bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.nodes) + size_of_val(&*self.planes)
    }

    /// Visits all nodes, the child below first: index, node, depth.
    pub fn visit(&self, mut see: impl FnMut(u32, Node, usize)) {
        let mut waiting = vec![(self.root(), 0)];
        while let Some((index, depth)) = waiting.pop() {
            let node = self.node(index);
            see(index, node, depth);
            if let Node::Axis { children, .. } | Node::Oblique { children, .. } = node {
                waiting.extend([(children + 1, depth + 1), (children, depth + 1)]);
            }
        }
    }
}
