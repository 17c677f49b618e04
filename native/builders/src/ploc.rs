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
use crate::reach::Reach;
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

/// Number of clusters that are compared at once.
const LANES: usize = 8;

/// Clusters whose pairs are measured together (chosen): with the usual radius, their areas fit into the first cache.
const STRIPE: usize = 256;

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
#[derive(Debug, Clone, Copy, Default)]
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
        Self {
            bounds: ENDLESS.map(|end| vec![end; count + 2 * AROUND]),
            numbers: vec![0; count],
        }
    }

    fn len(&self) -> usize {
        self.numbers.len()
    }

    /// Returns the box of a cluster.
    #[inline(always)]
    fn bounds(&self, i: usize) -> Aabb {
        let end = |k: usize| self.bounds[k][AROUND + i];
        Aabb {
            min: [end(0), end(1), end(2)],
            max: [end(3), end(4), end(5)],
        }
    }

    /// Keeps the first `count` places, and ends them with boxes without end.
    fn shorten(&mut self, count: usize) {
        self.numbers.truncate(count);
        for (column, end) in self.bounds.iter_mut().zip(ENDLESS) {
            column.truncate(count + 2 * AROUND);
            column[AROUND + count..].fill(end);
        }
    }

    /// Divides the places, and those of `unions`, the first of which has number `next`, among the parts of a round.
    fn divide<'a>(
        &'a mut self,
        mut unions: &'a mut [Union],
        mut next: usize,
        sizes: &[Size],
    ) -> Vec<Part<'a>> {
        let end = AROUND + self.len();
        let mut bounds = (self.bounds.each_mut()).map(|column| &mut column[AROUND..end]);
        let mut numbers = self.numbers.as_mut_slice();
        let part = |size: &Size| {
            next += size.unions;
            Part {
                bounds: (bounds.each_mut()).map(|column| first(column, size.clusters)),
                numbers: first(&mut numbers, size.clusters),
                unions: first(&mut unions, size.unions),
                next: index(next - size.unions),
            }
        };
        sizes.iter().map(part).collect()
    }

    /// Writes the best neighbours of the clusters from `from` on to `best`: those with the smallest common box, of equal
    /// ones that whose position has the lowest exclusive disjunction with the cluster's own. The two clusters of the
    /// pair that is first in this order find each other.
    #[inline(always)]
    fn neighbours<S: Simd>(&self, simd: S, radius: usize, from: usize, best: &mut [u32]) {
        let before = radius.next_multiple_of(LANES);
        let mut areas = vec![0.0; radius * (before + STRIPE)];
        for (stripe, best) in best.chunks_mut(STRIPE).enumerate() {
            let first = from + stripe * STRIPE;
            let width = before + best.len().next_multiple_of(LANES);
            for start in (0..width).step_by(LANES) {
                // Clusters before the first are boxes without end.
                let at = AROUND + first + start - before;
                self.measure(simd, radius, at, &mut areas[start..], width);
            }
            for (start, best) in (before..).step_by(LANES).zip(best.chunks_mut(LANES)) {
                let found = choose(simd, radius, &areas[..radius * width], start, first);
                best.copy_from_slice(&found[..best.len()]);
            }
        }
    }

    /// Writes the area of the common box of each of the [`LANES`] clusters from row `at` of the columns on and the
    /// cluster `apart` places after it to `areas[(apart - 1) * width + lane]`, for all `apart` up to `radius`.
    #[inline(always)]
    fn measure<S: Simd>(&self, simd: S, radius: usize, at: usize, areas: &mut [f32], width: usize) {
        // Functions of arrays that take a closure would be compiled without the instructions of `simd`.
        let mut own = [f32x8::splat(simd, 0.0); 6];
        for (own, column) in own.iter_mut().zip(&self.bounds) {
            *own = f32x8::from_slice(simd, &column[at..at + LANES]);
        }
        for (apart, areas) in (1..=radius).zip(areas.chunks_mut(width)) {
            let mut sides = [own[0]; 3];
            for (k, side) in sides.iter_mut().enumerate() {
                let [low, high] = [&self.bounds[k], &self.bounds[3 + k]];
                let from = at + apart;
                let low = own[k].min(f32x8::from_slice(simd, &low[from..from + LANES]));
                let high = own[3 + k].max(f32x8::from_slice(simd, &high[from..from + LANES]));
                *side = high - low;
            }
            let [x, y, z] = sides;
            let area = x * y + (x + y) * z;
            areas[..LANES].copy_from_slice(area.as_slice());
        }
    }
}

/// Returns the best neighbours of the [`LANES`] clusters in the columns from `start` on of a table of areas, as
/// [`Clusters::measure`] writes it. The first of the stripe, in column `radius` rounded up to lanes, is `first`.
#[inline(always)]
fn choose<S: Simd>(
    simd: S,
    radius: usize,
    areas: &[f32],
    start: usize,
    first: usize,
) -> [u32; LANES] {
    let width = areas.len() / radius;
    let before = radius.next_multiple_of(LANES);
    // Find the smallest areas. A pair stands in the column of its first cluster.
    let mut least = [f32x8::splat(simd, f32::INFINITY); 2];
    for apart in 1..=radius {
        let row = &areas[(apart - 1) * width..apart * width];
        let after = f32x8::from_slice(simd, &row[start..start + LANES]);
        let before = f32x8::from_slice(simd, &row[start - apart..start - apart + LANES]);
        least = [least[0].min(after), least[1].min(before)];
    }
    let least = least[0].min(least[1]);
    // Find the nearest by position of the neighbours with these areas.
    let lanes = u32x8::from_slice(simd, &[0, 1, 2, 3, 4, 5, 6, 7]);
    let position = lanes + u32x8::splat(simd, index(first + start - before));
    let farthest = u32x8::splat(simd, u32::MAX);
    let mut nearest = [farthest; 2];
    for apart in 1..=radius {
        let row = &areas[(apart - 1) * width..apart * width];
        let after = f32x8::from_slice(simd, &row[start..start + LANES]);
        let before = f32x8::from_slice(simd, &row[start - apart..start - apart + LANES]);
        let apart = u32x8::splat(simd, index(apart));
        let after = (after.simd_eq(least)).select((position + apart) ^ position, farthest);
        // Positions before the first wrap around; their boxes have no end.
        let before = (before.simd_eq(least)).select((position - apart) ^ position, farthest);
        nearest = [nearest[0].min(after), nearest[1].min(before)];
    }
    *(nearest[0].min(nearest[1]) ^ position)
}

/// Takes the first `count` values off a slice.
fn first<'a, T>(values: &mut &'a mut [T], count: usize) -> &'a mut [T] {
    values.split_off_mut(..count).expect("room for all parts")
}

/// Number of clusters that a part of a round leaves, and of the unions that it makes.
#[derive(Debug, Clone, Copy)]
struct Size {
    clusters: usize,
    unions: usize,
}

/// The places of the clusters that a part of a round leaves, and of the unions that it makes.
struct Part<'a> {
    bounds: [&'a mut [f32]; 6],
    numbers: &'a mut [u32],
    unions: &'a mut [Union],
    /// Number of the first union.
    next: u32,
}

impl Part<'_> {
    /// Writes a cluster to a place.
    #[inline(always)]
    fn put(&mut self, place: usize, bounds: &Aabb, number: u32) {
        for k in 0..3 {
            self.bounds[k][place] = bounds.min[k];
            self.bounds[3 + k][place] = bounds.max[k];
        }
        self.numbers[place] = number;
    }
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
        unions: Vec::new(),
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
        self.begin(&mut clusters);
        let mut best = vec![0; n];
        let (mut unions, mut made) = (vec![Union::default(); n - 1], 0);
        while clusters.len() > 1 {
            self.monitor.check()?;
            let best = &mut best[..clusters.len()];
            let sizes = self.find(&clusters, best);
            next.shorten(sizes.iter().map(|size| size.clusters).sum());
            let (done, left) = unions.split_at_mut(made);
            let parts = next.divide(left, n + made, &sizes);
            parts.into_par_iter().enumerate().for_each(|(k, part)| {
                self.part(&clusters, best, k * PART, done, part);
            });
            let united = clusters.len() - next.len();
            made += united;
            self.monitor.advance(united as f64 / (n - 1) as f64);
            std::mem::swap(&mut clusters, &mut next);
        }
        self.unions = unions;
        Ok(clusters.numbers[0])
    }

    /// Writes one cluster for each object.
    fn begin(&self, clusters: &mut Clusters) {
        let chunks = self.objects.chunks(PART);
        let sizes: Vec<_> = chunks
            .map(|objects| Size {
                clusters: objects.len(),
                unions: 0,
            })
            .collect();
        let parts = clusters.divide(&mut [], 0, &sizes).into_par_iter();
        let filled = parts.zip(self.objects.par_chunks(PART)).enumerate();
        filled.for_each(|(k, (mut part, objects))| {
            for (place, object) in objects.iter().enumerate() {
                part.put(place, &object.bounds, index(k * PART + place));
            }
        });
    }

    /// Writes the neighbour that each cluster chooses to `best`; returns the size of each part.
    fn find(&self, clusters: &Clusters, best: &mut [u32]) -> Vec<Size> {
        let radius = self.clustering.radius;
        let level = simd::level();
        best.par_chunks_mut(PART)
            .enumerate()
            .for_each(|(part, best)| {
                dispatch!(level, simd => clusters.neighbours(simd, radius, part * PART, best));
            });
        let sizes = |best: &[u32]| -> Vec<Size> {
            (0..best.len().div_ceil(PART))
                .into_par_iter()
                .map(|part| {
                    let own = part * PART..best.len().min(part * PART + PART);
                    let unions = own.clone().filter(|&i| is_first(best, i)).count();
                    let paired = own.clone().filter(|&i| has_pair(best, i)).count();
                    Size {
                        clusters: own.len() + unions - paired,
                        unions,
                    }
                })
                .collect()
        };
        let found = sizes(best);
        if found.iter().map(|size| size.unions).sum::<usize>() * FEWEST >= best.len() {
            return found;
        }
        // Pair the clusters that are left by position.
        let last = best.len() - 1;
        for i in (0..last).step_by(2) {
            if !has_pair(best, i) && !has_pair(best, i + 1) {
                (best[i], best[i + 1]) = (index(i + 1), index(i));
            }
        }
        sizes(best)
    }

    /// Unites the pairs that begin among the [`PART`] clusters from `from` on; `done` are the unions before.
    fn part(
        &self,
        clusters: &Clusters,
        best: &[u32],
        from: usize,
        done: &[Union],
        mut part: Part<'_>,
    ) {
        let (mut place, mut made) = (0, 0);
        for i in from..best.len().min(from + PART) {
            if is_first(best, i) {
                let (bounds, union) = self.union(clusters, [i, best[i] as usize], done);
                part.unions[made] = union;
                part.put(place, &bounds, part.next + index(made));
                made += 1;
            } else if has_pair(best, i) {
                continue;
            } else {
                part.put(place, &clusters.bounds(i), clusters.numbers[i]);
            }
            place += 1;
        }
    }

    /// Unites two clusters: returns their box and the union.
    #[expect(clippy::cast_possible_truncation, reason = "a cost")]
    fn union(&self, clusters: &Clusters, pair: [usize; 2], done: &[Union]) -> (Aabb, Union) {
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
        let [below, above] =
            [0, 1].map(|k| self.measure(done, clusters.numbers[pair[k]], &boxes[k]));
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
    fn measure(&self, done: &[Union], number: u32, bounds: &Aabb) -> (u32, f64, u8) {
        match self.union_of(done, number) {
            None => (1, self.clustering.heuristic.leaf(1) * bounds.area(), 0),
            Some(union) => (union.count, f64::from(union.cost), union.height),
        }
    }

    /// Returns the union with this number among all; `None` for an object.
    fn union_of<'u>(&self, unions: &'u [Union], number: u32) -> Option<&'u Union> {
        (number as usize)
            .checked_sub(self.objects.len())
            .map(|union| &unions[union])
    }

    /// Appends the nodes of a cluster in preorder, and writes the numbers of its triangles.
    fn write(
        &self,
        number: u32,
        depth: usize,
        ids: &mut [u32],
        items: &mut Vec<Item>,
    ) -> Result<()> {
        let union = match self.union_of(&self.unions, number) {
            Some(union) if !union.leaf => union,
            _ => {
                let (mut reach, mut places) = (Reach::EMPTY, ids.iter_mut());
                self.visit(number, |object| {
                    reach = reach.union(&Reach::new(&object.bounds));
                    *places.next().expect("a place for each object") = object.id;
                });
                items.push(Item::leaf(reach.bounds(), ids.len()));
                return Ok(());
            }
        };
        // Halve nodes near the depth limit, as deep as medians need to reach single objects.
        let room = MAX_DEPTH - depth;
        if usize::from(union.height) > room
            && room <= ids.len().next_power_of_two().ilog2() as usize
        {
            let mut objects = Vec::with_capacity(ids.len());
            self.visit(number, |object| objects.push(*object));
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
        let count = (self.union_of(&self.unions, below)).map_or(1, |union| union.count as usize);
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

    /// Visits the objects of a cluster.
    fn visit(&self, number: u32, mut visit: impl FnMut(&Object)) {
        let Some(union) = self.union_of(&self.unions, number) else {
            visit(&self.objects[number as usize]);
            return;
        };
        let mut open = vec![union.parts[1], union.parts[0]];
        while let Some(number) = open.pop() {
            match self.union_of(&self.unions, number) {
                Some(union) => open.extend([union.parts[1], union.parts[0]]),
                None => visit(&self.objects[number as usize]),
            }
        }
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

    /// Boxes from numbers that look random; of four equal ones, the nearest by position counts.
    #[test]
    fn neighbours_are_those_of_a_plain_search() {
        let spread = |i: usize| (index(i).wrapping_mul(2_654_435_761) >> 20) as f32 / 64.0;
        let count = 2 * STRIPE + 77;
        let mut clusters = Clusters::new(count);
        for i in 0..count {
            for k in 0..3 {
                let low = spread(3 * (i / 4) + k);
                clusters.bounds[k][AROUND + i] = low;
                clusters.bounds[3 + k][AROUND + i] = low + 1.0;
            }
        }
        for radius in [1, 5, 8, 16, FARTHEST] {
            let mut best = vec![0; count];
            let level = simd::level();
            dispatch!(level, simd => clusters.neighbours(simd, radius, 0, &mut best));
            for (i, &best) in best.iter().enumerate() {
                let near = i.saturating_sub(radius)..count.min(i + radius + 1);
                let area = |j: usize| {
                    let both = clusters.bounds(i).union(&clusters.bounds(j));
                    let [x, y, z] = [0, 1, 2].map(|k| both.max[k] - both.min[k]);
                    x * y + (x + y) * z
                };
                let key = |&j: &usize| (area(j).to_bits(), i ^ j);
                let expected = near.filter(|&j| j != i).min_by_key(key);
                assert_eq!(expected, Some(best as usize), "{radius}: {i}");
            }
        }
    }

    #[test]
    fn the_threads_do_not_change_the_tree() {
        let spread = |i: u32| (i.wrapping_mul(2_654_435_761) >> 8) as f32 / 16_777_216.0;
        let at = |i: u32| [spread(3 * i), spread(3 * i + 1), spread(3 * i + 2)];
        let vertices = (0..90_000).map(at).collect();
        let indices = (0..30_000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let scene = Triangles::new(vertices, indices).unwrap();
        let frame = Frame::new(scene.bounds());
        let [one, two] = [1, 2].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            let pool = pool.build().unwrap();
            pool.install(|| build(&scene, &frame, &CLUSTERING, &Monitor::new()).unwrap())
        });
        assert_eq!((one.items, one.ids), (two.items, two.ids));
    }

    #[test]
    fn none_and_one_are_leaves() {
        assert_eq!(depth(&[]), 0);
        assert_eq!(depth(&[1.0]), 0);
    }
}
