// SPDX-License-Identifier: GPL-3.0-or-later
//! Checks octrees: cells, contents of leaves, neighbour links.

use crate::octree_nodes::{Node, OUTSIDE, Octree};
use crate::tree::Body;
use halfspace_geom::overlap::TriangleBox;
use halfspace_leaf::Leaf;
use std::collections::BTreeSet;

/// Appends a description of each broken invariant.
pub fn octree(body: &Body<'_>, tree: &Octree, broken: &mut Vec<String>) {
    let shape = body.shape;
    let cube = tree.cube();
    let (mut inner, mut leaves, mut references, mut linked) = (0, 0, 0, 0);
    tree.visit(|index, node, corner| {
        if body.monitor.is_cancelled() {
            return;
        }
        let visited = Visited {
            index,
            node,
            corner,
        };
        // Check level and parent.
        if node.level() > cube.depth {
            broken.push(format!("node {index} lies below level {}", cube.depth));
        }
        let parent = tree.node(node.parent());
        if index != 0
            && (parent.level() + 1 != node.level()
                || parent.children() + node.octant() != index
                || !parent.is_inner())
        {
            broken.push(format!("node {index} is not its parent's child"));
        }
        // Compute the same planes in f64, where they are exact.
        let cell = tree.cell(node, corner);
        let unit = f64::from(cube.side) / f64::from(1_u32 << cube.depth);
        let edge = f64::from(1_u32 << (cube.depth - node.level())) * unit;
        for (k, steps) in corner.into_iter().enumerate() {
            let low = f64::from(cube.corner[k]) + f64::from(steps) * unit;
            if f64::from(cell.min[k]) != low || f64::from(cell.max[k]) != low + edge {
                broken.push(format!("node {index}: its walls are not floats"));
            }
        }
        // Check the mask of empty octants of an inner node.
        if node.is_inner() {
            inner += 1;
            for octant in 0..8 {
                let child = tree.node(node.children() + octant);
                let empty = !child.is_inner() && child.blocks().count == 0;
                if empty != (node.empty_octants() >> octant & 1 == 1) {
                    broken.push(format!("node {index}: octant {octant} is wrongly marked"));
                }
            }
            return;
        }
        // Check the triangles and the links of a leaf.
        leaves += 1;
        references += node.blocks().count;
        contents(body, tree, visited, broken);
        if tree.has_links() {
            linked += tree
                .links(node.leaf_index())
                .iter()
                .filter(|&&l| l != OUTSIDE)
                .count();
            links(tree, visited, broken);
        }
    });
    // Compare the counts with the structure's statistics.
    let counted = (inner, leaves, references, linked);
    let stated = (
        shape.nodes_axis,
        shape.leaves,
        shape.references,
        shape.links,
    );
    if counted != stated {
        broken.push(format!(
            "inner nodes, leaves, references and links are {counted:?}, the statistics are {stated:?}"
        ));
    }
}

/// A node on a visit of all nodes.
#[derive(Clone, Copy)]
struct Visited {
    index: u32,
    node: Node,
    /// Lowest corner on the grid of the smallest cells.
    corner: [u32; 3],
}

/// Checks that a leaf holds each of its triangles once, and only triangles within the error margin of its cell.
fn contents(body: &Body<'_>, tree: &Octree, leaf: Visited, broken: &mut Vec<String>) {
    let index = leaf.index;
    let Leaf { first, count } = leaf.node.blocks();
    let ids = body.blocks.ids(first, count);
    if ids.iter().collect::<BTreeSet<_>>().len() != ids.len() {
        broken.push(format!("leaf {index} holds a triangle twice"));
    }
    // Allow twice the margin: one was applied by the builder, one covers rounding here.
    let frame = body.frame;
    let cell = tree.cell(leaf.node, leaf.corner);
    let half = 0.5 * (f64::from(cell.max[0]) - f64::from(cell.min[0]));
    let centre = cell.min.map(|x| f64::from(x) + half);
    let margin = f64::from(tree.cube().step_margin(frame));
    // Each triangle must meet the cell, enlarged by the margin.
    for id in ids {
        let corners = body.scene.corners(id).map(|p| frame.point(p));
        let magnitude = frame.bounds().magnitude();
        if !TriangleBox::new(corners, magnitude).meets(centre, half + 2.0 * margin) {
            broken.push(format!("leaf {index}: triangle {id} lies outside its cell"));
        }
    }
}

/// Checks that each link leads to the node across its face, found from the root by position, and that the
/// neighbour's opposite link leads back to the leaf or to an ancestor of it.
fn links(tree: &Octree, visited: Visited, broken: &mut Vec<String>) {
    let Visited {
        index,
        node: leaf,
        corner,
    } = visited;
    let depth = tree.cube().depth;
    let edge = 1_u32 << (depth - leaf.level());
    for (face, link) in tree.links(leaf.leaf_index()).iter().enumerate() {
        let (axis, up) = (face / 2, face % 2 == 1);
        // Position of the smallest cell across the face.
        let mut across = corner;
        let end = if up { 1 << depth } else { 0 };
        if corner[axis] + if up { edge } else { 0 } == end {
            if *link != OUTSIDE {
                broken.push(format!("leaf {index}: link {face} should lead outside"));
            }
            continue;
        }
        // Descend from the root to the node across the face, at most as deep as the leaf.
        across[axis] = if up {
            corner[axis] + edge
        } else {
            corner[axis] - 1
        };
        let mut expected = 0;
        while tree.node(expected).is_inner() && tree.node(expected).level() < leaf.level() {
            let node = tree.node(expected);
            let bit = depth - node.level() - 1;
            expected = node.children() + (0..3).map(|k| (across[k] >> bit & 1) << k).sum::<u32>();
        }
        if *link != expected {
            broken.push(format!(
                "leaf {index}: link {face} leads to {link}, not {expected}"
            ));
            continue;
        }
        // Follow the ancestors of this leaf to the target of the neighbour's link.
        let neighbour = tree.node(expected);
        if !neighbour.is_inner() {
            let back = tree.links(neighbour.leaf_index())[face ^ 1];
            let mut ancestor = index;
            while ancestor != 0 && ancestor != back {
                ancestor = tree.node(ancestor).parent();
            }
            if ancestor != back {
                broken.push(format!("leaf {index}: neighbour {link} does not link back"));
            }
        }
    }
}
