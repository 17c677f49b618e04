// SPDX-License-Identifier: GPL-3.0-or-later
//! Shadow tiles answer like brute force and are formed where possible; camera tiles visit no empty leaves.

mod common;
mod hard;
#[path = "hard/turns.rs"]
mod turns;

use common::build;
use fearless_simd::{Level, dispatch};
use halfspace::group::tile::shadow::Shadows;
use halfspace::oracle::cases::{Random, grid, ray, soup, strew};
use halfspace::oracle::levels;
use halfspace::ray::frame::Frame;
use halfspace::ray::{Hit, Order, Ray, RayCounters, Tracer};

const SPECS: [&str; 12] = [
    "kd:traversal=tile",
    "kd:nodes=boxes,traversal=tile",
    "kd-sah:traversal=tile",
    "bsp-wn:traversal=tile",
    "bsp-wn-plus-kd:traversal=tile16",
    "bvh-sah:traversal=tile",
    "bsp-wn-plus-kd:nodes=wide,traversal=tile",
    "bvh-sah:width=4,traversal=tile",
    "obb:traversal=tile",
    "bih:traversal=tile",
    "octree-param:traversal=tile",
    "grid:traversal=tile",
];

fn blocked(structure: &impl Tracer, rays: &[Ray]) -> Vec<bool> {
    let mut blocked = vec![false; rays.len()];
    structure.occluded(rays, &mut blocked, None);
    blocked
}

/// Rays to a light from `count` squares of 8 by 8 points, each square at a random position.
fn squares(count: usize, side: f32, to: impl Fn([f32; 3]) -> Ray) -> Vec<Ray> {
    let mut random = Random(31);
    let mut rays = Vec::with_capacity(64 * count);
    for _ in 0..count {
        let [x, y, _] = random.point(-2.0, 6.0);
        for i in 0..64_u8 {
            let at = |i: u8| f32::from(i) / 8.0 * side;
            rays.push(to([x + at(i % 8), y + at(i / 8), -0.5]));
        }
    }
    rays
}

/// A ray towards `light` that ends a fraction `share` of its length before it; its direction is `length` times
/// the distance.
fn to(light: [f32; 3], length: f32, share: f32) -> impl Fn([f32; 3]) -> Ray {
    move |o| Ray {
        t_max: (1.0 - share) / length,
        ..ray(o, std::array::from_fn(|k| (light[k] - o[k]) * length))
    }
}

/// Number of tiles that can be formed from the rays.
fn tiles(frame: &Frame, rays: &[Ray]) -> usize {
    rays.chunks(64)
        .filter(|rays| {
            dispatch!(Level::new(), simd => Shadows::<4>::new(simd, frame, rays)).is_some()
        })
        .count()
}

#[test]
fn shadow_tiles_answer_like_brute_force() {
    // A receiving floor with boxes above it.
    let mut corners = grid(4, 0.3);
    corners.extend([[-2.0, -2.0, -0.6], [6.0, -2.0, -0.6], [2.0, 9.0, -0.6]]);
    let scene = soup(corners);
    let frame = Frame::new(scene.bounds());
    let lights = [
        [9.0, 9.0, 12.0],
        // Inside a box, on a corner of boxes, below the floor, and so near that the rays of a square diverge.
        [2.2, 1.7, 2.1],
        [2.0, 2.0, 2.0],
        [2.0, 2.0, -9.0],
        [2.0, 2.0, -0.4],
    ];
    let mut rays = Vec::new();
    for (i, light) in lights.into_iter().enumerate() {
        for (length, share) in [
            (1.0, 1e-4),
            (1.0, 0.0),
            (0.037, 1e-3),
            (900.0, 1e-6),
            (1.0, -0.2),
        ] {
            let some = squares(12, 0.1, to(light, length, share));
            // Rays that continue behind the light form no tiles.
            let wanted = if share < 0.0 { 0 } else { 12 };
            if i < 3 {
                assert_eq!(
                    tiles(&frame, &some),
                    wanted,
                    "light {i}, length {length}, share {share}"
                );
            }
            rays.extend(some);
            rays.extend(squares(4, 1.5, to(light, length, share)));
        }
    }
    // Rays to a sun have no common origin.
    rays.extend(squares(4, 0.1, |o| ray(o, [0.3, 0.2, 1.0])));
    // A partial tile.
    rays.extend(
        squares(1, 0.1, to(lights[0], 1.0, 0.0))
            .into_iter()
            .take(41),
    );
    let expected = blocked(&build(&scene, "brute"), &rays);
    let count = expected.iter().filter(|blocked| **blocked).count();
    assert!(
        count > rays.len() / 8 && count < rays.len() * 7 / 8,
        "{count} of {}",
        rays.len()
    );
    for spec in SPECS {
        let structure = build(&scene, spec);
        for (set, level) in levels() {
            let found = blocked(&structure.at_level(level), &rays);
            assert!(found == expected, "{spec}, {set}");
        }
        let mut counters = vec![RayCounters::default(); rays.len()];
        let mut counted = vec![false; rays.len()];
        structure.occluded(&rays, &mut counted, Some(&mut counters));
        assert!(counted == expected, "{spec}, counted");
    }
}

#[test]
fn shadow_tiles_answer_like_brute_force_on_hard_scenes() {
    let (mut formed, share) = (0, hard::share());
    let sets = levels();
    for (c, case) in hard::cases(8).into_iter().enumerate() {
        let bounds = case.scene.bounds();
        if bounds.is_empty() {
            continue;
        }
        let frame = Frame::new(bounds);
        let brute = build(&case.scene, "brute");
        let mut rays = case.rays.clone();
        let middle = std::array::from_fn(|k| bounds.min[k] / 2.0 + bounds.max[k] / 2.0);
        for light in [bounds.min, bounds.max, middle] {
            // Squares of 64 points around origins of the case's rays, some far apart, some identical.
            for (i, start) in case
                .rays
                .iter()
                .step_by(17)
                .take(24_usize.div_ceil(share))
                .enumerate()
            {
                let step: [f32; 3] = std::array::from_fn(|k| {
                    (bounds.max[k] - bounds.min[k]) * [1e-3, 1e-6, 0.0][i % 3]
                });
                for j in 0..64_u8 {
                    let (x, y) = (f32::from(j % 8), f32::from(j / 8));
                    let shift = [step[0] * x, step[1] * y, step[2] * (x - y)];
                    let o = std::array::from_fn(|k| start.o[k] + shift[k]);
                    rays.push(Ray {
                        t_max: 1.0,
                        ..ray(o, std::array::from_fn(|k| light[k] - o[k]))
                    });
                }
            }
        }
        // Make some rays of every other tile irregular.
        for tile in rays.chunks_mut(64).step_by(2) {
            strew(tile, 9);
        }
        formed += tiles(&frame, &rays);
        let expected = blocked(&brute, &rays);
        for (s, spec) in SPECS.into_iter().enumerate() {
            let structure = build(&case.scene, spec);
            for (set, level) in turns::in_turn(&sets, c + s) {
                let found = blocked(&structure.at_level(*level), &rays);
                let wrong = found.iter().zip(&expected).filter(|(a, b)| a != b).count();
                assert_eq!(wrong, 0, "{}, {spec}, {set}: of {}", case.name, rays.len());
            }
        }
    }
    assert!(formed > 500 / (share * share), "{formed} tiles");
}

/// A tree of boxes has no empty leaves, and an empty slot of a node is not visited.
#[test]
fn tiles_of_all_directions_visit_no_empty_slots() {
    let structure = build(&soup(grid(4, 0.3)), "bvh-sah:traversal=tile");
    let mut random = Random(3);
    let rays: Vec<_> = (0..64)
        .map(|_| ray([1.2, 1.7, 2.1], random.point(-1.0, 1.0)))
        .collect();
    let mut hits = vec![Hit::MISS; rays.len()];
    let mut counters = vec![RayCounters::default(); rays.len()];
    structure.closest_ordered(&rays, &mut hits, Some(&mut counters), Order::Tiles);
    let leaves: u32 = counters.iter().map(|c| c.leaves).sum();
    let empty: u32 = counters.iter().map(|c| c.leaves_empty).sum();
    assert!(leaves > 0 && empty == 0, "{empty} of {leaves}");
}
