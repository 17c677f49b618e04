// SPDX-License-Identifier: GPL-3.0-or-later
//! Partitions of objects by the surface area heuristic: every position along each axis for few objects, 32 bins of
//! centres for many (Wald 2007, On fast construction of SAH-based bounding volume hierarchies).

use crate::object::{self, Node, Object, ObjectPolicy, Partition};
use crate::reach::Reach;
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
        // Each box is needed six times, each cost of a leaf up to six times.
        let mut boxes = [Reach::EMPTY; SWEEP];
        for (reach, object) in boxes.iter_mut().zip(objects) {
            *reach = Reach::new(&object.bounds);
        }
        let mut leaves = [0.0; SWEEP];
        for (i, leaf) in leaves[..n].iter_mut().enumerate().skip(1) {
            *leaf = self.leaf(i);
        }
        for axis in 0..3 {
            if centres.min[axis] >= centres.max[axis] {
                continue;
            }
            // Sort the objects by their centres, as integer keys with the object's index in the low byte.
            let order = &mut order[..n];
            for (i, (key, object)) in order.iter_mut().zip(objects).enumerate() {
                // Both zeros are one centre.
                *key = u64::from(ascending(object.centre(axis) + 0.0)) << 8 | i as u64;
            }
            // The order of equal centres does not matter: no partition lies between them.
            order.sort_unstable();
            let reach = |key: u64| &boxes[usize::from(key as u8)];
            // Accumulate the areas from above, then sweep from below and evaluate each partition.
            let mut above = Reach::EMPTY;
            for i in (1..n).rev() {
                above = above.union(reach(order[i]));
                areas[i] = above.area();
            }
            let mut below = Reach::EMPTY;
            for i in 1..n {
                below = below.union(reach(order[i - 1]));
                // Only partitions between different centres can be reproduced from the largest centre below.
                if order[i - 1] >> 8 == order[i] >> 8 {
                    continue;
                }
                let cost = below.area() * leaves[i] + areas[i] * leaves[n - i];
                if best.is_none_or(|b| cost < b.cost) {
                    let last = &objects[usize::from(order[i - 1] as u8)];
                    best = Some(Best {
                        cost,
                        axis,
                        at: last.centre(axis),
                    });
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
                    let at = 0.0 - below.reach.free();
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
    /// Their boxes, with the negated largest centre: a partition at it reproduces the bins without computing them again.
    reach: Reach,
    count: usize,
}

impl Bin {
    /// Bin without objects.
    const EMPTY: Self = Self {
        reach: Reach::EMPTY,
        count: 0,
    };

    /// Returns the bin of the objects of both.
    #[inline(always)]
    fn union(&self, other: &Self) -> Self {
        Self {
            reach: self.reach.union(&other.reach),
            count: self.count + other.count,
        }
    }

    /// Returns the cost of a leaf of the objects, in units of area.
    #[inline(always)]
    fn cost(&self, policy: &SurfaceArea) -> f64 {
        if self.count == 0 {
            0.0
        } else {
            self.reach.area() * policy.leaf(self.count)
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

    /// Returns the bin along each axis; the last one also takes the largest centre. The bin may be off by rounding, but
    /// equal centres share a bin.
    #[inline(always)]
    fn bins_of(&self, centre: [f32; 3]) -> [usize; 3] {
        // Adding 2^23 leaves an integer in the lowest bits, without the checks of a conversion.
        let last = (BINS - 1) as f32;
        std::array::from_fn(|k| {
            let x = (centre[k] - self.low[k]) * self.scale[k];
            let whole = if x < last { x } else { last }.floor();
            (whole + 8_388_608.0).to_bits() as usize % BINS
        })
    }

    /// Adds objects to bins, one bin per axis.
    fn fill(&self, objects: &[Object]) -> [[Bin; BINS]; 3] {
        let mut bins = [[Bin::EMPTY; BINS]; 3];
        for object in objects {
            let reach = Reach::new(&object.bounds);
            let centre = [0, 1, 2].map(|k| object.centre(k));
            let own = self.bins_of(centre);
            for (k, bins) in bins.iter_mut().enumerate() {
                let bin = &mut bins[own[k]];
                bin.reach = bin.reach.union(&reach.with(-centre[k]));
                bin.count += 1;
            }
        }
        bins
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const POLICY: SurfaceArea = SurfaceArea {
        costs: Costs::BOXES,
        leaf_max: 8,
    };

    /// Objects whose centres often coincide.
    fn objects(count: std::ops::Range<usize>) -> impl Strategy<Value = Vec<Object>> {
        let number = || prop_oneof![(-4_i8..4).prop_map(f32::from), -4.0_f32..4.0];
        let size = || prop_oneof![Just(0.0_f32), 0.0_f32..2.0];
        let object = ([number(), number(), number()], [size(), size(), size()]);
        prop::collection::vec(object, count).prop_map(|all| {
            let object = |(id, (low, size)): (u32, ([f32; 3], [f32; 3]))| {
                let mut bounds = Aabb::EMPTY;
                bounds.grow(low);
                bounds.grow([0, 1, 2].map(|k| low[k] + size[k]));
                Object { bounds, id }
            };
            (0..).zip(all).map(object).collect()
        })
    }

    fn best(objects: &[Object]) -> Option<Best> {
        POLICY.best(objects, &object::measure(objects).1)
    }

    /// Cost of the partition at this centre; `None` if it leaves a side empty.
    fn cost(objects: &[Object], axis: usize, at: f32) -> Option<f64> {
        let (below, above): (Vec<Object>, Vec<_>) =
            objects.iter().partition(|object| object.centre(axis) <= at);
        let side = |side: &[Object]| {
            let all = side
                .iter()
                .fold(Aabb::EMPTY, |all, object| all.union(&object.bounds));
            all.area() * POLICY.leaf(side.len())
        };
        (!below.is_empty() && !above.is_empty()).then(|| side(&below) + side(&above))
    }

    proptest! {
        #[test]
        fn no_partition_of_few_objects_is_cheaper(objects in objects(2..SWEEP + 1)) {
            let all = objects.iter().flat_map(|object| (0..3).map(|k| (k, object.centre(k))));
            let costs = all.filter_map(|(axis, at)| cost(&objects, axis, at));
            let cheapest = costs.min_by(f64::total_cmp);
            prop_assert_eq!(best(&objects).map(|best| best.cost), cheapest);
        }

        #[test]
        fn the_cost_is_that_of_the_partition(objects in objects(2..4 * SWEEP)) {
            if let Some(best) = best(&objects) {
                prop_assert_eq!(cost(&objects, best.axis, best.at), Some(best.cost));
            }
        }
    }

    #[test]
    fn equal_centres_share_a_bin_and_all_bins_are_used() {
        let grid = Grid::new(Aabb {
            min: [0.0, -1.0, 5.0],
            max: [32.0, 1.0, 5.0],
        });
        for i in 0..=32_u8 {
            let x = f32::from(i);
            let [a, b, c] = grid.bins_of([x, x / 16.0 - 1.0, 5.0]);
            let expected = usize::from(i.min(31));
            assert_eq!([a, b, c], [expected, expected, 0]);
        }
    }
}
