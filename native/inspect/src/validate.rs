// SPDX-License-Identifier: GPL-3.0-or-later
//! Checks of the invariants that every built structure satisfies.

use halfspace_geom::cell::Direction;
use halfspace_nodes::tree::Body;
use halfspace_ray::{Hit, Order, Ray, Tracer};
use halfspace_structure::Structure;
use std::collections::BTreeSet;

/// Rays of a tile.
const TILE: usize = 64;

/// Broken invariants, one sentence each; empty for a sound structure.
pub fn validate(structure: &Structure) -> Vec<String> {
    let (built, scene) = (structure.built(), structure.scene());
    let mut broken = Vec::new();
    let shape = structure.shape();
    let body = Body {
        scene,
        frame: &built.frame,
        blocks: &built.leaves,
        shape: &shape,
    };
    let mut ids = BTreeSet::new();
    match &built.tree {
        None => ids.extend(built.leaves.ids(0, shape.references)),
        Some(tree) => {
            tree.validate(&body, &mut broken);
            tree.leaves(&mut |first, count| ids.extend(built.leaves.ids(first, count)));
        }
    }
    for derived in &built.derived {
        derived.tree.validate(&body, &mut broken);
    }
    if built.plan.tiles.is_some() {
        tiles(structure, &mut broken);
    }
    if ids.len() != scene.live().len() {
        broken.push(format!(
            "{} triangles are in some leaf, but {} can be hit",
            ids.len(),
            scene.live().len()
        ));
    }
    broken
}

/// The point where the planes of the root meet, in the scene's frame; its middle along axes without a plane.
fn crossing(structure: &Structure) -> [f32; 3] {
    let built = structure.built();
    let bounds = built.frame.bounds();
    let mut point = [0, 1, 2].map(|k| 0.5 * bounds.min[k] + 0.5 * bounds.max[k]);
    if let Some(cells) = built.tree.as_ref().and_then(|tree| tree.cells()) {
        let (root, region) = cells.root(bounds);
        for (plane, _) in cells.node(root, &region).planes {
            if let Direction::Axis(axis) = plane.direction {
                point[axis] = plane.offset;
            }
        }
    }
    built.frame.to_scene(point)
}

/// Compares every pixel of tiles with its single ray: perspective and parallel views from a corner of cells and from the
/// lowest corner of the scene, along all axes.
fn tiles(structure: &Structure, broken: &mut Vec<String>) {
    let bounds = structure.scene().bounds();
    if bounds.is_empty() {
        return;
    }
    let size: [f32; 3] = std::array::from_fn(|k| bounds.max[k] - bounds.min[k]);
    for apex in [crossing(structure), bounds.min] {
        for face in 0..6 {
            let (axis, sign) = (face / 2, if face % 2 == 1 { 1.0 } else { -1.0 });
            let mut rays = Vec::with_capacity(4 * TILE);
            for pixel in 0..2 * TILE {
                let position = [pixel % 16, pixel / 16].map(|i| i as f32 / 8.0 - 1.0);
                let mut d = [sign; 3];
                (d[(axis + 1) % 3], d[(axis + 2) % 3]) = (position[0], position[1]);
                let mut ray = Ray {
                    o: apex,
                    d,
                    t_min: 0.0,
                    t_max: f32::INFINITY,
                };
                rays.push(ray);
                // Add a parallel ray from the same window.
                ray.o = std::array::from_fn(|k| apex[k] + 0.5 * d[k] * size[k]);
                ray.d = [0.0; 3];
                ray.d[axis] = sign;
                rays.push(ray);
            }
            // Put all rays of the first kind before those of the second.
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
                    "{n} of {} rays have other answers in tiles from {apex:?}",
                    rays.len()
                )),
            }
        }
    }
}
