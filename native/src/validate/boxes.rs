// SPDX-License-Identifier: GPL-3.0-or-later
//! The boxes that are made from a tree of planes.

use super::contains;
use crate::build::plane_tree::MAX_DEPTH;
use crate::structure::Structure;
use crate::traverse::nested::{Look, visit};
use crate::traverse::plane_boxes::PlaneBoxes;

/// Each triangle's corners lie in boxes of leaves that hold it, and boxes inside those above them.
pub(super) fn boxes(structure: &Structure, boxes: &PlaneBoxes, broken: &mut Vec<String>) {
    let (frame, scene) = (&structure.built().frame, structure.scene());
    // A bit for each corner that was found.
    let mut found = vec![0_u8; scene.len()];
    visit(
        &boxes.tree,
        frame.bounds(),
        |(_, region), depth, look, children| {
            if depth > MAX_DEPTH {
                broken.push(format!("a box lies at depth {depth}, beyond {MAX_DEPTH}"));
            }
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
            for id in boxes.blocks.ids(first, count) {
                let corners = scene.corners(id).map(|p| frame.point(p));
                for (corner, p) in corners.into_iter().enumerate() {
                    if (0..3).all(|k| region.min[k] <= p[k] && p[k] <= region.max[k]) {
                        found[id as usize] |= 1 << corner;
                    }
                }
            }
        },
    );
    for &id in scene.live() {
        if found[id as usize] != 0b111 {
            broken.push(format!(
                "a corner of triangle {id} lies in no box of a leaf that holds it"
            ));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::boxes;
    use crate::oracle::cases::{grid, soup};
    use crate::structure::Structure;

    #[test]
    fn boxes_that_lie_elsewhere_are_told_of() {
        let [structure, other] =
            [0.3, 0.2].map(|size| Structure::of(&soup(grid(4, size)), "kd:traversal=boxes"));
        let mut broken = Vec::new();
        boxes(&structure, structure.boxes().unwrap(), &mut broken);
        assert!(broken.is_empty(), "{broken:?}");
        boxes(&structure, other.boxes().unwrap(), &mut broken);
        let corners = broken.iter().filter(|line| line.contains("a corner of"));
        assert!(corners.count() > 10, "{broken:?}");
    }
}
