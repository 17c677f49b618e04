// SPDX-License-Identifier: GPL-3.0-or-later
//! The tree of boxes that nearest and overlap queries traverse: the nodes of a bounding volume hierarchy with boxes in
//! the scene's own space, exact to the bit, and its finite triangles without area, which rays never hit.

use halfspace_base::error::{Error, Result};
use halfspace_base::memory::check_room;
use halfspace_geom::Aabb;
use halfspace_nodes::box_tree::{BoxTree, INNER, WIDEST, Wide};
use halfspace_nodes::tree::Tree;
use halfspace_scene::Triangles;
use halfspace_structure::Structure;
use std::sync::Arc;

/// A node: up to eight children with their boxes. The link of a leaf is the index of its first triangle in the tree's
/// list.
pub type Node = Wide<WIDEST>;

/// Largest number of triangles without area in a leaf (chosen: that of rows of eight boxes).
const FLAT_LEAF: usize = 8;

/// The finite triangles of a structure's scene in a tree of boxes. Immutable; any number of threads may query it.
#[derive(Debug)]
pub struct Surface {
    scene: Arc<Triangles>,
    nodes: Vec<Node>,
    /// The triangles of the leaves.
    ids: Vec<u32>,
    root: u32,
}

impl Surface {
    /// Copies the nodes of a structure and computes their boxes. Takes time in proportion to the triangles.
    ///
    /// # Errors
    /// [`Error::Spec`] if the structure's tree is not of boxes around whole triangles; [`Error::Memory`] if the copy does
    /// not fit the memory.
    pub fn new(structure: &Structure) -> Result<Self> {
        let scene = structure.scene().clone();
        check_room("boxes", (2 * structure.bytes() + 4 * scene.len()) as u64)?;
        let mut surface = Self {
            scene,
            nodes: Vec::new(),
            ids: Vec::new(),
            root: 0,
        };
        // Brute force has no tree.
        if let Some(tree) = structure.built().tree.as_deref() {
            let copied = surface.copy::<8>(structure, tree)
                || surface.copy::<4>(structure, tree)
                || surface.copy::<2>(structure, tree);
            if !copied {
                return Err(Error::Spec(format!(
                    "structure: {} has no boxes around its triangles for nearest points and overlaps; bvh-sah has",
                    structure.config().canonical()
                )));
            }
        }
        surface.add_others();
        Ok(surface)
    }

    /// Returns the triangles.
    pub fn scene(&self) -> &Triangles {
        &self.scene
    }

    /// Returns the link to the root.
    pub fn root(&self) -> u32 {
        self.root
    }

    /// Returns the node at a link.
    #[inline(always)]
    pub fn node(&self, link: u32) -> &Node {
        &self.nodes[link as usize]
    }

    /// Returns the triangles of a leaf.
    #[inline(always)]
    pub fn leaf(&self, link: u32, count: u32) -> &[u32] {
        &self.ids[link as usize..][..count as usize]
    }

    /// Returns all triangles that queries can find: the finite ones, in no particular order.
    pub fn triangles(&self) -> &[u32] {
        &self.ids
    }

    /// Copies a tree of `W` children per node if the structure's tree is one.
    fn copy<const W: usize>(&mut self, structure: &Structure, tree: &dyn Tree) -> bool {
        let Some(tree) = tree.downcast_ref::<BoxTree<W>>() else {
            return false;
        };
        // Copy links and leaves.
        let blocks = structure.leaves();
        self.nodes = vec![BoxTree::BLANK; tree.nodes.len()];
        self.ids.reserve(self.scene.live().len());
        for (own, node) in self.nodes.iter_mut().zip(&tree.nodes) {
            for lane in (0..W).filter(|&lane| node.count[lane] != 0) {
                own.count[lane] = node.count[lane];
                own.link[lane] = node.link[lane];
                if node.count[lane] != INNER {
                    own.link[lane] = index(self.ids.len());
                    self.ids
                        .extend(blocks.ids(node.link[lane], node.count[lane] as usize));
                }
            }
        }
        // Compute the boxes; children lie behind their parents.
        for at in (0..self.nodes.len()).rev() {
            for lane in 0..W {
                self.bound(at, lane);
            }
        }
        true
    }

    /// Computes the box of a child of which all nodes below are complete.
    fn bound(&mut self, at: usize, lane: usize) {
        let node = &self.nodes[at];
        let (link, count) = (node.link[lane], node.count[lane]);
        if count == 0 {
            return;
        }
        let bounds = if count == INNER {
            bounds(self.node(link))
        } else {
            let corners = (self.leaf(link, count).iter()).map(|&id| self.scene.corners(id));
            corners.fold(Aabb::EMPTY, |all, one| all.union(&Aabb::of_triangle(one)))
        };
        let node = &mut self.nodes[at];
        for k in 0..3 {
            node.bounds[k][lane] = bounds.min[k];
            node.bounds[3 + k][lane] = bounds.max[k];
        }
    }

    /// Adds the finite triangles that the tree does not hold, such as those without area, as a second child of a new
    /// root.
    fn add_others(&mut self) {
        let finite = |id: u32| {
            let corners = self.scene.corners(id);
            corners.as_flattened().iter().all(|x| x.is_finite())
        };
        let mut held = vec![false; self.scene.len()];
        for &id in &self.ids {
            held[id as usize] = true;
        }
        let mut others: Vec<_> = (0..index(self.scene.len()))
            .filter(|&id| !held[id as usize] && finite(id))
            .collect();
        if others.is_empty() {
            return;
        }
        if self.nodes.is_empty() {
            self.root = self.split(&mut others);
            return;
        }
        // Join both trees.
        let both = [self.root, self.split(&mut others)];
        let at = self.nodes.len();
        self.nodes.push(BoxTree::BLANK);
        for (lane, link) in both.into_iter().enumerate() {
            (self.nodes[at].link[lane], self.nodes[at].count[lane]) = (link, INNER);
            self.bound(at, lane);
        }
        self.root = index(at);
    }

    /// Appends a tree over triangles, split at the median of their boxes' centres; returns its root.
    fn split(&mut self, ids: &mut [u32]) -> u32 {
        let at = self.nodes.len();
        self.nodes.push(BoxTree::BLANK);
        let mut groups = vec![ids];
        // Halve the largest group until there are eight, or all fit leaves.
        while groups.len() < WIDEST {
            let largest = (0..groups.len()).max_by_key(|&i| groups[i].len());
            let largest = largest.expect("there is at least one group");
            if groups[largest].len() <= FLAT_LEAF {
                break;
            }
            let group = groups.swap_remove(largest);
            self.sort(group);
            let (below, above) = group.split_at_mut(group.len() / 2);
            groups.extend([below, above]);
        }
        // Make a leaf or a node of each.
        for (lane, group) in groups.into_iter().enumerate() {
            let (link, count) = if group.len() <= FLAT_LEAF {
                let first = index(self.ids.len());
                self.ids.extend_from_slice(group);
                (first, index(group.len()))
            } else {
                (self.split(group), INNER)
            };
            (self.nodes[at].link[lane], self.nodes[at].count[lane]) = (link, count);
            self.bound(at, lane);
        }
        index(at)
    }

    /// Sorts triangles by the centres of their boxes along the axis on which these differ most.
    fn sort(&self, ids: &mut [u32]) {
        let centre = |id: u32, k: usize| {
            let own = Aabb::of_triangle(self.scene.corners(id));
            0.5 * own.min[k] + 0.5 * own.max[k]
        };
        let extent = |k: usize| {
            let all = ids.iter().map(|&id| centre(id, k));
            let (min, max) = all.fold((f32::MAX, f32::MIN), |(a, b), x| (a.min(x), b.max(x)));
            f64::from(max) - f64::from(min)
        };
        let widest = [1, 2]
            .into_iter()
            .fold(0, |best, k| if extent(k) > extent(best) { k } else { best });
        ids.sort_by(|&a, &b| centre(a, widest).total_cmp(&centre(b, widest)));
    }
}

/// Returns a position in a list of at most 2^29 triangles or as many nodes.
fn index(i: usize) -> u32 {
    u32::try_from(i).expect("bounded by the scene")
}

/// Returns the box of a node.
fn bounds(node: &Node) -> Aabb {
    let mut all = Aabb::EMPTY;
    for lane in (0..WIDEST).filter(|&lane| node.count[lane] != 0) {
        all = all.union(&Aabb {
            min: [0, 1, 2].map(|k: usize| node.bounds[k][lane]),
            max: [0, 1, 2].map(|k: usize| node.bounds[3 + k][lane]),
        });
    }
    all
}
