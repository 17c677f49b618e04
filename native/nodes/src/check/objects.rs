// SPDX-License-Identifier: GPL-3.0-or-later
//! Checks of object trees: each triangle lies in exactly one leaf, and inside the bounds of every node above it.

use crate::nested::{Content, Nested, Visit, visit};
use crate::plane_tree::MAX_DEPTH;
use crate::tree::Body;
use halfspace_geom::Aabb;
use std::collections::BTreeSet;

/// Appends a description of each broken invariant.
pub fn object_tree(body: &Body<'_>, tree: &dyn Nested, broken: &mut Vec<String>) {
    // Visit all nodes.
    let scene = body.scene;
    let mut seen = BTreeSet::new();
    let (mut inner, mut leaves, mut references) = (0, 0, 0);
    visit(
        tree,
        body.frame.bounds(),
        |Visit {
             node,
             region,
             depth,
             content,
             children,
         }| {
            if body.monitor.is_cancelled() {
                return;
            }
            if depth > MAX_DEPTH {
                broken.push(format!("a node lies at depth {depth}, beyond {MAX_DEPTH}"));
            }
            let Content::Leaf { first, count } = content else {
                // Check that the bounds of an inner node enclose those of its children.
                inner += 1;
                if !tree.encloses_children(node) {
                    broken.push(format!(
                        "the bounds of {region:?} do not hold its children's"
                    ));
                }
                for (_, child) in children {
                    if !contains(region, child) {
                        broken.push(format!(
                            "the region {child:?} extends beyond its parent's {region:?}"
                        ));
                    }
                }
                return;
            };
            // Check that the bounds of a leaf enclose its triangles, which are in no other leaf.
            leaves += 1;
            references += count;
            for id in body.blocks.ids(first, count) {
                if !seen.insert(id) {
                    broken.push(format!("triangle {id} lies in two leaves"));
                }
                let corners = scene.corners(id).map(|p| body.frame.point(p));
                let enclosed = tree.encloses(node, corners);
                if !enclosed || !contains(region, &Aabb::of_triangle(corners)) {
                    broken.push(format!(
                        "triangle {id} lies partly outside its leaf's region"
                    ));
                }
            }
        },
    );
    // Compare the counts with the structure's statistics.
    let shape = body.shape;
    let counted = (inner, leaves, references);
    let stated = (shape.nodes_axis, shape.leaves, shape.references);
    if counted != stated {
        broken.push(format!(
            "inner nodes, leaves and references are {counted:?}, the statistics are {stated:?}"
        ));
    }
}

/// Returns whether the second box lies inside the first.
pub fn contains(outer: &Aabb, inner: &Aabb) -> bool {
    inner.is_empty() || (0..3).all(|k| outer.min[k] <= inner.min[k] && inner.max[k] <= outer.max[k])
}
