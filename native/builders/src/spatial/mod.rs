// SPDX-License-Identifier: GPL-3.0-or-later
//! Box hierarchies with spatial splits (Stich, Friedrich and Dietrich 2009, Spatial splits in bounding volume
//! hierarchies): where the boxes of the best partition overlap, planes that cut triangles are tried too. The parts of a
//! triangle go to both sides, each with a box of its own, if that is cheaper.
//!
//! A budget bounds the number of further references. The children of a node share what is left of it by their numbers of
//! references, so the tree does not depend on the number of threads.

use crate::binned::SurfaceArea;
use crate::object::{self, Object, measure, partition_by};
use crate::sides::Sides;
use halfspace_base::error::Result;
use halfspace_base::{Monitor, footprint};
use halfspace_geom::Aabb;
use halfspace_nodes::object_tree::{Item, ObjectTree, Sizes};
use halfspace_nodes::plane_tree::MAX_DEPTH;
use halfspace_ray::FramedScene;
use parts::Cutter;
use planes::{Plane, Search};

mod parts;
mod planes;

/// Overlap of two boxes, per area of the scene's box, up to which no plane is tried. Stich, Friedrich and Dietrich
/// recommend 1e-5, with which builds take up to three times as long and the expected cost of rays falls by at most
/// 2 % (measured on five scenes).
const OVERLAP: f64 = 1e-4;

/// Nodes of more objects than this are built on two threads.
const PARALLEL: usize = 4096;

/// Builds a tree over the live triangles of a scene, with at most `share` further references per triangle.
///
/// # Errors
/// [`halfspace_base::error::Error::Cancelled`] and [`halfspace_base::error::Error::Memory`] as the monitor returns them.
pub fn build(
    framed: FramedScene<'_>,
    share: f32,
    policy: &SurfaceArea,
    monitor: &Monitor,
) -> Result<ObjectTree> {
    let bounds = framed.frame.bounds();
    let builder = Builder {
        cutter: Cutter::new(framed),
        policy,
        monitor,
        least: OVERLAP * bounds.area(),
    };
    let objects = object::gather(framed.scene, framed.frame);
    let count = objects.len();
    let root = OpenNode {
        depth: 0,
        room: budget(count, share),
        work: Some(1.0),
    };
    let mut tree = ObjectTree::default();
    builder.node(objects, root, &mut tree)?;
    // Account for the layout of the further references.
    monitor.take((tree.ids.len() - count) * footprint::TRIANGLE)?;
    Ok(tree)
}

/// Returns the largest number of further references for `count` triangles.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the share is a small positive number"
)]
fn budget(count: usize, share: f32) -> usize {
    (count as f64 * f64::from(share)) as usize
}

/// A node that is still to be built.
#[derive(Clone, Copy)]
struct OpenNode {
    depth: usize,
    /// Number of further references that its subtree may make.
    room: usize,
    /// Share of the whole work; `None` in small subtrees, whose ancestor reports for all of them.
    work: Option<f64>,
}

/// The inputs of a build.
struct Builder<'a> {
    cutter: Cutter<'a>,
    policy: &'a SurfaceArea,
    monitor: &'a Monitor,
    /// Overlap of two boxes up to which no plane is tried.
    least: f64,
}

impl Builder<'_> {
    /// Appends the tree over the objects of a node. The depth of the recursion is that of the tree.
    fn node(&self, objects: Vec<Object>, open: OpenNode, tree: &mut ObjectTree) -> Result<()> {
        self.monitor.check()?;
        let count = objects.len();
        let (bounds, centres) = measure(&objects);
        // Below a box that is no larger than the least overlap nothing is cut, and near the depth limit only medians
        // reach single objects in time.
        let levels = count.next_power_of_two().ilog2() as usize;
        let deep = open.depth + 2 + 2 * levels > MAX_DEPTH;
        if count < 2 || open.room == 0 || deep || bounds.area() <= self.least {
            return self.whole(objects, open, tree);
        }
        // Find the best partition, and the best plane where the boxes of the partition overlap.
        let partition = self.policy.best(&objects, &centres);
        let overlap = partition.map_or(f64::INFINITY, |best| {
            let mut sides = [Aabb::EMPTY; 2];
            for object in &objects {
                let side = usize::from(object.centre(best.axis) > best.at);
                sides[side] = sides[side].union(&object.bounds);
            }
            common(&sides[0], &sides[1]).area()
        });
        let plane = if overlap > self.least {
            let search = Search {
                cutter: self.cutter,
                policy: self.policy,
                room: open.room,
            };
            search.best(&objects, &bounds)
        } else {
            None
        };
        let of_objects = partition.map_or(f64::INFINITY, |best| best.cost);
        let plane = plane.filter(|plane| plane.cost < of_objects);
        let cost = plane.map_or(of_objects, |plane| plane.cost);
        if self.policy.is_leaf(count, &bounds, cost) {
            return self.leaf(&objects, open, tree);
        }
        // Split by the cheaper of both.
        let parts = match (plane, partition) {
            (Some(plane), _) => self.split(objects, plane)?,
            (None, Some(best)) => {
                let mut objects = objects;
                let below = partition_by(&mut objects, |o| o.centre(best.axis) <= best.at);
                let above = objects.split_off(below);
                [objects, above]
            }
            (None, None) => return self.whole(objects, open, tree),
        };
        match parts {
            // All objects stayed whole on one side.
            [all, none] | [none, all] if none.is_empty() => self.whole(all, open, tree),
            parts => self.inner(parts, count, open, tree),
        }
    }

    /// Appends an inner node of `count` objects with its subtrees.
    fn inner(
        &self,
        [below, above]: [Vec<Object>; 2],
        count: usize,
        open: OpenNode,
        tree: &mut ObjectTree,
    ) -> Result<()> {
        let before = tree.sizes();
        let index = tree.items.len();
        let (first, all) = (below.len(), below.len() + above.len());
        // Share out what is left of the budget.
        let room = open.room - (all - count).min(open.room);
        let part = (room as u128 * first as u128 / all as u128) as usize;
        let child = |room: usize, work: Option<f64>| OpenNode {
            depth: open.depth + 1,
            room,
            work,
        };
        // The axis of these nodes is not used.
        tree.items.push(Item::inner(0));
        let above_at = if count <= PARALLEL {
            self.node(below, child(part, None), tree)?;
            let above_at = tree.items.len();
            self.node(above, child(room - part, None), tree)?;
            self.report(open.work, before, tree)?;
            above_at
        } else {
            let _held = self.monitor.hold(all * size_of::<Object>())?;
            // The second thread writes to a tree of its own, which is appended.
            let mut other = ObjectTree::default();
            let work = open.work.unwrap_or(0.0);
            let share = work * first as f64 / all as f64;
            let (one, two) = rayon::join(
                || self.node(below, child(part, Some(share)), tree),
                || self.node(above, child(room - part, Some(work - share)), &mut other),
            );
            one?;
            two?;
            let above_at = tree.items.len();
            tree.items.append(&mut other.items);
            tree.ids.append(&mut other.ids);
            above_at
        };
        Item::link(&mut tree.items[index..], above_at - index);
        Ok(())
    }

    /// Appends the tree over objects that no plane cuts.
    fn whole(&self, mut objects: Vec<Object>, open: OpenNode, tree: &mut ObjectTree) -> Result<()> {
        let before = tree.sizes();
        let items = &mut tree.items;
        object::build_subtree(
            &mut objects,
            (),
            open.depth,
            self.policy,
            self.monitor,
            items,
        )?;
        tree.ids.extend(objects.iter().map(|object| object.id));
        self.report(open.work, before, tree)
    }

    /// Appends a leaf.
    fn leaf(&self, objects: &[Object], open: OpenNode, tree: &mut ObjectTree) -> Result<()> {
        let before = tree.sizes();
        tree.items.push(object::leaf(objects));
        tree.ids.extend(objects.iter().map(|object| object.id));
        self.report(open.work, before, tree)
    }

    /// Reports a share of the work, if this node has one, and the memory that the tree has taken since it had the sizes
    /// `before`.
    fn report(&self, work: Option<f64>, before: Sizes, tree: &ObjectTree) -> Result<()> {
        let Some(work) = work else {
            return Ok(());
        };
        self.monitor.advance(work);
        // Includes the node above, which is not reported otherwise.
        let made = tree.items.len() - before.items + 1;
        let listed = (tree.ids.len() - before.ids) * size_of::<u32>();
        self.monitor.take(footprint::boxes::<Item>(made) + listed)
    }

    /// Splits objects by a plane.
    fn split(&self, objects: Vec<Object>, plane: Plane) -> Result<[Vec<Object>; 2]> {
        let Plane { axis, at, .. } = plane;
        let sides = Sides::along_axis(objects, axis, at, self.cutter.little());
        let cut = |object: &Object, cells: [Aabb; 2]| {
            cells.map(|cell| self.cutter.around(object, &cell).unwrap_or(Aabb::EMPTY))
        };
        sides.share_out(cut, self.monitor)
    }
}

/// Returns the box that two boxes have in common.
fn common(a: &Aabb, b: &Aabb) -> Aabb {
    Aabb {
        min: [0, 1, 2].map(|k| a.min[k].max(b.min[k])),
        max: [0, 1, 2].map(|k| a.max[k].min(b.max[k])),
    }
}

#[cfg(test)]
mod tests;
