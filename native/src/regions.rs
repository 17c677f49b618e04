// SPDX-License-Identifier: GPL-3.0-or-later
//! What nodes cover, whatever their layout: convex regions with their faces, for drawing and for
//! following a ray. Walks do not come here.

use crate::build::cell::{Cell, ConvexCell, Direction, Plane};
use crate::build::grid::Grid;
use crate::build::octree_nodes::Octree;
use crate::build::plane_tree::{Node, PlaneTree};
use crate::build::slanted_tree::direction;
use crate::geom::Aabb;
use crate::geom::vec3::{Vec3, dot, widen};
use crate::polygons;
use crate::structure::{Layout, Structure};
use crate::traverse::nested::{self, Look, Nested};
use crate::traverse::objects::Objects;
use crate::traverse::slant_tree::{Kind, SlantTree};

/// A polygon by its corners, in order around it.
pub type Face = Vec<Vec3>;

/// A straight line in the frame of a structure, `origin + t direction`.
#[derive(Debug, Clone, Copy)]
pub struct Line {
    /// Where `t` is 0.
    pub origin: Vec3,
    /// The way that it goes in one unit of `t`.
    pub direction: Vec3,
}

impl Line {
    /// Where it crosses a plane; not finite when it runs along it.
    pub fn crosses(&self, plane: &Plane) -> f64 {
        self.reaches(widen(plane.direction.vector()), f64::from(plane.offset))
    }

    fn reaches(&self, normal: Vec3, offset: f64) -> f64 {
        (offset - dot(normal, self.origin)) / dot(normal, self.direction)
    }
}

/// What a node covers, in the frame of its structure.
#[derive(Debug, Clone)]
pub struct Region(ConvexCell);

impl Region {
    /// The box of a whole scene.
    pub fn of_scene(bounds: Aabb) -> Self {
        Self(ConvexCell::from_box(bounds, bounds.magnitude()))
    }

    /// A box inside a region of the same scene.
    fn part(&self, bounds: Aabb) -> Self {
        Self(ConvexCell::from_box(bounds, self.0.magnitude()))
    }

    /// The region, if it is a box.
    pub fn bounds(&self) -> Option<Aabb> {
        match &self.0 {
            ConvexCell::Box(flat) => Some(flat.bounds()),
            ConvexCell::Polytope(_) => None,
        }
    }

    /// The part of an interval of a line that lies inside, ends included.
    pub fn interval(&self, line: &Line, (mut from, mut to): (f64, f64)) -> Option<(f64, f64)> {
        let mut sides: Vec<(Vec3, f64)> = Vec::with_capacity(8);
        if let Some(bounds) = self.bounds() {
            for k in 0..3 {
                let axis = widen(Direction::Axis(k).vector());
                sides.push((axis.map(|x| -x), -f64::from(bounds.min[k])));
                sides.push((axis, f64::from(bounds.max[k])));
            }
        } else {
            let cell = self.0.polytope();
            for facet in cell.facets() {
                let corner = cell.corners(facet).next().expect("a face has corners");
                sides.push((facet.normal, dot(facet.normal, corner)));
            }
        }
        for (normal, offset) in sides {
            let speed = dot(normal, line.direction);
            if speed == 0.0 {
                if dot(normal, line.origin) > offset {
                    return None;
                }
            } else if speed > 0.0 {
                to = to.min(line.reaches(normal, offset));
            } else {
                from = from.max(line.reaches(normal, offset));
            }
        }
        (from <= to).then_some((from, to))
    }

    /// All faces.
    pub fn faces(&self) -> Vec<Face> {
        let cell = self.0.polytope();
        let corners = |facet| cell.corners(facet).collect();
        cell.facets().iter().map(corners).collect()
    }

    /// The cross section with a plane, counter-clockwise seen from above it; empty when there is none, and
    /// where rounding lost it.
    pub fn section(&self, plane: &Plane) -> Face {
        if let (Some(bounds), Direction::Axis(axis)) = (self.bounds(), plane.direction) {
            let inside = bounds.min[axis] <= plane.offset && plane.offset <= bounds.max[axis];
            return if inside {
                rectangle(&bounds, axis, plane.offset).to_vec()
            } else {
                Face::new()
            };
        }
        let Some((below, _)) = self.0.polytope().split(*plane) else {
            return Face::new();
        };
        let cap = below.facets().last().expect("a polytope has faces");
        below.corners(cap).collect()
    }

    /// The parts below and above a plane.
    fn split(&self, plane: Plane) -> [Self; 2] {
        let (below, above) = self.0.split(plane);
        [Self(below), Self(above)]
    }
}

/// The cross section of a box, counter-clockwise seen from above the plane.
pub fn rectangle(cell: &Aabb, axis: usize, at: f32) -> [Vec3; 4] {
    let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
    let ends = [
        (cell.min, cell.min),
        (cell.max, cell.min),
        (cell.max, cell.max),
        (cell.min, cell.max),
    ];
    ends.map(|(u, v)| {
        let mut corner = [at; 3];
        corner[i] = u[i];
        corner[j] = v[j];
        widen(corner)
    })
}

/// What is found at a node.
#[derive(Debug, Clone, Default)]
pub struct Found<P> {
    /// For a leaf, where its blocks begin and how many triangles they hold.
    pub leaf: Option<(u32, usize)>,
    /// For an inner node, the planes that it states, each with its kind as in [`polygons`].
    pub planes: Vec<(Plane, u8)>,
    /// Its children and their regions.
    pub children: Vec<(P, Region)>,
}

/// A layout, seen as nodes that cover regions.
pub trait Cells {
    /// Where a node is found.
    type Place: Copy;

    /// The root and its region; `bounds` is the scene's box.
    fn top(&self, bounds: Aabb) -> (Self::Place, Region);

    /// What is found at a node of this region.
    fn look(&self, place: Self::Place, region: &Region) -> Found<Self::Place>;
}

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

/// Something to be done with a layout, whatever it is.
pub trait Task {
    /// What comes out.
    type Result;

    /// Does it.
    fn run<T: Cells>(self, tree: &T) -> Self::Result;
}

/// Does `task` with a structure's tree; `None` when it has none.
pub fn with_cells<K: Task>(structure: &Structure, task: K) -> Option<K::Result> {
    Some(match &structure.built().layout {
        Layout::Brute => return None,
        Layout::Lazy(_) => unreachable!("what is built is whole"),
        Layout::Plane(tree, _) => task.run(tree),
        Layout::Objects(Objects::Slanted(tree)) => task.run(tree),
        Layout::Objects(tree) => task.run(&Boxes(tree.nested())),
        Layout::Grid(grid) => task.run(grid),
        Layout::OctreeParam(tree)
        | Layout::OctreeNet(tree)
        | Layout::OctreeBeam(tree, _)
        | Layout::OctreeSamet(tree)
        | Layout::OctreeGlassner(tree) => task.run(tree),
    })
}

/// A leaf: where it is and what it holds.
#[derive(Debug, Clone, Copy)]
pub struct Leaf<'a> {
    /// Where its blocks begin.
    pub first: u32,
    /// How many triangles they hold.
    pub count: usize,
    /// Of the leaf; the root has depth 0.
    pub depth: usize,
    /// What it covers.
    pub region: &'a Region,
}

/// Visits all leaves in the order of the tree.
pub fn each_leaf<T: Cells>(tree: &T, bounds: Aabb, mut see: impl FnMut(Leaf<'_>)) {
    let (top, whole) = tree.top(bounds);
    let mut waiting = vec![(top, whole, 0)];
    while let Some((place, region, depth)) = waiting.pop() {
        let found = tree.look(place, &region);
        if let Some((first, count)) = found.leaf {
            see(Leaf {
                first,
                count,
                depth,
                region: &region,
            });
        }
        let children = found.children.into_iter().rev();
        waiting.extend(children.map(|(place, region)| (place, region, depth + 1)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit() -> Region {
        Region::of_scene(Aabb {
            min: [0.0; 3],
            max: [1.0; 3],
        })
    }

    /// The plane x + y = 1.
    fn diagonal() -> Plane {
        let s = std::f32::consts::FRAC_1_SQRT_2;
        Plane {
            direction: Direction::Oblique([s, s, 0.0]),
            offset: s,
        }
    }

    #[test]
    fn sections_of_a_box_are_its_corners_cut_off() {
        let s = 1.0 / 3.0_f32.sqrt();
        let at = |offset| Plane {
            direction: Direction::Oblique([s; 3]),
            offset,
        };
        assert_eq!(unit().section(&at(2.5 * s)).len(), 3);
        assert_eq!(unit().section(&at(1.5 * s)).len(), 6);
        assert_eq!(unit().section(&at(3.5 * s)).len(), 0);
        let axis = |offset| Plane {
            direction: Direction::Axis(1),
            offset,
        };
        assert_eq!(unit().section(&axis(0.25)).len(), 4);
        assert_eq!(unit().section(&axis(2.0)).len(), 0);
        let [below, above] = unit().split(at(2.5 * s));
        assert_eq!((below.faces().len(), above.faces().len()), (7, 4));
    }

    #[test]
    fn a_cut_through_an_edge_keeps_a_wedge() {
        let [wedge, _] = unit().split(diagonal());
        assert_eq!(wedge.faces().len(), 5);
    }

    #[test]
    fn intervals_end_where_the_region_does() {
        let line = Line {
            origin: [-1.0, 0.25, 0.5],
            direction: [2.0, 0.0, 0.0],
        };
        let all = (f64::NEG_INFINITY, f64::INFINITY);
        assert_eq!(unit().interval(&line, all), Some((0.5, 1.0)));
        let [wedge, _] = unit().split(diagonal());
        let (from, to) = wedge.interval(&line, all).unwrap();
        assert!((from - 0.5).abs() < 1e-12 && (to - 0.875).abs() < 1e-6);
        assert_eq!(unit().interval(&line, (0.6, 0.7)), Some((0.6, 0.7)));
        assert_eq!(unit().interval(&line, (1.5, 2.0)), None);
        let beside = Line {
            origin: [-1.0, 1.25, 0.5],
            ..line
        };
        assert_eq!(unit().interval(&beside, all), None);
    }
}
