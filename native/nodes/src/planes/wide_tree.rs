// SPDX-License-Identifier: GPL-3.0-or-later
//! Plane trees with wide nodes: each stores three levels of a binary tree, with at most seven planes and eight
//! children, and is processed as a whole without branches.
//!
//! A node whose planes are all axis-aligned occupies one cache line: seven heights, a word with the planes' axes and a
//! mask of the children that contain triangles, and eight children. Other nodes have two more lines, with the normals
//! of all planes; since these are processed together, an oblique plane costs little more than another. Leaves are those
//! of the binary tree.

use crate::next::Next;
use crate::plane_tree::{Node, PlaneTree};
use halfspace_leaf::Leaf;
use prefetch_index::prefetch_index;

/// Number of planes of a node.
pub const PLANES: usize = 7;

/// Flag of a child that is a leaf; the other bits are its index among the leaves.
const LEAF: u32 = Next::LEAF.word();

/// Flag of a child with oblique planes; the other bits are the index of its first line.
const OBLIQUE: u32 = Next::GENERAL.word();

/// Word in place of a child that ends the traversal.
pub const OVER: u32 = Next::OVER.word();

/// A cache line. Children and other words are stored as bits of floats, because they pass through the same
/// registers as distances.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub struct Line {
    /// Heights of the planes and the word of [`Info`]; in the lines after it, x and z of the normals.
    pub first: [f32; 8],
    /// Children; in the line after it, y of the normals.
    pub second: [f32; 8],
}

impl Line {
    /// Line of zeros.
    const BLANK: Self = Self {
        first: [0.0; 8],
        second: [0.0; 8],
    };
}

/// The last word of a node's first row.
#[derive(Debug, Clone, Copy)]
pub struct Info(pub u32);

impl Info {
    /// Returns the mask of the planes perpendicular to y.
    #[inline(always)]
    pub fn along_y(self) -> u32 {
        self.0 & 0x7f
    }

    /// Returns the mask of the planes perpendicular to z.
    #[inline(always)]
    pub fn along_z(self) -> u32 {
        self.0 >> 8 & 0x7f
    }

    /// Returns the mask of the children that contain triangles.
    #[inline(always)]
    pub fn used(self) -> u32 {
        self.0 >> 16 & 0xff
    }
}

/// Place of a child's word in its parent.
#[derive(Debug, Clone, Copy)]
struct Slot {
    /// First line of the parent.
    line: usize,
    /// Lane of the child.
    lane: usize,
}

/// A node to lay out.
struct Open {
    /// Its index in the binary tree.
    node: u32,
    /// Where its parent refers to it; `None` for the root.
    parent: Option<Slot>,
}

/// A plane tree with wide nodes.
#[derive(Debug, Clone, Default)]
pub struct WideTree {
    /// The lines of all nodes.
    lines: Vec<Line>,
    /// First block and number of triangles of each leaf.
    leaves: Vec<[u32; 2]>,
    root: u32,
}

/// Returns the three levels below a node in heap order: seven planes and eight children. A leaf at a higher level is
/// moved down to the lowest child there, and the planes on this path are missing.
fn levels(tree: &PlaneTree, root: u32) -> ([Option<Node>; PLANES], [Option<u32>; 8]) {
    let mut heap = [None; 2 * PLANES + 1];
    let mut planes = [None; PLANES];
    heap[0] = Some(root);
    // Copy each inner node's children to the heap; a leaf becomes its own lower child.
    for i in 0..PLANES {
        let Some(index) = heap[i] else { continue };
        let node = tree.node(index);
        if let Node::Axis { children, .. } | Node::Oblique { children, .. } = node {
            planes[i] = Some(node);
            heap[2 * i + 1] = Some(children);
            heap[2 * i + 2] = Some(children + 1);
        } else {
            heap[2 * i + 1] = Some(index);
        }
    }
    (planes, std::array::from_fn(|lane| heap[PLANES + lane]))
}

impl WideTree {
    /// Lays out a binary tree with wide nodes.
    pub fn new(tree: &PlaneTree) -> Self {
        let mut wide = Self::default();
        // Lay out the nodes from the root down.
        let mut open = Vec::new();
        wide.root = wide.link(tree, tree.root(), None, &mut open);
        while let Some(Open { node, parent }) = open.pop() {
            let (planes, children) = levels(tree, node);
            let at = wide.lines.len();
            // Write heights and axes, and normals if one of the planes is oblique.
            let oblique = planes
                .iter()
                .any(|p| matches!(p, Some(Node::Oblique { .. })));
            wide.lines
                .resize(at + if oblique { 3 } else { 1 }, Line::BLANK);
            let mut info = 0;
            for (i, plane) in planes.iter().enumerate() {
                let (normal, height) = match *plane {
                    Some(Node::Axis { axis, split, .. }) => {
                        info |= [0, 1, 1 << 8][axis] << i;
                        let mut normal = [0.0; 3];
                        normal[axis] = 1.0;
                        (normal, split)
                    }
                    Some(Node::Oblique { normal, offset, .. }) => (normal, offset),
                    // Put everything below a missing plane.
                    _ => ([0.0; 3], f32::MAX),
                };
                wide.lines[at].first[i] = height;
                if oblique {
                    wide.lines[at + 1].first[i] = normal[0];
                    wide.lines[at + 1].second[i] = normal[1];
                    wide.lines[at + 2].first[i] = normal[2];
                }
            }
            // Link the children that contain triangles.
            for (lane, &child) in children.iter().enumerate() {
                let Some(child) = child else { continue };
                if matches!(tree.node(child), Node::Leaf { count: 0, .. }) {
                    continue;
                }
                info |= 1 << (16 + lane);
                let word = wide.link(tree, child, Some(Slot { line: at, lane }), &mut open);
                wide.lines[at].second[lane] = f32::from_bits(word);
            }
            wide.lines[at].first[PLANES] = f32::from_bits(info);
            let own = u32::try_from(at).expect("bounded by the budget")
                | if oblique { OBLIQUE } else { 0 };
            // Write the node's own word where its parent refers to it.
            match parent {
                Some(Slot { line, lane }) => wide.lines[line].second[lane] = f32::from_bits(own),
                None => wide.root = own,
            }
        }
        wide.lines.shrink_to_fit();
        wide.leaves.shrink_to_fit();
        wide
    }

    /// Returns the word of a leaf. Appends an inner node to `open` and returns 0; its word is written to `parent` when
    /// it is laid out.
    fn link(
        &mut self,
        tree: &PlaneTree,
        node: u32,
        parent: Option<Slot>,
        open: &mut Vec<Open>,
    ) -> u32 {
        let Node::Leaf { first, count } = tree.node(node) else {
            open.push(Open { node, parent });
            return 0;
        };
        let count = u32::try_from(count).expect("bounded by the budget");
        self.leaves.push([first, count]);
        LEAF | u32::try_from(self.leaves.len() - 1).expect("bounded by the budget")
    }

    /// Returns the root's word.
    #[inline(always)]
    pub fn root(&self) -> u32 {
        self.root
    }

    /// Returns a node's first line.
    #[inline(always)]
    pub fn line(&self, child: u32) -> &Line {
        &self.lines[(child & !OBLIQUE) as usize]
    }

    /// Returns all lines of a node with oblique planes.
    #[inline(always)]
    pub fn lines(&self, child: u32) -> &[Line; 3] {
        self.lines[(child & !OBLIQUE) as usize..]
            .first_chunk()
            .expect("such nodes have three lines")
    }

    /// Prefetches the lines of a node.
    #[inline(always)]
    pub fn fetch_ahead<const LINES: usize>(&self, child: u32) {
        for line in 0..LINES {
            prefetch_index(&self.lines, (child & !OBLIQUE) as usize + line);
        }
    }

    /// Returns a leaf.
    #[inline(always)]
    pub fn leaf(&self, child: u32) -> Leaf {
        let [first, count] = self.leaves[(child & !LEAF) as usize];
        Leaf {
            first,
            count: count as usize,
        }
    }

    /// Returns whether the other tree has the same nodes and leaves, bit for bit.
    pub fn is_same(&self, other: &Self) -> bool {
        let bits = |line: &Line| [line.first, line.second].map(|row| row.map(f32::to_bits));
        self.root == other.root
            && self.leaves == other.leaves
            && self.lines.iter().map(bits).eq(other.lines.iter().map(bits))
    }

    /// Returns the size in bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.lines) + size_of_val(&*self.leaves)
    }
}
