// SPDX-License-Identifier: GPL-3.0-or-later
//! The invariants of octrees: cells, contents, links.

use crate::build::octree_nodes::{Node, OUTSIDE, Octree};
use crate::build::overlap::TriangleBox;
use crate::structure::Structure;
use crate::traverse::bundle::RAYS;
use crate::traverse::{Hit, Order, Ray, Tracer};
use std::collections::BTreeSet;

/// All triangles that some leaf holds.
pub fn leaves(structure: &Structure, tree: &Octree) -> BTreeSet<u32> {
    let mut ids = BTreeSet::new();
    tree.visit(|_, node, _| {
        if !node.is_inner() {
            let (first, count) = node.blocks();
            ids.extend(structure.built().blocks.ids(first, count));
        }
    });
    ids
}

/// Broken invariants, in words.
pub fn octree(structure: &Structure, tree: &Octree, broken: &mut Vec<String>) {
    let shape = structure.shape();
    let cube = tree.cube();
    let (mut inner, mut leaves, mut references, mut linked) = (0, 0, 0, 0);
    tree.visit(|index, node, place| {
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
        // Exact: the same planes in f64.
        let cell = tree.cell(node, place);
        let unit = f64::from(cube.side) / f64::from(1_u32 << cube.depth);
        let edge = f64::from(1_u32 << (cube.depth - node.level())) * unit;
        for (k, steps) in place.into_iter().enumerate() {
            let low = f64::from(cube.corner[k]) + f64::from(steps) * unit;
            if f64::from(cell.min[k]) != low || f64::from(cell.max[k]) != low + edge {
                broken.push(format!("node {index}: its walls are not floats"));
            }
        }
        if node.is_inner() {
            inner += 1;
            for octant in 0..8 {
                let child = tree.node(node.children() + octant);
                let empty = !child.is_inner() && child.blocks().1 == 0;
                if empty != (node.empty_octants() >> octant & 1 == 1) {
                    broken.push(format!("node {index}: octant {octant} is wrongly marked"));
                }
            }
            return;
        }
        leaves += 1;
        references += node.blocks().1;
        contents(structure, tree, (index, node, place), broken);
        if tree.has_links() {
            linked += tree
                .links(node.place())
                .iter()
                .filter(|&&l| l != OUTSIDE)
                .count();
            links(tree, (index, node, place), broken);
        }
    });
    let counted = (inner, leaves, references, linked);
    let stated = (
        shape.nodes_axis,
        shape.leaves,
        shape.references,
        shape.links,
    );
    if counted != stated {
        broken.push(format!(
            "inner nodes, leaves, references and links are {counted:?}, the statistics say {stated:?}"
        ));
    }
}

/// Every pixel of a beam belongs to one cell after the other, and to no two at once: then it has the
/// answer of the single ray. Views from the middle of the scene, which is a corner of cells, and
/// from its lowest corner, in all directions; and parallel ones.
pub fn pixels(structure: &Structure, tree: &Octree, broken: &mut Vec<String>) {
    let frame = &structure.built().frame;
    let bounds = structure.scene().bounds();
    if bounds.is_empty() {
        return;
    }
    let half = 0.5 * tree.cube().side;
    let corner = frame.to_scene(tree.cube().corner.map(|x| x + half));
    let size: [f32; 3] = std::array::from_fn(|k| bounds.max[k] - bounds.min[k]);
    for apex in [corner, bounds.min] {
        for face in 0..6 {
            let (axis, sign) = (face / 2, if face % 2 == 1 { 1.0 } else { -1.0 });
            let mut rays = Vec::with_capacity(4 * RAYS);
            for pixel in 0..2 * RAYS {
                let place = [pixel % 16, pixel / 16].map(|i| i as f32 / 8.0 - 1.0);
                let mut d = [sign; 3];
                (d[(axis + 1) % 3], d[(axis + 2) % 3]) = (place[0], place[1]);
                let mut ray = Ray {
                    o: apex,
                    d,
                    t_min: 0.0,
                    t_max: f32::INFINITY,
                };
                rays.push(ray);
                // The same window, and parallel rays from it.
                ray.o = std::array::from_fn(|k| apex[k] + 0.5 * d[k] * size[k]);
                ray.d = [0.0; 3];
                ray.d[axis] = sign;
                rays.push(ray);
            }
            // The first kind before the second.
            let rays: Vec<_> = (0..2)
                .flat_map(|kind| rays.iter().skip(kind).step_by(2))
                .copied()
                .collect();
            let mut hits = [(); 2].map(|()| vec![Hit::MISS; rays.len()]);
            structure.closest(&rays, &mut hits[0], None);
            structure.closest_ordered(&rays, &mut hits[1], None, Order::Tiles);
            let bits = |h: &Hit| (h.t.to_bits(), h.triangle, h.u.to_bits(), h.v.to_bits());
            let wrong = hits[0]
                .iter()
                .zip(&hits[1])
                .filter(|(a, b)| bits(a) != bits(b));
            match wrong.count() {
                0 => {}
                n => broken.push(format!(
                    "{n} of {} rays got lost in beams from {apex:?}",
                    rays.len()
                )),
            }
        }
    }
}

/// A leaf holds each of its triangles once, and none that is far from its cell.
fn contents(
    structure: &Structure,
    tree: &Octree,
    (index, node, place): (u32, Node, [u32; 3]),
    broken: &mut Vec<String>,
) {
    let (first, count) = node.blocks();
    let ids = structure.built().blocks.ids(first, count);
    if ids.iter().collect::<BTreeSet<_>>().len() != ids.len() {
        broken.push(format!("leaf {index} holds a triangle twice"));
    }
    let frame = &structure.built().frame;
    let cell = tree.cell(node, place);
    let half = 0.5 * (f64::from(cell.max[0]) - f64::from(cell.min[0]));
    let centre = cell.min.map(|x| f64::from(x) + half);
    let margin = f64::from(tree.cube().step_margin(frame));
    for id in ids {
        let corners = structure.scene().corners(id).map(|p| frame.point(p));
        let magnitude = frame.bounds().magnitude();
        if !TriangleBox::new(corners, magnitude).meets(centre, half + 2.0 * margin) {
            broken.push(format!("leaf {index}: triangle {id} lies outside its cell"));
        }
    }
}

/// Each link leads to the node that lies across the face, found from the root by its place; and the
/// neighbour's link leads back, to the leaf or to an ancestor of it.
fn links(tree: &Octree, (index, leaf, place): (u32, Node, [u32; 3]), broken: &mut Vec<String>) {
    let depth = tree.cube().depth;
    let edge = 1_u32 << (depth - leaf.level());
    for (face, link) in tree.links(leaf.place()).iter().enumerate() {
        let (axis, up) = (face / 2, face % 2 == 1);
        let mut across = place;
        let end = if up { 1 << depth } else { 0 };
        if place[axis] + if up { edge } else { 0 } == end {
            if *link != OUTSIDE {
                broken.push(format!("leaf {index}: link {face} should lead outside"));
            }
            continue;
        }
        across[axis] = if up {
            place[axis] + edge
        } else {
            place[axis] - 1
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
        let neighbour = tree.node(expected);
        if !neighbour.is_inner() {
            let back = tree.links(neighbour.place())[face ^ 1];
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
