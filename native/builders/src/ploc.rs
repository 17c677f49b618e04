// SPDX-License-Identifier: GPL-3.0-or-later
//! Box hierarchies from the leaves up by parallel locally-ordered clustering (Meister and Bittner 2018).
//!
//! Clusters lie in the order of the Z-order curve, at first one per triangle. In each round a cluster finds, among its
//! neighbours in this order, the one with which it has the smallest box, and any two clusters that find each other
//! become one, in place of the first. A cluster whose triangles cost less as a leaf is one. The tree depends only on the
//! triangles, not on the number of threads.
//!
//! Two additions bound the time and the depth. Where boxes have equal areas, neighbours whose positions differ in the
//! lowest bits go first, so that equal triangles make a balanced tree; and a round that unites few of the clusters
//! unites the others by position, which boxes within boxes need. Nodes near the depth limit are halved.

use crate::binned::SurfaceArea;
use crate::morton;
use crate::object::{self, Object};
use fearless_simd::{Select, Simd, SimdBase, dispatch, f32x8, u32x8};
use halfspace_base::error::Result;
use halfspace_base::{Monitor, footprint, simd};
use halfspace_geom::Aabb;
use halfspace_nodes::object_tree::{Item, ObjectTree};
use halfspace_nodes::plane_tree::MAX_DEPTH;
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;
use rayon::prelude::*;

/// Largest search radius.
pub const FARTHEST: usize = 128;

/// Number of neighbours that are compared at once.
const LANES: usize = 8;

/// Clusters that one task unites (chosen).
const PART: usize = 1 << 12;

/// A round unites at least one in this number of clusters (chosen: without this, a third is usual).
const FEWEST: usize = 32;

/// How clusters are united.
pub struct Clustering {
    /// Number of neighbours that a cluster compares on each side, up to [`FARTHEST`].
    pub radius: usize,
    /// Costs of leaves and their largest size; where nodes are halved, also the partitions.
    pub heuristic: SurfaceArea,
}

/// Two clusters that became one.
#[derive(Debug, Clone, Copy)]
struct Union {
    /// The numbers of both: of an object, or, from the number of objects on, of a union.
    parts: [u32; 2],
    /// Number of its objects.
    count: u32,
    /// Its cost, multiplied by its area, as a leaf or divided, whichever is lower.
    cost: f32,
    /// Levels below it, 255 for all above.
    height: u8,
    /// Axis along which the centres of the parts lie farthest apart, the lower one first.
    axis: u8,
    /// Whether it is a leaf.
    leaf: bool,
}

/// Clusters in columns: six of boxes, the lower ends first, and their numbers. Boxes without end surround them, which no
/// cluster chooses as a neighbour.
struct Clusters {
    bounds: [Vec<f32>; 6],
    numbers: Vec<u32>,
}

/// Boxes before the first cluster and after the last.
const AROUND: usize = FARTHEST + LANES;

/// Lower and upper ends of a box without end.
const ENDLESS: [f32; 6] = [f32::MIN, f32::MIN, f32::MIN, f32::MAX, f32::MAX, f32::MAX];

impl Clusters {
    /// Makes room for `count` clusters, between boxes without end.
    fn new(count: usize) -> Self {
        let column = |end: f32| {
            let mut column = Vec::with_capacity(count + 2 * AROUND);
            column.resize(AROUND, end);
            column
        };
        Self {
            bounds: ENDLESS.map(column),
            numbers: Vec::with_capacity(count),
        }
    }

    fn len(&self) -> usize {
        self.numbers.len()
    }

    /// Returns the box of a cluster.
    #[inline(always)]
    fn bounds(&self, i: usize) -> Aabb {
        let [a, b, c, d, e, f] = self.bounds.each_ref().map(|column| column[AROUND + i]);
        Aabb {
            min: [a, b, c],
            max: [d, e, f],
        }
    }

    /// Removes all clusters.
    fn clear(&mut self) {
        for column in &mut self.bounds {
            column.truncate(AROUND);
        }
        self.numbers.clear();
    }

    /// Appends the clusters of a part.
    fn append(&mut self, part: &Part) {
        for (k, column) in self.bounds.iter_mut().enumerate() {
            let end = |bounds: &Aabb| {
                if k < 3 {
                    bounds.min[k]
                } else {
                    bounds.max[k - 3]
                }
            };
            column.extend(part.bounds.iter().map(end));
        }
        self.numbers.extend(&part.numbers);
    }

    /// Appends boxes without end.
    fn close(&mut self) {
        for (column, end) in self.bounds.iter_mut().zip(ENDLESS) {
            column.resize(column.len() + AROUND, end);
        }
    }

    /// Writes the best neighbours of the clusters from `from` on to `best`: those with the smallest common box, of equal
    /// ones that whose position has the lowest exclusive disjunction with the cluster's own. The two clusters of the
    /// pair that is first in this order find each other.
    #[inline(always)]
    fn neighbours<S: Simd>(&self, simd: S, radius: usize, from: usize, best: &mut [u32]) {
        let splat = |x: f32| f32x8::splat(simd, x);
        let lanes = u32x8::from_slice(simd, &[0, 1, 2, 3, 4, 5, 6, 7]);
        for (i, best) in (from..).zip(best) {
            let own = self
                .bounds
                .each_ref()
                .map(|column| splat(column[AROUND + i]));
            let position = u32x8::splat(simd, index(i));
            let mut least = splat(f32::INFINITY);
            let mut nearest = u32x8::splat(simd, u32::MAX);
            for first in [AROUND + i - radius, AROUND + i + 1] {
                for step in (0..radius).step_by(LANES) {
                    let start = first + step;
                    let [a, b, c, d, e, f] = std::array::from_fn(|k| {
                        let other = f32x8::from_slice(simd, &self.bounds[k][start..start + LANES]);
                        if k < 3 {
                            own[k].min(other)
                        } else {
                            own[k].max(other)
                        }
                    });
                    let (x, y, z) = (d - a, e - b, f - c);
                    let area = x * y + (x + y) * z;
                    // Positions before the first wrap around; their boxes have no end.
                    let other =
                        lanes + u32x8::splat(simd, index(start).wrapping_sub(index(AROUND)));
                    let apart = other ^ position;
                    let within = lanes.simd_lt(u32x8::splat(simd, index(radius - step)));
                    let better =
                        area.simd_lt(least) | (area.simd_eq(least) & apart.simd_lt(nearest));
                    let better = better & within;
                    least = better.select(area, least);
                    nearest = better.select(apart, nearest);
                }
            }
            // Take the best of the lanes.
            let smallest = least.simd_eq(splat(least.reduce_min()));
            let apart = smallest.select(nearest, u32x8::splat(simd, u32::MAX));
            *best = apart.reduce_min() ^ index(i);
        }
    }
}

/// The clusters of one task after a round, and the unions that it made.
#[derive(Default)]
struct Part {
    bounds: Vec<Aabb>,
    numbers: Vec<u32>,
    unions: Vec<Union>,
}

/// The clusters of a build.
struct Builder<'a> {
    clustering: &'a Clustering,
    monitor: &'a Monitor,
    /// The objects, in the order of the curve.
    objects: &'a [Object],
    unions: Vec<Union>,
    /// Number of objects from which nodes are written on two threads.
    parallel: usize,
}

/// Builds a tree over the live triangles of `scene`, in the frame `frame`, in the current rayon pool.
///
/// # Errors
/// [`halfspace_base::error::Error::Cancelled`] and [`halfspace_base::error::Error::Memory`] as the monitor returns
/// them.
pub fn build(
    scene: &Triangles,
    frame: &Frame,
    clustering: &Clustering,
    monitor: &Monitor,
) -> Result<ObjectTree> {
    let objects = object::gather(scene, frame);
    let n = objects.len();
    // Count what is needed until the tree is written: objects in both orders, clusters before and after a round.
    let per_object = size_of::<Object>() + 2 * size_of::<(Aabb, u32)>() + size_of::<Union>() + 24;
    let _held = monitor.hold(n * per_object)?;
    if n < 2 {
        monitor.advance(1.0);
        return Ok(ObjectTree {
            items: vec![object::leaf(&objects)],
            ids: objects.iter().map(|object| object.id).collect(),
        });
    }
    let objects = morton::sort(&objects).1;
    let mut builder = Builder {
        clustering,
        monitor,
        objects: &objects,
        unions: Vec::with_capacity(n - 1),
        parallel: object::parallel_from(n),
    };
    let root = builder.unite()?;
    // Write the nodes in preorder, and the triangles of the leaves.
    let (mut items, mut ids) = (Vec::with_capacity(n / 2), vec![0; n]);
    builder.write(root, 0, &mut ids, &mut items)?;
    monitor.take(footprint::boxes::<Item>(items.len()))?;
    Ok(ObjectTree { items, ids })
}

/// Returns a position or a number as 32 bits.
fn index(i: usize) -> u32 {
    u32::try_from(i).expect("fewer than 2^31 clusters")
}

impl Builder<'_> {
    /// Unites clusters until one is left; returns its number.
    fn unite(&mut self) -> Result<u32> {
        let n = self.objects.len();
        let (mut clusters, mut next) = (Clusters::new(n), Clusters::new(n));
        for part in self.objects.chunks(PART) {
            let first = index(clusters.len());
            clusters.append(&Part {
                bounds: part.iter().map(|object| object.bounds).collect(),
                numbers: (first..first + index(part.len())).collect(),
                unions: Vec::new(),
            });
        }
        clusters.close();
        let mut best = vec![0; n];
        while clusters.len() > 1 {
            self.monitor.check()?;
            let best = &mut best[..clusters.len()];
            let pairs = self.find(&clusters, best);
            // Number the unions of each part after those of the parts before it.
            let mut first = n + self.unions.len();
            let firsts: Vec<_> = pairs
                .iter()
                .map(|pairs| {
                    let own = first;
                    first += pairs;
                    index(own)
                })
                .collect();
            let parts: Vec<_> = (firsts.par_iter().enumerate())
                .map(|(part, &first)| self.part(&clusters, best, part * PART, first))
                .collect();
            next.clear();
            for part in &parts {
                next.append(part);
                self.unions.extend(&part.unions);
            }
            next.close();
            let united = clusters.len() - next.len();
            self.monitor.advance(united as f64 / (n - 1) as f64);
            std::mem::swap(&mut clusters, &mut next);
        }
        Ok(clusters.numbers[0])
    }

    /// Writes the neighbour that each cluster chooses to `best`; returns the number of pairs that begin in each part.
    fn find(&self, clusters: &Clusters, best: &mut [u32]) -> Vec<usize> {
        let radius = self.clustering.radius;
        let level = simd::level();
        best.par_chunks_mut(PART)
            .enumerate()
            .for_each(|(part, best)| {
                dispatch!(level, simd => clusters.neighbours(simd, radius, part * PART, best));
            });
        let pairs = |best: &[u32]| -> Vec<usize> {
            (0..best.len().div_ceil(PART))
                .into_par_iter()
                .map(|part| {
                    let own = part * PART..best.len().min(part * PART + PART);
                    own.filter(|&i| is_first(best, i)).count()
                })
                .collect()
        };
        let found = pairs(best);
        if found.iter().sum::<usize>() * FEWEST >= best.len() {
            return found;
        }
        // Pair the clusters that are left by position.
        let last = best.len() - 1;
        for i in (0..last).step_by(2) {
            if !has_pair(best, i) && !has_pair(best, i + 1) {
                (best[i], best[i + 1]) = (index(i + 1), index(i));
            }
        }
        pairs(best)
    }

    /// Unites the pairs that begin among the [`PART`] clusters from `from` on; their first number is `number`.
    fn part(&self, clusters: &Clusters, best: &[u32], from: usize, mut number: u32) -> Part {
        let mut part = Part::default();
        let own = from..best.len().min(from + PART);
        part.bounds.reserve(own.len());
        part.numbers.reserve(own.len());
        for i in own {
            if is_first(best, i) {
                let (bounds, union) = self.union(clusters, [i, best[i] as usize]);
                part.bounds.push(bounds);
                part.numbers.push(number);
                part.unions.push(union);
                number += 1;
            } else if !has_pair(best, i) {
                part.bounds.push(clusters.bounds(i));
                part.numbers.push(clusters.numbers[i]);
            }
        }
        part
    }

    /// Unites two clusters: returns their box and the union.
    #[expect(clippy::cast_possible_truncation, reason = "a cost")]
    fn union(&self, clusters: &Clusters, pair: [usize; 2]) -> (Aabb, Union) {
        let boxes = pair.map(|i| clusters.bounds(i));
        let mut parts = pair.map(|i| clusters.numbers[i]);
        let bounds = boxes[0].union(&boxes[1]);
        // Find the axis along which the centres differ most.
        let apart = |k: usize| {
            let [a, b] = boxes.each_ref().map(|own| own.min[k] + own.max[k]);
            b - a
        };
        let axis = (1..3).fold(0, |best, k| {
            if apart(k).abs() > apart(best).abs() {
                k
            } else {
                best
            }
        });
        if apart(axis) < 0.0 {
            parts.reverse();
        }
        // Compare the cost of both parts with that of a leaf.
        let SurfaceArea { costs, leaf_max } = &self.clustering.heuristic;
        let [below, above] = [0, 1].map(|k| self.measure(clusters.numbers[pair[k]], &boxes[k]));
        let count = below.0 + above.0;
        let divided = f64::from(costs.step) * bounds.area() + below.1 + above.1;
        let whole = self.clustering.heuristic.leaf(count as usize) * bounds.area();
        let leaf = count as usize <= *leaf_max && whole <= divided;
        let union = Union {
            parts,
            count,
            cost: if leaf { whole } else { divided } as f32,
            height: if leaf {
                0
            } else {
                below.2.max(above.2).saturating_add(1)
            },
            axis: axis as u8,
            leaf,
        };
        (bounds, union)
    }

    /// Returns the number of objects, the cost and the height of a cluster.
    #[inline(always)]
    fn measure(&self, number: u32, bounds: &Aabb) -> (u32, f64, u8) {
        match self.union_of(number) {
            None => (1, self.clustering.heuristic.leaf(1) * bounds.area(), 0),
            Some(union) => (union.count, f64::from(union.cost), union.height),
        }
    }

    /// Returns the union with this number; `None` for an object.
    fn union_of(&self, number: u32) -> Option<&Union> {
        (number as usize)
            .checked_sub(self.objects.len())
            .map(|union| &self.unions[union])
    }

    /// Appends the nodes of a cluster in preorder, and writes the numbers of its triangles.
    fn write(
        &self,
        number: u32,
        depth: usize,
        ids: &mut [u32],
        items: &mut Vec<Item>,
    ) -> Result<()> {
        let union = match self.union_of(number) {
            Some(union) if !union.leaf => union,
            _ => {
                items.push(object::leaf(&self.objects_of(number, ids)));
                return Ok(());
            }
        };
        // Halve nodes near the depth limit, as deep as medians need to reach single objects.
        let room = MAX_DEPTH - depth;
        if usize::from(union.height) > room
            && room <= ids.len().next_power_of_two().ilog2() as usize
        {
            let mut objects = self.objects_of(number, ids);
            let policy = &self.clustering.heuristic;
            object::build_subtree(&mut objects, (), depth, policy, self.monitor, items)?;
            for (id, object) in ids.iter_mut().zip(&objects) {
                *id = object.id;
            }
            return Ok(());
        }
        let index = items.len();
        items.push(Item::inner(usize::from(union.axis)));
        let both = ids.len() >= self.parallel;
        let [below, above] = union.parts;
        let count = self.union_of(below).map_or(1, |union| union.count as usize);
        let (first, second) = ids.split_at_mut(count);
        let distance = object::grow_both(
            items,
            both,
            |items| self.write(below, depth + 1, first, items),
            |items| self.write(above, depth + 1, second, items),
        )?;
        Item::link(&mut items[index..], distance - index);
        Ok(())
    }

    /// Returns the objects of a cluster, and writes their numbers.
    fn objects_of(&self, number: u32, ids: &mut [u32]) -> Vec<Object> {
        let mut objects = Vec::with_capacity(ids.len());
        let mut open = vec![number];
        while let Some(number) = open.pop() {
            match self.union_of(number) {
                Some(union) => open.extend([union.parts[1], union.parts[0]]),
                None => objects.push(self.objects[number as usize]),
            }
        }
        for (id, object) in ids.iter_mut().zip(&objects) {
            *id = object.id;
        }
        objects
    }
}

/// Whether two clusters chose each other.
fn has_pair(best: &[u32], i: usize) -> bool {
    let other = best.get(best[i] as usize);
    other.is_some_and(|&back| back as usize == i)
}

/// Whether a cluster is the first of a pair.
fn is_first(best: &[u32], i: usize) -> bool {
    best[i] as usize > i && has_pair(best, i)
}

#[cfg(test)]
mod tests {
    use super::*;
    use halfspace_nodes::cost::Costs;
    use halfspace_nodes::object_tree::ItemKind;

    const CLUSTERING: Clustering = Clustering {
        radius: 16,
        heuristic: SurfaceArea {
            costs: Costs::BOXES,
            leaf_max: 1,
        },
    };

    /// Builds a tree of leaves of one triangle, from triangles around the origin with these sizes; returns its depth.
    fn depth(sizes: &[f32]) -> u8 {
        let corners = |&x: &f32| [[-x, -x, -x], [x, x, -x], [-x, x, x]];
        let vertices = sizes.iter().flat_map(corners).collect();
        let count = index(sizes.len());
        let indices = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let scene = Triangles::new(vertices, indices).unwrap();
        let frame = Frame::new(scene.bounds());
        let tree = build(&scene, &frame, &CLUSTERING, &Monitor::new()).unwrap();
        // Each triangle is in one leaf, within the box of every node above it.
        let mut ids = tree.ids.clone();
        ids.sort_unstable();
        assert_eq!(ids, scene.live());
        let firsts = tree.firsts();
        for (i, item) in tree.items.iter().enumerate() {
            match tree.kind(i) {
                ItemKind::Leaf { count } => {
                    assert_eq!(count, sizes.len().min(1));
                    if count == 0 {
                        continue;
                    }
                    let corners = scene.corners(tree.ids[firsts[i] as usize]);
                    assert_eq!(
                        item.bounds,
                        Aabb::of_triangle(corners.map(|p| frame.point(p)))
                    );
                }
                ItemKind::Inner { children, .. } => {
                    let [a, b] = children.map(|child| tree.items[child].bounds);
                    assert_eq!(item.bounds, a.union(&b));
                }
            }
        }
        tree.heights()[0]
    }

    #[test]
    fn equal_triangles_make_a_balanced_tree() {
        assert_eq!(depth(&[1.0; 4096]), 12);
        assert_eq!(depth(&[1.0; 10_000]), 14);
    }

    /// Each of these triangles has its smallest common box with the next smaller one, so that a round would unite two.
    #[test]
    fn boxes_within_boxes_end_within_the_depth_limit() {
        let sizes: Vec<_> = (0..50_000_u16).map(|i| 1.0005_f32.powi(i.into())).collect();
        let deepest = usize::from(depth(&sizes));
        assert!((16..=MAX_DEPTH).contains(&deepest), "{deepest}");
        assert_eq!(depth(&[1.0, 2.0, 4.0]), 2);
    }

    #[test]
    fn none_and_one_are_leaves() {
        assert_eq!(depth(&[]), 0);
        assert_eq!(depth(&[1.0]), 0);
    }
}
