// SPDX-License-Identifier: GPL-3.0-or-later
//! Shadow tiles answer as brute force does, and do go as tiles where they should.

use super::Shadows;
use crate::oracle::cases::{Random, Size, cases, grid, ray, soup, strew};
use crate::oracle::levels;
use crate::structure::Structure;
use crate::traverse::frame::Frame;
use crate::traverse::{Ray, RayCounters, Tracer};
use fearless_simd::{Level, dispatch};

const SPECS: [&str; 5] = [
    "kd",
    "kd-sah:traversal=tile8",
    "bsp-wn",
    "bsp-wn-plus-kd:traversal=tile16",
    "bvh-sah:traversal=tile8",
];

fn blocked(structure: &impl Tracer, rays: &[Ray]) -> Vec<bool> {
    let mut blocked = vec![false; rays.len()];
    structure.occluded(rays, &mut blocked, None);
    blocked
}

/// Rays to a light from squares of 8 by 8 points, each square somewhere else.
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

/// A ray that ends a share of its length before the light, its direction `length` times as long as the way.
fn to(light: [f32; 3], length: f32, share: f32) -> impl Fn([f32; 3]) -> Ray {
    move |o| Ray {
        t_max: (1.0 - share) / length,
        ..ray(o, std::array::from_fn(|k| (light[k] - o[k]) * length))
    }
}

fn tiles(frame: &Frame, rays: &[Ray]) -> usize {
    rays.chunks(64)
        .filter(|rays| {
            dispatch!(Level::new(), simd => Shadows::<4>::new(simd, frame, rays)).is_some()
        })
        .count()
}

#[test]
fn shadow_tiles_answer_like_brute_force() {
    // A floor that receives, and boxes above it.
    let mut corners = grid(4, 0.3);
    corners.extend([[-2.0, -2.0, -0.6], [6.0, -2.0, -0.6], [2.0, 9.0, -0.6]]);
    let scene = soup(corners);
    let frame = Frame::new(scene.bounds());
    let lights = [
        [9.0, 9.0, 12.0],
        // Inside, on a corner of boxes, below the floor, and so near that rays of a square differ much.
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
            // Rays that go on behind the light do not end there.
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
    // Suns have no light to start from.
    rays.extend(squares(4, 0.1, |o| ray(o, [0.3, 0.2, 1.0])));
    // A row of rays that ends in the middle of a tile.
    rays.extend(
        squares(1, 0.1, to(lights[0], 1.0, 0.0))
            .into_iter()
            .take(41),
    );
    let expected = blocked(&Structure::of(&scene, "brute"), &rays);
    let count = expected.iter().filter(|blocked| **blocked).count();
    assert!(
        count > rays.len() / 8 && count < rays.len() * 7 / 8,
        "{count} of {}",
        rays.len()
    );
    for spec in SPECS {
        let structure = Structure::of(&scene, spec);
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
fn shadow_tiles_lose_nothing_on_hard_scenes() {
    let mut formed = 0;
    for case in cases(Size::Small, 8) {
        let bounds = case.scene.bounds();
        if bounds.is_empty() {
            continue;
        }
        let frame = Frame::new(bounds);
        let brute = Structure::of(&case.scene, "brute");
        let mut rays = case.rays.clone();
        let middle = std::array::from_fn(|k| bounds.min[k] / 2.0 + bounds.max[k] / 2.0);
        for light in [bounds.min, bounds.max, middle] {
            // Squares of 64 places around those at which rays of the case start, some far apart, some equal.
            for (i, start) in case.rays.iter().step_by(17).take(24).enumerate() {
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
        // In every other tile some rays are odd.
        for tile in rays.chunks_mut(64).step_by(2) {
            strew(tile, 9);
        }
        formed += tiles(&frame, &rays);
        let expected = blocked(&brute, &rays);
        for spec in SPECS {
            let structure = Structure::of(&case.scene, spec);
            for (set, level) in levels() {
                let found = blocked(&structure.at_level(level), &rays);
                let wrong = found.iter().zip(&expected).filter(|(a, b)| a != b).count();
                assert_eq!(wrong, 0, "{}, {spec}, {set}: of {}", case.name, rays.len());
            }
        }
    }
    assert!(formed > 500, "{formed} tiles");
}
