// SPDX-License-Identifier: GPL-3.0-or-later
//! What nodes cover, whatever their layout: convex regions with their faces, for drawing and for
//! following a ray. Walks do not come here; all arithmetic is plain f64.

use crate::build::octree_nodes::Octree;
use crate::build::plane_tree::{Node, PlaneTree};
use crate::geom::Aabb;
use crate::polygons;
use crate::structure::{Layout, Structure};
use crate::traverse::nested::{self, Look, Nested};

/// A point or a vector.
pub type Point = [f64; 3];

/// A polygon by its corners, in order around it.
pub type Face = Vec<Point>;

/// A half-space, `normal . x <= offset`, or the plane that bounds it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// Of about unit length.
    pub normal: Point,
    /// Height along the normal.
    pub offset: f64,
}

impl Plane {
    fn of_axis(axis: usize, at: f32) -> Self {
        let mut normal = [0.0; 3];
        normal[axis] = 1.0;
        Self {
            normal,
            offset: f64::from(at),
        }
    }

    fn flipped(self) -> Self {
        Self {
            normal: self.normal.map(|x| -x),
            offset: -self.offset,
        }
    }

    fn height(&self, p: Point) -> f64 {
        dot(self.normal, p) - self.offset
    }
}

/// A straight line in the frame of a structure, `origin + t direction`.
#[derive(Debug, Clone, Copy)]
pub struct Line {
    /// Where `t` is 0.
    pub origin: Point,
    /// The way that it goes in one unit of `t`.
    pub direction: Point,
}

impl Line {
    /// Where it crosses a plane; not finite when it runs along it.
    pub fn crosses(&self, plane: &Plane) -> f64 {
        -plane.height(self.origin) / dot(plane.normal, self.direction)
    }
}

/// What a node covers: a box, cut by oblique planes. In the frame of its structure.
#[derive(Debug, Clone, PartialEq)]
pub struct Region {
    /// The box.
    pub bounds: Aabb,
    /// The region lies below each of these.
    pub cuts: Vec<Plane>,
}

impl Region {
    /// A box.
    pub fn of_box(bounds: Aabb) -> Self {
        Self {
            bounds,
            cuts: Vec::new(),
        }
    }

    fn below(&self, cut: Plane) -> Self {
        let mut part = self.clone();
        part.cuts.push(cut);
        part
    }

    /// The part of an interval of a line that lies inside, ends included.
    pub fn interval(&self, line: &Line, (mut from, mut to): (f64, f64)) -> Option<(f64, f64)> {
        let sides = (0..3).flat_map(|k| {
            [
                Plane::of_axis(k, self.bounds.min[k]).flipped(),
                Plane::of_axis(k, self.bounds.max[k]),
            ]
        });
        for side in sides.chain(self.cuts.iter().copied()) {
            let speed = dot(side.normal, line.direction);
            if speed == 0.0 {
                if side.height(line.origin) > 0.0 {
                    return None;
                }
            } else if speed > 0.0 {
                to = to.min(line.crosses(&side));
            } else {
                from = from.max(line.crosses(&side));
            }
        }
        (from <= to).then_some((from, to))
    }

    /// All faces.
    pub fn faces(&self) -> Vec<Face> {
        let mut faces = box_faces(&self.bounds);
        for cut in &self.cuts {
            let cap = cut_faces(&mut faces, cut);
            if cap.len() > 2 {
                faces.push(cap);
            }
        }
        faces
    }

    /// The cross section with a plane; fewer than three corners when there is none.
    pub fn section(&self, plane: &Plane) -> Face {
        cut_faces(&mut self.faces(), plane)
    }
}

/// The six faces of a box.
fn box_faces(bounds: &Aabb) -> Vec<Face> {
    let corner = |bits: usize| {
        std::array::from_fn(|k| {
            let end = if bits >> k & 1 == 1 {
                bounds.max[k]
            } else {
                bounds.min[k]
            };
            f64::from(end)
        })
    };
    (0..3)
        .flat_map(|k| [(k, 0), (k, 1 << k)])
        .map(|(k, side)| {
            let (i, j) = (1 << ((k + 1) % 3), 1 << ((k + 2) % 3));
            [0, i, i | j, j].map(|bits| corner(side | bits)).to_vec()
        })
        .collect()
}

/// Takes away what lies above a plane; returns the cross section.
fn cut_faces(faces: &mut Vec<Face>, plane: &Plane) -> Face {
    let mut section = Vec::new();
    for face in faces.iter_mut() {
        let mut kept = Vec::with_capacity(face.len() + 1);
        for (i, &a) in face.iter().enumerate() {
            let b = face[(i + 1) % face.len()];
            let (x, y) = (plane.height(a), plane.height(b));
            if x <= 0.0 {
                kept.push(a);
            }
            if x == 0.0 {
                section.push(a);
            }
            if (x < 0.0 && y > 0.0) || (x > 0.0 && y < 0.0) {
                let t = x / (x - y);
                let p = std::array::from_fn(|k| a[k] + t * (b[k] - a[k]));
                kept.push(p);
                section.push(p);
            }
        }
        *face = kept;
    }
    faces.retain(|face| face.len() > 2);
    ordered(section, plane.normal)
}

/// Points of a convex polygon in order around it, each once.
fn ordered(mut points: Vec<Point>, normal: Point) -> Face {
    if points.len() < 3 {
        return points;
    }
    let n = points.len() as f64;
    let middle: Point = std::array::from_fn(|k| points.iter().map(|p| p[k]).sum::<f64>() / n);
    let across = if normal[0].abs() < 0.6 {
        [1.0, 0.0, 0.0]
    } else {
        [0.0, 1.0, 0.0]
    };
    let u = cross(normal, across);
    let v = cross(normal, u);
    let angle = |p: &Point| {
        let way: Point = std::array::from_fn(|k| p[k] - middle[k]);
        dot(way, v).atan2(dot(way, u))
    };
    points.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
    let size = points
        .iter()
        .flat_map(|p| (0..3).map(|k| (p[k] - middle[k]).abs()))
        .fold(0.0, f64::max);
    let same = |a: &Point, b: &Point| (0..3).all(|k| (a[k] - b[k]).abs() <= 1e-9 * size);
    points.dedup_by(|b, a| same(a, b));
    while points.len() > 1 && same(&points[0], &points[points.len() - 1]) {
        points.pop();
    }
    points
}

fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: Point, b: Point) -> Point {
    std::array::from_fn(|k| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        a[i] * b[j] - a[j] * b[i]
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
        (self.root(), Region::of_box(bounds))
    }

    fn look(&self, place: u32, region: &Region) -> Found<u32> {
        match self.node(place) {
            Node::Leaf { first, count } => leaf(first, count),
            Node::Axis {
                axis,
                split,
                children,
                ..
            } => {
                let (mut below, mut above) = (region.clone(), region.clone());
                below.bounds.max[axis] = split;
                above.bounds.min[axis] = split;
                #[expect(clippy::cast_possible_truncation, reason = "an axis")]
                let kind = axis as u8;
                Found {
                    leaf: None,
                    planes: vec![(Plane::of_axis(axis, split), kind)],
                    children: vec![(children, below), (children + 1, above)],
                }
            }
            Node::Oblique {
                normal,
                offset,
                children,
                ..
            } => {
                let plane = Plane {
                    normal: normal.map(f64::from),
                    offset: f64::from(offset),
                };
                Found {
                    leaf: None,
                    planes: vec![(plane, polygons::OBLIQUE)],
                    children: vec![
                        (children, region.below(plane)),
                        (children + 1, region.below(plane.flipped())),
                    ],
                }
            }
        }
    }
}

impl Cells for Octree {
    type Place = (u32, [u32; 3]);

    fn top(&self, _: Aabb) -> (Self::Place, Region) {
        let root = self.node(0);
        ((0, [0; 3]), Region::of_box(self.cell(root, [0; 3])))
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
            ((index, place), Region::of_box(cell))
        });
        let bounds = &region.bounds;
        let planes = (0..3).map(|k| {
            let middle = bounds.min[k] + 0.5 * (bounds.max[k] - bounds.min[k]);
            (Plane::of_axis(k, middle), polygons::OCTANT)
        });
        Found {
            leaf: None,
            planes: planes.collect(),
            children: children.collect(),
        }
    }
}

/// A tree of boxes or slabs.
pub struct Boxes<'a>(pub &'a dyn Nested);

impl Cells for Boxes<'_> {
    type Place = nested::Place;

    fn top(&self, bounds: Aabb) -> (nested::Place, Region) {
        (self.0.top(), Region::of_box(bounds))
    }

    fn look(&self, place: nested::Place, region: &Region) -> Found<nested::Place> {
        let mut children = Vec::new();
        let look = self.0.look(place, &region.bounds, &mut children);
        let planes = match look {
            Look::Leaf { first, count } => return leaf(first, count),
            Look::Boxes => Vec::new(),
            Look::Slabs { axis } => children
                .iter()
                .flat_map(|(_, child)| [child.min[axis], child.max[axis]])
                .map(|at| (Plane::of_axis(axis, at), polygons::SLAB))
                .collect(),
        };
        let regions = children
            .into_iter()
            .map(|(place, bounds)| (place, Region::of_box(bounds)));
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
        Layout::Plane(tree, _) => task.run(tree),
        Layout::Objects(tree) => task.run(&Boxes(tree.nested())),
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
        Region::of_box(Aabb {
            min: [0.0; 3],
            max: [1.0; 3],
        })
    }

    fn area(face: &Face) -> f64 {
        let mut sum = [0.0; 3];
        for pair in face[1..].windows(2) {
            let side = |p: Point| std::array::from_fn(|k| p[k] - face[0][k]);
            let part = cross(side(pair[0]), side(pair[1]));
            for k in 0..3 {
                sum[k] += 0.5 * part[k];
            }
        }
        dot(sum, sum).sqrt()
    }

    #[test]
    fn a_cut_corner_leaves_seven_faces_of_the_right_areas() {
        let s = 3.0_f64.sqrt();
        let cut = Plane {
            normal: [1.0 / s; 3],
            offset: 2.5 / s,
        };
        let faces = unit().below(cut).faces();
        assert_eq!(faces.len(), 7);
        let total: f64 = faces.iter().map(area).sum();
        let cap = 0.125 * s; // a triangle with sides of sqrt(2) / 2
        assert!((total - (6.0 - 3.0 * 0.125 + cap)).abs() < 1e-12, "{total}");
        assert_eq!(unit().section(&cut).len(), 3);
    }

    #[test]
    fn a_section_through_the_middle_is_a_hexagon() {
        let s = 3.0_f64.sqrt();
        let plane = Plane {
            normal: [1.0 / s; 3],
            offset: 1.5 / s,
        };
        assert_eq!(unit().section(&plane).len(), 6);
        assert_eq!(unit().section(&Plane::of_axis(1, 0.25)).len(), 4);
        assert!(unit().section(&Plane::of_axis(1, 2.0)).len() < 3);
    }

    #[test]
    fn a_cut_through_an_edge_keeps_a_wedge() {
        let s = 2.0_f64.sqrt();
        let cut = Plane {
            normal: [1.0 / s, 1.0 / s, 0.0],
            offset: 1.0 / s,
        };
        let total: f64 = unit().below(cut).faces().iter().map(area).sum();
        assert!((total - (3.0 + s)).abs() < 1e-12, "{total}");
    }

    #[test]
    fn intervals_end_where_the_region_does() {
        let s = 2.0_f64.sqrt();
        let cut = Plane {
            normal: [1.0 / s, 1.0 / s, 0.0],
            offset: 1.0 / s,
        };
        let line = Line {
            origin: [-1.0, 0.25, 0.5],
            direction: [2.0, 0.0, 0.0],
        };
        let all = (f64::NEG_INFINITY, f64::INFINITY);
        assert_eq!(unit().interval(&line, all), Some((0.5, 1.0)));
        let (from, to) = unit().below(cut).interval(&line, all).unwrap();
        assert!((from - 0.5).abs() < 1e-12 && (to - 0.875).abs() < 1e-12);
        assert_eq!(unit().interval(&line, (0.6, 0.7)), Some((0.6, 0.7)));
        assert_eq!(unit().interval(&line, (1.5, 2.0)), None);
        let beside = Line {
            origin: [-1.0, 1.25, 0.5],
            ..line
        };
        assert_eq!(unit().interval(&beside, all), None);
    }
}
