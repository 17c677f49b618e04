// SPDX-License-Identifier: GPL-3.0-or-later
//! The split planes of a tree as polygons, each cut to its cell: what the overlay draws.

use crate::geom::Aabb;
use crate::geom::vec3::Vec3;
use crate::regions::{Cells, rectangle};
use crate::structure::{Layout, Structure};
use crate::traverse::nested::{Look, Nested};
use crate::traverse::objects::Objects;

/// Kind of an oblique plane.
pub const OBLIQUE: u8 = 3;
/// Kind of a plane that bounds a child of an interval hierarchy.
pub const SLAB: u8 = 4;
/// Kind of a mid plane of an octant.
pub const OCTANT: u8 = 5;
/// Kind of a face of a box.
const BOX: u8 = 6;

/// Convex polygons in the scene's frame.
#[derive(Debug, Clone, Default)]
pub struct Polygons {
    /// Corners of all polygons, one after another.
    pub vertices: Vec<[f32; 3]>,
    /// Where each polygon begins in `vertices`, and one more entry for the end.
    pub offsets: Vec<u32>,
    /// Depth of each polygon's node; the root has depth 0.
    pub depths: Vec<u32>,
    /// What each polygon is: 0, 1, 2 the plane of an axis; 3 oblique; 4 one of the planes
    /// between which a child lies; 5 octant; 6 a face of a box.
    pub kinds: Vec<u8>,
    /// How many polygons within `max_depth` were left out because of `max_count`.
    pub hidden: usize,
}

/// The split planes of all nodes down to `max_depth`, breadth first, at most `max_count` of them.
pub fn split_polygons(structure: &Structure, max_depth: usize, max_count: usize) -> Polygons {
    let mut polygons = Polygons {
        offsets: vec![0],
        ..Polygons::default()
    };
    match &structure.built().layout {
        Layout::Brute => {}
        Layout::Lazy(_) => unreachable!("what is built is whole"),
        Layout::Plane(tree, _) => {
            planes(structure, tree, (max_depth, max_count), &mut polygons);
        }
        Layout::Grid(grid) => {
            planes(structure, grid, (max_depth, max_count), &mut polygons);
        }
        Layout::Objects(Objects::Slanted(tree)) => {
            planes(structure, tree, (max_depth, max_count), &mut polygons);
        }
        Layout::Objects(tree) => {
            object_tree(
                structure,
                tree.nested(),
                (max_depth, max_count),
                &mut polygons,
            );
        }
        Layout::OctreeParam(tree)
        | Layout::OctreeNet(tree)
        | Layout::OctreeBeam(tree, _)
        | Layout::OctreeSamet(tree)
        | Layout::OctreeGlassner(tree) => {
            planes(structure, tree, (max_depth, max_count), &mut polygons);
        }
    }
    polygons
}

/// The planes that nodes state, each cut to its node.
fn planes<T: Cells>(
    structure: &Structure,
    tree: &T,
    (max_depth, max_count): (usize, usize),
    out: &mut Polygons,
) {
    let frame = &structure.built().frame;
    let mut level = vec![tree.top(frame.bounds())];
    for depth in 0..=max_depth {
        let mut next = Vec::new();
        for (place, region) in level {
            let mut found = tree.look(place, &region);
            for (plane, kind) in &found.planes {
                let corners = region.section(plane);
                if !corners.is_empty() {
                    let corners = corners.into_iter().map(|p| frame.to_scene(narrow(p)));
                    out.push(corners, (depth, *kind), max_count);
                }
            }
            next.append(&mut found.children);
        }
        level = next;
    }
}

#[expect(clippy::cast_possible_truncation, reason = "for drawing")]
fn narrow(p: Vec3) -> [f32; 3] {
    p.map(|x| x as f32)
}

/// Boxes as six rectangles each, with the depth of the box's own node; slabs as the planes that cut
/// something off the node's region, each cut to that region.
fn object_tree(
    structure: &Structure,
    tree: &dyn Nested,
    (max_depth, max_count): (usize, usize),
    out: &mut Polygons,
) {
    let frame = &structure.built().frame;
    let mut level = vec![(tree.top(), frame.bounds())];
    let mut children = Vec::new();
    for depth in 0..=max_depth {
        let mut next = Vec::new();
        for (place, region) in level {
            children.clear();
            let look = tree.look(place, &region, &mut children);
            let mut draw = |within: &Aabb, axis: usize, at: f32, kind: (usize, u8)| {
                let corners = rectangle(within, axis, at).map(|p| frame.to_scene(narrow(p)));
                out.push(corners, kind, max_count);
            };
            for (_, child) in children.iter().filter(|(_, child)| !child.is_empty()) {
                match look {
                    Look::Boxes if depth < max_depth => {
                        for axis in 0..3 {
                            draw(child, axis, child.min[axis], (depth + 1, BOX));
                            draw(child, axis, child.max[axis], (depth + 1, BOX));
                        }
                    }
                    Look::Slabs { axis } => {
                        let pairs = [
                            (region.min[axis], child.min[axis]),
                            (region.max[axis], child.max[axis]),
                        ];
                        for (_, at) in pairs.into_iter().filter(|(old, new)| old != new) {
                            draw(&region, axis, at, (depth, SLAB));
                        }
                    }
                    _ => {}
                }
            }
            next.append(&mut children);
        }
        level = next;
    }
}

impl Polygons {
    /// Appends a polygon, unless there are enough.
    fn push(
        &mut self,
        corners: impl IntoIterator<Item = [f32; 3]>,
        (depth, kind): (usize, u8),
        max_count: usize,
    ) {
        if self.kinds.len() >= max_count {
            self.hidden += 1;
            return;
        }
        self.vertices.extend(corners);
        #[expect(clippy::cast_possible_truncation, reason = "bounded by max_count")]
        self.offsets.push(self.vertices.len() as u32);
        #[expect(clippy::cast_possible_truncation, reason = "at most 60")]
        self.depths.push(depth as u32);
        self.kinds.push(kind);
    }
}
