// SPDX-License-Identifier: GPL-3.0-or-later
//! Packets return the hits of brute force for any sequence of rays, and so do tiles that leave rays to packets.

mod common;
mod hard;
#[path = "hard/turns.rs"]
mod turns;

use common::build;
use halfspace::oracle::cases::{Case, Random, aimed, grid, lattice_rays, ray, soup, strew};
use halfspace::oracle::levels;
use halfspace::ray::{Hit, Order, Ray, RayCounters, Tracer};

const SPECS: [&str; 32] = [
    "kd:traversal=packet",
    "kd-sah:traversal=packet4",
    "bsp-wn-plus-kd:traversal=packet",
    "bvh-sah:traversal=packet8",
    "kd:traversal=tile",
    "bvh-sah:traversal=tile",
    "kd",
    "bsp-wn-plus-kd",
    "bsp-wn",
    // Boxes around what the planes separate.
    "kd:nodes=boxes",
    "bsp-wn-plus-kd:nodes=boxes",
    "bsp-wn:nodes=boxes",
    "kd:nodes=boxes,traversal=packet",
    // Nodes that cut intervals.
    "kd:nodes=wide,traversal=tile",
    "kd:nodes=wide,traversal=packet",
    "bsp-wn-plus-kd:nodes=wide,traversal=tile",
    "bsp-wn-plus-kd:nodes=wide,traversal=packet",
    "bvh-sah:width=4,traversal=tile",
    "bvh-sah:width=2,traversal=packet",
    "obb:traversal=tile",
    "obb:traversal=packet",
    "obb:traversal=packet,leaves=indices",
    "bih:traversal=tile",
    "bih:traversal=packet,leaves=corners",
    "bih1:traversal=tile",
    "bih-n:n=8,traversal=tile",
    "bih4:traversal=packet",
    "bih-obl:traversal=tile",
    "octree-param:traversal=tile",
    "octree-param:traversal=packet",
    "grid:traversal=tile",
    "grid:traversal=packet",
];

/// Bit patterns of the nearest hits, and whether each ray is occluded.
fn answers(
    structure: &impl Tracer,
    rays: &[Ray],
    mut counters: Option<&mut [RayCounters]>,
) -> (Vec<[u32; 4]>, Vec<bool>) {
    let mut hits = vec![Hit::MISS; rays.len()];
    let mut blocked = vec![false; rays.len()];
    structure.closest_ordered(rays, &mut hits, counters.as_deref_mut(), Order::Tiles);
    structure.occluded(rays, &mut blocked, counters);
    let bits = |hit: &Hit| {
        [
            hit.t.to_bits(),
            hit.triangle,
            hit.u.to_bits(),
            hit.v.to_bits(),
        ]
    };
    (hits.iter().map(bits).collect(), blocked)
}

/// The rays of the case, and fans of 16 neighbouring rays from common origins to corners of triangles, points
/// of their edges and points just outside. Every fifth ray is irregular.
fn rays(case: &Case) -> Vec<Ray> {
    let mut rays = case.rays.clone();
    let bounds = case.scene.bounds();
    let size = bounds.magnitude();
    let starts = case.rays.iter().step_by(41).take(2).map(|ray| ray.o);
    let above = std::array::from_fn(|k| bounds.max[k] + 0.3 * size);
    for o in starts.chain([bounds.min, above]) {
        // Aim a grid of 4 x 4 directions at each chosen triangle's parallelogram.
        for id in case
            .scene
            .live()
            .iter()
            .step_by(7)
            .take(8_usize.div_ceil(hard::share()))
        {
            let [a, b, c] = case.scene.corners(*id);
            for i in 0..16_u8 {
                let (s, t) = (f32::from(i % 4) / 3.0, f32::from(i / 4) / 3.0);
                let at = |k: usize| a[k] + s * (b[k] - a[k]) + t * (c[k] - a[k]);
                rays.push(ray(o, std::array::from_fn(|k| at(k) - o[k])));
            }
        }
    }
    strew(&mut rays, 5);
    rays
}

#[test]
fn packets_lose_nothing_on_hard_scenes() {
    // Each instruction set, and the best one with counters.
    let mut ways: Vec<_> = levels().into_iter().map(|way| (way, false)).collect();
    ways.extend(ways.last().copied().map(|(way, _)| (way, true)));
    for (c, case) in hard::cases(8).into_iter().enumerate() {
        let rays = rays(&case);
        let expected = answers(&build(&case.scene, "brute"), &rays, None);
        for (s, spec) in SPECS.into_iter().enumerate() {
            let structure = build(&case.scene, spec);
            for &((set, level), counts) in turns::in_turn(&ways, c + s) {
                let mut counters = vec![RayCounters::default(); rays.len()];
                let counted = counts.then_some(&mut counters[..]);
                let found = answers(&structure.at_level(level), &rays, counted);
                let wrong = (0..rays.len())
                    .find(|&i| found.0[i] != expected.0[i] || found.1[i] != expected.1[i]);
                assert_eq!(
                    wrong.map(|i| (rays[i], found.0[i], expected.0[i])),
                    None,
                    "{}, {spec}, {set}, counted: {counts}",
                    case.name
                );
            }
        }
    }
}

/// Packets as published, without error bounds, return wrong hits as single rays do; this proves that the
/// comparison above can fail. Each ray occurs four times and none is irregular, so no group has a single ray.
#[test]
fn packets_without_bounds_are_caught() {
    let scene = soup(grid(5, 0.0));
    let mut random = Random(7);
    let mut rays = lattice_rays(5, &mut random, 4000);
    rays.extend(aimed(&scene, 4000, &mut random));
    rays.retain(|ray| ray.d.iter().any(|d| d.abs() > 1e-3));
    let rays: Vec<_> = rays.iter().flat_map(|ray| [*ray; 4]).collect();
    let mut expected = vec![Hit::MISS; rays.len()];
    build(&scene, "brute").closest(&rays, &mut expected, None);
    for spec in [
        "kd:robust=none,traversal=packet4",
        "kd:robust=none,traversal=packet",
        "bsp-random:robust=none,traversal=packet8",
    ] {
        let mut found = vec![Hit::MISS; rays.len()];
        build(&scene, spec).closest(&rays, &mut found, None);
        assert!(found != expected, "{spec}");
    }
}
