// SPDX-License-Identifier: GPL-3.0-or-later
//! The invariants of a built tree, checked from outside: what must hold whatever built it.

use crate::build::plane_tree::{MAX_DEPTH, Node};
use crate::geom::Aabb;
use crate::structure::{Layout, Structure};
use crate::traverse::nested::{Look, Nested, visit};
use crate::traverse::objects::Objects;
use std::collections::BTreeSet;

mod boxes;
mod grid;
mod octree;
mod planes;
mod ropes;
mod slanted;

/// Broken invariants, in words; empty for a sound structure.
pub fn validate(structure: &Structure) -> Vec<String> {
    let mut broken = Vec::new();
    match &structure.built().layout {
        Layout::Brute => {}
        Layout::Lazy(_) => unreachable!("what is built is whole"),
        Layout::Plane(tree, _) => {
            planes::planes(structure, tree, &mut broken);
            if let Some(links) = structure.ropes() {
                ropes::ropes(structure, (tree, links), &mut broken);
            }
            if let Some(own) = structure.boxes() {
                boxes::boxes(structure, own, &mut broken);
            }
        }
        Layout::Objects(Objects::Slanted(tree)) => {
            slanted::slanted(structure, tree, &mut broken);
        }
        Layout::Objects(tree) => object_tree(structure, tree.nested(), &mut broken),
        Layout::Grid(cells) => grid::grid(structure, cells, &mut broken),
        Layout::OctreeParam(tree)
        | Layout::OctreeNet(tree)
        | Layout::OctreeSamet(tree)
        | Layout::OctreeGlassner(tree) => octree::octree(structure, tree, &mut broken),
        Layout::OctreeBeam(tree, _) => {
            octree::octree(structure, tree, &mut broken);
            octree::pixels(structure, tree, &mut broken);
        }
    }
    let count = structure.built().layout.leaves(structure).len();
    if count != structure.scene().live().len() {
        broken.push(format!(
            "{count} triangles are in some leaf, but {} can be hit",
            structure.scene().live().len()
        ));
    }
    broken
}

impl Layout {
    /// All triangles that some leaf holds.
    fn leaves(&self, structure: &Structure) -> BTreeSet<u32> {
        let blocks = &structure.built().blocks;
        match self {
            Self::Brute => blocks
                .ids(0, structure.shape().references)
                .into_iter()
                .collect(),
            Self::Lazy(_) => unreachable!("what is built is whole"),
            Self::OctreeParam(tree)
            | Self::OctreeNet(tree)
            | Self::OctreeBeam(tree, _)
            | Self::OctreeSamet(tree)
            | Self::OctreeGlassner(tree) => octree::leaves(structure, tree),
            Self::Plane(tree, _) => {
                let mut ids = BTreeSet::new();
                tree.visit(|_, node, _| {
                    if let Node::Leaf { first, count } = node {
                        ids.extend(blocks.ids(first, count));
                    }
                });
                ids
            }
            Self::Objects(tree) => nested_ids(structure, tree.nested()),
            Self::Grid(cells) => grid::cells(structure, cells),
        }
    }
}

/// All triangles that some leaf of an object tree holds.
fn nested_ids(structure: &Structure, tree: &dyn Nested) -> BTreeSet<u32> {
    let mut ids = BTreeSet::new();
    visit(tree, structure.built().frame.bounds(), |_, _, look, _| {
        if let Look::Leaf { first, count } = look {
            ids.extend(structure.built().blocks.ids(first, count));
        }
    });
    ids
}

/// Object trees hold each triangle once, inside every box and between all planes on its path.
fn object_tree(structure: &Structure, tree: &dyn Nested, broken: &mut Vec<String>) {
    let (built, scene) = (structure.built(), structure.scene());
    let mut seen = BTreeSet::new();
    let (mut inner, mut leaves, mut references) = (0, 0, 0);
    visit(
        tree,
        built.frame.bounds(),
        |(place, region), depth, look, children| {
            if depth > MAX_DEPTH {
                broken.push(format!("a node lies at depth {depth}, beyond {MAX_DEPTH}"));
            }
            let Look::Leaf { first, count } = look else {
                inner += 1;
                if !tree.nests(place) {
                    broken.push(format!(
                        "the bounds of {region:?} do not hold its children's"
                    ));
                }
                for (_, child) in children {
                    if !contains(region, child) {
                        broken.push(format!(
                            "the region {child:?} leaves its parent's {region:?}"
                        ));
                    }
                }
                return;
            };
            leaves += 1;
            references += count;
            for id in built.blocks.ids(first, count) {
                if !seen.insert(id) {
                    broken.push(format!("triangle {id} lies in two leaves"));
                }
                let corners = scene.corners(id).map(|p| built.frame.point(p));
                let held = tree.holds(place, corners);
                if !held || !contains(region, &Aabb::of_triangle(corners)) {
                    broken.push(format!(
                        "triangle {id} lies partly outside its leaf's region"
                    ));
                }
            }
        },
    );
    let shape = structure.shape();
    let counted = (inner, leaves, references);
    let stated = (shape.nodes_axis, shape.leaves, shape.references);
    if counted != stated {
        broken.push(format!(
            "inner nodes, leaves and references are {counted:?}, the statistics say {stated:?}"
        ));
    }
}

/// Whether the second box lies inside the first.
fn contains(outer: &Aabb, inner: &Aabb) -> bool {
    inner.is_empty() || (0..3).all(|k| outer.min[k] <= inner.min[k] && inner.max[k] <= outer.max[k])
}
