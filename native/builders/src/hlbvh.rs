// SPDX-License-Identifier: GPL-3.0-or-later
//! Box hierarchies by the order of a curve (Pantaleoni and Luebke 2010, HLBVH).
//!
//! Objects are sorted along the Z-order curve. Those of one cell of a coarse grid, 16 to an axis, make a treelet, which
//! the bits of the curve divide (Lauterbach et al. 2009); the nodes above the treelets are chosen by the surface area
//! heuristic. A node whose triangles cost less as a leaf is one. The tree depends only on the triangles, not on the
//! number of threads.

use crate::binned::SurfaceArea;
use crate::morton;
use crate::object::{self, Node, Object, ObjectPolicy, Partition};
use halfspace_base::error::Result;
use halfspace_base::{Monitor, footprint};
use halfspace_geom::Aabb;
use halfspace_nodes::object_tree::{Item, ItemKind, ObjectTree};
use halfspace_nodes::plane_tree::MAX_DEPTH;
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;
use rayon::prelude::*;
use std::ops::Range;

/// Bits of a code that name the treelet of an object (Pantaleoni and Luebke: up to 15).
const TREELET_BITS: u32 = 12;

/// The nodes over treelets: always divided, where the surface area heuristic is lowest.
struct Upper<'a>(&'a SurfaceArea);

impl ObjectPolicy for Upper<'_> {
    type Region = ();

    fn root(&self, _: Aabb) {}

    fn partition(&self, node: &Node<'_, ()>) -> Partition<()> {
        let (_, centres) = node.measure();
        match self.0.best(node.objects, &centres) {
            Some(best) => Partition::Centre {
                axis: best.axis,
                at: best.at,
                regions: [(); 2],
            },
            None => Partition::Median {
                axis: 0,
                regions: [(); 2],
            },
        }
    }
}

/// A subtree that was written.
#[derive(Clone, Copy)]
struct Subtree {
    /// Number of its objects.
    count: usize,
    /// Its cost, multiplied by its area.
    cost: f64,
}

/// The objects of a build, in the order of the curve.
struct Builder<'a> {
    heuristic: &'a SurfaceArea,
    monitor: &'a Monitor,
    codes: &'a [u64],
    objects: &'a [Object],
    /// Number of objects from which a node of a treelet is built on two threads.
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
    heuristic: &SurfaceArea,
    monitor: &Monitor,
) -> Result<ObjectTree> {
    let objects = object::gather(scene, frame);
    // Count objects in both orders, and codes while they are sorted.
    let per_object = 2 * size_of::<Object>() + 3 * size_of::<(u64, u32)>();
    let _held = monitor.hold(objects.len() * per_object)?;
    if objects.len() < 2 {
        monitor.advance(1.0);
        return Ok(ObjectTree {
            items: vec![object::leaf(&objects)],
            ids: objects.iter().map(|object| object.id).collect(),
        });
    }
    let (codes, objects) = morton::sort(&objects);
    monitor.check()?;
    monitor.advance(0.5);
    Builder {
        heuristic,
        monitor,
        codes: &codes,
        objects: &objects,
        parallel: object::parallel_from(objects.len()),
    }
    .tree()
}

impl Builder<'_> {
    /// Builds the treelets and the nodes above them.
    fn tree(&self) -> Result<ObjectTree> {
        // Find the objects of each treelet, and its box.
        let treelet = |code: &u64| code >> (morton::BITS - TREELET_BITS);
        let mut ranges = Vec::new();
        let mut first = 0;
        for same in self.codes.chunk_by(|a, b| treelet(a) == treelet(b)) {
            ranges.push(first..first + same.len());
            first += same.len();
        }
        let boxed = |(id, range): (usize, &Range<usize>)| Object {
            bounds: object::around(&self.objects[range.clone()]),
            id: u32::try_from(id).expect("few treelets"),
        };
        let mut treelets: Vec<_> = ranges.par_iter().enumerate().map(boxed).collect();

        // Build the nodes above, with as many levels left as halving the largest treelet takes.
        let largest = ranges.iter().map(Range::len).max().unwrap_or(1);
        let mut upper = ObjectTree::default();
        let (policy, reserved, nodes) = (Upper(self.heuristic), levels(largest), &mut upper.items);
        object::build_subtree(&mut treelets, (), reserved, &policy, self.monitor, nodes)?;
        let depths = leaf_depths(&upper);

        // Write each treelet, then all in the order of the leaves above.
        let written: Vec<_> = (treelets.par_iter().zip(&depths))
            .map(|(treelet, &depth)| {
                let mut items = Vec::new();
                let objects = ranges[treelet.id as usize].clone();
                let subtree = self.write(objects, depth, &mut items)?;
                Ok((items, subtree))
            })
            .collect::<Result<_>>()?;
        let mut items = Vec::with_capacity(written.iter().map(|(items, _)| items.len()).sum());
        self.join(&upper, 0, &mut written.iter(), &mut items);
        let ranges = treelets.iter().map(|treelet| &ranges[treelet.id as usize]);
        let objects = ranges.flat_map(|range| &self.objects[range.clone()]);
        let ids = objects.map(|object| object.id).collect();
        self.monitor.take(footprint::boxes::<Item>(items.len()))?;
        self.monitor.advance(0.5);
        Ok(ObjectTree { items, ids })
    }

    /// Appends the nodes of objects that are neighbours on the curve, in preorder.
    fn write(&self, objects: Range<usize>, depth: usize, items: &mut Vec<Item>) -> Result<Subtree> {
        let count = objects.len();
        if count == 1 {
            let bounds = self.objects[objects.start].bounds;
            items.push(Item::leaf(bounds, 1));
            let cost = self.heuristic.leaf(1) * bounds.area();
            return Ok(Subtree { count, cost });
        }
        if count >= object::TASK {
            self.monitor.check()?;
        }
        // Divide at the highest bit that differs, or by halves: near the depth limit, and where no bit differs.
        let codes = &self.codes[objects.clone()];
        let differing = codes[0] ^ codes[count - 1];
        let (axis, below) = if differing == 0 || MAX_DEPTH - depth <= levels(count) {
            (0, count / 2)
        } else {
            let bit = differing.ilog2();
            let below = codes.partition_point(|code| code >> bit & 1 == 0);
            (2 - bit as usize % 3, below)
        };
        let middle = objects.start + below;
        let index = items.len();
        items.push(Item::inner(axis));
        let mut parts = [Subtree {
            count: 0,
            cost: 0.0,
        }; 2];
        let [first, second] = &mut parts;
        let above = object::grow_both(
            items,
            count >= self.parallel,
            |items| {
                *first = self.write(objects.start..middle, depth + 1, items)?;
                Ok(())
            },
            |items| {
                *second = self.write(middle..objects.end, depth + 1, items)?;
                Ok(())
            },
        )?;
        Ok(self.close(index, above, parts, items))
    }

    /// Appends a node above the treelets, and all below it; `treelets` are those of the leaves still to come.
    fn join<'a>(
        &self,
        upper: &ObjectTree,
        node: usize,
        treelets: &mut impl Iterator<Item = &'a (Vec<Item>, Subtree)>,
        items: &mut Vec<Item>,
    ) -> Subtree {
        let ItemKind::Inner { axis, children } = upper.kind(node) else {
            let (nodes, subtree) = treelets.next().expect("a treelet for each leaf");
            items.extend_from_slice(nodes);
            return *subtree;
        };
        let index = items.len();
        items.push(Item::inner(axis));
        let first = self.join(upper, children[0], treelets, items);
        let above = items.len();
        let second = self.join(upper, children[1], treelets, items);
        self.close(index, above, [first, second], items)
    }

    /// Completes the inner node at `index`, whose second child begins at `above`, or makes it a leaf.
    fn close(
        &self,
        index: usize,
        above: usize,
        [first, second]: [Subtree; 2],
        items: &mut Vec<Item>,
    ) -> Subtree {
        Item::link(&mut items[index..], above - index);
        let bounds = items[index].bounds;
        let count = first.count + second.count;
        let SurfaceArea { costs, leaf_max } = self.heuristic;
        let divided = f64::from(costs.step) * bounds.area() + first.cost + second.cost;
        let whole = self.heuristic.leaf(count) * bounds.area();
        if count > *leaf_max || whole > divided {
            return Subtree {
                count,
                cost: divided,
            };
        }
        items.truncate(index);
        items.push(Item::leaf(bounds, count));
        Subtree { count, cost: whole }
    }
}

/// Number of levels that halving needs to reach single objects.
fn levels(count: usize) -> usize {
    count.next_power_of_two().ilog2() as usize
}

/// Returns the depths of the leaves, in their order.
fn leaf_depths(tree: &ObjectTree) -> Vec<usize> {
    let (mut open, mut depths) = (vec![0], Vec::new());
    for index in 0..tree.items.len() {
        let depth = open.pop().expect("a depth for each node");
        match tree.kind(index) {
            ItemKind::Inner { .. } => open.extend([depth + 1; 2]),
            ItemKind::Leaf { .. } => depths.push(depth),
        }
    }
    depths
}

#[cfg(test)]
mod tests {
    use super::*;
    use halfspace_nodes::cost::Costs;

    /// Builds a tree of leaves of one triangle over triangles with these first corners and sizes; returns its depth.
    fn depth(triangles: &[([f32; 3], f32)]) -> usize {
        let corners = |&([x, y, z], size): &([f32; 3], f32)| {
            [[x, y, z], [x + size, y, z], [x, y + size, z + size]]
        };
        let vertices = triangles.iter().flat_map(corners).collect();
        let count = u32::try_from(triangles.len()).unwrap();
        let indices = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let scene = Triangles::new(vertices, indices).unwrap();
        let frame = Frame::new(scene.bounds());
        let heuristic = SurfaceArea {
            costs: Costs::BOXES,
            leaf_max: 1,
        };
        let tree = build(&scene, &frame, &heuristic, &Monitor::new()).unwrap();
        let mut ids = tree.ids.clone();
        ids.sort_unstable();
        assert_eq!(ids, scene.live());
        // Each triangle is in one leaf, within the box of every node above it.
        let firsts = tree.firsts();
        for (i, item) in tree.items.iter().enumerate() {
            match tree.kind(i) {
                ItemKind::Leaf { count } => {
                    assert_eq!(count, 1);
                    let corners = scene.corners(tree.ids[firsts[i] as usize]);
                    let own = Aabb::of_triangle(corners.map(|p| frame.point(p)));
                    assert_eq!(item.bounds, own);
                }
                ItemKind::Inner { children, .. } => {
                    let [a, b] = children.map(|child| tree.items[child].bounds);
                    assert_eq!(item.bounds, a.union(&b));
                }
            }
        }
        usize::from(tree.heights()[0])
    }

    #[test]
    fn equal_triangles_are_halved() {
        assert_eq!(depth(&[([0.5; 3], 1.0); 4096]), 12);
        assert_eq!(depth(&[([0.5; 3], 1.0); 10_000]), 14);
    }

    /// Each cell holds all smaller triangles but one, and the largest cells make a chain of treelets.
    #[test]
    fn depth_is_bounded() {
        let near = |i: i32| ([0.9_f32.powi(i); 3], 0.5 * 0.9_f32.powi(i));
        let many: Vec<_> = (0..50_000).map(|i| near(i % 600)).collect();
        let deepest = depth(&many);
        assert!((16..=MAX_DEPTH).contains(&deepest), "{deepest}");
    }

    #[test]
    fn the_threads_do_not_change_the_tree() {
        let spread = |i: u32| (i.wrapping_mul(2_654_435_761) >> 8) as f32 / 16_777_216.0;
        let at = |i: u32| [spread(3 * i), spread(3 * i + 1), spread(3 * i + 2)];
        let vertices = (0..90_000).map(at).collect();
        let indices = (0..30_000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let scene = Triangles::new(vertices, indices).unwrap();
        let frame = Frame::new(scene.bounds());
        let heuristic = SurfaceArea {
            costs: Costs::BOXES,
            leaf_max: 8,
        };
        let [one, several] = [1, 4].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            let pool = pool.build().unwrap();
            pool.install(|| build(&scene, &frame, &heuristic, &Monitor::new()).unwrap())
        });
        assert_eq!((one.items, one.ids), (several.items, several.ids));
    }
}
