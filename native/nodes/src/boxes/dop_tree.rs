// SPDX-License-Identifier: GPL-3.0-or-later
//! Hierarchies of discrete oriented polytopes: each node lies between two parallel planes for each of `D` fixed
//! normals, and rays take nodes from a heap, nearest first (Kay and Kajiya 1986). With three normals they are
//! boxes.
//!
//! Distances are `bound * inv - n.o * inv`, moved outwards by a bound on their error, so a node is culled only
//! if the ray provably misses it or enters it beyond the reach. The bound of an axis is the frame's. With the
//! sum of a normal's components at most 3, that of an oblique slab is at most 30 u multiplied by the frame's
//! span: 9 for `n.o`, 9 for `n.d` over the way to any point of the scene, 12 for the products, the reciprocal
//! and the sums.

use crate::nested::{Content, Nested, NodeRef};
use halfspace_base::error::{Error, Result};
use halfspace_geom::Aabb;
use halfspace_leaf::leaves::Leaves;
use halfspace_ray::FramedScene;

/// Normals of the slabs: the axes, the diagonals of the cube, the diagonals of its faces. Their components are
/// 0 and ±1, so products with them are exact.
pub const NORMALS: [[f32; 3]; 13] = [
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [1.0, 1.0, 1.0],
    [-1.0, 1.0, 1.0],
    [1.0, -1.0, 1.0],
    [1.0, 1.0, -1.0],
    [0.0, 1.0, 1.0],
    [0.0, 1.0, -1.0],
    [1.0, 0.0, 1.0],
    [1.0, 0.0, -1.0],
    [1.0, 1.0, 0.0],
    [1.0, -1.0, 0.0],
];

/// Set in `count` of inner nodes; the other bits are then the number of children.
pub const INNER: u32 = 1 << 31;

/// A node; the children of an inner node are consecutive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Node<const D: usize> {
    /// Lower bounds of `n . x` over the node, per normal, in the frame.
    pub low: [f32; D],
    /// Upper bounds, likewise.
    pub high: [f32; D],
    /// Index of the first child, or word offset of a leaf's data.
    pub link: u32,
    /// Number of triangles of a leaf, or [`INNER`] with the number of children.
    pub count: u32,
}

/// A child of a node of a [`Hierarchy`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Child {
    /// A node.
    Node(usize),
    /// A chain of objects, nearly always one.
    Objects(usize),
}

/// A hierarchy of objects with any number of children per node, the result of a builder; node 0 is the root.
pub trait Hierarchy {
    /// Returns the children of a node in order, each with the number of objects below it.
    fn children(&self, node: usize) -> impl Iterator<Item = (Child, usize)> + '_;

    /// Appends the indices of all objects below a child.
    fn objects(&self, child: Child, out: &mut Vec<usize>);
}

/// A hierarchy of slabs over a scene, with `D` slabs per node. Node 0 is the root.
#[derive(Debug, Clone, PartialEq)]
pub struct DopTree<const D: usize> {
    /// Nodes; the root is the first.
    pub nodes: Vec<Node<D>>,
}

impl<const D: usize> Node<D> {
    /// Node that contains nothing.
    const EMPTY: Self = Self {
        low: [f32::INFINITY; D],
        high: [f32::NEG_INFINITY; D],
        link: 0,
        count: 0,
    };

    /// Returns the axis-aligned bounding box, from the first three slabs.
    fn bounds(&self) -> Aabb {
        Aabb {
            min: [self.low[0], self.low[1], self.low[2]],
            max: [self.high[0], self.high[1], self.high[2]],
        }
    }

    /// Extends the slabs to contain a point.
    fn grow(&mut self, p: [f32; 3]) {
        for (k, n) in NORMALS.iter().enumerate().take(D) {
            let (low, high) = height(*n, p);
            self.low[k] = self.low[k].min(low);
            self.high[k] = self.high[k].max(high);
        }
    }

    /// Extends the slabs to contain another node.
    fn join(&mut self, other: &Self) {
        for k in 0..D {
            self.low[k] = self.low[k].min(other.low[k]);
            self.high[k] = self.high[k].max(other.high[k]);
        }
    }

    /// Returns whether the slabs of `other` lie inside these.
    fn contains(&self, other: &Self) -> bool {
        (0..D).all(|k| {
            other.low[k] > other.high[k]
                || (self.low[k] <= other.low[k] && other.high[k] <= self.high[k])
        })
    }
}

/// Returns a lower and an upper bound of `n . p`; for an axis both are the coordinate itself.
#[expect(clippy::cast_possible_truncation, reason = "moved outwards")]
pub fn height(n: [f32; 3], p: [f32; 3]) -> (f32, f32) {
    // Products with 0 and ±1 are exact, so only the sum rounds.
    let terms = [0, 1, 2].map(|k| f64::from(n[k]) * f64::from(p[k]));
    let sum = terms[0] + terms[1] + terms[2];
    if n.iter().filter(|x| **x != 0.0).count() == 1 {
        // `+ 0.0` turns -0.0 into +0.0.
        return (sum as f32 + 0.0, sum as f32 + 0.0);
    }
    // Bound the two roundings of the sum in f64; the step to the next float covers that to f32.
    let error = 2.0_f64.powi(-51) * terms.iter().map(|x| x.abs()).sum::<f64>();
    (
        ((sum - error) as f32).next_down(),
        ((sum + error) as f32).next_up(),
    )
}

impl<const D: usize> DopTree<D> {
    /// Lays out a tree built by insertion over the triangles `objects`, adds its leaves to `leaves` and their
    /// triangles' ids to `ids`. Subtrees of at most `leaf_size` objects become leaves.
    ///
    /// # Errors
    /// [`Error::Memory`] if there are 2^28 objects or more, or more leaf data than links can address.
    pub fn new(
        grown: &impl Hierarchy,
        framed: FramedScene<'_>,
        objects: &[u32],
        leaf_size: usize,
        leaves: &mut Leaves,
        ids: &mut Vec<u32>,
    ) -> Result<Self> {
        if objects.len() >= 1 << 28 {
            return Err(Error::Memory(format!(
                "the tree would hold {} triangles; fewer than 2^28 are possible",
                objects.len()
            )));
        }
        // Create nodes from the top down, children side by side. Leaves get the slabs of their triangles.
        let mut nodes = vec![Node::EMPTY];
        let mut open = vec![(0, Child::Node(0), objects.len())];
        let mut members = Vec::new();
        while let Some((slot, child, count)) = open.pop() {
            match child {
                Child::Node(from) if count > leaf_size => {
                    // Reserve the nodes of the children and fill them later, the first child first.
                    let link = nodes.len();
                    let before = open.len();
                    for (child, count) in grown.children(from) {
                        open.push((nodes.len(), child, count));
                        nodes.push(Node::EMPTY);
                    }
                    open[before..].reverse();
                    nodes[slot].link = narrow(link);
                    nodes[slot].count = INNER | narrow(nodes.len() - link);
                }
                _ => {
                    // Make a leaf of all objects below, and bound their vertices.
                    members.clear();
                    grown.objects(child, &mut members);
                    nodes[slot].link = leaves.push(narrow(ids.len()), members.len());
                    nodes[slot].count = narrow(members.len());
                    for &member in &members {
                        let id = objects[member];
                        ids.push(id);
                        for p in framed.scene.corners(id) {
                            nodes[slot].grow(framed.frame.point(p));
                        }
                    }
                }
            }
        }
        // Join the slabs of children into their parents, from the bottom up: children have larger indices.
        for slot in (0..nodes.len()).rev() {
            let Node { link, count, .. } = nodes[slot];
            if count & INNER != 0 {
                for child in link..link + (count & !INNER) {
                    let child = nodes[child as usize];
                    nodes[slot].join(&child);
                }
            }
        }
        nodes.shrink_to_fit();
        Ok(Self { nodes })
    }
}

/// Returns a number of nodes or objects as 32 bits.
fn narrow(x: usize) -> u32 {
    u32::try_from(x).expect("fewer than 2^29 nodes")
}

impl<const D: usize> Nested for DopTree<D> {
    fn top(&self) -> NodeRef {
        NodeRef::index(0)
    }

    fn content(&self, node: NodeRef, _: &Aabb, children: &mut Vec<(NodeRef, Aabb)>) -> Content {
        let Node { link, count, .. } = self.nodes[node.link as usize];
        if count & INNER == 0 {
            return Content::Leaf {
                first: link,
                count: count as usize,
            };
        }
        let below = link..link + (count & !INNER);
        children.extend(below.map(|i| (NodeRef::index(i), self.nodes[i as usize].bounds())));
        Content::Boxes
    }

    fn bytes(&self) -> usize {
        size_of_val(&*self.nodes)
    }

    fn encloses_children(&self, node: NodeRef) -> bool {
        let node = &self.nodes[node.link as usize];
        let below = if node.count & INNER == 0 {
            0..0
        } else {
            node.link..node.link + (node.count & !INNER)
        };
        below
            .into_iter()
            .all(|i| node.contains(&self.nodes[i as usize]))
    }

    fn encloses(&self, leaf: NodeRef, corners: [[f32; 3]; 3]) -> bool {
        let node = &self.nodes[leaf.link as usize];
        corners.iter().all(|p| {
            NORMALS.iter().take(D).enumerate().all(|(k, n)| {
                let height: f64 = (0..3).map(|k| f64::from(n[k]) * f64::from(p[k])).sum();
                f64::from(node.low[k]) <= height && height <= f64::from(node.high[k])
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use halfspace_strategies::point;
    use num_bigint::BigInt;
    use proptest::prelude::*;

    /// Returns a float as a multiple of the smallest float.
    fn whole(x: f32) -> BigInt {
        let bits = x.to_bits() & 0x7fff_ffff;
        let (exponent, mantissa) = (bits >> 23, bits & 0x007f_ffff);
        let magnitude = if exponent == 0 {
            BigInt::from(mantissa)
        } else {
            BigInt::from(mantissa | 0x0080_0000) << (exponent - 1)
        };
        if x.is_sign_negative() {
            -magnitude
        } else {
            magnitude
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        #[test]
        fn heights_are_enclosed(p in point()) {
            for n in NORMALS {
                let exact = (0..3).fold(BigInt::from(0), |sum, k| match n[k] {
                    x if x > 0.0 => sum + whole(p[k]),
                    x if x < 0.0 => sum - whole(p[k]),
                    _ => sum,
                });
                let (low, high) = height(n, p);
                prop_assert!(low == f32::NEG_INFINITY || whole(low) <= exact);
                prop_assert!(high == f32::INFINITY || exact <= whole(high));
            }
        }
    }
}
