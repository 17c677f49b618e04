// SPDX-License-Identifier: GPL-3.0-or-later
//! The split planes of a tree as polygons, each cut to its cell: what the overlay draws.

use crate::build::octree_nodes::Octree;
use crate::build::plane_tree::{Node, PlaneTree};
use crate::geom::Aabb;
use crate::structure::{Layout, Structure};

/// Convex polygons in the scene's frame.
#[derive(Debug, Clone, Default)]
pub struct Polygons {
    /// Corners of all polygons, one after another.
    pub vertices: Vec<[f32; 3]>,
    /// Where each polygon begins in `vertices`, and one more entry for the end.
    pub offsets: Vec<u32>,
    /// Depth of each polygon's node; the root has depth 0.
    pub depths: Vec<u32>,
    /// What each polygon is: 0, 1, 2 the plane of an axis; 3 oblique; 4 slab pair; 5 octant.
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
        Layout::OctreeParam(tree)
        | Layout::OctreeNet(tree)
        | Layout::OctreeBeam(tree, _)
        | Layout::OctreeSamet(tree)
        | Layout::OctreeGlassner(tree) => {
            octree(structure, tree, (max_depth, max_count), &mut polygons);
        }
        Layout::PlaneDir(tree) | Layout::PlaneTaB(tree) => {
            plane_tree(structure, tree, (max_depth, max_count), &mut polygons);
        }
    }
    polygons
}

fn plane_tree(
    structure: &Structure,
    tree: &PlaneTree,
    (max_depth, max_count): (usize, usize),
    out: &mut Polygons,
) {
    let frame = &structure.built().frame;
    let mut level = vec![(tree.root(), frame.bounds())];
    for depth in 0..=max_depth {
        let mut next = Vec::new();
        for (index, cell) in level {
            let Node::Axis {
                axis,
                split,
                children,
                ..
            } = tree.node(index)
            else {
                continue;
            };
            if out.kinds.len() < max_count {
                for corner in rectangle(&cell, axis, split) {
                    out.vertices.push(frame.to_scene(corner));
                }
                #[expect(clippy::cast_possible_truncation, reason = "bounded by max_count")]
                out.offsets.push(out.vertices.len() as u32);
                #[expect(clippy::cast_possible_truncation, reason = "at most 60")]
                out.depths.push(depth as u32);
                #[expect(clippy::cast_possible_truncation, reason = "an axis")]
                out.kinds.push(axis as u8);
            } else {
                out.hidden += 1;
            }
            let (mut below, mut above) = (cell, cell);
            below.max[axis] = split;
            above.min[axis] = split;
            next.extend([(children, below), (children + 1, above)]);
        }
        level = next;
    }
}

/// The three mid planes of every inner octant.
fn octree(
    structure: &Structure,
    tree: &Octree,
    (max_depth, max_count): (usize, usize),
    out: &mut Polygons,
) {
    let frame = &structure.built().frame;
    let mut inner = Vec::new();
    tree.visit(|_, node, place| {
        if node.is_inner() && node.level() as usize <= max_depth {
            inner.push((node.level(), tree.cell(node, place)));
        }
    });
    // Breadth first; the sort is stable.
    inner.sort_by_key(|(level, _)| *level);
    for (level, cell) in inner {
        for axis in 0..3 {
            if out.kinds.len() == max_count {
                out.hidden += 1;
                continue;
            }
            let at = cell.min[axis] + 0.5 * (cell.max[axis] - cell.min[axis]);
            for corner in rectangle(&cell, axis, at) {
                out.vertices.push(frame.to_scene(corner));
            }
            #[expect(clippy::cast_possible_truncation, reason = "bounded by max_count")]
            out.offsets.push(out.vertices.len() as u32);
            out.depths.push(level);
            out.kinds.push(5);
        }
    }
}

/// The cross section of a box, counter-clockwise seen from above the plane.
fn rectangle(cell: &Aabb, axis: usize, at: f32) -> [[f32; 3]; 4] {
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
        corner
    })
}
