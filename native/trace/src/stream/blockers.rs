// SPDX-License-Identifier: GPL-3.0-or-later
//! Any-hit streams through nodes of eight boxes: the children of each node are visited in an order of their own,
//! whatever the directions of the rays. Any hit is enough, so those children come first that most probably block a ray
//! for their work (Ize and Hansen 2011, RTSAH traversal order for occlusion rays, choose by cost and probability; Nah
//! and Manocha 2014, SATO: Surface area traversal order for shadow ray tracing, by the area of the triangles). The
//! answers are those of any other order.

use crate::stream::Steps;
use crate::stream::boxes::{Child, Order, visit};
use crate::stream::lists::{Entry, Stream};
use crate::stream::ray_state::{Line, RayState};
use fearless_simd::{Simd, u8x16};
use halfspace_geom::vec3::{cross, dot, sub, widen};
use halfspace_leaf::Leaf;
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::box_tree::{BoxTree, INNER, Wide};
use halfspace_ray::query::Counters;
use std::sync::{Arc, OnceLock};

/// Number of children of a node.
const CHILDREN: usize = 8;

/// One in each of eight bytes.
const ONES: u64 = 0x0101_0101_0101_0101;

/// A tree with an order of the children of each node.
#[derive(Debug)]
pub struct BlockersFirst {
    tree: Arc<BoxTree<CHILDREN>>,
    leaves: Arc<Blocks>,
    /// Eight bytes per node, made for the first rays.
    order: OnceLock<Vec<Listed>>,
}

impl BlockersFirst {
    /// The tree; `leaves` are its own, stored with their vertices.
    pub fn new(tree: &Arc<BoxTree<CHILDREN>>, leaves: &Arc<Blocks>) -> Self {
        Self {
            tree: tree.clone(),
            leaves: leaves.clone(),
            order: OnceLock::new(),
        }
    }

    /// The order of the children of all nodes.
    #[inline(always)]
    fn order(&self) -> &[Listed] {
        self.order.get_or_init(|| listed(&self.tree, &self.leaves))
    }
}

/// The triangles below a node.
#[derive(Clone, Copy, Default)]
struct Below {
    triangles: f64,
    /// The sum of their areas, in the frame.
    area: f64,
}

/// Lists the children of all nodes. Compiled once, out of the loop over nodes.
#[inline(never)]
fn listed(tree: &BoxTree<CHILDREN>, leaves: &Blocks) -> Vec<Listed> {
    let mut below = vec![Below::default(); tree.nodes.len()];
    let mut order = vec![Listed(0); tree.nodes.len()];
    // Children stand behind their parents, so their sums are known.
    for (i, node) in tree.nodes.iter().enumerate().rev() {
        let own: [Below; CHILDREN] = std::array::from_fn(|child| {
            let (link, count) = (node.link[child], node.count[child]);
            match count {
                INNER => below[link as usize],
                count => of_leaf(leaves, link, count),
            }
        });
        for child in own {
            below[i].triangles += child.triangles;
            below[i].area += child.area;
        }
        order[i] = Listed::by_worth(std::array::from_fn(|child| worth(node, child, own[child])));
    }
    order
}

/// The triangles of a leaf.
fn of_leaf(leaves: &Blocks, first: u32, count: u32) -> Below {
    let mut area = 0.0;
    let leaf = Leaf {
        first,
        count: count as usize,
    };
    leaves.each(leaf, |_, corners| {
        let [a, b, c] = corners.map(widen);
        let normal = cross(sub(b, a), sub(c, a));
        area += 0.5 * dot(normal, normal).sqrt();
    });
    Below {
        triangles: f64::from(count),
        area,
    }
}

/// The probability that a child blocks a ray that meets its box, divided by the expected work in it.
///
/// A line through a convex body of surface S crosses surfaces of area A inside it 2 A / S times on average (Santalo
/// 1976); the number of crossings is taken as that of independent triangles. The work is a leaf, or a path of nodes as
/// long as the logarithm of the number of triangles.
fn worth(node: &Wide<CHILDREN>, child: usize, below: Below) -> f64 {
    let [x, y, z] = [0, 1, 2]
        .map(|k: usize| f64::from(node.bounds[k + 3][child]) - f64::from(node.bounds[k][child]));
    let half = x * y + y * z + z * x;
    let crossings = if half > 0.0 {
        below.area / half
    } else {
        f64::MAX
    };
    let work = match node.count[child] {
        INNER => 1.0 + below.triangles.max(1.0).log2(),
        _ => 1.0,
    };
    (1.0 - (-crossings).exp()) / work
}

/// The children of a node as they lie on the stack: byte `i` has the bit of the child at position `i`.
#[derive(Debug, Clone, Copy)]
struct Listed(u64);

impl Listed {
    /// The child of most worth lies on top.
    fn by_worth(worths: [f64; CHILDREN]) -> Self {
        let mut children: [usize; CHILDREN] = std::array::from_fn(|child| child);
        children.sort_by(|&a, &b| worths[a].total_cmp(&worths[b]));
        let bit = |(position, child): (usize, usize)| 1 << (8 * position + child);
        Self(children.into_iter().enumerate().map(bit).sum())
    }
}

/// Moves the lowest bit of byte `i` to bit `i`.
#[inline(always)]
pub const fn gather(bytes: u64) -> u64 {
    (bytes & ONES).wrapping_mul(0x0102_0408_1020_4080) >> 56
}

impl Order for Listed {
    #[inline(always)]
    fn positions(self, children: u64) -> u64 {
        // Copy all children to each byte, and keep there the child of its position. Adding 127 sets the upper bit of
        // each byte that is not zero.
        let own = children.wrapping_mul(ONES) & self.0;
        gather((own + 127 * ONES) >> 7)
    }

    #[inline(always)]
    fn child(self, position: usize) -> usize {
        (self.0 >> (8 * position)).trailing_zeros() as usize % CHILDREN
    }
}

impl Steps for BlockersFirst {
    type Node = Child;
    type Scratch<S: Simd> = Vec<u8x16<S>>;
    const INTERVALS: bool = false;

    fn root(&self) -> Child {
        Steps::root(&*self.tree)
    }

    #[inline(always)]
    fn leaf(&self, child: &Child) -> Option<Leaf> {
        Steps::leaf(&*self.tree, child)
    }

    #[inline(always)]
    fn fetch_ahead(&self, child: &Child, blocks: &Blocks) {
        Steps::fetch_ahead(&*self.tree, child, blocks);
    }

    #[inline(always)]
    fn enters(child: &Child, line: &Line) -> bool {
        <BoxTree<CHILDREN> as Steps>::enters(child, line)
    }

    #[inline(always)]
    fn count<C: Counters>(&self, child: &Child, counters: &mut C) {
        Steps::count(&*self.tree, child, counters);
    }

    #[inline(always)]
    fn visit<S: Simd>(
        &self,
        simd: S,
        stream: &mut Stream<Child>,
        own: Entry<Child>,
        states: &[RayState],
        masks: &mut Vec<u8x16<S>>,
    ) {
        let order = self.order()[own.node.index()];
        visit(simd, &self.tree, order, stream, own, states, masks);
    }

    fn bytes(&self) -> usize {
        Steps::bytes(&*self.tree) + self.tree.nodes.len() * size_of::<Listed>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use halfspace_ray::frame::Frame;
    use halfspace_scene::Triangles;

    #[test]
    fn bits_are_gathered_from_bytes() {
        for mask in 0..256_u64 {
            let spread = (0..8).map(|i| (mask >> i & 1) << (8 * i)).sum::<u64>();
            assert_eq!(gather(spread), mask);
            assert_eq!(gather(spread | 0xfefe_fefe_fefe_fefe), mask, "upper bits");
        }
    }

    /// Any order of children is a permutation that keeps all of them.
    #[test]
    fn positions_are_those_of_the_children() {
        let order = Listed::by_worth([0.4, 0.0, 0.9, 0.1, 0.3, f64::NAN, 0.2, 0.8]);
        let listed = [0, 1, 2, 3, 4, 5, 6, 7].map(|position| order.child(position));
        assert_eq!(listed, [1, 3, 6, 4, 0, 7, 2, 5]);
        for mask in 0..256_u64 {
            let wanted = (0..8).map(|position| (mask >> listed[position] & 1) << position);
            assert_eq!(order.positions(mask), wanted.sum::<u64>(), "{mask:b}");
        }
    }

    /// The hits do not depend on the order, only the speed does; so it is tested here.
    #[test]
    fn likely_blockers_are_visited_first() {
        // Three leaves in equal boxes: a triangle across the box, a small one, and many small ones of the same area in
        // an inner node.
        let mut random = vec![[0.0, 0.0, 0.5], [1.0, 0.0, 0.5], [0.0, 1.0, 0.5]];
        random.extend([[0.0, 0.0, 0.2], [0.1, 0.0, 0.2], [0.0, 0.1, 0.2]]);
        let indices = vec![[0, 1, 2], [3, 4, 5]];
        let scene = Triangles::new(random, indices).expect("two triangles");
        let frame = Frame::new(scene.bounds());
        let mut leaves = Blocks::new();
        let firsts = [0, 1].map(|id| leaves.push_leaf(&scene, &frame, &[id]));
        leaves.seal();
        let (mut root, mut inner) = (BoxTree::<CHILDREN>::BLANK, BoxTree::<CHILDREN>::BLANK);
        for (child, (link, count)) in [(firsts[1], 1), (firsts[0], 1), (1, INNER)]
            .into_iter()
            .enumerate()
        {
            for k in 0..3 {
                (root.bounds[k][child], root.bounds[3 + k][child]) = (0.0, 1.0);
            }
            (root.link[child], root.count[child]) = (link, count);
        }
        for child in 0..2 {
            (inner.link[child], inner.count[child]) = (firsts[0], 1);
        }
        let tree = BoxTree {
            nodes: vec![root, inner],
        };
        let order = BlockersFirst::new(&Arc::new(tree), &Arc::new(leaves));
        // The large triangle alone comes first; twice its area for twice the work comes next, then the small one.
        let top = [7, 6, 5].map(|position| order.order()[0].child(position));
        assert_eq!(top, [1, 2, 0]);
    }
}
