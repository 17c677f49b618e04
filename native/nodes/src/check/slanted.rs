// SPDX-License-Identifier: GPL-3.0-or-later
//! Checks hierarchies bounded by oblique planes: each triangle is in one leaf, on the inner side of every plane on
//! its path.

use crate::plane_tree::MAX_DEPTH;
use crate::slant_tree::{SlantKind, SlantSide, SlantTree, between};
use crate::tree::Body;
use std::collections::BTreeSet;

/// Appends a description of each broken invariant.
pub fn slanted(body: &Body<'_>, tree: &SlantTree, broken: &mut Vec<String>) {
    let scene = body.scene;
    let mut seen = BTreeSet::new();
    let (mut axis, mut oblique, mut leaves) = (0, 0, 0);
    // Nodes still to visit, and the planes on the path to each.
    let mut stack = vec![(0, Vec::new())];
    while let Some((index, path)) = stack.pop() {
        if body.monitor.is_cancelled() {
            return;
        }
        // Stop if the links form a cycle.
        if path.len() > 2 * MAX_DEPTH || axis + oblique + leaves > tree.node_count() {
            broken.push(format!(
                "node {index} lies too deep, or the links run in a circle"
            ));
            return;
        }
        match tree.kind(index) {
            // Each triangle must be in one leaf, between all planes on the path.
            SlantKind::Leaf { first, count } => {
                leaves += 1;
                for id in body.blocks.ids(first, count) {
                    if !seen.insert(id) {
                        broken.push(format!("triangle {id} lies in two leaves"));
                    }
                    let corners = scene.corners(id).map(|p| body.frame.point(p));
                    if !between(&path, corners) {
                        broken.push(format!("triangle {id} lies beyond a plane on its path"));
                    }
                }
            }
            SlantKind::Inner {
                direction,
                alone,
                planes,
                link,
            } => {
                *(if direction < 3 {
                    &mut axis
                } else {
                    &mut oblique
                }) += 1;
                // Push a child with its parent's path and its own planes.
                let mut child = |index: u32, more: &[SlantSide]| {
                    let mut path = path.clone();
                    path.extend_from_slice(more);
                    stack.push((index, path));
                };
                let side = |k: usize, above| SlantSide {
                    direction,
                    height: planes[k],
                    above,
                };
                if alone {
                    child(link, &[side(0, true), side(1, false)]);
                } else {
                    // Push the child above first, so that the one below is visited first.
                    child(link + 1, &[side(1, true)]);
                    child(link, &[side(0, false)]);
                }
            }
        }
    }
    // Compare the counts with the structure's statistics.
    let shape = body.shape;
    let counted = (axis, oblique, leaves, seen.len());
    let stated = (
        shape.nodes_axis,
        shape.nodes_oblique,
        shape.leaves,
        shape.references,
    );
    if counted != stated {
        broken.push(format!(
            "nodes along axes, oblique ones, leaves and references are {counted:?}, the statistics are {stated:?}"
        ));
    }
}
