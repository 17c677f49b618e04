// SPDX-License-Identifier: GPL-3.0-or-later
//! Statistics common to all trees: numbers of nodes and leaves, depths, and the expected cost of a ray by the
//! surface area heuristic (Goldsmith and Salmon 1987, MacDonald and Booth 1990).

use crate::cost::Costs;
use crate::preorder::{Item, Preorder};
use halfspace_geom::cell::Direction;

/// Leaves of more triangles count as large: no plane could split them, or none was tried.
const LARGE: usize = 64;

/// Statistics of a tree.
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
    /// Links from leaves to their neighbours, without those that lead out of the tree.
    pub links: usize,
    /// Triangles in the largest leaf.
    pub leaf_max: usize,
    /// Leaves of more than [`LARGE`] triangles.
    pub leaves_large: usize,
    /// Largest depth of a leaf; the root has depth 0.
    pub depth_max: usize,
    /// Mean depth of the leaves.
    pub depth_mean: f64,
    /// Expected cost of a random ray in the units of the thesis (Hoobergs 2019): 80 per triangle test, 1 per
    /// axis-aligned step, 5 per oblique step. The same for all trees, so that their costs compare.
    pub sah_cost: f64,
}

impl Shape {
    /// Adds the statistics of a subtree whose root lies at this depth.
    pub fn join(&mut self, other: &Self, depth: usize) {
        // Combine the mean depths, weighted by the numbers of leaves.
        let depth_sum = self.depth_mean * self.leaves as f64
            + (other.depth_mean + depth as f64) * other.leaves as f64;
        // Add the counts.
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
        // Depths of the nodes still to come, the next one last.
        let mut depths = vec![0_usize];
        for item in &preorder.items {
            let depth = depths.pop().expect("preorder: every node has a depth");
            match *item {
                Item::Inner { plane, share } => {
                    // Oblique steps cost more.
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

/// Accumulates the statistics of a tree, node by node. `share` is the probability that a ray which meets the
/// scene's box also meets the node's region: the ratio of their surface areas.
#[derive(Debug, Default)]
pub struct Measure {
    shape: Shape,
    depth_sum: usize,
}

impl Measure {
    /// Adds an inner node with an axis-aligned plane.
    pub fn axis(&mut self, share: f64) {
        self.shape.nodes_axis += 1;
        self.steps(share);
    }

    /// Adds an inner node with an oblique plane.
    pub fn oblique(&mut self, share: f64) {
        self.shape.nodes_oblique += 1;
        self.steps(f64::from(Costs::THESIS_OBLIQUE) * share);
    }

    /// Adds a number of axis-aligned steps of an average ray, in addition to those of [`Self::axis`].
    pub fn steps(&mut self, count: f64) {
        self.shape.sah_cost += count;
    }

    /// Adds a leaf of `count` triangles.
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

    /// Returns the statistics.
    pub fn finish(mut self) -> Shape {
        self.shape.depth_mean = self.depth_sum as f64 / self.shape.leaves.max(1) as f64;
        self.shape
    }
}
