// SPDX-License-Identifier: GPL-3.0-or-later
//! Interval hierarchies with `W` children per node: along one axis, each child lies between two planes of its
//! own. For two children these are four planes in twenty bytes.

use crate::nested::{Content, Nested, NodeRef};
use crate::object_tree::{ItemKind, ObjectTree};
use crate::plane_tree::MAX_DEPTH;
use crate::refit::{Below, FitNode, FitTree, Fitted};
use halfspace_base::error::{Error, Result};
use halfspace_geom::Aabb;
use halfspace_geom::tighten::{Sides, Tighten};
use halfspace_leaf::Leaf;
use halfspace_leaf::leaves::Leaves;

/// Largest number of children of a node.
pub const WIDEST: usize = 8;

/// Stands in place of the axis in leaves.
pub const LEAF: u32 = 3;

/// Number of bits below the link: the axis, and above it the number of children minus one.
const LOW_BITS: u32 = 5;

/// Largest number of nodes in a tree and of triangles in a leaf, from the bits of the link.
const MOST: usize = 1 << (32 - LOW_BITS);

/// A node. The upper bits of `word` are the number of the first child, whose siblings follow it, or a leaf's
/// number of triangles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Node<const W: usize> {
    /// Kind or axis in the low bits, the link above them.
    pub word: u32,
    /// Two rows: the start and the end of each child; for an only child, those of the rest of the region. A
    /// leaf stores the bits of its first block in the first number.
    pub planes: [[f32; W]; 2],
}

/// A wide interval hierarchy over a scene.
#[derive(Debug, Clone)]
pub struct WideSlabs<const W: usize> {
    /// Nodes; the root is the first.
    pub nodes: Vec<Node<W>>,
}

impl<const W: usize> PartialEq for WideSlabs<W> {
    /// Compares bit patterns: a leaf's first block is stored as a float and may read as NaN.
    fn eq(&self, other: &Self) -> bool {
        let same = |(a, b): (&Node<W>, &Node<W>)| {
            a.word == b.word
                && a.planes.map(|row| row.map(f32::to_bits))
                    == b.planes.map(|row| row.map(f32::to_bits))
        };
        self.nodes.len() == other.nodes.len() && self.nodes.iter().zip(&other.nodes).all(same)
    }
}

impl<const W: usize> Node<W> {
    /// Node without children: every interval is empty.
    const BLANK: Self = Self {
        word: LEAF,
        planes: [[f32::MAX; W], [f32::MIN; W]],
    };

    /// Makes a node; `low` is its axis, or [`LEAF`].
    fn new(link: usize, children: usize, low: usize) -> Self {
        let word = |x: usize| u32::try_from(x).expect("checked by the layout");
        Self {
            word: word(link) << LOW_BITS | word(children - 1) << 2 | word(low),
            ..Self::BLANK
        }
    }

    /// Returns the first child, or a leaf's number of triangles.
    #[inline(always)]
    pub fn link(&self) -> u32 {
        self.word >> LOW_BITS
    }

    /// Returns the box of a child inside the node's region.
    fn part(&self, lane: usize, axis: usize, region: &Aabb) -> Aabb {
        let mut part = *region;
        part.min[axis] = self.planes[0][lane];
        part.max[axis] = self.planes[1][lane];
        part
    }

    /// Returns the number of children.
    #[inline(always)]
    pub fn children(&self) -> u32 {
        (self.word >> 2 & 7) + 1
    }
}

impl<const W: usize> WideSlabs<W> {
    /// Lays out a binary tree over a scene with these bounds, its leaves in `leaves`. A child that is split
    /// along the same axis as its parent is replaced by its own children while there is room, the largest child
    /// first. Where `tighten` finds it worthwhile, a node with one child first cuts off empty space.
    ///
    /// # Errors
    /// [`Error::Memory`] if the tree has more nodes than links can address.
    pub fn new(
        binary: &ObjectTree,
        bounds: Aabb,
        tighten: Tighten,
        leaves: &mut Leaves,
    ) -> Result<Self> {
        binary.check_size()?;
        let firsts = binary.firsts();
        let heights = binary.heights();
        let mut nodes = Vec::with_capacity(binary.items.len());
        nodes.push(Node::BLANK);
        // Nodes to fill: number, index in `binary`, region and depth.
        let mut open = vec![(0, 0, bounds, 0)];
        while let Some((slot, from, region, depth)) = open.pop() {
            let link = nodes.len();
            if link + W > MOST || binary.ids.len() >= MOST {
                return Err(Error::Memory(format!(
                    "the tree would have {MOST} nodes or triangles"
                )));
            }
            let room = depth + usize::from(heights[from]) < MAX_DEPTH;
            let cut = tighten.cut(Sides::Both, &region, &binary.items[from].bounds);
            // Cut off empty space first, and lay the same item out again inside.
            if let Some(cut) = cut.filter(|_| room) {
                let mut node = Node::new(link, 1, cut.axis);
                node.planes[0][0] = cut.inside.min[cut.axis];
                node.planes[1][0] = cut.inside.max[cut.axis];
                nodes.push(Node::BLANK);
                nodes[slot] = node;
                open.push((link, from, cut.inside, depth + 1));
                continue;
            }
            // Lay out the item itself.
            nodes[slot] = match binary.kind(from) {
                ItemKind::Leaf { count } => {
                    let mut node = Node::new(count, 1, LEAF as usize);
                    node.planes[0][0] = f32::from_bits(leaves.push(firsts[from], count));
                    node
                }
                ItemKind::Inner { axis, .. } => {
                    let children = Self::children(binary, from, axis);
                    let mut node = Node::new(link, children.len(), axis);
                    // Write the bounds of the children, and lay them out later.
                    for (lane, &child) in children.iter().enumerate() {
                        let bounds = &binary.items[child].bounds;
                        node.planes[0][lane] = bounds.min[axis];
                        node.planes[1][lane] = bounds.max[axis];
                        nodes.push(Node::BLANK);
                    }
                    let below = (0..children.len()).rev().map(|lane| {
                        let part = node.part(lane, axis, &region);
                        (link + lane, children[lane], part, depth + 1)
                    });
                    open.extend(below);
                    node
                }
            };
        }
        nodes.shrink_to_fit();
        Ok(Self { nodes })
    }

    /// Returns the at most `W` descendants of an item, all separated along `axis`, that become its children.
    fn children(binary: &ObjectTree, root: usize, axis: usize) -> Vec<usize> {
        let mut children = vec![root];
        while children.len() < W {
            // Replace the largest child that is split along the same axis.
            let largest = (0..children.len())
                .filter_map(|i| match binary.kind(children[i]) {
                    ItemKind::Inner {
                        axis: own,
                        children: below,
                    } if own == axis => Some((i, below, binary.items[children[i]].bounds.area())),
                    _ => None,
                })
                .reduce(|a, b| if b.2 > a.2 { b } else { a });
            let Some((i, [below, above], _)) = largest else {
                break;
            };
            children[i] = below;
            children.insert(i + 1, above);
        }
        children
    }
}

impl<const W: usize> Nested for WideSlabs<W> {
    fn top(&self) -> NodeRef {
        NodeRef::index(0)
    }

    fn content(
        &self,
        node: NodeRef,
        region: &Aabb,
        children: &mut Vec<(NodeRef, Aabb)>,
    ) -> Content {
        let node = &self.nodes[node.link as usize];
        let axis = (node.word & LEAF) as usize;
        if axis == 3 {
            return Content::Leaf {
                first: node.planes[0][0].to_bits(),
                count: node.link() as usize,
            };
        }
        for lane in 0..node.children() {
            let part = node.part(lane as usize, axis, region);
            children.push((NodeRef::index(node.link() + lane), part));
        }
        Content::Slabs { axis }
    }

    fn bytes(&self) -> usize {
        size_of_val(&*self.nodes)
    }
}

impl<const W: usize> FitNode for Node<W> {
    fn fit(&mut self, mut child: impl FnMut(Below) -> Fitted) -> Fitted {
        let axis = (self.word & LEAF) as usize;
        if axis == LEAF as usize {
            let first = self.planes[0][0].to_bits();
            let count = self.link() as usize;
            let fitted = child(Below::Leaf(Leaf { first, count }));
            self.word = fitted.count << LOW_BITS | self.word & ((1 << LOW_BITS) - 1);
            return fitted;
        }
        let (mut all, link) = (Fitted::NOTHING, self.link());
        for lane in 0..self.children() {
            let fitted = child(Below::Node(link + lane));
            let lane = lane as usize;
            self.planes[0][lane] = fitted.low(axis);
            self.planes[1][lane] = fitted.high(axis);
            all = all.join(fitted);
        }
        all
    }
}

impl<const W: usize> FitTree for WideSlabs<W> {
    type Node = Node<W>;

    fn nodes(&self) -> &[Node<W>] {
        &self.nodes
    }

    fn of_nodes(nodes: Vec<Node<W>>) -> Self {
        Self { nodes }
    }
}
