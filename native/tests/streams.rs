// SPDX-License-Identifier: GPL-3.0-or-later
//! Ray streams return the answers of brute force bit for bit, for any number and distribution of rays.

mod common;

use common::build;
use halfspace::oracle::cases::{
    Random, aimed, cloud, everywhere, lattice_rays, placed, ray, soup, strew,
};
use halfspace::oracle::levels;
use halfspace::ray::{Hit, Ray, RayCounters, Tracer};
use halfspace::scene::Triangles;
use halfspace::stream::STREAM;
use halfspace::structure::way::Rays;
use std::sync::Arc;

/// Structures whose rays go in streams, one for each kind of nodes at least.
const SPECS: [&str; 21] = [
    "kd:traversal=stream",
    "bsp-wn-plus-kd:traversal=stream",
    "kd:nodes=wide,traversal=stream",
    "bsp-wn-plus-kd:nodes=wide,traversal=stream",
    "kd:nodes=boxes,traversal=stream",
    "bsp-wn-plus-kd:nodes=boxes",
    "bvh-sah",
    "bvh-sah:traversal=stream",
    "bvh-sah:width=4,traversal=stream",
    "bvh-sah:width=2,traversal=stream",
    "obb:traversal=stream",
    "obb:traversal=stream,leaves=indices",
    "bih:traversal=stream",
    "bih5:traversal=stream,leaves=corners",
    "bih1:traversal=stream",
    "bih4:traversal=stream",
    "bih-n:traversal=stream",
    "bih-n:n=8,traversal=stream",
    "bih-obl:traversal=stream",
    "octree-param:traversal=stream",
    "grid:traversal=stream",
];

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

/// Checks that every structure on every instruction set answers these rays like brute force, in batches of `size`.
/// Returns the answers of brute force.
fn agree(scene: &Arc<Triangles>, rays: &[Ray], size: usize) -> Vec<[u32; 4]> {
    let reference = closest(&build(scene, "brute"), rays);
    let is_hit: Vec<_> = reference.iter().map(|hit| hit[1] != Hit::NONE).collect();
    for spec in SPECS {
        let structure = build(scene, spec);
        for (set, level) in levels() {
            let structure = structure.at_level(level);
            let chunks = rays.chunks(size).zip(reference.chunks(size));
            for ((rays, expected), is_hit) in chunks.zip(is_hit.chunks(size)).take(30) {
                let found = closest(&structure, rays);
                assert_eq!(found, expected, "{spec}, {set}, {size} rays at once");
                let mut found = vec![false; rays.len()];
                structure.occluded(rays, &mut found, None);
                assert_eq!(found, is_hit, "{spec}, {set}, {size} any-hit rays at once");
            }
        }
    }
    reference
}

/// A batch of any kind goes in streams, and they count themselves.
#[test]
fn streams_take_all_rays_and_count_them() {
    let mut random = Random(9);
    let scene = soup(cloud(200, 0.1, &mut random));
    let rays = aimed(&scene, 400, &mut random);
    for spec in SPECS.iter().filter(|spec| spec.ends_with("stream")) {
        let structure = build(&scene, spec);
        let [single, others @ ..] = structure.routes();
        assert_eq!(single.rays, Rays::Single, "{spec}");
        for route in others {
            assert_eq!(route.rays, Rays::Stream, "{spec}: {}", route.batch);
            assert!(route.counted, "{spec}: {}", route.batch);
        }
        // Rays that join others have gone together.
        let mut counters = vec![RayCounters::default(); rays.len()];
        structure.closest(&rays, &mut vec![Hit::MISS; rays.len()], Some(&mut counters));
        assert!(counters.iter().any(|own| own.joined > 0), "{spec}");
        let mut counters = vec![RayCounters::default(); rays.len()];
        structure.occluded(&rays, &mut vec![false; rays.len()], Some(&mut counters));
        assert!(counters.iter().any(|own| own.joined > 0), "{spec}");
    }
}

/// Lists end within and at the ends of groups of sixteen, and streams of some octants end before those of others.
#[test]
fn batches_of_any_size_answer_like_brute_force() {
    let mut random = Random(5);
    let scene = soup(cloud(3000, 0.1, &mut random));
    let mut rays = aimed(&scene, 1500, &mut random);
    rays.extend(everywhere(700, &mut random));
    strew(&mut rays, 9);
    for size in [1, 2, 3, 8, 15, 16, 17, 31, 32, 33, 63, 100, 640, 2200] {
        agree(&scene, &rays, size);
    }
}

/// Each of these rays hits all of these boxes, so no list is shorter than that of the parent. There are more rays than
/// one stream holds.
#[test]
fn rays_that_meet_everything_answer_like_brute_force() {
    let mut random = Random(6);
    let plates = (0..600).flat_map(|i| {
        let z = i as f32 * 1e-3;
        [[-8.0, -8.0, z], [8.0, -8.0, z + 0.7], [0.0, 8.0, z - 0.3]]
    });
    let scene = soup(plates.collect());
    let rays: Vec<_> = (0..STREAM + 3000)
        .map(|i| {
            let [x, y, z] = random.point(-1.0, 1.0);
            let side = if i % 3 == 0 { -4.0 } else { 4.0 };
            ray([x, y, side], [0.1 * y, 0.1 * z, -side])
        })
        .collect();
    let reference = agree(&scene, &rays, rays.len());
    assert!(reference.iter().all(|hit| hit[1] != Hit::NONE));
}

/// Scaled frames, in which all rays are irregular, and rays through edges and vertices.
#[test]
fn streams_in_scaled_frames_answer_like_brute_force() {
    let mut random = Random(7);
    for scale in [1e-30, 1e-12, 1.0, 1e15, 1e30] {
        let corners = cloud(400, 0.2, &mut random);
        let scene = soup(placed(&corners, scale, [0.0; 3]));
        let mut rays = aimed(&scene, 600, &mut random);
        rays.extend(lattice_rays(3, &mut random, 200));
        agree(&scene, &rays, rays.len());
    }
}

/// Such a direction lies in the wall in units of the frame; in those of the scene it leaves the wall, and the ray hits
/// it at its origin.
#[test]
fn a_direction_that_rounds_to_zero_in_the_frame_is_not_in_the_wall() {
    let mut random = Random(8);
    let mut corners = vec![[0.0, -1.0, -1.0], [0.0, 1.0, -1.0], [0.0, 0.0, 1.0]];
    corners.extend(cloud(500, 0.1, &mut random));
    let scene = soup(corners);
    let rays: Vec<_> = (0..200)
        .map(|i| {
            let o = [0.0, 0.1 * random.unit(), -0.1 * random.unit()];
            let along = [2.0, -3.0, 1e30, 5.0][i % 4];
            ray(o, [f32::from_bits(1), 0.0, along])
        })
        .collect();
    let reference = agree(&scene, &rays, rays.len());
    assert!(reference.iter().all(|hit| hit[1] == 0), "all start in it");
}
