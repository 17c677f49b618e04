// SPDX-License-Identifier: GPL-3.0-or-later
//! Traversals repeated without triangle tests visit the same leaves.

use halfspace::base::Monitor;
use halfspace::base::error::Error;
use halfspace::oracle::cases::{Random, aimed, grid, lattice_rays, ray, soup};
use halfspace::ray::replay::CHUNK;
use halfspace::ray::{Hit, RayCounters, Tracer};
use halfspace::registry::{self, TREES};
use halfspace::scene::Triangles;
use halfspace::structure::Structure;
use halfspace::structure::row::StructureSpec;
use halfspace::structure::way::{Rays, Way};
use std::sync::Arc;

fn build(scene: &Arc<Triangles>, spec: &str) -> Structure {
    let config = registry::parse(spec).unwrap();
    Structure::build(scene.clone(), config, 1, &Monitor::new()).unwrap()
}

/// The configuration string of a way.
fn spelled(tree: &StructureSpec, way: &Way) -> String {
    let part = tree.spelled(way);
    format!(
        "{}{}{part}",
        tree.id,
        if part.is_empty() { "" } else { ":" }
    )
}

#[test]
fn every_traversal_repeats_itself_without_triangles() {
    let scene = soup(grid(5, 0.3));
    let mut random = Random(3);
    let mut rays = lattice_rays(5, &mut random, 700);
    rays.extend(aimed(&scene, 700, &mut random));
    rays.push(ray([90.0; 3], [1.0; 3]));
    let kd = build(&scene, "kd")
        .record(rays.clone(), false, None)
        .unwrap();
    for tree in TREES.iter().filter(|tree| tree.id != "brute") {
        // Recordings are of single rays, which a structure of other rays has too.
        let single = |way: &&Way| [Rays::Single, Rays::Auto].contains(&way.rays);
        let specs = (tree.ways.iter().filter(single)).map(|way| (way, spelled(tree, way)));
        for (way, spec) in specs {
            let spec = &spec;
            let structure = build(&scene, spec);
            for any in [false, true] {
                let recording = structure.record(rays.clone(), any, None).unwrap();
                let (seconds, strayed) = structure.replay(&recording);
                assert_eq!(strayed, 0, "{spec}, any: {any}");
                assert_eq!(seconds.len(), rays.len().div_ceil(CHUNK));
                assert!(seconds.iter().all(|s| *s > 0.0));

                if way.rays != Rays::Single {
                    continue;
                }
                let mut counters = vec![RayCounters::default(); rays.len()];
                if any {
                    let mut answers = vec![false; rays.len()];
                    structure.occluded(&rays, &mut answers, Some(&mut counters));
                } else {
                    let mut hits = vec![Hit::MISS; rays.len()];
                    structure.closest(&rays, &mut hits, Some(&mut counters));
                }
                assert!(recording.counters == counters, "{spec}, any: {any}");
            }
            // The check can fail: another tree's recording does not fit.
            if ["octree", "bvh"]
                .iter()
                .any(|family| spec.starts_with(family))
            {
                assert!(structure.replay(&kd).1 > rays.len() / 4, "{spec}");
            }
        }
    }
    let brute = build(&scene, "brute").record(rays, false, None);
    assert!(matches!(brute, Err(Error::Spec(_))));
}

#[test]
fn rays_that_are_counted_are_left_out_once_a_monitor_is_cancelled() {
    let scene = soup(grid(4, 0.3));
    let rays = aimed(&scene, 2048, &mut Random(5));
    let monitor = Monitor::new();
    monitor.cancel();
    for tree in TREES {
        for spec in tree.ways.iter().map(|way| spelled(tree, way)) {
            let structure = build(&scene, &spec);
            let watched = structure.watched(Some(&monitor));
            for any in [false, true] {
                let mut counters = vec![RayCounters::default(); rays.len()];
                if any {
                    let mut answers = vec![false; rays.len()];
                    watched.occluded(&rays, &mut answers, Some(&mut counters));
                } else {
                    let mut hits = vec![Hit::MISS; rays.len()];
                    watched.closest(&rays, &mut hits, Some(&mut counters));
                }
                let traced = counters
                    .iter()
                    .filter(|c| **c != RayCounters::default())
                    .count();
                assert!(
                    traced <= rays.len() / 2,
                    "{spec}, any: {any}: {traced} rays"
                );
            }
        }
    }
}
