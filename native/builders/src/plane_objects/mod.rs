// SPDX-License-Identifier: GPL-3.0-or-later
//! Builds an object tree from a tree of split planes: the planes separate the triangles, and each node gets the
//! box of its triangles.
//!
//! If a plane cuts a triangle, each side gets its part, or one side gets the whole triangle, whichever costs least
//! by the surface area heuristic; boxes may overlap, unlike cells (Stich, Friedrich and Dietrich 2009, Spatial
//! splits in bounding volume hierarchies, section 4.3, reference unsplitting). Below the leaves of the planes, and
//! where a plane is not worth its step, triangles are partitioned as objects.

use crate::binned::SurfaceArea;
use crate::object::{self, Object};
use crate::sides::{CHUNK, Sides};
use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_geom::Aabb;
use halfspace_geom::clip::clipped_bounds;
use halfspace_geom::oblique_part::Cutter;
use halfspace_nodes::cost::Costs;
use halfspace_nodes::object_tree::{Item, ObjectTree, Sizes};
use halfspace_nodes::plane_tree::{MAX_DEPTH, Node, PlaneTree};
use halfspace_ray::FramedScene;
use halfspace_ray::frame::{AXIS_PAD, Frame};
use halfspace_scene::Triangles;
use rayon::prelude::*;

/// Costs, and the partition of objects below the planes.
const OBJECTS: SurfaceArea = SurfaceArea {
    costs: Costs::BOXES,
    leaf_max: 16,
};

/// Distance beyond a plane, per unit of the scene's largest coordinate, up to which a triangle is not cut: planes
/// through vertices and edges are rounded, and the parts they would cut off are rounding errors.
const LITTLE: f32 = 4.0 * AXIS_PAD;

/// Nodes of more objects than this are built on two threads.
const PARALLEL: usize = 4096;

/// Share of the work on boxes that is done here; the layout of the boxes takes the rest.
pub const SHARE: f64 = 0.75;

/// Builds the tree over the live triangles of `scene`.
///
/// # Errors
/// [`halfspace_base::error::Error::Cancelled`] and [`halfspace_base::error::Error::Memory`] as the monitor returns
/// them.
pub fn build(planes: &PlaneTree, framed: FramedScene<'_>, monitor: &Monitor) -> Result<ObjectTree> {
    let FramedScene { scene, frame } = framed;
    let builder = Builder {
        planes,
        scene,
        frame,
        monitor,
        magnitude: frame.bounds().magnitude(),
    };
    // Start with all triangles at the root of the tree of planes.
    let objects = object::gather(scene, frame);
    let mut tree = ObjectTree::default();
    let root = OpenNode {
        node: planes.root(),
        depth: 0,
        work: Some(SHARE),
    };
    builder.node(objects, root, &mut tree)?;
    Ok(tree)
}

/// A node that is still to be built.
#[derive(Clone, Copy)]
struct OpenNode {
    /// Index of the node in the tree of planes.
    node: u32,
    depth: usize,
    /// Share of the whole work; `None` in small subtrees, whose ancestor reports for all of them: a report per leaf
    /// would make threads contend.
    work: Option<f64>,
}

impl OpenNode {
    /// Returns a child with this index and this share of the work.
    fn child(&self, node: u32, work: Option<f64>) -> Self {
        Self {
            node,
            depth: self.depth + 1,
            work,
        }
    }
}

/// The inputs of a build.
struct Builder<'a> {
    planes: &'a PlaneTree,
    scene: &'a Triangles,
    frame: &'a Frame,
    monitor: &'a Monitor,
    /// The scene's largest coordinate.
    magnitude: f32,
}

impl Builder<'_> {
    /// Appends the tree over the objects of a node. The depth of the recursion is that of the tree.
    fn node(
        &self,
        mut objects: Vec<Object>,
        mut open: OpenNode,
        tree: &mut ObjectTree,
    ) -> Result<()> {
        loop {
            self.monitor.check()?;
            let node = self.planes.node(open.node);
            let (Node::Axis { children, .. } | Node::Oblique { children, .. }) = node else {
                return self.objects(objects, open, tree);
            };
            // Split the objects by the node's plane; skip planes with all objects on one side.
            let whole = (objects.len() <= OBJECTS.leaf_max).then(|| objects.clone());
            let parts = self.split(objects, &node)?;
            match parts {
                [below, above] if above.is_empty() => (objects, open.node) = (below, children),
                [below, above] if below.is_empty() => (objects, open.node) = (above, children + 1),
                parts => {
                    return match whole {
                        Some(whole) if !OBJECTS.is_worth(&whole, &parts) => {
                            self.objects(whole, open, tree)
                        }
                        _ => self.inner(parts, open, children, tree),
                    };
                }
            }
        }
    }

    /// Appends an inner node with its subtrees; `children` is the index of the first child in the tree of planes.
    fn inner(
        &self,
        [below, above]: [Vec<Object>; 2],
        open: OpenNode,
        children: u32,
        tree: &mut ObjectTree,
    ) -> Result<()> {
        let before = tree.sizes();
        let count = below.len() + above.len();
        let index = tree.items.len();
        // The axis of these nodes is not used.
        tree.items.push(Item::inner(0));
        // Build small subtrees in sequence and report them at once.
        let above_at = if count <= PARALLEL {
            self.node(below, open.child(children, None), tree)?;
            let above_at = tree.items.len();
            self.node(above, open.child(children + 1, None), tree)?;
            self.report(open.work, before, tree)?;
            above_at
        // Build large subtrees on two threads.
        } else {
            let _held = self.monitor.hold(count * size_of::<Object>())?;
            // The second thread writes to a tree of its own, which is appended.
            let mut other = ObjectTree::default();
            let work = open.work.unwrap_or(0.0);
            let part = work * below.len() as f64 / count as f64;
            let (first, last) = rayon::join(
                || self.node(below, open.child(children, Some(part)), tree),
                || {
                    let child = open.child(children + 1, Some(work - part));
                    self.node(above, child, &mut other)
                },
            );
            first?;
            last?;
            // Append the second tree.
            let above_at = tree.items.len();
            tree.items.append(&mut other.items);
            tree.ids.append(&mut other.ids);
            above_at
        };
        Item::link(&mut tree.items[index..], above_at - index);
        Ok(())
    }

    /// Appends the tree over objects that no plane splits. If the tree might exceed the depth limit, the objects
    /// become one leaf.
    fn objects(
        &self,
        mut objects: Vec<Object>,
        OpenNode { depth, work, .. }: OpenNode,
        tree: &mut ObjectTree,
    ) -> Result<()> {
        let before = tree.sizes();
        let most = 2 * objects.len() * size_of::<Item>();
        // Only large lists are worth reporting while they are partitioned.
        let many = objects.len() > PARALLEL;
        let _held = many.then(|| self.monitor.hold(most)).transpose()?;
        // Halving reaches single objects in this number of levels.
        let levels = objects.len().next_power_of_two().ilog2() as usize;
        if depth + levels <= MAX_DEPTH {
            let items = &mut tree.items;
            object::build_subtree(&mut objects, (), depth, &OBJECTS, self.monitor, items)?;
        } else {
            tree.items.push(object::leaf(&objects));
        }
        tree.ids.extend(objects.iter().map(|object| object.id));
        self.report(work, before, tree)
    }

    /// Reports a share of the work, if this node has one, and the memory that the tree has taken since it had the
    /// sizes `before`.
    fn report(&self, work: Option<f64>, before: Sizes, tree: &ObjectTree) -> Result<()> {
        let Some(work) = work else {
            return Ok(());
        };
        self.monitor.advance(work);
        // Includes the node above, which is not reported otherwise.
        let made = (tree.items.len() - before.items + 1) * size_of::<Item>();
        self.monitor
            .take(made + (tree.ids.len() - before.ids) * size_of::<u32>())
    }

    /// Splits objects by the plane of a node.
    fn split(&self, objects: Vec<Object>, node: &Node) -> Result<[Vec<Object>; 2]> {
        let many = objects.len() >= 2 * CHUNK;
        // Bytes per object: a copy, and the classified object, cut or not.
        let most = 2 * size_of::<Object>() + size_of::<(Object, [Aabb; 2])>();
        let held = many.then(|| self.monitor.hold(objects.len() * most));
        let _held = held.transpose()?;
        let sides = if many {
            self.sides_of_many(objects, node)?
        } else {
            self.sides(objects, node)?
        };
        match node {
            // Most objects that an axis-aligned plane cuts stay whole, so they are clipped only if they do not.
            Node::Axis { .. } => sides.share_out(
                |object, parts| {
                    let corners = self.corners(object);
                    parts.map(|part| {
                        let bounds = clipped_bounds(corners, &part, self.magnitude);
                        bounds.unwrap_or(Aabb::EMPTY)
                    })
                },
                self.monitor,
            ),
            _ => sides.share_out(|_, parts| parts, self.monitor),
        }
    }

    /// Like [`Self::sides`], in parallel: near the root there are few nodes and many objects.
    fn sides_of_many(&self, objects: Vec<Object>, node: &Node) -> Result<Sides> {
        let pieces = objects.par_chunks(CHUNK);
        let sides: Result<Vec<_>> = pieces
            .map(|piece| self.sides(piece.to_vec(), node))
            .collect();
        drop(objects);
        Ok(Sides::joined(sides?))
    }

    /// Classifies objects by the plane of a node. Those above keep the memory of the list.
    fn sides(&self, mut objects: Vec<Object>, node: &Node) -> Result<Sides> {
        self.monitor.check()?;
        let little = LITTLE * self.magnitude;
        match *node {
            Node::Axis { axis, split, .. } => Ok(Sides::along_axis(objects, axis, split, little)),
            Node::Oblique { normal, offset, .. } => {
                // Clip each triangle to both sides of an oblique plane.
                let mut sides = Sides::default();
                let mut cutter = Cutter::new(normal, offset, self.magnitude, little);
                objects.retain_mut(|object| {
                    let parts = cutter.parts(self.corners(object), &object.bounds);
                    let above = sides.take(*object, parts);
                    above.is_some_and(|above| {
                        *object = above;
                        true
                    })
                });
                sides.apart[1] = objects;
                Ok(sides)
            }
            Node::Leaf { .. } => unreachable!("leaves have no plane"),
        }
    }

    /// Returns the vertices of an object's triangle in the structure's frame.
    fn corners(&self, object: &Object) -> [[f32; 3]; 3] {
        (self.scene.corners(object.id)).map(|p| self.frame.point(p))
    }
}

#[cfg(test)]
mod tests;
