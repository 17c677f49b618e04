// SPDX-License-Identifier: GPL-3.0-or-later
//! The invariants of a built tree, checked from outside: what must hold whatever built it.

use crate::build::plane_tree::{MAX_DEPTH, Node, PlaneTree};
use crate::geom::Aabb;
use crate::structure::{Layout, Structure};
use std::collections::BTreeSet;

mod octree;

/// Broken invariants, in words; empty for a sound structure.
pub fn validate(structure: &Structure) -> Vec<String> {
    let mut broken = Vec::new();
    match &structure.built().layout {
        Layout::Brute => {}
        Layout::PlaneDir(tree) | Layout::PlaneTaB(tree) => plane_tree(structure, tree, &mut broken),
        Layout::OctreeParam(tree)
        | Layout::OctreeNet(tree)
        | Layout::OctreeBeam(tree, _)
        | Layout::OctreeSamet(tree)
        | Layout::OctreeGlassner(tree) => octree::octree(structure, tree, &mut broken),
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
        }
    }
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
