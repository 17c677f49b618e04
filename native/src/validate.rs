// SPDX-License-Identifier: GPL-3.0-or-later
//! The invariants of a built tree, checked from outside: what must hold whatever built it.

use crate::build::plane_tree::{MAX_DEPTH, Node, PlaneTree};
use crate::geom::Aabb;
use crate::structure::{Layout, Structure};
use crate::traverse::nested::{Look, Nested, visit};
use std::collections::BTreeSet;

mod octree;

/// Broken invariants, in words; empty for a sound structure.
pub fn validate(structure: &Structure) -> Vec<String> {
    let mut broken = Vec::new();
    match &structure.built().layout {
        Layout::Brute => {}
        Layout::PlaneDir(tree) | Layout::PlaneTaB(tree) => plane_tree(structure, tree, &mut broken),
        Layout::Box2(tree) => object_tree(structure, tree, &mut broken),
        Layout::Box4(tree) => object_tree(structure, tree, &mut broken),
        Layout::Box8(tree) => object_tree(structure, tree, &mut broken),
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
            Self::OctreeParam(tree)
            | Self::OctreeNet(tree)
            | Self::OctreeBeam(tree, _)
            | Self::OctreeSamet(tree)
            | Self::OctreeGlassner(tree) => octree::leaves(structure, tree),
            Self::PlaneDir(tree) | Self::PlaneTaB(tree) => {
                let mut ids = BTreeSet::new();
                tree.visit(|_, node, _| {
                    if let Node::Leaf { first, count } = node {
                        ids.extend(blocks.ids(first, count));
                    }
                });
                ids
            }
            Self::Box2(tree) => nested_ids(structure, tree),
            Self::Box4(tree) => nested_ids(structure, tree),
            Self::Box8(tree) => nested_ids(structure, tree),
        }
    }
}

/// All triangles that some leaf of an object tree holds.
fn nested_ids(structure: &Structure, tree: &impl Nested) -> BTreeSet<u32> {
    let mut ids = BTreeSet::new();
    visit(tree, structure.built().frame.bounds(), |_, _, look, _| {
        if let Look::Leaf { first, count } = look {
            ids.extend(structure.built().blocks.ids(first, count));
        }
    });
    ids
}

/// Object trees hold each triangle once, inside every box and between all planes on its path.
fn object_tree(structure: &Structure, tree: &impl Nested, broken: &mut Vec<String>) {
    let (built, scene) = (structure.built(), structure.scene());
    let mut seen = BTreeSet::new();
    let (mut inner, mut leaves, mut references) = (0, 0, 0);
    visit(
        tree,
        built.frame.bounds(),
        |region, depth, look, children| {
            if depth > MAX_DEPTH {
                broken.push(format!("a node lies at depth {depth}, beyond {MAX_DEPTH}"));
            }
            let Look::Leaf { first, count } = look else {
                inner += 1;
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
                if !contains(region, &Aabb::of_triangle(corners)) {
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

fn plane_tree(structure: &Structure, tree: &PlaneTree, broken: &mut Vec<String>) {
    let shape = *structure.shape();
    let (mut inner, mut leaves, mut references) = (0, 0, 0);
    let mut cells = vec![structure.built().frame.bounds()];
    tree.visit(|index, node, depth| {
        let cell = cells.pop().unwrap_or(Aabb::EMPTY);
        if depth > MAX_DEPTH {
            broken.push(format!(
                "node {index} lies at depth {depth}, beyond {MAX_DEPTH}"
            ));
        }
        match node {
            Node::Axis { axis, split, .. } => {
                inner += 1;
                if !(cell.min[axis] <= split && split <= cell.max[axis]) {
                    broken.push(format!(
                        "node {index}: the plane {split} lies outside its cell"
                    ));
                }
                let (mut below, mut above) = (cell, cell);
                below.max[axis] = split;
                above.min[axis] = split;
                cells.extend([above, below]);
            }
            Node::Oblique { .. } => inner += 1,
            Node::Leaf { first, count } => {
                leaves += 1;
                references += count;
                let ids = structure.built().blocks.ids(first, count);
                let unique: BTreeSet<_> = ids.iter().collect();
                if unique.len() != ids.len() {
                    broken.push(format!("leaf {index} holds a triangle twice"));
                }
                for id in ids {
                    let frame = &structure.built().frame;
                    let corners = structure.scene().corners(id).map(|p| frame.point(p));
                    let bounds = Aabb::of_triangle(corners);
                    let apart =
                        (0..3).any(|k| bounds.max[k] < cell.min[k] || bounds.min[k] > cell.max[k]);
                    if apart {
                        broken.push(format!("leaf {index}: triangle {id} lies outside its cell"));
                    }
                }
            }
        }
    });
    let counted = (inner, leaves, references);
    let stated = (
        shape.nodes_axis + shape.nodes_oblique,
        shape.leaves,
        shape.references,
    );
    if counted != stated {
        broken.push(format!(
            "inner nodes, leaves and references are {counted:?}, the statistics say {stated:?}"
        ));
    }
}
