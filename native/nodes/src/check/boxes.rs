// SPDX-License-Identifier: GPL-3.0-or-later
//! Checks the boxes that are made from a tree of split planes.

use crate::box_tree::BoxTree;
use crate::check::objects::contains;
use crate::nested::{Content, Visit, visit};
use crate::plane_tree::MAX_DEPTH;
use crate::tree::Body;

/// Checks that each vertex of a triangle lies in the box of a leaf with the triangle, and each box inside its parent's.
/// Appends a description of each broken invariant.
pub fn boxes(body: &Body<'_>, boxes: &BoxTree<8>, broken: &mut Vec<String>) {
    let (frame, scene) = (body.frame, body.scene);
    // One bit per vertex that a box contains.
    let mut found = vec![0_u8; scene.len()];
    visit(
        boxes,
        frame.bounds(),
        |Visit {
             region,
             depth,
             content,
             children,
             ..
         }| {
            if body.monitor.is_cancelled() {
                return;
            }
            if depth > MAX_DEPTH {
                broken.push(format!("a box lies at depth {depth}, beyond {MAX_DEPTH}"));
            }
            // Each child must lie inside its parent.
            for (_, child) in children {
                if !contains(region, child) {
                    broken.push(format!(
                        "the box {child:?} extends beyond its parent {region:?}"
                    ));
                }
            }
            // Record the vertices inside the box of a leaf.
            let Content::Leaf { first, count } = content else {
                return;
            };
            for id in body.blocks.ids(first, count) {
                let corners = scene.corners(id).map(|p| frame.point(p));
                for (corner, p) in corners.into_iter().enumerate() {
                    if (0..3).all(|k| region.min[k] <= p[k] && p[k] <= region.max[k]) {
                        found[id as usize] |= 1 << corner;
                    }
                }
            }
        },
    );
    if body.monitor.is_cancelled() {
        return;
    }
    // All three vertices of each triangle must have been found.
    for &id in scene.live() {
        if found[id as usize] != 0b111 {
            broken.push(format!(
                "a vertex of triangle {id} lies in no box of a leaf that holds it"
            ));
        }
    }
}
