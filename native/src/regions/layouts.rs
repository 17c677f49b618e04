// SPDX-License-Identifier: GPL-3.0-or-later
//! Each layout as nodes that cover regions.

use super::{Cells, Found, Region};
use crate::build::cell::{Direction, Plane};
use crate::build::grid::Grid;
use crate::build::octree_nodes::Octree;
use crate::build::plane_tree::{Node, PlaneTree};
use crate::build::slanted_tree::direction;
use crate::geom::Aabb;
use crate::polygons;
use crate::traverse::nested::{self, Look, Nested};
use crate::traverse::slant_tree::{Kind, SlantTree};

impl Cells for PlaneTree {
    type Place = u32;

    fn top(&self, bounds: Aabb) -> (u32, Region) {
        (self.root(), Region::of_scene(bounds))
    }

    fn look(&self, place: u32, region: &Region) -> Found<u32> {
        let (direction, offset, children, kind) = match self.node(place) {
            Node::Leaf { first, count } => return leaf(first, count),
            Node::Axis {
                axis,
                split,
                children,
                ..
            } => {
                #[expect(clippy::cast_possible_truncation, reason = "an axis")]
                let kind = axis as u8;
                (Direction::Axis(axis), split, children, kind)
            }
            Node::Oblique {
                normal,
                offset,
                children,
                ..
            } => (
                Direction::Oblique(normal),
                offset,
                children,
                polygons::OBLIQUE,
            ),
        };
        let plane = Plane { direction, offset };
        let [below, above] = region.split(plane);
        Found {
            leaf: None,
            planes: vec![(plane, kind)],
            children: vec![(children, below), (children + 1, above)],
        }
    }
}

impl Cells for Octree {
    type Place = (u32, [u32; 3]);

    fn top(&self, _: Aabb) -> (Self::Place, Region) {
        let root = self.node(0);
        ((0, [0; 3]), Region::of_scene(self.cell(root, [0; 3])))
    }

    fn look(&self, (index, place): Self::Place, region: &Region) -> Found<Self::Place> {
        let node = self.node(index);
        if !node.is_inner() {
            let (first, count) = node.blocks();
            return leaf(first, count);
        }
        let half = 1 << (self.cube().depth - node.level() - 1);
        let children = (0..8).map(|octant| {
            let place = std::array::from_fn(|k| place[k] + half * (octant >> k & 1));
            let index = node.children() + octant;
            let cell = self.cell(self.node(index), place);
            ((index, place), region.part(cell))
        });
        let bounds = self.cell(node, place);
        let planes = (0..3).map(|k| {
            let plane = Plane {
                direction: Direction::Axis(k),
                offset: bounds.min[k] + 0.5 * (bounds.max[k] - bounds.min[k]),
            };
            (plane, polygons::OCTANT)
        });
        Found {
            leaf: None,
            planes: planes.collect(),
            children: children.collect(),
        }
    }
}

/// A grid as a tree: slices along x, in each of them rows along y, and in those the cells.
impl Cells for Grid {
    /// As many coordinates as there are levels above, and how many these are.
    type Place = ([usize; 3], usize);

    fn top(&self, bounds: Aabb) -> (Self::Place, Region) {
        (([0; 3], 0), Region::of_scene(bounds))
    }

    fn look(&self, (at, axis): Self::Place, region: &Region) -> Found<Self::Place> {
        if axis == 3 {
            let (first, count) = self.cell(at);
            return leaf(first, count);
        }
        let bounds = region.bounds().expect("a box within a grid");
        let walls = self.walls(axis);
        let planes = walls[1..self.count(axis)].iter().map(|&offset| {
            #[expect(clippy::cast_possible_truncation, reason = "an axis")]
            let kind = axis as u8;
            let direction = Direction::Axis(axis);
            (Plane { direction, offset }, kind)
        });
        let children = (0..self.count(axis)).map(|number| {
            let (mut at, mut part) = (at, bounds);
            at[axis] = number;
            part.min[axis] = walls[number];
            part.max[axis] = walls[number + 1];
            ((at, axis + 1), region.part(part))
        });
        Found {
            leaf: None,
            planes: planes.collect(),
            children: children.collect(),
        }
    }
}

impl Cells for SlantTree {
    type Place = u32;

    fn top(&self, bounds: Aabb) -> (u32, Region) {
        (0, Region::of_scene(bounds))
    }

    fn look(&self, place: u32, region: &Region) -> Found<u32> {
        let (k, alone, planes, link) = match self.kind(place) {
            Kind::Leaf { first, count } => return leaf(first, count),
            Kind::Inner {
                direction,
                alone,
                planes,
                link,
            } => (direction, alone, planes, link),
        };
        let kind = if k < 3 {
            polygons::SLAB
        } else {
            polygons::OBLIQUE
        };
        let planes = planes.map(|offset| Plane {
            direction: direction(k),
            offset,
        });
        let children = if alone {
            let [_, above] = region.split(planes[0]);
            let [inside, _] = above.split(planes[1]);
            vec![(link, inside)]
        } else {
            let ([below, _], [_, above]) = (region.split(planes[0]), region.split(planes[1]));
            vec![(link, below), (link + 1, above)]
        };
        Found {
            leaf: None,
            planes: planes.map(|plane| (plane, kind)).to_vec(),
            children,
        }
    }
}

/// A tree of boxes or slabs.
pub struct Boxes<'a>(pub &'a dyn Nested);

impl Cells for Boxes<'_> {
    type Place = nested::Place;

    fn top(&self, bounds: Aabb) -> (nested::Place, Region) {
        (self.0.top(), Region::of_scene(bounds))
    }

    fn look(&self, place: nested::Place, region: &Region) -> Found<nested::Place> {
        let mut children = Vec::new();
        let bounds = region.bounds().expect("a box within a tree of boxes");
        let look = self.0.look(place, &bounds, &mut children);
        let planes = match look {
            Look::Leaf { first, count } => return leaf(first, count),
            Look::Boxes => Vec::new(),
            Look::Slabs { axis } => children
                .iter()
                .flat_map(|(_, child)| [child.min[axis], child.max[axis]])
                .map(|offset| {
                    let direction = Direction::Axis(axis);
                    (Plane { direction, offset }, polygons::SLAB)
                })
                .collect(),
        };
        let regions = children
            .into_iter()
            .map(|(place, bounds)| (place, region.part(bounds)));
        Found {
            leaf: None,
            planes,
            children: regions.collect(),
        }
    }
}

fn leaf<P>(first: u32, count: usize) -> Found<P> {
    Found {
        leaf: Some((first, count)),
        planes: Vec::new(),
        children: Vec::new(),
    }
}
