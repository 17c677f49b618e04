// SPDX-License-Identifier: GPL-3.0-or-later
//! Checks of the invariants of built structures.

use halfspace_base::Monitor;
use halfspace_base::error::Result;
use halfspace_geom::cell::Direction;
use halfspace_nodes::tree::Body;
use halfspace_ray::{Hit, Order, Ray, Tracer};
use halfspace_structure::Structure;
use std::collections::BTreeSet;

/// Number of rays of a tile.
const TILE: usize = 64;

/// Checks a structure, and returns its broken invariants, one sentence each; empty for a sound structure.
pub fn validate(structure: &Structure) -> Vec<String> {
    let found = watched(structure, &Monitor::new());
    found.expect("nothing cancels it")
}

/// As [`validate`], until the monitor is cancelled.
///
/// # Errors
/// [`Error::Cancelled`](halfspace_base::error::Error::Cancelled) once the monitor is cancelled.
pub fn watched(structure: &Structure, monitor: &Monitor) -> Result<Vec<String>> {
    let (built, live) = (structure.built(), structure.scene().live());
    let mut broken = Vec::new();
    // Check all trees and their derived layouts, and collect the triangles of all leaves.
    let mut ids = BTreeSet::new();
    let shape = structure.progress().shape;
    let trees = std::iter::once((built, &shape));
    let trees = trees.chain(structure.apart().iter().map(|apart| (apart, &apart.shape)));
    for (part, (built, shape)) in trees.enumerate() {
        let scene = structure.scene_of(part).expect("a scene that is built");
        let body = Body {
            scene: &scene,
            frame: &built.frame,
            blocks: &built.leaves,
            shape,
            monitor,
        };
        match &built.tree {
            None => insert(&mut ids, built.leaves.ids(0, shape.references), monitor),
            Some(tree) => {
                tree.validate(&body, &mut broken);
                tree.leaves(&mut |first, count| {
                    if !monitor.is_cancelled() {
                        insert(&mut ids, built.leaves.ids(first, count), monitor);
                    }
                });
            }
        }
        for derived in &built.derived {
            derived.tree.validate(&body, &mut broken);
        }
        monitor.check()?;
    }
    if built.plan.tiles.is_some() {
        tiles(structure, &mut broken);
    }
    if ids.len() != live.len() {
        broken.push(format!(
            "{} triangles are in some leaf, but {} can be hit",
            ids.len(),
            live.len()
        ));
    }
    Ok(broken)
}

/// Inserts triangles until the monitor is cancelled.
fn insert(set: &mut BTreeSet<u32>, ids: Vec<u32>, monitor: &Monitor) {
    for part in ids.chunks(1024) {
        if monitor.is_cancelled() {
            return;
        }
        set.extend(part);
    }
}

/// Returns the point in which the axis-aligned planes of the root meet, in the scene's space; the middle of the scene's
/// box along axes without a plane.
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

/// Compares the hits of tiles with those of single rays, for perspective and parallel views along all axes, from a
/// corner of cells and from the lowest corner of the scene.
fn tiles(structure: &Structure, broken: &mut Vec<String>) {
    let bounds = structure.scene().bounds();
    if bounds.is_empty() {
        return;
    }
    let size: [f32; 3] = std::array::from_fn(|k| bounds.max[k] - bounds.min[k]);
    for apex in [crossing(structure), bounds.min] {
        for face in 0..6 {
            let (axis, sign) = (face / 2, if face % 2 == 1 { 1.0 } else { -1.0 });
            // Make the rays of two tiles of each view.
            let mut perspective = Vec::with_capacity(2 * TILE);
            let mut parallel = Vec::with_capacity(2 * TILE);
            for pixel in 0..2 * TILE {
                let position = [pixel % 16, pixel / 16].map(|i| i as f32 / 8.0 - 1.0);
                let mut d = [sign; 3];
                (d[(axis + 1) % 3], d[(axis + 2) % 3]) = (position[0], position[1]);
                let ray = |o: [f32; 3], d: [f32; 3]| Ray {
                    o,
                    d,
                    t_min: 0.0,
                    t_max: f32::INFINITY,
                };
                perspective.push(ray(apex, d));
                let mut along = [0.0; 3];
                along[axis] = sign;
                let start = std::array::from_fn(|k| apex[k] + 0.5 * d[k] * size[k]);
                parallel.push(ray(start, along));
            }
            let rays = [perspective, parallel].concat();
            // Trace them as single rays and as tiles, and count the different hits.
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
