// SPDX-License-Identifier: GPL-3.0-or-later
//! Bounding volume hierarchies with `W` children per node: the boxes of all children are fetched and tested
//! together (Wald, Benthin and Boulos 2008; Dammertz, Hanika and Keller 2008).
//!
//! The traversal visits the nearest box first and pushes the others on a stack, farthest deepest. Slab
//! distances are `bound * inv - o * inv`, moved outwards by the frame's `slack`: that covers the roundings of
//! the products, of their difference and of the reciprocal. A box is therefore culled only if the ray provably
//! misses it or enters it beyond the reach.

use crate::nested::{Content, Nested, NodeRef};
use crate::object_tree::{ItemKind, ObjectTree};
use crate::refit::{Below, FitNode, FitTree, Fitted};
use halfspace_base::error::Result;
use halfspace_geom::Aabb;
use halfspace_leaf::Leaf;
use halfspace_leaf::blocks::Blocks;
use halfspace_leaf::leaves::Leaves;
use prefetch_index::prefetch_index;

/// Largest number of children of a node.
pub const WIDEST: usize = 8;

/// Marks, in place of a count, a link to an inner node.
pub const INNER: u32 = u32::MAX;

/// A node, 32 bytes per child. An empty slot has count 0 and inverted bounds.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(64))]
pub struct Wide<const W: usize> {
    /// The boxes of the children, one row per plane: lower x, y, z, then upper x, y, z.
    pub bounds: [[f32; W]; 6],
    /// The node index of an inner child, or the word offset of a leaf's blocks.
    pub link: [u32; W],
    /// The number of triangles of a leaf, [`INNER`] for an inner child, 0 for an empty slot.
    pub count: [u32; W],
}

impl<const W: usize> Wide<W> {
    /// Prefetches the cache lines of the node.
    #[inline(always)]
    pub fn fetch_ahead(&self) {
        // A cache line holds sixteen floats.
        for row in (0..6).step_by(16 / W) {
            prefetch_index(self.bounds[row].as_slice(), 0);
        }
        prefetch_index(self.link.as_slice(), 0);
    }
}

/// A bounding volume hierarchy over a scene, with up to `W` children per node. Node 0 is the root.
#[derive(Debug, Clone, PartialEq)]
pub struct BoxTree<const W: usize> {
    /// Nodes; the root is the first.
    pub nodes: Vec<Wide<W>>,
}

impl<const W: usize> BoxTree<W> {
    /// Node without children: every box is empty.
    pub const BLANK: Wide<W> = Wide {
        bounds: [
            [f32::MAX; W],
            [f32::MAX; W],
            [f32::MAX; W],
            [f32::MIN; W],
            [f32::MIN; W],
            [f32::MIN; W],
        ],
        link: [0; W],
        count: [0; W],
    };

    /// Collapses a binary tree into nodes of up to `W` children and adds its leaves to `leaves`. A node
    /// replaces up to `W - 1` binary ones: while it has a free slot, its inner child of largest surface area is
    /// replaced by that child's own children.
    ///
    /// # Errors
    /// [`halfspace_base::error::Error::Memory`] if the leaf data exceeds what links can address.
    pub fn new(binary: &ObjectTree, leaves: &mut Leaves) -> Result<Self> {
        binary.check_size()?;
        let firsts = binary.firsts();
        let mut nodes = vec![Self::BLANK];
        // Nodes to fill, the next one last: the index of the node, and the indices of its children in `binary`.
        let mut open = vec![(0, Self::children(binary, 0))];
        while let Some((slot, children)) = open.pop() {
            // Copy the boxes of the children.
            let mut node = Self::BLANK;
            let mut inner = Vec::with_capacity(W);
            for (lane, &child) in children.iter().enumerate() {
                let bounds = binary.items[child].bounds;
                for k in 0..3 {
                    node.bounds[k][lane] = bounds.min[k];
                    node.bounds[3 + k][lane] = bounds.max[k];
                }
                // Link the child: a leaf to its data, an inner node to a node that is filled later.
                (node.link[lane], node.count[lane]) = match binary.kind(child) {
                    ItemKind::Leaf { count } => {
                        let number = u32::try_from(count).expect("bounded by the scene");
                        (leaves.push(firsts[child], count), number)
                    }
                    ItemKind::Inner { .. } => {
                        let own = nodes.len();
                        inner.push((own, Self::children(binary, child)));
                        nodes.push(Self::BLANK);
                        (u32::try_from(own).expect("bounded by the scene"), INNER)
                    }
                };
            }
            nodes[slot] = node;
            open.extend(inner.into_iter().rev());
        }
        nodes.shrink_to_fit();
        Ok(Self { nodes })
    }

    /// Returns the at most `W` descendants that become the children of a binary node.
    fn children(binary: &ObjectTree, root: usize) -> Vec<usize> {
        let mut children = vec![root];
        while children.len() < W {
            // Replace the inner child of largest surface area, the one most likely to be hit.
            let inner = (children.iter().enumerate()).filter_map(|(i, &child)| {
                let ItemKind::Inner { children, .. } = binary.kind(child) else {
                    return None;
                };
                Some((i, children, binary.items[child].bounds.area()))
            });
            let Some((i, [below, above], _)) = inner.reduce(|a, b| if b.2 > a.2 { b } else { a })
            else {
                break;
            };
            children[i] = below;
            children.insert(i + 1, above);
        }
        children
    }

    /// Prefetches the node or the leaf that a link and a count refer to.
    #[inline(always)]
    pub fn fetch_ahead(&self, link: u32, count: u32, blocks: &Blocks) {
        if count == INNER {
            self.nodes[link as usize].fetch_ahead();
        } else {
            blocks.fetch_ahead(link);
        }
    }
}

impl<const W: usize> Nested for BoxTree<W> {
    fn top(&self) -> NodeRef {
        NodeRef {
            link: 0,
            count: INNER,
        }
    }

    /// References are links and counts as nodes store them.
    fn content(
        &self,
        NodeRef { link, count }: NodeRef,
        _: &Aabb,
        children: &mut Vec<(NodeRef, Aabb)>,
    ) -> Content {
        if count != INNER {
            let count = count as usize;
            return Content::Leaf { first: link, count };
        }
        let node = &self.nodes[link as usize];
        for lane in 0..W {
            let bounds = Aabb {
                min: [0, 1, 2].map(|k| node.bounds[k][lane]),
                max: [3, 4, 5].map(|k| node.bounds[k][lane]),
            };
            if !bounds.is_empty() {
                let (link, count) = (node.link[lane], node.count[lane]);
                children.push((NodeRef { link, count }, bounds));
            }
        }
        Content::Boxes
    }

    fn bytes(&self) -> usize {
        size_of_val(&*self.nodes)
    }
}

impl<const W: usize> FitNode for Wide<W> {
    /// A child without triangles becomes an empty slot.
    fn fit(&mut self, mut child: impl FnMut(Below) -> Fitted) -> Fitted {
        let mut all = Fitted::NOTHING;
        for lane in 0..W {
            let (link, count) = (self.link[lane], self.count[lane]);
            let inner = count == INNER;
            let fitted = match count {
                0 => continue,
                INNER => child(Below::Node(link)),
                _ => child(Below::Leaf(Leaf {
                    first: link,
                    count: count as usize,
                })),
            };
            for k in 0..3 {
                self.bounds[k][lane] = fitted.low(k);
                self.bounds[3 + k][lane] = fitted.high(k);
            }
            if !inner || fitted.count == 0 {
                self.count[lane] = fitted.count;
            }
            all = all.join(fitted);
        }
        all
    }
}

impl<const W: usize> FitTree for BoxTree<W> {
    type Node = Wide<W>;

    fn nodes(&self) -> &[Wide<W>] {
        &self.nodes
    }

    fn of_nodes(nodes: Vec<Wide<W>>) -> Self {
        Self { nodes }
    }
}
