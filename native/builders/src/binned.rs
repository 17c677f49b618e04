// SPDX-License-Identifier: GPL-3.0-or-later
//! Partitions of objects by the surface area heuristic: every position along each axis for few objects, 32 bins of
//! centres for many (Wald 2007, On fast construction of SAH-based bounding volume hierarchies).

use crate::object::{self, Node, Object, ObjectPolicy, Partition};
use halfspace_geom::Aabb;
use halfspace_nodes::cost::Costs;
use rayon::prelude::*;

/// Nodes of at most this number of objects try every partition along each axis.
const SWEEP: usize = 96;

/// Number of bins per axis.
const BINS: usize = 32;

/// Nodes of at least this number of objects fill their bins in parallel.
const PARALLEL: usize = 1 << 15;

/// Partitions objects where the surface area heuristic is lowest.
pub struct SurfaceArea {
    /// Costs of the operations of a traversal.
    pub costs: Costs,
    /// Largest number of triangles in a leaf, unless all centres coincide.
    pub leaf_max: usize,
}

/// A partition of objects.
#[derive(Debug, Clone, Copy)]
pub struct Best {
    /// Cost of the two parts as leaves, in units of area times triangle tests.
    pub cost: f64,
    /// Axis along which centres are compared.
    pub axis: usize,
    /// Largest centre below.
    pub at: f32,
}

impl ObjectPolicy for SurfaceArea {
    type Region = ();

    fn root(&self, _: Aabb) {}

    fn partition(&self, node: &Node<'_, ()>) -> Partition<()> {
        let n = node.objects.len();
        let (bounds, centres) = node.measure();
        let Some(best) = self.best(node.objects, &centres) else {
            return Partition::Leaf; // all centres coincide
        };
        if self.is_leaf(n, &bounds, best.cost) {
            return Partition::Leaf;
        }
        Partition::Centre {
            axis: best.axis,
            at: best.at,
            regions: [(); 2],
        }
    }
}

impl SurfaceArea {
    /// Returns the best partition of objects: every one of few objects is tried, and bins of many; `None` if all centres
    /// coincide. `centres` is the box around them.
    pub fn best(&self, objects: &[Object], centres: &Aabb) -> Option<Best> {
        if objects.len() <= SWEEP {
            self.sweep(objects, centres)
        } else {
            self.bins(objects, centres)
        }
    }

    /// Returns whether `n` objects in a box make a leaf: that is allowed, and a split into leaves that cost `parts` is
    /// not cheaper.
    pub fn is_leaf(&self, n: usize, bounds: &Aabb, parts: f64) -> bool {
        let area = bounds.area();
        n <= self.leaf_max && f64::from(self.costs.step) * area + parts >= self.leaf(n) * area
    }

    /// Returns whether the partition of the objects `whole` into `parts` costs less than one leaf.
    pub fn is_worth(&self, whole: &[Object], parts: &[Vec<Object>; 2]) -> bool {
        let cost = |objects: &[Object]| object::around(objects).area() * self.leaf(objects.len());
        let step = f64::from(self.costs.step) * object::around(whole).area();
        step + cost(&parts[0]) + cost(&parts[1]) < cost(whole)
    }

    /// Returns the cost of a leaf of `n` objects.
    #[expect(clippy::cast_precision_loss, reason = "a cost")]
    pub fn leaf(&self, n: usize) -> f64 {
        f64::from(self.costs.leaf(n as f32))
    }

    /// Returns the best of all partitions between different centres, or `None` if all centres coincide.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "the lowest eight bits are the index of one of few objects"
    )]
    fn sweep(&self, objects: &[Object], centres: &Aabb) -> Option<Best> {
        let n = objects.len();
        let mut best: Option<Best> = None;
        let mut order = [0_u64; SWEEP];
        let mut areas = [0.0; SWEEP];
        for axis in 0..3 {
            if centres.min[axis] >= centres.max[axis] {
                continue;
            }
            // Sort the objects by their centres, as integer keys with the object's index in the low byte.
            let order = &mut order[..n];
            for (i, (key, object)) in order.iter_mut().zip(objects).enumerate() {
                *key = u64::from(ascending(object.centre(axis))) << 8 | i as u64;
            }
            // The order of equal centres does not matter: no partition lies between them.
            order.sort_unstable();
            let object = |key: u64| &objects[usize::from(key as u8)];
            // Accumulate the areas from above, then sweep from below and evaluate each partition.
            let mut above = Aabb::EMPTY;
            for i in (1..n).rev() {
                above = above.union(&object(order[i]).bounds);
                areas[i] = above.area();
            }
            let mut below = Aabb::EMPTY;
            for i in 1..n {
                let last = object(order[i - 1]);
                below = below.union(&last.bounds);
                // Only partitions between different centres can be reproduced from `at`.
                let at = last.centre(axis);
                if at == object(order[i]).centre(axis) {
                    continue;
                }
                let cost = below.area() * self.leaf(i) + areas[i] * self.leaf(n - i);
                if best.is_none_or(|b| cost < b.cost) {
                    best = Some(Best { cost, axis, at });
                }
            }
        }
        best
    }

    /// Returns the best of the partitions between bins of centres.
    fn bins(&self, objects: &[Object], centres: &Aabb) -> Option<Best> {
        let grid = Grid::new(*centres);
        // Sort the objects into bins, in parallel for many objects.
        let bins = if objects.len() < PARALLEL {
            grid.fill(objects)
        } else {
            objects
                .par_chunks(PARALLEL / 4)
                .map(|objects| grid.fill(objects))
                .reduce(|| [[Bin::EMPTY; BINS]; 3], join)
        };
        let mut best: Option<Best> = None;
        for (axis, bins) in bins.iter().enumerate() {
            if centres.min[axis] >= centres.max[axis] {
                continue;
            }
            // Accumulate the costs from above, then sweep from below and evaluate each boundary between bins.
            let mut costs = [0.0; BINS];
            let mut above = Bin::EMPTY;
            for i in (1..BINS).rev() {
                above = above.union(&bins[i]);
                costs[i] = above.cost(self);
            }
            let mut below = Bin::EMPTY;
            for i in 1..BINS {
                let filled = bins[i - 1].count > 0;
                below = below.union(&bins[i - 1]);
                let cost = below.cost(self) + costs[i];
                if filled && below.count < objects.len() && best.is_none_or(|b| cost < b.cost) {
                    // An empty bin repeats the previous boundary.
                    let at = below.last;
                    best = Some(Best { cost, axis, at });
                }
            }
        }
        best
    }
}

/// Maps a float to an integer of the same order, that of [`f32::total_cmp`].
#[inline(always)]
fn ascending(x: f32) -> u32 {
    let bits = x.to_bits();
    if bits >> 31 == 0 {
        bits | 1 << 31
    } else {
        !bits
    }
}

/// The objects whose centres fall between two heights.
#[derive(Clone, Copy)]
struct Bin {
    bounds: Aabb,
    /// Their largest centre: a partition at it reproduces the bins without computing them again.
    last: f32,
    count: usize,
}

impl Bin {
    /// Bin without objects.
    const EMPTY: Self = Self {
        bounds: Aabb::EMPTY,
        last: f32::NEG_INFINITY,
        count: 0,
    };

    /// Returns the bin of the objects of both.
    fn union(&self, other: &Self) -> Self {
        Self {
            bounds: self.bounds.union(&other.bounds),
            last: self.last.max(other.last),
            count: self.count + other.count,
        }
    }

    /// Returns the cost of a leaf of the objects, in units of area.
    fn cost(&self, policy: &SurfaceArea) -> f64 {
        if self.count == 0 {
            0.0
        } else {
            self.bounds.area() * policy.leaf(self.count)
        }
    }
}

/// Adds the bins of two sets of objects.
fn join(mut a: [[Bin; BINS]; 3], b: [[Bin; BINS]; 3]) -> [[Bin; BINS]; 3] {
    for (a, b) in a.as_flattened_mut().iter_mut().zip(b.as_flattened()) {
        *a = a.union(b);
    }
    a
}

/// Origin and scale of the bins along each axis.
struct Grid {
    low: [f32; 3],
    scale: [f32; 3],
}

impl Grid {
    /// Divides the box of the centres into bins.
    #[expect(clippy::cast_precision_loss, reason = "a small number")]
    fn new(centres: Aabb) -> Self {
        let scale = |k: usize| {
            // All centres fall into the first bin along an axis where they coincide.
            let scale = BINS as f32 / (centres.max[k] - centres.min[k]);
            if scale.is_finite() { scale } else { 0.0 }
        };
        Self {
            low: centres.min,
            scale: [scale(0), scale(1), scale(2)],
        }
    }

    /// Adds objects to bins, one bin per axis.
    fn fill(&self, objects: &[Object]) -> [[Bin; BINS]; 3] {
        let mut bins = [[Bin::EMPTY; BINS]; 3];
        // Add each object to one bin per axis; the last bin also takes the largest centre.
        for object in objects {
            for (k, bins) in bins.iter_mut().enumerate() {
                let centre = object.centre(k);
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "saturates, and is clamped"
                )]
                // The bin may be off by rounding, but equal centres share a bin.
                let i = ((centre - self.low[k]) * self.scale[k]) as usize;
                let bin = &mut bins[i.min(BINS - 1)];
                bin.bounds = bin.bounds.union(&object.bounds);
                bin.last = bin.last.max(centre);
                bin.count += 1;
            }
        }
        bins
    }
}
