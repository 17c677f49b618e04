// SPDX-License-Identifier: GPL-3.0-or-later
//! A tree of objects out of a tree of planes: its planes part the triangles, and boxes lie around what is parted.
//!
//! Of a triangle that a plane cuts each side takes its part, or one side takes it whole, whichever costs the least by the
//! surface area heuristic: boxes may overlap, where cells may not (Stich, Friedrich and Dietrich 2009, Spatial splits in
//! bounding volume hierarchies, section 4.3, reference unsplitting). Where a leaf of the planes begins, or a plane is not
//! worth its step, triangles are parted as objects.

use super::Monitor;
use super::binned::SurfaceArea;
use super::clip::clipped_bounds;
use super::cost::Costs;
use super::object::{self, Object, around};
use super::object_tree::{Item, ObjectTree};
use super::oblique_part::Cutter;
use super::plane_tree::{MAX_DEPTH, Node, PlaneTree};
use crate::error::Result;
use crate::geom::Aabb;
use crate::scene::Triangles;
use crate::traverse::frame::{AXIS_PAD, Frame};
use rayon::prelude::*;

/// Prices, and how triangles are parted as objects.
const OBJECTS: SurfaceArea = SurfaceArea {
    costs: Costs::BOXES,
    leaf_max: 16,
};

/// What reaches no farther beyond a plane, per unit of the scene's largest coordinate, is not cut: planes through corners and
/// edges are rounded, and what they would cut off is rounding.
const LITTLE: f32 = 4.0 * AXIS_PAD;

/// Nodes of more objects than this are built on two threads.
const PARALLEL: usize = 4096;

/// The share of the work on boxes that is done here, the rest being their layout.
pub const SHARE: f64 = 0.75;

/// Many objects are parted in pieces of so many, on any thread; before each it is asked whether the work is still wanted.
const PATIENCE: usize = 1 << 14;

/// Builds the tree over the live triangles of `scene`.
///
/// # Errors
/// [`crate::error::Error::Cancelled`] and [`crate::error::Error::Memory`] when the monitor says so.
pub fn build(
    planes: &PlaneTree,
    (scene, frame): (&Triangles, &Frame),
    monitor: &Monitor,
) -> Result<ObjectTree> {
    let builder = Builder {
        planes,
        scene,
        frame,
        monitor,
        magnitude: frame.bounds().magnitude(),
    };
    let objects = object::gather(scene, frame);
    let mut tree = ObjectTree::default();
    builder.node(objects, (planes.root(), 0, Some(SHARE)), &mut tree)?;
    Ok(tree)
}

/// The objects of a node by the sides of its plane.
#[derive(Debug, Default, PartialEq)]
struct Sides {
    /// Below and above.
    apart: [Vec<Object>; 2],
    /// Those that the plane cuts, and boxes that hold their parts below and above.
    cut: Vec<(Object, [Aabb; 2])>,
}

impl Sides {
    /// Takes in an object with boxes around its parts, but for one without a part below, which goes above: that is returned.
    fn take(&mut self, whole: Object, parts: [Aabb; 2]) -> Option<Object> {
        let [below, above] = parts;
        match parts.map(|part| part.is_empty()) {
            [false, false] => self.cut.push((whole, parts)),
            [false, true] => self.apart[0].push(Object {
                bounds: below,
                ..whole
            }),
            [true, false] => {
                return Some(Object {
                    bounds: above,
                    ..whole
                });
            }
            // What seems to have a part on neither side stays whole.
            [true, true] => return Some(whole),
        }
        None
    }

    /// All of these, one after the other.
    fn joined(parts: Vec<Self>) -> Self {
        let all = |side: usize| parts.iter().map(|part| part.apart[side].len()).sum();
        let mut joined = Self {
            apart: [Vec::with_capacity(all(0)), Vec::with_capacity(all(1))],
            cut: Vec::new(),
        };
        for part in parts {
            for (all, own) in joined.apart.iter_mut().zip(part.apart) {
                all.extend(own);
            }
            joined.cut.extend(part.cut);
        }
        joined
    }

    /// Shares out what is cut: to both sides, or whole to one of them, one after another, by the boxes at hand. Of what goes
    /// to both sides `cut` finds the smallest boxes around the parts.
    fn share_out(
        mut self,
        cut: impl Fn(&Object, [Aabb; 2]) -> [Aabb; 2],
        monitor: &Monitor,
    ) -> Result<[Vec<Object>; 2]> {
        let mut bounds = [0, 1].map(|side| {
            let parts = self.cut.iter().map(|(_, parts)| parts[side]);
            parts.fold(around(&self.apart[side]), |all, part| all.union(&part))
        });
        let mut count = [0, 1].map(|side| (self.apart[side].len() + self.cut.len()) as f64);
        for (seen, (whole, parts)) in std::mem::take(&mut self.cut).into_iter().enumerate() {
            if seen % PATIENCE == PATIENCE - 1 {
                monitor.check()?;
            }
            let grown = bounds.map(|own| own.union(&whole.bounds));
            let cost = |areas: [f64; 2], less: [f64; 2]| {
                areas[0] * (count[0] - less[0]) + areas[1] * (count[1] - less[1])
            };
            let [below, above] = bounds.map(|own| own.area());
            let both = cost([below, above], [0.0, 0.0]);
            let only_below = cost([grown[0].area(), above], [0.0, 1.0]);
            let only_above = cost([below, grown[1].area()], [1.0, 0.0]);
            if both <= only_below && both <= only_above {
                let parts = cut(&whole, parts);
                if parts.iter().any(Aabb::is_empty) {
                    count[usize::from(!parts[0].is_empty())] -= 1.0;
                    let above = self.take(whole, parts);
                    self.apart[1].extend(above);
                    continue;
                }
                for (side, bounds) in parts.into_iter().enumerate() {
                    self.apart[side].push(Object { bounds, ..whole });
                }
            } else {
                let side = usize::from(only_above < only_below);
                bounds[side] = grown[side];
                count[1 - side] -= 1.0;
                self.apart[side].push(whole);
            }
        }
        Ok(self.apart)
    }
}

struct Builder<'a> {
    planes: &'a PlaneTree,
    scene: &'a Triangles,
    frame: &'a Frame,
    monitor: &'a Monitor,
    /// The scene's largest coordinate.
    magnitude: f32,
}

impl Builder<'_> {
    /// Appends the tree over some objects, whose node in the tree of planes, depth and share of the whole work are given:
    /// none where few objects are left, of which the node above tells at once. Threads that told of every leaf would wait
    /// for each other. The depth of the recursion is that of the tree.
    fn node(
        &self,
        mut objects: Vec<Object>,
        (mut place, depth, work): (u32, usize, Option<f64>),
        tree: &mut ObjectTree,
    ) -> Result<()> {
        loop {
            self.monitor.check()?;
            let node = self.planes.node(place);
            let (Node::Axis { children, .. } | Node::Oblique { children, .. }) = node else {
                return self.objects(objects, (depth, work), tree);
            };
            let whole = (objects.len() <= OBJECTS.leaf_max).then(|| objects.clone());
            let parted = self.part(objects, &node)?;
            match parted {
                [below, above] if above.is_empty() => (objects, place) = (below, children),
                [below, above] if below.is_empty() => (objects, place) = (above, children + 1),
                parted => {
                    return match whole {
                        Some(whole) if !OBJECTS.pays(&whole, &parted) => {
                            self.objects(whole, (depth, work), tree)
                        }
                        _ => self.inner(parted, (children, depth, work), tree),
                    };
                }
            }
        }
    }

    /// Appends an inner node with its subtrees.
    fn inner(
        &self,
        [below, above]: [Vec<Object>; 2],
        (children, depth, work): (u32, usize, Option<f64>),
        tree: &mut ObjectTree,
    ) -> Result<()> {
        let before = tree.sizes();
        let count = below.len() + above.len();
        let place = tree.items.len();
        // Nobody asks for the axis.
        tree.items.push(Item::inner(0));
        let above_at = if count <= PARALLEL {
            self.node(below, (children, depth + 1, None), tree)?;
            let above_at = tree.items.len();
            self.node(above, (children + 1, depth + 1, None), tree)?;
            self.tell(work, before, tree)?;
            above_at
        } else {
            let _held = self.monitor.hold(count * size_of::<Object>())?;
            let mut other = ObjectTree::default();
            let work = work.unwrap_or(0.0);
            let part = work * below.len() as f64 / count as f64;
            let (first, last) = rayon::join(
                || self.node(below, (children, depth + 1, Some(part)), tree),
                || {
                    self.node(
                        above,
                        (children + 1, depth + 1, Some(work - part)),
                        &mut other,
                    )
                },
            );
            first?;
            last?;
            let above_at = tree.items.len();
            tree.items.append(&mut other.items);
            tree.ids.append(&mut other.ids);
            above_at
        };
        Item::link(&mut tree.items[place..], above_at - place);
        Ok(())
    }

    /// Appends the tree over objects that no plane parts any more. Where it might become deeper than any tree may, they are
    /// one leaf.
    fn objects(
        &self,
        mut objects: Vec<Object>,
        (depth, work): (usize, Option<f64>),
        tree: &mut ObjectTree,
    ) -> Result<()> {
        let before = tree.sizes();
        let most = 2 * objects.len() * size_of::<Item>();
        let many = objects.len() > PARALLEL;
        let _held = many.then(|| self.monitor.hold(most)).transpose()?;
        let levels = objects.len().next_power_of_two().ilog2() as usize;
        if depth + levels <= MAX_DEPTH {
            let at = ((), depth);
            object::build_part(&mut objects, at, (&OBJECTS, self.monitor), &mut tree.items)?;
        } else {
            tree.items.push(object::leaf(&objects));
        }
        tree.ids.extend(objects.iter().map(|object| object.id));
        self.tell(work, before, tree)
    }

    /// Tells of a share of the work, if it is for this node to tell, and of what the tree has taken in since it had these
    /// numbers of items and ids.
    fn tell(
        &self,
        work: Option<f64>,
        (items, ids): (usize, usize),
        tree: &ObjectTree,
    ) -> Result<()> {
        let Some(work) = work else {
            return Ok(());
        };
        self.monitor.advance(work);
        // And the node above, which nobody tells of.
        let made = (tree.items.len() - items + 1) * size_of::<Item>();
        self.monitor
            .take(made + (tree.ids.len() - ids) * size_of::<u32>())
    }

    /// Parts objects by the plane of a node.
    fn part(&self, objects: Vec<Object>, node: &Node) -> Result<[Vec<Object>; 2]> {
        let many = objects.len() >= 2 * PATIENCE;
        // A copy, and what becomes of it, cut or not.
        let most = 2 * size_of::<Object>() + size_of::<(Object, [Aabb; 2])>();
        let held = many.then(|| self.monitor.hold(objects.len() * most));
        let _held = held.transpose()?;
        let sides = if many {
            self.sides_of_many(objects, node)?
        } else {
            self.sides(objects, node)?
        };
        match node {
            // Most of what such a plane cuts stays whole, and need not be cut to learn it.
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

    /// As [`Self::sides`], piece by piece: near the root there are few nodes and many objects.
    fn sides_of_many(&self, objects: Vec<Object>, node: &Node) -> Result<Sides> {
        let pieces = objects.par_chunks(PATIENCE);
        let sides: Result<Vec<_>> = pieces
            .map(|piece| self.sides(piece.to_vec(), node))
            .collect();
        drop(objects);
        Ok(Sides::joined(sides?))
    }

    /// On which sides of the plane of a node objects lie. Those above stay where they are.
    fn sides(&self, mut objects: Vec<Object>, node: &Node) -> Result<Sides> {
        self.monitor.check()?;
        let little = LITTLE * self.magnitude;
        let mut sides = Sides::default();
        match *node {
            Node::Axis { axis, split, .. } => objects.retain(|object| {
                let below = split - object.bounds.min[axis];
                let above = object.bounds.max[axis] - split;
                if below.min(above) <= little {
                    // What lies in the plane is below, as planes have it.
                    if below < above {
                        return true;
                    }
                    sides.apart[0].push(*object);
                } else {
                    let mut parts = [object.bounds; 2];
                    parts[0].max[axis] = split;
                    parts[1].min[axis] = split;
                    sides.cut.push((*object, parts));
                }
                false
            }),
            Node::Oblique { normal, offset, .. } => {
                let mut cutter = Cutter::new((normal, offset), self.magnitude, little);
                objects.retain_mut(|object| {
                    let parts = cutter.parts(self.corners(object), &object.bounds);
                    let above = sides.take(*object, parts);
                    above.is_some_and(|above| {
                        *object = above;
                        true
                    })
                });
            }
            Node::Leaf { .. } => unreachable!("leaves have no plane"),
        }
        sides.apart[1] = objects;
        Ok(sides)
    }

    fn corners(&self, object: &Object) -> [[f32; 3]; 3] {
        (self.scene.corners(object.id)).map(|p| self.frame.point(p))
    }
}

#[cfg(test)]
mod tests;
