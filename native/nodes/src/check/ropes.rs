// SPDX-License-Identifier: GPL-3.0-or-later
//! Checks ropes: the leaves behind each link touch the face, cover it, and link back.

use crate::axis_tree::{AxisNode, AxisTree};
use crate::ropes::{Face, OUTSIDE, Ropes, Step};
use crate::tree::Body;
use halfspace_geom::Aabb;
use std::collections::HashMap;

/// Appends a description of each broken invariant.
pub fn ropes(body: &Body<'_>, tree: AxisTree<'_>, ropes: &Ropes, broken: &mut Vec<String>) {
    let bounds = body.frame.bounds();
    // Compute the boxes of the leaves from the split planes alone.
    let mut cells = HashMap::new();
    let mut stack = vec![(tree.root(), bounds)];
    while let Some((node, cell)) = stack.pop() {
        if body.monitor.is_cancelled() {
            return;
        }
        if let AxisNode::Axis {
            axis,
            split,
            children,
            ..
        } = tree.node(node)
        {
            let (mut below, mut above) = (cell, cell);
            below.max[axis] = split;
            above.min[axis] = split;
            stack.extend([(children, below), (children + 1, above)]);
        } else {
            cells.insert(node, cell);
        }
    }
    // Check the links of each leaf.
    let mut links = 0;
    for (&leaf, cell) in &cells {
        if body.monitor.is_cancelled() {
            return;
        }
        for axis in 0..3 {
            for side in 0..2 {
                let link = ropes.links(leaf)[axis][side];
                let wall = [cell.min[axis], cell.max[axis]][side];
                let stored = ropes.walls(leaf)[axis][side];
                // A missing link is correct only at the border of the scene.
                if link == OUTSIDE {
                    let end = [bounds.min[axis], bounds.max[axis]][side];
                    if wall != end || stored != [f32::NEG_INFINITY, f32::INFINITY][side] {
                        broken.push(format!("leaf {leaf}: no link at {wall}, inside the scene"));
                    }
                    continue;
                }
                links += 1;
                // The stored wall must equal that of the cell.
                if stored != wall {
                    broken.push(format!("leaf {leaf}: a wall at {stored}, not at {wall}"));
                }
                // Check that each leaf behind the link touches the face and links back.
                let face = Face { cell, axis, side };
                let mut covered = 0.0;
                for other in behind(tree, ropes, face, link) {
                    let beyond = &cells[&other];
                    let touching = [beyond.max[axis], beyond.min[axis]][side] == wall;
                    let shared = common(cell, beyond, axis);
                    let back = Face {
                        cell: beyond,
                        axis,
                        side: 1 - side,
                    };
                    let returning = ropes.links(other)[axis][1 - side];
                    let returns = returning != OUTSIDE
                        && behind(tree, ropes, back, returning).contains(&leaf);
                    // Flat cells may touch along lines only, which can belong to another link.
                    if !touching || shared > 0.0 && !returns {
                        broken.push(format!("leaf {leaf}: {other} is no neighbour along {axis}"));
                    }
                    covered += shared;
                }
                // The leaves behind the link must cover the whole face.
                let area = common(cell, cell, axis);
                if (covered - area).abs() > 1e-9 * area {
                    broken.push(format!(
                        "leaf {leaf}: {covered} of the face {area} along {axis} is linked"
                    ));
                }
            }
        }
    }
    if links != body.shape.links {
        broken.push(format!(
            "there are {links} links, the statistics count {}",
            body.shape.links
        ));
    }
}

/// Returns the leaves behind a link that touch a face of a leaf, at least along an edge.
fn behind(tree: AxisTree<'_>, ropes: &Ropes, face: Face<'_>, link: u32) -> Vec<u32> {
    let cell = face.cell;
    let mut leaves = Vec::new();
    let mut stack = vec![link];
    while let Some(link) = stack.pop() {
        let Step::Plane {
            axis,
            split,
            children,
        } = ropes.step(tree, link)
        else {
            leaves.push(link);
            continue;
        };
        // A plane parallel to the face: take the child next to the face.
        if axis == face.axis {
            stack.push(children[1 - face.side]);
            continue;
        }
        // A face without extent along this axis lies in at least one of the two children.
        let flat = cell.min[axis] == cell.max[axis];
        if cell.min[axis] < split || flat && cell.min[axis] <= split {
            stack.push(children[0]);
        }
        if cell.max[axis] > split || flat && cell.max[axis] >= split {
            stack.push(children[1]);
        }
    }
    leaves
}

/// Returns the area that two cells have in common, projected along `axis`.
fn common(a: &Aabb, b: &Aabb, axis: usize) -> f64 {
    let length = |k: usize| {
        let (low, high) = (a.min[k].max(b.min[k]), a.max[k].min(b.max[k]));
        (f64::from(high) - f64::from(low)).max(0.0)
    };
    length((axis + 1) % 3) * length((axis + 2) % 3)
}
