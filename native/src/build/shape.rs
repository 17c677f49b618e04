// SPDX-License-Identifier: GPL-3.0-or-later
//! What trees are like, whatever they are: numbers of nodes and leaves, depths, and the cost that the surface area
//! heuristic (Goldsmith and Salmon 1987, MacDonald and Booth 1990) expects of a ray.

use super::cell::Direction;
use super::cost::Costs;
use super::preorder::{Item, Preorder};

/// A leaf of more triangles is large: planes could not part them, or none were tried.
const LARGE: usize = 64;

/// What there is to know about a tree's shape.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Shape {
    /// Inner nodes with an axis-aligned plane.
    pub nodes_axis: usize,
    /// Inner nodes with an oblique plane.
    pub nodes_oblique: usize,
    /// Leaves, empty ones included.
    pub leaves: usize,
    /// Leaves without triangles.
    pub leaves_empty: usize,
    /// Triangle references in all leaves.
    pub references: usize,
    /// Links from leaves to their neighbours; those that lead out of the tree do not count.
    pub links: usize,
    /// Triangles in the largest leaf.
    pub leaf_max: usize,
    /// Leaves of more than [`LARGE`] triangles.
    pub leaves_large: usize,
    /// Largest depth of a leaf; the root has depth 0.
    pub depth_max: usize,
    /// Mean depth of the leaves.
    pub depth_mean: f64,
    /// Expected cost of a random ray in the units of the thesis (Hoobergs 2019): 80 a triangle, 1
    /// an axis step, 5 an oblique step. The same for all trees, so that they compare.
    pub sah_cost: f64,
}

impl Shape {
    /// Takes in the shape of a subtree whose root has this depth.
    pub fn join(&mut self, other: &Self, depth: usize) {
        let depth_sum = self.depth_mean * self.leaves as f64
            + (other.depth_mean + depth as f64) * other.leaves as f64;
        self.nodes_axis += other.nodes_axis;
        self.nodes_oblique += other.nodes_oblique;
        self.leaves += other.leaves;
        self.leaves_empty += other.leaves_empty;
        self.references += other.references;
        self.links += other.links;
        self.leaf_max = self.leaf_max.max(other.leaf_max);
        self.leaves_large += other.leaves_large;
        self.depth_max = self.depth_max.max(other.depth_max + depth);
        self.depth_mean = depth_sum / self.leaves.max(1) as f64;
        self.sah_cost += other.sah_cost;
    }

    /// Measures a tree in preorder.
    pub fn new(preorder: &Preorder) -> Self {
        let mut measure = Measure::default();
        let mut depths = vec![0_usize];
        for item in &preorder.items {
            let depth = depths.pop().expect("preorder: every node has a depth");
            match *item {
                Item::Inner { plane, share } => {
                    match plane.direction {
                        Direction::Axis(_) => measure.axis(f64::from(share)),
                        Direction::Oblique(_) => measure.oblique(f64::from(share)),
                    }
                    depths.extend([depth + 1; 2]);
                }
                Item::Later => {}
                Item::Leaf { count, share } => {
                    measure.leaf(count as usize, depth, f64::from(share));
                }
            }
        }
        measure.finish()
    }
}

/// Takes the measure of a tree, node by node. A `share` is the chance that a ray which meets the scene's box meets the
/// node's region too: area by area.
#[derive(Debug, Default)]
pub struct Measure {
    shape: Shape,
    depth_sum: usize,
}

impl Measure {
    /// An inner node with an axis-aligned plane.
    pub fn axis(&mut self, share: f64) {
        self.shape.nodes_axis += 1;
        self.steps(share);
    }

    /// An inner node with an oblique plane.
    pub fn oblique(&mut self, share: f64) {
        self.shape.nodes_oblique += 1;
        self.steps(f64::from(Costs::THESIS_OBLIQUE) * share);
    }

    /// So many axis steps of an average ray, beside those of [`Self::axis`].
    pub fn steps(&mut self, count: f64) {
        self.shape.sah_cost += count;
    }

    /// A leaf of so many triangles.
    pub fn leaf(&mut self, count: usize, depth: usize, share: f64) {
        let shape = &mut self.shape;
        shape.leaves += 1;
        shape.leaves_empty += usize::from(count == 0);
        shape.leaves_large += usize::from(count > LARGE);
        shape.references += count;
        shape.leaf_max = shape.leaf_max.max(count);
        shape.depth_max = shape.depth_max.max(depth);
        shape.sah_cost += f64::from(Costs::THESIS.triangle) * share * count as f64;
        self.depth_sum += depth;
    }

    /// All of it.
    pub fn finish(mut self) -> Shape {
        self.shape.depth_mean = self.depth_sum as f64 / self.shape.leaves.max(1) as f64;
        self.shape
    }
}
