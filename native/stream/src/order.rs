// SPDX-License-Identifier: GPL-3.0-or-later
//! Orders in which any-hit streams visit the eight children of a node. Any hit is enough, so those come first that
//! probably block a ray for little work; the answers are those of any other order.
//!
//! Ize and Hansen 2011 (RTSAH traversal order for occlusion rays) choose by the expected costs, Nah and Manocha 2014
//! (SATO: Surface area traversal order for shadow ray tracing) by the surface of the boxes; both for single rays and two
//! children at a node.

use crate::OCTANTS;
use halfspace_geom::vec3::{cross, dot, sub, widen};
use halfspace_leaf::Leaf;
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::box_corners::rank;
use halfspace_nodes::box_tree::{BoxTree, INNER, Wide};

/// Number of children of a node.
pub const CHILDREN: usize = 8;

/// How the children of a node are ordered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rule {
    /// By the probability that a child blocks a ray that meets its box, divided by the expected work, both summed up
    /// from the leaves (RTSAH for eight children).
    Cost,
    /// By the surface of its box (SATO).
    Area,
    /// By the corners that the rays of an octant come from, as nearest hits do. For [`BoxTree::by_corners`].
    Near,
}

impl Rule {
    /// Number of orders of a node: one, or one for each octant of directions.
    pub fn orders(self) -> usize {
        match self {
            Self::Near => OCTANTS,
            _ => 1,
        }
    }

    /// The orders of the children of all nodes, those of a node one after another.
    pub fn listed(self, tree: &BoxTree<CHILDREN>, leaves: &Blocks) -> Vec<Listed> {
        match self {
            Self::Near => {
                let order = |octant| Listed::new([0, 1, 2, 3, 4, 5, 6, 7].map(|i| rank(octant, i)));
                let orders: Vec<Listed> = (0..OCTANTS).map(order).collect();
                orders.repeat(tree.nodes.len())
            }
            _ => self.by_contents(tree, leaves),
        }
    }

    /// [`Self::listed`] by what is below each child.
    fn by_contents(self, tree: &BoxTree<CHILDREN>, leaves: &Blocks) -> Vec<Listed> {
        let mut below = vec![Below::default(); tree.nodes.len()];
        let mut order = vec![Listed(0); tree.nodes.len()];
        // Children are behind their parents, so what is below them is known.
        for (i, node) in tree.nodes.iter().enumerate().rev() {
            let own: [Below; CHILDREN] = std::array::from_fn(|child| {
                let (link, count) = (node.link[child], node.count[child]);
                match count {
                    INNER => below[link as usize],
                    count => Below::leaf(leaves, link, count, half_area(&corners(node, child))),
                }
            });
            let worth = |child: usize| match self {
                // Empty slots are never met.
                _ if node.count[child] == 0 => -1.0,
                Self::Area => half_area(&corners(node, child)),
                _ => own[child].blocks / own[child].work,
            };
            let children = ascending(std::array::from_fn(worth));
            order[i] = Listed::new(children);
            below[i] = Below::node(node, &own, children);
        }
        order
    }
}

/// Summary of the subtree below a child.
#[derive(Clone, Copy, Default)]
struct Below {
    /// Probability that a ray which meets the box is blocked in it.
    blocks: f64,
    /// Expected number of nodes and leaves that such a ray visits in it, itself included.
    work: f64,
}

impl Below {
    /// A leaf, whose box has half of this surface.
    fn leaf(leaves: &Blocks, first: u32, count: u32, half: f64) -> Self {
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
        Self {
            blocks: chance(area, half),
            work: 1.0,
        }
    }

    /// A node, whose children are visited from the last to the first. The children of a ray are taken as independent.
    fn node(node: &Wide<CHILDREN>, own: &[Self; CHILDREN], children: [usize; CHILDREN]) -> Self {
        let full = |child: &usize| node.count[*child] != 0;
        let extreme = |side: usize, start: f64, pick: fn(f64, f64) -> f64| {
            let of = |k: usize| {
                children
                    .iter()
                    .filter(|child| full(child))
                    .fold(start, |most, &child| {
                        pick(most, f64::from(node.bounds[side + k][child]))
                    })
            };
            [0, 1, 2].map(of)
        };
        let low = extreme(0, f64::INFINITY, f64::min);
        let high = extreme(3, f64::NEG_INFINITY, f64::max);
        let whole = half_area(&[low, high]);
        let mut sum = Self {
            work: 1.0,
            ..Self::default()
        };
        let mut open = 1.0;
        for child in children.into_iter().filter(full).rev() {
            let share = half_area(&corners(node, child)) / whole;
            let meets = if share.is_finite() { share } else { 1.0 };
            sum.work += open * meets * own[child].work;
            open *= 1.0 - meets * own[child].blocks;
        }
        sum.blocks = 1.0 - open;
        sum
    }
}

/// The lower and the upper corner of a child's box.
fn corners(node: &Wide<CHILDREN>, child: usize) -> [[f64; 3]; 2] {
    [0, 3].map(|side| [0, 1, 2].map(|k: usize| f64::from(node.bounds[side + k][child])))
}

/// Half of the surface of a box.
fn half_area([low, high]: &[[f64; 3]; 2]) -> f64 {
    let [x, y, z] = sub(*high, *low);
    x * y + y * z + z * x
}

/// The probability that triangles of this area block a ray that meets a box with half of this surface.
///
/// A line through a convex body of surface S crosses surfaces of area A inside it 2 A / S times on average (Santalo
/// 1976); the number of crossings is taken as that of independent triangles.
fn chance(area: f64, half: f64) -> f64 {
    let crossings = if half > 0.0 { area / half } else { f64::MAX };
    1.0 - (-crossings).exp()
}

/// The children by ascending worth.
fn ascending(worths: [f64; CHILDREN]) -> [usize; CHILDREN] {
    let mut children: [usize; CHILDREN] = std::array::from_fn(|child| child);
    children.sort_by(|&a, &b| worths[a].total_cmp(&worths[b]));
    children
}

/// The children of a node as they lie on the stack: byte `i` has the bit of the child at position `i`; the highest
/// position is visited first.
#[derive(Debug, Clone, Copy)]
pub struct Listed(pub u64);

impl Listed {
    /// The children, the last of which is visited first.
    pub fn new(children: [usize; CHILDREN]) -> Self {
        let bit = |(position, child): (usize, usize)| 1 << (8 * position + child);
        Self(children.into_iter().enumerate().map(bit).sum())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use halfspace_ray::frame::Frame;
    use halfspace_scene::Triangles;

    #[test]
    fn children_ascend_by_worth() {
        let worths = [0.4, 0.0, 0.9, 0.1, 0.3, f64::NAN, 0.2, 0.8];
        assert_eq!(ascending(worths), [1, 3, 6, 4, 0, 7, 2, 5]);
    }

    /// The hits do not depend on the order, only the speed does; so it is tested here.
    #[test]
    fn likely_blockers_are_visited_first() {
        // Three children: a triangle across its box, a small one, and an inner node with two of the large ones.
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
        // The box of the inner node is larger.
        root.bounds[3][2] = 1.5;
        for child in 0..2 {
            for k in 0..3 {
                (inner.bounds[k][child], inner.bounds[3 + k][child]) = (0.0, 1.0);
            }
            (inner.link[child], inner.count[child]) = (firsts[0], 1);
        }
        let tree = BoxTree {
            nodes: vec![root, inner],
        };
        // The large triangle alone comes first; twice its area for twice the work comes next, then the small one.
        let top = |rule: Rule| {
            let Listed(bits) = rule.listed(&tree, &leaves)[0];
            [7, 6, 5].map(|position| (bits >> (8 * position) & 0xff).trailing_zeros())
        };
        assert_eq!(top(Rule::Cost), [1, 2, 0]);
        // By surface alone, the larger box comes first.
        assert_eq!(top(Rule::Area)[0], 2);
        assert_eq!(Rule::Near.listed(&tree, &leaves).len(), 2 * OCTANTS);
    }
}
