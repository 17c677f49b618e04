// SPDX-License-Identifier: GPL-3.0-or-later
//! The object-partition loop: builds every tree in which each triangle lies in exactly one leaf.
//!
//! A tree supplies only a policy that proposes a partition of a node's objects ([`ObjectPolicy`]); bounds, partitioning
//! in place, the depth limit and parallelism are implemented here, once. The result depends only on the triangles and
//! the policy, not on the number of threads.

use crate::reach::Reach;
use halfspace_base::error::Result;
use halfspace_base::{Monitor, footprint};
use halfspace_geom::Aabb;
use halfspace_nodes::object_tree::{Item, ObjectTree};
use halfspace_nodes::plane_tree::MAX_DEPTH;
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;
use rayon::prelude::*;

/// Subtrees of fewer objects are built on one thread, and report their progress at the end (chosen).
pub const TASK: usize = 4096;

/// Number of tasks per thread (chosen): several, because their durations differ.
const TASKS: usize = 8;

/// Nodes of at least this number of objects are measured in parallel (chosen).
const PARALLEL: usize = 1 << 15;

/// A triangle during the build.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Object {
    /// Its box, in the structure's frame.
    pub bounds: Aabb,
    /// Its number in the scene.
    pub id: u32,
}

impl Object {
    /// Returns the middle of its box along axis `k`, rounded; equal boxes have equal centres.
    #[inline(always)]
    pub fn centre(&self, k: usize) -> f32 {
        0.5 * self.bounds.min[k] + 0.5 * self.bounds.max[k]
    }
}

/// The data of a node that a policy receives.
pub struct Node<'a, R> {
    /// The node's objects.
    pub objects: &'a [Object],
    /// Data that the policy passed to the node when it partitioned the parent.
    pub region: &'a R,
}

impl<R> Node<'_, R> {
    /// Returns the boxes around the objects and around their centres.
    pub fn measure(&self) -> (Aabb, Aabb) {
        if self.objects.len() < PARALLEL {
            return measure(self.objects);
        }
        let join = |a: (Aabb, Aabb), b: (Aabb, Aabb)| (a.0.union(&b.0), a.1.union(&b.1));
        self.objects
            .par_chunks(PARALLEL / 4)
            .map(measure)
            .reduce(|| (Aabb::EMPTY, Aabb::EMPTY), join)
    }
}

/// Returns the boxes around objects and around their centres, on the calling thread.
pub fn measure(objects: &[Object]) -> (Aabb, Aabb) {
    let mut both = (Reach::EMPTY, Reach::EMPTY);
    for object in objects {
        both.0 = both.0.union(&Reach::new(&object.bounds));
        let centre = [0, 1, 2].map(|k| object.centre(k));
        both.1 = both.1.union(&Reach::new(&Aabb {
            min: centre,
            max: centre,
        }));
    }
    (both.0.bounds(), both.1.bounds())
}

/// A proposed partition of a node's objects.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Partition<R> {
    /// None: the node becomes a leaf.
    Leaf,
    /// Objects with their centre at or below `at` go below, the others above.
    Centre {
        /// Axis of the comparison.
        axis: usize,
        /// Largest centre below.
        at: f32,
        /// Data of the policy for the two children.
        regions: [R; 2],
    },
    /// The half with the smaller centres goes below, which leaves no side empty.
    Median {
        /// Axis along which the centres are compared.
        axis: usize,
        /// Data of the policy for the two children.
        regions: [R; 2],
    },
}

/// The policy of an object tree: the only part in which object trees differ.
pub trait ObjectPolicy: Sync {
    /// Data that a node passes to its children.
    type Region: Clone + Send;
    /// Returns the data of the root; `bounds` is the scene's box.
    fn root(&self, bounds: Aabb) -> Self::Region;
    /// Proposes the partition of a node of at least two objects. If the proposal leaves a side empty, or the depth
    /// limit is near, the loop takes the median along the same axis.
    fn partition(&self, node: &Node<'_, Self::Region>) -> Partition<Self::Region>;
}

/// A node that is still to be built.
struct OpenNode<R> {
    /// Data that the policy passed to the node.
    region: R,
    depth: usize,
}

/// A partition that was made.
struct Split<R> {
    /// Axis of the comparison.
    axis: usize,
    /// Number of objects below.
    count: usize,
    /// Data of the policy for the two children.
    regions: [R; 2],
}

/// The inputs of a build.
struct Builder<'a, P> {
    policy: &'a P,
    monitor: &'a Monitor,
    /// Number of objects from which nodes are built on two threads.
    parallel: usize,
}

/// Returns the number of objects from which a node of a tree of `count` objects is built on two threads, in the
/// current rayon pool.
pub fn parallel_from(count: usize) -> usize {
    match rayon::current_num_threads() {
        1 => usize::MAX,
        threads => (count / (TASKS * threads)).max(TASK),
    }
}

/// Appends the items of two children, on two threads if `both` is set; returns the index of the second child's first
/// item.
pub fn grow_both<T: Send>(
    items: &mut Vec<T>,
    both: bool,
    below: impl FnOnce(&mut Vec<T>) -> Result<()> + Send,
    above: impl FnOnce(&mut Vec<T>) -> Result<()> + Send,
) -> Result<usize> {
    if !both {
        // In sequence, both children append to the same list.
        below(items)?;
        let second = items.len();
        above(items)?;
        return Ok(second);
    }
    // The second child writes to a list of its own, which is appended: the result is the same.
    let mut others = Vec::new();
    let (first, last) = rayon::join(|| below(items), || above(&mut others));
    first?;
    last?;
    let second = items.len();
    items.append(&mut others);
    Ok(second)
}

/// Appends the tree over `objects`; `region` is the policy's data for its root.
///
/// # Errors
/// Those of [`build`].
pub fn build_subtree<P: ObjectPolicy>(
    objects: &mut [Object],
    region: P::Region,
    depth: usize,
    policy: &P,
    monitor: &Monitor,
    items: &mut Vec<Item>,
) -> Result<()> {
    let builder = Builder {
        policy,
        monitor,
        parallel: usize::MAX,
    };
    builder.node(objects, OpenNode { region, depth }, items)
}

/// Returns the live triangles of `scene` as objects, in the frame `frame`.
pub fn gather(scene: &Triangles, frame: &Frame) -> Vec<Object> {
    let object = |&id: &u32| Object {
        bounds: Aabb::of_triangle(scene.corners(id).map(|p| frame.point(p))),
        id,
    };
    scene.live().par_iter().map(object).collect()
}

/// Builds a tree over the live triangles of `scene`, in the frame `frame`, in the current rayon pool.
///
/// # Errors
/// [`halfspace_base::error::Error::Cancelled`] and [`halfspace_base::error::Error::Memory`] as the monitor returns
/// them.
pub fn build<P: ObjectPolicy>(
    scene: &Triangles,
    frame: &Frame,
    policy: &P,
    monitor: &Monitor,
) -> Result<ObjectTree> {
    build_over(gather(scene, frame), frame.bounds(), policy, monitor)
}

/// Builds a tree over any objects within `bounds`.
///
/// # Errors
/// Those of [`build`].
pub fn build_over<P: ObjectPolicy>(
    mut objects: Vec<Object>,
    bounds: Aabb,
    policy: &P,
    monitor: &Monitor,
) -> Result<ObjectTree> {
    let builder = Builder {
        policy,
        monitor,
        parallel: parallel_from(objects.len()),
    };
    // Partition the objects in place, then read off their numbers in the order of the leaves.
    let root = OpenNode {
        region: policy.root(bounds),
        depth: 0,
    };
    let mut items = Vec::with_capacity(objects.len() / 2);
    builder.subtree(&mut objects, root, 1.0, &mut items)?;
    let ids = objects.iter().map(|object| object.id).collect();
    Ok(ObjectTree { items, ids })
}

impl<P: ObjectPolicy> Builder<'_, P> {
    /// Appends a subtree; `work` is its share of the whole work.
    fn subtree(
        &self,
        objects: &mut [Object],
        node: OpenNode<P::Region>,
        work: f64,
        items: &mut Vec<Item>,
    ) -> Result<()> {
        // Report progress and memory for small subtrees as a whole.
        if objects.len() < TASK {
            let before = items.len();
            self.node(objects, node, items)?;
            let made = items.len() - before;
            self.monitor.take(footprint::boxes::<Item>(made))?;
            self.monitor.advance(work);
            return Ok(());
        }
        // Partition the objects of a large node, or make a leaf.
        let depth = node.depth + 1;
        let Some(split) = self.split(objects, &node)? else {
            self.monitor.advance(work);
            items.push(leaf(objects));
            return Ok(());
        };
        let index = items.len();
        items.push(Item::inner(split.axis));
        // Divide the work in proportion to the objects.
        let share = split.count as f64 / objects.len() as f64;
        let both = objects.len() >= self.parallel;
        let (below, above) = objects.split_at_mut(split.count);
        let [first, second] = split.regions.map(|region| OpenNode { region, depth });
        // Build both children, and link them to the item reserved above.
        let distance = grow_both(
            items,
            both,
            |items| self.subtree(below, first, work * share, items),
            |items| self.subtree(above, second, work * (1.0 - share), items),
        )?;
        Item::link(&mut items[index..], distance - index);
        Ok(())
    }

    /// Appends a subtree without reporting progress. The depth of the recursion is that of the tree.
    fn node(
        &self,
        objects: &mut [Object],
        node: OpenNode<P::Region>,
        items: &mut Vec<Item>,
    ) -> Result<()> {
        let Some(split) = self.split(objects, &node)? else {
            items.push(leaf(objects));
            return Ok(());
        };
        let index = items.len();
        items.push(Item::inner(split.axis));
        let depth = node.depth + 1;
        let (below, above) = objects.split_at_mut(split.count);
        let [first, second] = split.regions.map(|region| OpenNode { region, depth });
        // The child below follows directly, the child above after all of its items.
        self.node(below, first, items)?;
        let distance = items.len() - index;
        self.node(above, second, items)?;
        Item::link(&mut items[index..], distance);
        Ok(())
    }

    /// Partitions a node's objects in place; returns `None` for a leaf.
    fn split(
        &self,
        objects: &mut [Object],
        node: &OpenNode<P::Region>,
    ) -> Result<Option<Split<P::Region>>> {
        self.monitor.check()?;
        if objects.len() < 2 {
            return Ok(None);
        }
        let partition = self.policy.partition(&Node {
            objects,
            region: &node.region,
        });
        // Apply the proposal, unless the depth limit is near: from there on only medians reach single objects in time.
        let levels = objects.len().next_power_of_two().ilog2() as usize;
        let last_resort = MAX_DEPTH - node.depth <= levels;
        let (axis, regions, count) = match partition {
            Partition::Leaf => return Ok(None),
            Partition::Centre { axis, at, regions } if !last_resort => (
                axis,
                regions,
                partition_by(objects, |o| o.centre(axis) <= at),
            ),
            Partition::Centre { axis, regions, .. } | Partition::Median { axis, regions } => {
                (axis, regions, 0)
            }
        };
        // Take the median if a side is empty, or no partition was applied.
        let count = if count == 0 || count == objects.len() {
            median(objects, axis)
        } else {
            count
        };
        Ok(Some(Split {
            axis,
            count,
            regions,
        }))
    }
}

/// Returns the box around objects.
pub fn around(objects: &[Object]) -> Aabb {
    let reach = |object: &Object| Reach::new(&object.bounds);
    let all = objects.iter().map(reach);
    all.fold(Reach::EMPTY, |all, one| all.union(&one)).bounds()
}

/// Returns a leaf of these objects.
pub fn leaf(objects: &[Object]) -> Item {
    Item::leaf(around(objects), objects.len())
}

/// Moves the objects for which `below` holds to the front; returns their number.
pub fn partition_by<T>(objects: &mut [T], below: impl Fn(&T) -> bool) -> usize {
    let (mut first, mut end) = (0, objects.len());
    loop {
        while first < end && below(&objects[first]) {
            first += 1;
        }
        while first < end && !below(&objects[end - 1]) {
            end -= 1;
        }
        if first == end {
            return first;
        }
        objects.swap(first, end - 1);
    }
}

/// Moves the half with the smaller centres to the front, equal ones by number; returns its size.
fn median(objects: &mut [Object], axis: usize) -> usize {
    let half = objects.len() / 2;
    objects.select_nth_unstable_by(half, |a, b| {
        a.centre(axis)
            .total_cmp(&b.centre(axis))
            .then(a.id.cmp(&b.id))
    });
    half
}

#[cfg(test)]
mod tests {
    use super::*;
    use halfspace_leaf::keep::Keep;
    use halfspace_leaf::leaves::Leaves;
    use halfspace_nodes::box_tree::BoxTree;
    use halfspace_nodes::nested;

    /// A policy that separates one object at a time, as long as the loop permits.
    struct Chain;

    impl ObjectPolicy for Chain {
        type Region = ();
        fn root(&self, _: Aabb) {}
        fn partition(&self, node: &Node<'_, ()>) -> Partition<()> {
            Partition::Centre {
                axis: 0,
                at: node.measure().1.min[0],
                regions: [(); 2],
            }
        }
    }

    #[test]
    fn depth_is_bounded_for_every_policy() {
        let mut vertices = Vec::new();
        for i in 0..1000 {
            let x = f32::from(i16::try_from(i).unwrap());
            vertices.extend([[x, 0.0, 0.0], [x + 0.5, 1.0, 0.0], [x + 0.5, 0.0, 1.0]]);
        }
        let indices = (0..1000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let scene = Triangles::new(vertices, indices).unwrap();
        let frame = Frame::new(scene.bounds());
        let tree = build(&scene, &frame, &Chain, &Monitor::new()).unwrap();
        let boxes = BoxTree::<2>::new(&tree, &mut Leaves::new(Keep::Corners)).unwrap();
        let shape = nested::shape(&boxes, frame.bounds());
        assert_eq!((shape.leaves, shape.depth_max), (1000, MAX_DEPTH));
        let mut ids = tree.ids.clone();
        ids.sort_unstable();
        assert_eq!(ids, scene.live());
    }
}
