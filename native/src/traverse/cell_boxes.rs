// SPDX-License-Identifier: GPL-3.0-or-later
//! Trees of split planes as trees of boxes: around what lies inside each cell.
//!
//! The leaves are the same. But the empty space in a cell, which planes close off by a chain of cuts, a box leaves out
//! at once, and eight boxes to a node make good use of its places, where three levels of planes leave most of them empty.
//! That a tree of planes gains from boxes around its nodes is known from hardware (Woop, Marmitt and Slusallek 2006,
//! B-KD trees for hardware accelerated ray tracing of dynamic scenes), where they replace the planes.

use super::blocks::Blocks;
use super::box_tree::{Binary, BoxTree};
use super::frame::{AXIS_PAD, Frame};
use super::nested::Nested;
use crate::build::plane_tree::{Node, PlaneTree};
use crate::build::{Held, Monitor};
use crate::error::Result;
use crate::geom::Aabb;
use crate::geom::vec3::{Vec3, add_scaled, dot, map, sub, widen};

/// A cell that holds anything.
struct Cell {
    /// Around that.
    bounds: Aabb,
    /// Of an inner node.
    children: Option<[usize; 2]>,
    /// Of a leaf, where its blocks begin and how many triangles they hold.
    leaf: (u32, u32),
}

/// The cells of a tree that hold anything, children before their parents.
struct Cells<'a> {
    tree: &'a PlaneTree,
    blocks: &'a Blocks,
    monitor: &'a Monitor,
    /// By how much cells reach beyond their planes: several times what builders' planes are off by where they part triangles.
    pad: f32,
    /// The oblique planes above a node, and the corners of what they leave of a triangle.
    slanted: Slanted,
    found: Vec<Cell>,
    /// The room that those take.
    room: Vec<Held<'a>>,
}

/// The points `x` where `normal . x` is at most a height.
type Side = (Vec3, f64);

/// The part of space that lies in all of these sides, and room for cutting triangles to it.
#[derive(Default)]
struct Slanted {
    sides: Vec<Side>,
    corners: Vec<Vec3>,
    cut: Vec<Vec3>,
}

impl Slanted {
    /// A box around the part of a triangle that lies inside (Sutherland and Hodgman 1974). What f64 rounds is far less than
    /// the sides reach beyond their planes.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "the walks allow for the rounding"
    )]
    fn bounds(&mut self, triangle: [[f32; 3]; 3]) -> Aabb {
        self.corners.clear();
        self.corners.extend(triangle.map(widen));
        for &(normal, height) in &self.sides {
            let above = |p: &Vec3| dot(normal, *p) - height;
            if self.corners.iter().all(|p| above(p) <= 0.0) {
                continue;
            }
            self.cut.clear();
            for (i, &a) in self.corners.iter().enumerate() {
                let b = self.corners[(i + 1) % self.corners.len()];
                let (from, to) = (above(&a), above(&b));
                if from <= 0.0 {
                    self.cut.push(a);
                }
                if (from <= 0.0) != (to <= 0.0) {
                    self.cut.push(add_scaled(a, from / (from - to), sub(b, a)));
                }
            }
            std::mem::swap(&mut self.corners, &mut self.cut);
        }
        let own = Aabb::of_triangle(triangle);
        let around = self.corners.iter().fold(Aabb::EMPTY, |bounds, p| Aabb {
            min: map([0, 1, 2], |k: usize| bounds.min[k].min(p[k] as f32)),
            max: map([0, 1, 2], |k: usize| bounds.max[k].max(p[k] as f32)),
        });
        common(&around, &own)
    }
}

/// What two boxes have in common.
fn common(a: &Aabb, b: &Aabb) -> Aabb {
    Aabb {
        min: map([0, 1, 2], |k: usize| a.min[k].max(b.min[k])),
        max: map([0, 1, 2], |k: usize| a.max[k].min(b.max[k])),
    }
}

impl Binary for Cells<'_> {
    fn bounds(&self, place: usize) -> Aabb {
        self.found[place].bounds
    }

    fn children(&self, place: usize) -> Option<[usize; 2]> {
        self.found[place].children
    }
}

impl BoxTree<8> {
    /// The tree of boxes around what the cells of a tree of planes hold, with its leaves, its children
    /// [`Self::by_corners`].
    ///
    /// # Errors
    /// [`crate::error::Error::Cancelled`] and [`crate::error::Error::Memory`] when the monitor says so.
    pub fn of_cells(
        tree: &PlaneTree,
        (frame, blocks): (&Frame, &Blocks),
        monitor: &Monitor,
    ) -> Result<Self> {
        let mut cells = Cells {
            tree,
            blocks,
            monitor,
            pad: 4.0 * AXIS_PAD * frame.bounds().magnitude(),
            slanted: Slanted::default(),
            found: Vec::new(),
            room: Vec::new(),
        };
        let space = Aabb {
            min: [f32::NEG_INFINITY; 3],
            max: [f32::INFINITY; 3],
        };
        let Some(root) = cells.gather(tree.root(), &space, 0)? else {
            return Ok(Self::none());
        };
        let boxes = Self::collapsed(&cells, root, |place| {
            monitor.check()?;
            Ok(cells.found[place].leaf)
        })?;
        monitor.take(boxes.bytes())?;
        Ok(boxes.by_corners())
    }
}

/// Cells for which there is room at first.
const FEWEST: usize = 64;

/// So many levels of a tree are shared out among threads. What is found stands in the same order.
const SHARED: u32 = 6;

impl Cells<'_> {
    /// Finds what a subtree holds; returns where its root is, if it holds anything. A node with one child that holds
    /// anything is that child.
    // The depth of the recursion is that of the tree.
    fn gather(&mut self, node: u32, cell: &Aabb, depth: u32) -> Result<Option<usize>> {
        let [first, second] = match self.tree.node(node) {
            Node::Leaf { first, count } => {
                self.monitor.check()?;
                let bounds = self.inside((first, count), cell);
                let number = u32::try_from(count).expect("bounded by the scene");
                return if bounds.is_empty() {
                    Ok(None)
                } else {
                    self.push(bounds, None, (first, number)).map(Some)
                };
            }
            Node::Axis {
                axis,
                split,
                children,
                ..
            } => {
                let (mut below, mut above) = (*cell, *cell);
                below.max[axis] = split + self.pad;
                above.min[axis] = split - self.pad;
                self.both(children, [(&below, None), (&above, None)], depth)?
            }
            Node::Oblique {
                normal,
                offset,
                children,
                ..
            } => {
                let (normal, height) = (widen(normal), f64::from(offset));
                let pad = f64::from(self.pad);
                let below = (normal, height + pad);
                let above = (normal.map(|x| -x), pad - height);
                self.both(children, [(cell, Some(below)), (cell, Some(above))], depth)?
            }
        };
        let (Some(first), Some(second)) = (first, second) else {
            return Ok(first.or(second));
        };
        let bounds = self.found[first].bounds.union(&self.found[second].bounds);
        self.push(bounds, Some([first, second]), (0, 0)).map(Some)
    }

    /// What the two children of a node hold, each from its cell and the side of the oblique plane that it lies on.
    fn both(
        &mut self,
        children: u32,
        [below, above]: [(&Aabb, Option<Side>); 2],
        depth: u32,
    ) -> Result<[Option<usize>; 2]> {
        if depth >= SHARED {
            return Ok([
                self.part(children, below, depth)?,
                self.part(children + 1, above, depth)?,
            ]);
        }
        let mut other = self.apart();
        let (first, second) = rayon::join(
            || self.part(children, below, depth),
            || other.part(children + 1, above, depth),
        );
        let (first, second) = (first?, second?);
        let moved = self.adopt(&other.found)?;
        Ok([first, second.map(|place| place + moved)])
    }

    fn part(
        &mut self,
        node: u32,
        (cell, side): (&Aabb, Option<Side>),
        depth: u32,
    ) -> Result<Option<usize>> {
        self.slanted.sides.extend(side);
        let found = self.gather(node, cell, depth + 1);
        self.slanted
            .sides
            .truncate(self.slanted.sides.len() - usize::from(side.is_some()));
        found
    }

    /// The same place in the tree, and nothing found yet.
    fn apart(&self) -> Self {
        Self {
            slanted: Slanted {
                sides: self.slanted.sides.clone(),
                ..Slanted::default()
            },
            found: Vec::new(),
            room: Vec::new(),
            ..*self
        }
    }

    /// Takes over what was found apart; returns by how much its places grow.
    fn adopt(&mut self, found: &[Cell]) -> Result<usize> {
        let moved = self.found.len();
        for cell in found {
            let children = cell.children.map(|both| both.map(|place| place + moved));
            self.push(cell.bounds, children, cell.leaf)?;
        }
        Ok(moved)
    }

    /// The box around what a leaf's triangles have inside its cell; empty where they have nothing there.
    fn inside(&mut self, leaf: (u32, usize), cell: &Aabb) -> Aabb {
        let mut bounds = Aabb::EMPTY;
        let slanted = &mut self.slanted;
        self.blocks.each(leaf, |_, corners| {
            let mut part = common(&Aabb::of_triangle(corners), cell);
            if !slanted.sides.is_empty() && !part.is_empty() {
                part = common(&part, &slanted.bounds(corners));
            }
            if !part.is_empty() {
                bounds = bounds.union(&part);
            }
        });
        bounds
    }

    fn push(
        &mut self,
        bounds: Aabb,
        children: Option<[usize; 2]>,
        leaf: (u32, u32),
    ) -> Result<usize> {
        if self.found.len() == self.found.capacity() {
            let more = self.found.len().max(FEWEST);
            self.room.push(self.monitor.hold(more * size_of::<Cell>())?);
            self.found.reserve_exact(more);
        }
        self.found.push(Cell {
            bounds,
            children,
            leaf,
        });
        Ok(self.found.len() - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::oracle::cases::{Random, grid, soup};
    use crate::structure::{Layout, Structure};
    use crate::traverse::nested::Look;
    use std::collections::BTreeSet;

    /// Leaves of a tree of planes that hold anything.
    fn of_planes(tree: &PlaneTree, node: u32, out: &mut BTreeSet<(u32, usize)>) {
        match tree.node(node) {
            Node::Leaf { first, count } => {
                if count > 0 {
                    out.insert((first, count));
                }
            }
            Node::Axis { children, .. } | Node::Oblique { children, .. } => {
                of_planes(tree, children, out);
                of_planes(tree, children + 1, out);
            }
        }
    }

    /// Leaves of a tree of boxes, each with its box.
    fn of_boxes(tree: &BoxTree<8>) -> Vec<((u32, usize), Aabb)> {
        let (mut out, mut open) = (Vec::new(), vec![(tree.top(), Aabb::EMPTY)]);
        while let Some((place, bounds)) = open.pop() {
            if let Look::Leaf { first, count } = tree.look(place, &bounds, &mut open) {
                out.push(((first, count), bounds));
            }
        }
        out
    }

    #[test]
    fn boxes_hold_the_leaves_of_the_planes_and_no_more_than_their_triangles() {
        let mut random = Random(3);
        let many: Vec<_> = (0..900).map(|_| random.point(-1.0, 1.0)).collect();
        for corners in [grid(3, 0.3), many, Vec::new()] {
            for spec in ["kd:traversal=boxes", "bsp-cn-plus-kd:traversal=boxes"] {
                let structure = Structure::of(&soup(corners.clone()), spec);
                let built = structure.built();
                let Layout::Plane(tree, _) = &built.layout else {
                    panic!("a tree of planes")
                };
                let (frame, blocks) = (&built.frame, &built.blocks);
                let boxes = BoxTree::of_cells(tree, (frame, blocks), &Monitor::new()).unwrap();
                let limited = Monitor::new();
                limited.limit_memory(boxes.bytes() as u64);
                let refused = BoxTree::of_cells(tree, (frame, blocks), &limited);
                assert_eq!(
                    refused.is_err(),
                    !corners.is_empty(),
                    "what they are made from counts too"
                );
                let mut expected = BTreeSet::new();
                of_planes(tree, tree.root(), &mut expected);
                let found = of_boxes(&boxes);
                let own: BTreeSet<_> = found.iter().map(|(leaf, _)| *leaf).collect();
                assert_eq!(own.len(), found.len(), "each leaf once");
                assert_eq!(own, expected);
                for (leaf, bounds) in found {
                    let mut around = Aabb::EMPTY;
                    blocks.each(leaf, |_, corners| {
                        around = around.union(&Aabb::of_triangle(corners));
                    });
                    assert_eq!(
                        around.union(&bounds),
                        around,
                        "no larger than its triangles"
                    );
                }
            }
        }
    }

    #[test]
    fn boxes_are_the_same_whatever_the_number_of_threads() {
        let mut random = Random(5);
        let many: Vec<_> = (0..6000).map(|_| random.point(-1.0, 1.0)).collect();
        for spec in ["kd:traversal=boxes", "bsp-wn-plus-kd:traversal=boxes"] {
            let structure = Structure::of(&soup(many.clone()), spec);
            let built = structure.built();
            let Layout::Plane(tree, _) = &built.layout else {
                panic!("a tree of planes")
            };
            let made = |threads: usize| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
                let parts = (&built.frame, &built.blocks);
                (pool.unwrap()).install(|| BoxTree::of_cells(tree, parts, &Monitor::new()).unwrap())
            };
            assert!(made(1) == made(3));
        }
    }

    /// Slivers on one skew line, lying over each other.
    fn slivers(count: usize) -> Vec<[f32; 3]> {
        let mut random = Random(11);
        let mut point = || {
            let t = random.unit();
            [t, 0.7 * t, 0.3 * t]
        };
        (0..3 * count).map(|_| point()).collect()
    }

    /// The leaves of the tree of boxes that walks take through a tree of planes, each with its box.
    fn leaves(structure: &Structure) -> Vec<((u32, usize), Aabb)> {
        let built = structure.built();
        let Layout::Plane(tree, _) = &built.layout else {
            panic!("a tree of planes")
        };
        let parts = (&built.frame, &built.blocks);
        of_boxes(&BoxTree::of_cells(tree, parts, &Monitor::new()).unwrap())
    }

    fn holds(bounds: &Aabb, p: [f32; 3]) -> bool {
        (0..3).all(|k| bounds.min[k] <= p[k] && p[k] <= bounds.max[k])
    }

    #[test]
    fn boxes_leave_out_what_oblique_planes_cut_off() {
        let structure = Structure::of(&soup(slivers(300)), "rbsp:traversal=boxes");
        let leaves = leaves(&structure);
        assert!(leaves.len() > 20, "{}", leaves.len());
        let at = |leaf: &&(_, Aabb)| holds(&leaf.1, [0.5, 0.35, 0.15]);
        let there = leaves.iter().filter(at).count();
        assert!(4 * there < leaves.len(), "{there} of {}", leaves.len());
    }

    #[test]
    fn every_point_of_a_triangle_lies_in_the_box_of_a_leaf_that_holds_it() {
        let mut random = Random(17);
        let many: Vec<_> = (0..600).map(|_| random.point(-1.0, 1.0)).collect();
        for corners in [slivers(150), many] {
            for spec in ["rbsp", "rbsp:clip=0", "bsp-ize", "bsp-random:ties=pbrt"] {
                let structure = Structure::of(&soup(corners.clone()), spec);
                let mut held = vec![Vec::new(); corners.len() / 3];
                for (leaf, bounds) in leaves(&structure) {
                    let blocks = &structure.built().blocks;
                    blocks.each(leaf, |id, _| held[id as usize].push(bounds));
                }
                for _ in 0..4000 {
                    let id = random.below(held.len());
                    let [a, b, c] = [0, 1, 2].map(|i| corners[3 * id + i]);
                    let (s, t) = (random.unit(), random.unit());
                    let p = [0, 1, 2]
                        .map(|k: usize| a[k] + s * (b[k] - a[k]) + (1.0 - s) * t * (c[k] - a[k]));
                    // Slivers without area are in no leaf.
                    let found =
                        held[id].is_empty() || held[id].iter().any(|bounds| holds(bounds, p));
                    assert!(found, "{spec}: {id} {p:?}");
                }
            }
        }
    }
}
