// SPDX-License-Identifier: GPL-3.0-or-later
//! Counts of nodes and leaves, and the operations that the surface area heuristic expects for a ray.

use super::{Analysis, Overlap};
use halfspace_geom::Aabb;
use halfspace_geom::cell::Direction;
use halfspace_geom::region::Region;
use halfspace_nodes::cells::{NodeCell, Steps};
use halfspace_nodes::cost::Costs;
use std::collections::{BTreeMap, HashSet};

/// Expected numbers of operations of a ray.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Charges {
    /// Axis-aligned steps.
    pub axis: f64,
    /// Oblique steps.
    pub oblique: f64,
    /// Triangle tests.
    pub tests: f64,
}

impl Charges {
    /// Adds the steps at a node and the tests of its triangles, multiplied by `weight`.
    pub fn add(&mut self, steps: Steps, tests: usize, weight: f64) {
        self.axis += weight * f64::from(steps.axis);
        self.oblique += weight * f64::from(steps.oblique);
        self.tests += weight * tests as f64;
    }

    /// Returns the cost of the steps in the units of the thesis (Hoobergs 2019): 1 per axis-aligned step, 5 per oblique
    /// one.
    pub fn nodes(&self) -> f64 {
        self.axis + f64::from(Costs::THESIS_OBLIQUE) * self.oblique
    }

    /// Returns the cost of the tests in the units of the thesis: 80 per triangle.
    pub fn leaves(&self) -> f64 {
        f64::from(Costs::THESIS.triangle) * self.tests
    }

    /// Returns the sum of both costs.
    pub fn cost(&self) -> f64 {
        self.nodes() + self.leaves()
    }
}

/// Numbers per level of the tree; the root is level 0. All lists have the same length.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Levels {
    /// Number of inner nodes.
    pub nodes: Vec<u64>,
    /// Number of axis-aligned planes that the nodes store.
    pub planes_axis: Vec<u64>,
    /// Number of oblique planes that the nodes store.
    pub planes_oblique: Vec<u64>,
    /// Number of distinct axes of the planes.
    pub directions_axis: Vec<u64>,
    /// Number of distinct normals of oblique planes, opposite ones counted once.
    pub directions_oblique: Vec<u64>,
}

/// Beta of the thesis (Hoobergs 2019, section 3.2): the probability that a random ray that visits a node hits one child
/// only, averaged over the visits of nodes that one plane divides in two. `None` without such nodes.
///
/// A random line that hits a convex cell of surface area A crosses a section of area C with probability 2 C / A.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Beta {
    /// All split planes.
    pub all: Option<f64>,
    /// Axis-aligned split planes.
    pub axis: Option<f64>,
    /// Oblique split planes.
    pub oblique: Option<f64>,
}

/// A weighted mean.
#[derive(Debug, Clone, Copy, Default)]
struct Mean {
    sum: f64,
    weight: f64,
}

impl Mean {
    /// Returns the mean; `None` without any weight.
    fn value(self) -> Option<f64> {
        (self.weight > 0.0).then(|| self.sum / self.weight)
    }
}

/// Counts at one depth.
#[derive(Debug, Default)]
struct Level {
    nodes: u64,
    planes_axis: u64,
    planes_oblique: u64,
    axes: HashSet<usize>,
    normals: HashSet<[u32; 3]>,
}

/// Accumulates the statistics of a tree node by node.
#[derive(Debug, Default)]
pub struct Census {
    leaf_depths: Vec<u64>,
    leaf_sizes: BTreeMap<usize, u64>,
    levels: Vec<Level>,
    children: Vec<u64>,
    visits: Charges,
    beta_axis: Mean,
    beta_oblique: Mean,
}

/// Returns the probability that a random ray that hits the scene's box hits a region: the ratio of their surface areas.
/// A box is clipped to that of the scene.
pub fn share(region: &Region, bounds: &Aabb) -> f64 {
    let area = match region.bounds() {
        Some(cell) => {
            let inside = Aabb {
                min: [0, 1, 2].map(|k| cell.min[k].max(bounds.min[k])),
                max: [0, 1, 2].map(|k| cell.max[k].min(bounds.max[k])),
            };
            if inside.is_empty() {
                0.0
            } else {
                inside.area()
            }
        }
        None => region.area(),
    };
    let whole = bounds.area();
    if whole > 0.0 { area / whole } else { 0.0 }
}

/// Adds one to an entry of a histogram, which grows as needed.
fn count(histogram: &mut Vec<u64>, entry: usize) {
    if histogram.len() <= entry {
        histogram.resize(entry + 1, 0);
    }
    histogram[entry] += 1;
}

/// Returns the bits of a normal, the same for the opposite one.
fn unsigned(normal: [f32; 3]) -> [u32; 3] {
    let first = normal.into_iter().find(|&x| x != 0.0);
    let sign = if first.is_some_and(|x| x < 0.0) {
        -1.0
    } else {
        1.0
    };
    // Adding 0.0 turns -0.0 into 0.0.
    normal.map(|x| (sign * x + 0.0).to_bits())
}

impl Census {
    /// Adds a leaf that a random ray visits with probability `share`.
    pub fn leaf(&mut self, triangles: usize, depth: usize, share: f64) {
        count(&mut self.leaf_depths, depth);
        *self.leaf_sizes.entry(triangles).or_default() += 1;
        self.visits.add(Steps::default(), triangles, share);
    }

    /// Adds the steps at a node that a random ray visits with probability `share`.
    pub fn steps(&mut self, steps: Steps, share: f64) {
        self.visits.add(steps, 0, share);
    }

    /// Adds an inner node. In a tree that `partitions` space, a node with one plane also counts in beta.
    pub fn inner(&mut self, node: &NodeCell<'_>, partitions: bool) {
        count(&mut self.children, node.view.children.len());
        if self.levels.len() <= node.depth {
            self.levels.resize_with(node.depth + 1, Level::default);
        }
        // Count the planes and their distinct directions.
        let level = &mut self.levels[node.depth];
        level.nodes += 1;
        for (plane, _) in &node.view.planes {
            match plane.direction {
                Direction::Axis(axis) => {
                    level.planes_axis += 1;
                    level.axes.insert(axis);
                }
                Direction::Oblique(normal) => {
                    level.planes_oblique += 1;
                    level.normals.insert(unsigned(normal));
                }
            }
        }
        // Add the probability of a single child at a node that one plane divides in two.
        if let ([(plane, _)], [(_, below), (_, above)], true) =
            (&node.view.planes[..], &node.view.children[..], partitions)
        {
            let mean = match plane.direction {
                Direction::Axis(_) => &mut self.beta_axis,
                Direction::Oblique(_) => &mut self.beta_oblique,
            };
            // The section has two sides, so the areas of both parts exceed that of the cell by twice the section.
            let area = node.region.area();
            let section = below.area() + above.area() - area;
            if area > 0.0 {
                mean.sum += (area - section).clamp(0.0, area);
                mean.weight += area;
            }
        }
    }

    /// Returns the statistics, with end-point overlap computed elsewhere.
    pub fn finish(self, overlap: Overlap) -> Analysis {
        let column = |get: fn(&Level) -> u64| self.levels.iter().map(get).collect();
        let levels = Levels {
            nodes: column(|level| level.nodes),
            planes_axis: column(|level| level.planes_axis),
            planes_oblique: column(|level| level.planes_oblique),
            directions_axis: column(|level| level.axes.len() as u64),
            directions_oblique: column(|level| level.normals.len() as u64),
        };
        let both = Mean {
            sum: self.beta_axis.sum + self.beta_oblique.sum,
            weight: self.beta_axis.weight + self.beta_oblique.weight,
        };
        Analysis {
            nodes: levels.nodes.iter().sum(),
            leaf_depths: self.leaf_depths,
            leaf_sizes: (self.leaf_sizes.iter())
                .map(|(&triangles, &leaves)| [triangles as u64, leaves])
                .collect(),
            levels,
            children: self.children,
            visits: self.visits,
            beta: Beta {
                all: both.value(),
                axis: self.beta_axis.value(),
                oblique: self.beta_oblique.value(),
            },
            overlap,
        }
    }
}
