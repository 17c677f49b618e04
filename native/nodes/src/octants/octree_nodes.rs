// SPDX-License-Identifier: GPL-3.0-or-later
//! Octrees as traversals read them: 16 bytes per node, eight children in consecutive nodes.
//!
//! Word 0 is the index of an inner node's first child, or the word offset of a leaf's first block. Word 1 is the
//! parent. Word 2 holds the level in its low five bits, the octant within the parent in the next three, and in the
//! others the number of triangles, or all bits set for an inner node. Word 3 is an inner node's mask of octants that
//! are empty leaves, or a leaf's index among the leaves, which addresses its links.

use crate::octants::{Cube, FAR, Item, Octants};
use crate::shape::{Measure, Shape};
use halfspace_base::error::{Error, Result};
use halfspace_geom::Aabb;
use halfspace_leaf::Leaf;
use halfspace_leaf::blocks::Blocks;
use halfspace_ray::FramedScene;
use halfspace_ray::frame::Frame;
use prefetch_index::prefetch_index;

/// Link across a face of the root.
pub const OUTSIDE: u32 = u32::MAX;

/// Number of bits of the level.
const LEVEL_BITS: u32 = 5;
/// Position of the number of triangles in word 2.
const COUNT_SHIFT: u32 = 8;
/// Value of the count of an inner node.
const INNER: u32 = (1 << 24) - 1;

/// A node.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Node([u32; 4]);

impl Node {
    /// Returns whether the node has children.
    #[inline(always)]
    pub fn is_inner(self) -> bool {
        self.0[2] >> COUNT_SHIFT == INNER
    }

    /// Returns the index of an inner node's first child.
    #[inline(always)]
    pub fn children(self) -> u32 {
        self.0[0]
    }

    /// Returns the mask of an inner node's octants that are empty leaves.
    #[inline(always)]
    pub fn empty_octants(self) -> u32 {
        self.0[3]
    }

    /// Returns a leaf's first block and number of triangles.
    #[inline(always)]
    pub fn blocks(self) -> Leaf {
        Leaf {
            first: self.0[0],
            count: (self.0[2] >> COUNT_SHIFT) as usize,
        }
    }

    /// Returns a leaf's index among the leaves.
    #[inline(always)]
    pub fn leaf_index(self) -> usize {
        self.0[3] as usize
    }

    /// Returns the parent; the root is its own parent.
    #[inline(always)]
    pub fn parent(self) -> u32 {
        self.0[1]
    }

    /// Returns the level; 0 for the root.
    #[inline(always)]
    pub fn level(self) -> u32 {
        self.0[2] & ((1 << LEVEL_BITS) - 1)
    }

    /// Returns the octant of the node within its parent.
    #[inline(always)]
    pub fn octant(self) -> u32 {
        self.0[2] >> LEVEL_BITS & 7
    }
}

/// An octree over a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Octree {
    nodes: Vec<Node>,
    /// Links of each leaf; empty without [`Self::with_links`].
    links: Vec<[u32; 6]>,
    cube: Cube,
    /// Largest absolute coordinate of origins for [`Self::is_near`].
    far: f32,
}

impl Octree {
    /// Lays out a tree and writes the triangles of its leaves to `blocks`.
    ///
    /// # Errors
    /// [`Error::Memory`] when the tree has more nodes or leaf data than its links can address.
    pub fn new(
        octants: &Octants,
        cube: Cube,
        framed: FramedScene<'_>,
        blocks: &mut Blocks,
    ) -> Result<Self> {
        let (nodes, references) = (octants.items.len(), octants.ids.len());
        // Check that the fields of a node can hold all values.
        let counts = octants.items.iter().map(|item| match item {
            Item::Inner => 0,
            Item::Leaf(count) => *count,
        });
        if nodes >= 1 << 30 || references >= 1 << 28 || counts.max().unwrap_or(0) >= INNER {
            return Err(Error::Memory(format!(
                "the tree would have {nodes} nodes and {references} references; fewer than 2^30 and 2^28 \
                 are possible, and 2^24 in a leaf"
            )));
        }
        let mut tree = Self {
            nodes: Vec::with_capacity(nodes),
            links: Vec::new(),
            cube,
            far: FAR * framed.frame.bounds().magnitude(),
        };
        tree.nodes.push(Node::default());
        // Fill the nodes in preorder.
        let mut ids = octants.ids.as_slice();
        let mut leaves = 0;
        // Nodes still to fill, with parent and level; the next one last.
        let mut stack = vec![(0_usize, 0_usize, 0_u32)];
        for item in &octants.items {
            let (slot, parent, level) = stack.pop().expect("preorder: every node has a slot");
            // Derive the octant from the index: groups of eight children follow the root.
            #[expect(clippy::cast_possible_truncation, reason = "checked above")]
            let (octant, up) = if slot == 0 {
                (0, 0)
            } else {
                ((slot as u32 - 1) & 7, parent as u32)
            };
            let head = level | octant << LEVEL_BITS;
            // Write the node; an inner node reserves its eight children, an empty leaf sets its bit in the parent.
            tree.nodes[slot] = Node(match *item {
                Item::Leaf(count) => {
                    if count == 0 && slot != 0 {
                        tree.nodes[parent].0[3] |= 1 << octant;
                    }
                    let (own, rest) = ids.split_at(count as usize);
                    ids = rest;
                    leaves += 1;
                    let first = blocks.push_leaf(framed.scene, framed.frame, own);
                    [first, up, head | count << COUNT_SHIFT, leaves - 1]
                }
                Item::Inner => {
                    // Reserve the children, and visit them in preorder.
                    let first = tree.nodes.len();
                    tree.nodes.resize(first + 8, Node::default());
                    stack.extend((0..8).rev().map(|o| (first + o, slot, level + 1)));
                    #[expect(clippy::cast_possible_truncation, reason = "checked above")]
                    let first = first as u32;
                    [first, up, head | INNER << COUNT_SHIFT, 0]
                }
            });
        }
        blocks.seal();
        Ok(tree)
    }

    /// Adds six links to each leaf, one to the neighbour across each face: the leaf that covers the face, or the inner
    /// node of the leaf's size if smaller leaves do (Endl and Sommer 1994). The link across the face on side `s` of
    /// axis `k` has index `2 k + s`.
    ///
    /// Links are computed from the root down: a neighbour is a sibling, or else a child of the parent's neighbour, or
    /// that neighbour itself if it has no children.
    pub fn with_links(mut self) -> Self {
        let mut all = vec![[OUTSIDE; 6]; self.nodes.len()];
        let mut leaves = vec![[OUTSIDE; 6]; self.nodes.iter().filter(|n| !n.is_inner()).count()];
        // One pass suffices, because children have larger indices than their parents.
        for (index, node) in self.nodes.iter().enumerate() {
            if index != 0 {
                // Compute the six links of the node from those of its parent.
                for (face, link) in (0_u32..).zip(0..6) {
                    let bit = 1 << (face >> 1);
                    let across = node.octant() ^ bit;
                    let leaves_parent = u32::from(node.octant() & bit != 0) == face & 1;
                    all[index][link] = if leaves_parent {
                        match all[node.parent() as usize][link] {
                            OUTSIDE => OUTSIDE,
                            wide if self.node(wide).is_inner() => {
                                self.node(wide).children() + across
                            }
                            wide => wide,
                        }
                    } else {
                        self.node(node.parent()).children() + across
                    };
                }
            }
            if !node.is_inner() {
                leaves[node.leaf_index()] = all[index];
            }
        }
        self.links = leaves;
        self
    }

    /// Returns a node; 0 is the root.
    #[inline(always)]
    pub fn node(&self, index: u32) -> Node {
        self.nodes[index as usize]
    }

    /// Prefetches the eight children of an inner node.
    #[inline(always)]
    pub fn fetch_children(&self, node: Node) {
        // Four nodes fill a cache line; the children may begin anywhere in one.
        for child in [0, 3, 7] {
            prefetch_index(&self.nodes, node.children() as usize + child);
        }
    }

    /// Returns the links of the leaf with index `leaf` among the leaves; see [`Self::with_links`].
    #[inline(always)]
    pub fn links(&self, leaf: usize) -> &[u32; 6] {
        &self.links[leaf]
    }

    /// Returns whether leaves have links.
    pub fn has_links(&self) -> bool {
        !self.links.is_empty()
    }

    /// Returns the root cell and the grid of the smallest cells.
    #[inline(always)]
    pub fn cube(&self) -> &Cube {
        &self.cube
    }

    /// Returns whether traversals from cell to cell are correct for rays from this origin; see
    /// [`Cube::step_margin`].
    #[inline(always)]
    pub fn is_near(&self, o: [f32; 3]) -> bool {
        o[0].abs().max(o[1].abs()).max(o[2].abs()) <= self.far
    }

    /// Returns the size in bytes.
    pub fn bytes(&self) -> usize {
        self.nodes.len() * size_of::<Node>() + self.links.len() * size_of::<[u32; 6]>()
    }

    /// Calls `see` for all nodes, parents before children, with index, node and the position of its lowest corner on
    /// the grid of the smallest cells.
    pub fn visit(&self, mut see: impl FnMut(u32, Node, [u32; 3])) {
        let mut stack = vec![(0, [0; 3])];
        while let Some((index, corner)) = stack.pop() {
            let node = self.node(index);
            see(index, node, corner);
            if node.is_inner() {
                let half = 1 << (self.cube.depth - node.level() - 1);
                stack.extend((0..8).rev().map(|octant| {
                    let corner = std::array::from_fn(|k| corner[k] + half * (octant >> k & 1));
                    (node.children() + octant, corner)
                }));
            }
        }
    }

    /// Returns the cell of a node whose lowest corner is `corner` on the grid of the smallest cells.
    pub fn cell(&self, node: Node, corner: [u32; 3]) -> Aabb {
        let min = self.cube.low(corner);
        let edge = self.cube.edge(node.level());
        Aabb {
            min,
            max: min.map(|x| x + edge),
        }
    }

    /// Measures the tree. An inner node counts as three axis-aligned steps in the cost.
    pub fn shape(&self, frame: &Frame) -> Shape {
        let bounds = frame.bounds();
        let whole = bounds.area().max(f64::MIN_POSITIVE);
        let mut measure = Measure::default();
        self.visit(|_, node, corner| {
            let mut cell = self.cell(node, corner);
            // Clip the cell to the scene's box: the cost model has no rays outside it.
            for k in 0..3 {
                cell.min[k] = cell.min[k].max(bounds.min[k]);
                cell.max[k] = cell.max[k].min(bounds.max[k]);
            }
            let share = if cell.is_empty() {
                0.0
            } else {
                cell.area() / whole
            };
            if node.is_inner() {
                // Count the node once, and its other two planes as steps.
                measure.axis(share);
                measure.steps(2.0 * share);
            } else {
                measure.leaf(node.blocks().count, node.level() as usize, share);
            }
        });
        let links = self.links.iter().flatten();
        Shape {
            links: links.filter(|&&link| link != OUTSIDE).count(),
            ..measure.finish()
        }
    }
}
