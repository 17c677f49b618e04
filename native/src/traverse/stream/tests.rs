// SPDX-License-Identifier: GPL-3.0-or-later
//! Streams of rays: the answers of brute force bit for bit, however many rays there are and however they crowd.

use super::*;
use crate::build::Monitor;
use crate::oracle::cases::{
    Random, aimed, cloud, everywhere, lattice_rays, placed, ray, soup, strew,
};
use crate::oracle::levels;
use crate::scene::Triangles;
use crate::spec::Config;
use crate::structure::Structure;
use crate::traverse::{Ray, Tracer};
use std::sync::Arc;

/// Structures whose nearest hits are found in streams.
const SPECS: [&str; 3] = ["kd", "bsp-wn-plus-kd", "bvh-sah:traversal=auto"];

fn build(scene: &Arc<Triangles>, spec: &str) -> Structure {
    let config = Config::parse(spec).unwrap();
    Structure::build(scene.clone(), config, 1, &Monitor::new()).unwrap()
}

fn closest(structure: &impl Tracer, rays: &[Ray]) -> Vec<[u32; 4]> {
    let mut hits = vec![Hit::MISS; rays.len()];
    structure.closest(rays, &mut hits, None);
    let bits = |hit: &Hit| {
        [
            hit.t.to_bits(),
            hit.triangle,
            hit.u.to_bits(),
            hit.v.to_bits(),
        ]
    };
    hits.iter().map(bits).collect()
}

/// Lists end within and at the ends of groups of sixteen, and streams of some octants end before those of others.
#[test]
fn batches_of_any_size_answer_like_brute_force() {
    let mut random = Random(5);
    let scene = soup(cloud(3000, 0.1, &mut random));
    let mut rays = aimed(&scene, 1500, &mut random);
    rays.extend(everywhere(700, &mut random));
    strew(&mut rays, 9);
    let reference = closest(&build(&scene, "brute"), &rays);
    for spec in SPECS {
        let structure = build(&scene, spec);
        for (set, level) in levels() {
            let structure = structure.at_level(level);
            for size in [1, 2, 3, 8, 15, 16, 17, 31, 32, 33, 63, 100, 640, 2200] {
                for (rays, expected) in rays.chunks(size).zip(reference.chunks(size)).take(60) {
                    assert_eq!(
                        closest(&structure, rays),
                        expected,
                        "{spec}, {set}, {size} rays"
                    );
                }
            }
        }
    }
}

/// Each of these rays meets all of these triangles, and lists grow from level to level instead of shrinking.
#[test]
fn rays_that_meet_everything_answer_like_brute_force() {
    let mut random = Random(6);
    let plates = (0..600).flat_map(|i| {
        let z = i as f32 * 1e-3;
        [[-8.0, -8.0, z], [8.0, -8.0, z + 0.7], [0.0, 8.0, z - 0.3]]
    });
    let scene = soup(plates.collect());
    let rays: Vec<_> = (0..3000)
        .map(|i| {
            let [x, y, z] = random.point(-1.0, 1.0);
            let side = if i % 3 == 0 { -4.0 } else { 4.0 };
            ray([x, y, side], [0.1 * y, 0.1 * z, -side])
        })
        .collect();
    let reference = closest(&build(&scene, "brute"), &rays);
    assert!(reference.iter().all(|hit| hit[1] != Hit::NONE));
    for spec in SPECS {
        assert_eq!(closest(&build(&scene, spec), &rays), reference, "{spec}");
    }
}

/// Scaled frames, in which nothing is put off, and rays through edges and corners.
#[test]
fn streams_in_scaled_frames_answer_like_brute_force() {
    let mut random = Random(7);
    for scale in [1e-30, 1e-12, 1.0, 1e15, 1e30] {
        let corners = cloud(400, 0.2, &mut random);
        let scene = soup(placed(&corners, scale, [0.0; 3]));
        let mut rays = aimed(&scene, 600, &mut random);
        rays.extend(lattice_rays(3, &mut random, 200));
        let reference = closest(&build(&scene, "brute"), &rays);
        for spec in SPECS {
            let found = closest(&build(&scene, spec), &rays);
            assert_eq!(found, reference, "{spec}, scale {scale}");
        }
    }
}

/// A wrong order would change no answer, only the time that rays take.
#[test]
fn the_child_at_the_nearest_corner_is_visited_first() {
    for octant in 0..OCTANTS {
        for child in 0..CHILDREN {
            assert_eq!(RANKED[octant][1 << child], 1 << rank(octant, child));
            assert_eq!(rank(octant, rank(octant, child)), child);
        }
        // A ray that goes down along an axis comes from its upper end; the highest bit is pushed last.
        assert_eq!(rank(octant, octant), CHILDREN - 1);
        assert_eq!(RANKED[octant][0xff], 0xff);
    }
}
