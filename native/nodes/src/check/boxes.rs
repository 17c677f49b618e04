// SPDX-License-Identifier: GPL-3.0-or-later
//! Checks the boxes that are made from a tree of split planes.

use crate::box_tree::BoxTree;
use crate::check::objects::contains;
use crate::nested::{Look, visit};
use crate::plane_tree::MAX_DEPTH;
use crate::tree::Body;

/// Each triangle's corners lie in boxes of leaves that hold it, and boxes inside those above them.
pub fn boxes(body: &Body<'_>, boxes: &BoxTree<8>, broken: &mut Vec<String>) {
    let (frame, scene) = (body.frame, body.scene);
    // A bit for each corner that was found.
    let mut found = vec![0_u8; scene.len()];
    visit(
        boxes,
        frame.bounds(),
        |(_, region), depth, look, children| {
            if depth > MAX_DEPTH {
                broken.push(format!("a box lies at depth {depth}, beyond {MAX_DEPTH}"));
            }
            // Each child must lie inside its parent.
            for (_, child) in children {
                if !contains(region, child) {
                    broken.push(format!(
                        "the box {child:?} leaves that above it, {region:?}"
                    ));
                }
            }
            let Look::Leaf { first, count } = look else {
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
    // All three vertices of each triangle must have been found.
    for &id in scene.live() {
        if found[id as usize] != 0b111 {
            broken.push(format!(
                "a corner of triangle {id} lies in no box of a leaf that holds it"
            ));
        }
    }
}
