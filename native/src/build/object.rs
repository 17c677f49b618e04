// SPDX-License-Identifier: GPL-3.0-or-later
//! The object-partition loop: builds every tree in which each triangle lies in exactly one leaf.
//!
//! A tree answers one question, "how would you part these objects?" ([`ObjectPolicy`]); bounds,
//! parting in place, bounded depth and going on in parallel happen here, once. The result is a pure
//! function of the triangles and the policy, for any number of threads.

use super::Monitor;
use super::footprint;
use super::object_tree::{Item, ObjectTree};
use super::plane_tree::MAX_DEPTH;
use crate::error::Result;
use crate::geom::Aabb;
use crate::scene::Triangles;
use crate::traverse::frame::Frame;
use rayon::prelude::*;

/// Progress is told for subtrees of less than this many objects.
pub(super) const TASK: usize = 4096;

/// Tasks per thread: some take longer than others.
const TASKS: usize = 8;

/// Nodes of at least this many objects are measured in parallel.
const PARALLEL: usize = 1 << 15;

/// A triangle, as the builder moves it about.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Object {
    /// Its box, in the frame of the walk.
    pub bounds: Aabb,
    /// Its number.
    pub id: u32,
}

impl Object {
    /// The middle of its box along axis `k`, rounded; the same number wherever it is asked for.
    #[inline(always)]
    pub fn centre(&self, k: usize) -> f32 {
        0.5 * self.bounds.min[k] + 0.5 * self.bounds.max[k]
    }
}

/// A node that is about to be parted.
pub struct Node<'a, R> {
    /// Its objects.
    pub objects: &'a [Object],
    /// What the policy said of it when it parted the parent.
    pub region: &'a R,
}

impl<R> Node<'_, R> {
    /// The boxes around the objects and around their centres.
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

/// The boxes around objects and around their centres, on the calling thread.
pub(super) fn measure(objects: &[Object]) -> (Aabb, Aabb) {
    let mut both = (Aabb::EMPTY, Aabb::EMPTY);
    for object in objects {
        both.0 = both.0.union(&object.bounds);
        both.1.grow([0, 1, 2].map(|k| object.centre(k)));
    }
    both
}

/// How a node's objects are parted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Parting<R> {
    /// Not at all.
    Leaf,
    /// Those with their centre at `at` or below go below, the others above.
    Centre {
        /// The axis.
        axis: usize,
        /// The largest centre below.
        at: f32,
        /// What the policy wants to know when it meets the two children.
        regions: [R; 2],
    },
    /// The half with the smaller centres goes below: possible wherever there are two objects.
    Median {
        /// The axis.
        axis: usize,
        /// What the policy wants to know when it meets the two children.
        regions: [R; 2],
    },
}

/// The one thing that tells object trees apart.
pub trait ObjectPolicy: Sync {
    /// What a node hands down to its children.
    type Region: Clone + Send;
    /// What the root is told; `bounds` is the scene's box.
    fn root(&self, bounds: Aabb) -> Self::Region;
    /// Parts a node of at least two objects. Where the proposal leaves a side empty, or the depth
    /// runs out, the loop takes the median along the same axis.
    fn part(&self, node: &Node<'_, Self::Region>) -> Parting<Self::Region>;
}

struct Builder<'a, P> {
    policy: &'a P,
    monitor: &'a Monitor,
    /// Nodes of at least this many objects are built on two threads.
    parallel: usize,
}

/// From how many objects on a node of a tree of `count` is built on two threads, in the current rayon pool.
pub(super) fn parallel_from(count: usize) -> usize {
    match rayon::current_num_threads() {
        1 => usize::MAX,
        threads => (count / (TASKS * threads)).max(TASK),
    }
}

/// Appends the items of two children, at once when `both` says so; returns where those of the second begin.
pub(super) fn grow_both<T: Send>(
    (items, both): (&mut Vec<T>, bool),
    below: impl FnOnce(&mut Vec<T>) -> Result<()> + Send,
    above: impl FnOnce(&mut Vec<T>) -> Result<()> + Send,
) -> Result<usize> {
    if !both {
        below(items)?;
        let second = items.len();
        above(items)?;
        return Ok(second);
    }
    let mut others = Vec::new();
    let (first, last) = rayon::join(|| below(items), || above(&mut others));
    first?;
    last?;
    let second = items.len();
    items.append(&mut others);
    Ok(second)
}

/// Appends the tree over some objects, of which `at` says what the policy is told and how deep they lie.
///
/// # Errors
/// Those of [`build`].
pub fn build_part<P: ObjectPolicy>(
    objects: &mut [Object],
    at: (P::Region, usize),
    (policy, monitor): (&P, &Monitor),
    items: &mut Vec<Item>,
) -> Result<()> {
    let builder = Builder {
        policy,
        monitor,
        parallel: usize::MAX,
    };
    builder.node(objects, at, items)
}

/// The live triangles of `scene`, in the frame `frame`.
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
/// [`crate::error::Error::Cancelled`] and [`crate::error::Error::Memory`] when the monitor says so.
pub fn build<P: ObjectPolicy>(
    scene: &Triangles,
    frame: &Frame,
    policy: &P,
    monitor: &Monitor,
) -> Result<ObjectTree> {
    build_over(gather(scene, frame), frame.bounds(), policy, monitor)
}

/// The same over any objects within `bounds`.
///
/// # Errors
/// As there.
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
    let region = policy.root(bounds);
    let mut items = Vec::with_capacity(objects.len() / 2);
    builder.subtree(&mut objects, (region, 0, 1.0), &mut items)?;
    let ids = objects.iter().map(|object| object.id).collect();
    Ok(ObjectTree { items, ids })
}

impl<P: ObjectPolicy> Builder<'_, P> {
    /// Appends a subtree: what the policy is told, how deep it lies, and its share of the whole work.
    fn subtree(
        &self,
        objects: &mut [Object],
        (region, depth, work): (P::Region, usize, f64),
        items: &mut Vec<Item>,
    ) -> Result<()> {
        let at = (region, depth);
        if objects.len() < TASK {
            let before = items.len();
            self.node(objects, at, items)?;
            let made = items.len() - before;
            self.monitor.take(footprint::boxes::<Item>(made))?;
            self.monitor.advance(work);
            return Ok(());
        }
        let Some((split, regions, axis)) = self.split(objects, &at)? else {
            self.monitor.advance(work);
            items.push(leaf(objects));
            return Ok(());
        };
        let place = items.len();
        items.push(Item::inner(axis));
        let share = split as f64 / objects.len() as f64;
        let both = objects.len() >= self.parallel;
        let (below, above) = objects.split_at_mut(split);
        let [first, second] = regions;
        let tasks = (
            (first, depth + 1, work * share),
            (second, depth + 1, work * (1.0 - share)),
        );
        let distance = grow_both(
            (items, both),
            |items| self.subtree(below, tasks.0, items),
            |items| self.subtree(above, tasks.1, items),
        )?;
        Item::link(&mut items[place..], distance - place);
        Ok(())
    }

    /// Appends a subtree. The depth of the recursion is that of the tree.
    fn node(
        &self,
        objects: &mut [Object],
        at: (P::Region, usize),
        items: &mut Vec<Item>,
    ) -> Result<()> {
        let Some((split, regions, axis)) = self.split(objects, &at)? else {
            items.push(leaf(objects));
            return Ok(());
        };
        let place = items.len();
        items.push(Item::inner(axis));
        let depth = at.1 + 1;
        let (below, above) = objects.split_at_mut(split);
        let [first, second] = regions;
        self.node(below, (first, depth), items)?;
        let distance = items.len() - place;
        self.node(above, (second, depth), items)?;
        Item::link(&mut items[place..], distance);
        Ok(())
    }

    /// Parts a node in place, or says that it is a leaf: how many objects are below, what the
    /// children are told, and the axis.
    #[expect(
        clippy::type_complexity,
        reason = "three results, named in the sentence above"
    )]
    fn split(
        &self,
        objects: &mut [Object],
        (region, depth): &(P::Region, usize),
    ) -> Result<Option<(usize, [P::Region; 2], usize)>> {
        self.monitor.check()?;
        if objects.len() < 2 {
            return Ok(None);
        }
        let parting = self.policy.part(&Node { objects, region });
        // Halving reaches single objects in this many levels; from here on nothing else may be done.
        let last_resort = MAX_DEPTH - depth <= objects.len().next_power_of_two().ilog2() as usize;
        let (axis, regions, split) = match parting {
            Parting::Leaf => return Ok(None),
            Parting::Centre { axis, at, regions } if !last_resort => {
                (axis, regions, part_by(objects, |o| o.centre(axis) <= at))
            }
            Parting::Centre { axis, regions, .. } | Parting::Median { axis, regions } => {
                (axis, regions, 0)
            }
        };
        let split = if split == 0 || split == objects.len() {
            median(objects, axis)
        } else {
            split
        };
        Ok(Some((split, regions, axis)))
    }
}

/// The box around some objects.
pub fn around(objects: &[Object]) -> Aabb {
    (objects.iter()).fold(Aabb::EMPTY, |all, object| all.union(&object.bounds))
}

/// Some objects as a leaf.
pub fn leaf(objects: &[Object]) -> Item {
    Item::leaf(around(objects), objects.len())
}

/// Moves the objects of which `below` holds to the front; returns how many they are.
pub(super) fn part_by<T>(objects: &mut [T], below: impl Fn(&T) -> bool) -> usize {
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

/// Moves the half with the smaller centres to the front, equal ones by number.
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
    use crate::build::leaves::Leaves;
    use crate::traverse::box_tree::BoxTree;
    use crate::traverse::keep::Keep;
    use crate::traverse::nested;

    /// Cuts one object off at a time, as long as the loop lets it.
    struct Chain;

    impl ObjectPolicy for Chain {
        type Region = ();
        fn root(&self, _: Aabb) {}
        fn part(&self, node: &Node<'_, ()>) -> Parting<()> {
            Parting::Centre {
                axis: 0,
                at: node.measure().1.min[0],
                regions: [(); 2],
            }
        }
    }

    #[test]
    fn depth_is_bounded_whatever_the_policy_wants() {
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
