// SPDX-License-Identifier: GPL-3.0-or-later
//! The kernels of shadow rays return the answers of the plain any-hit traversal.

use halfspace::oracle::cases::{Random, grid, ray, soup};
use halfspace::ray::{Ray, RayCounters, Tracer};
use halfspace::registry::TREES;
use halfspace::scene::Triangles;
use halfspace::structure::way::{Rays, Way};

mod common;

use common::build;

/// Rays to two lights and a sun, among them those whose blocker in the cache is invalid.
fn shadow_rays(scene: &Triangles) -> Vec<Ray> {
    let mut random = Random(21);
    let lights = [[2.0, 2.0, 9.0], [-3.0, 5.0, 1.0]];
    let mut rays = Vec::new();
    for i in 0..6000 {
        let o = random.point(-1.0, 5.0);
        let light = lights[i / 64 % 2];
        let d = std::array::from_fn(|k| light[k] - o[k]);
        rays.push(match i % 5 {
            // From vertices: the receiver itself is hit at zero.
            0 => Ray {
                t_max: 1.0,
                ..ray(scene.vertices()[i % scene.vertices().len()], d)
            },
            // A light on the surface, or at no distance at all.
            1 => Ray {
                t_max: if i % 2 == 0 { 0.0 } else { 0.5 },
                ..ray(o, d)
            },
            // A sun, and rays that end before the blockers.
            2 => ray(o, [0.1, 0.2, 1.0]),
            3 => Ray {
                t_max: 1.0,
                ..ray([1.5 + 0.01 * (i % 7) as f32, 1.5, -3.0], [0.3, 0.2, 9.0])
            },
            _ => Ray {
                t_max: 0.999,
                ..ray(o, d)
            },
        });
    }
    rays
}

/// The cached blocker of a light may be the receiver, lie behind the light, or belong to another light: no answer
/// changes for any rays traced before, and in wide shadows most rays are answered by the cache.
#[test]
fn shadow_kernels_change_no_answer() {
    let scene = soup(grid(4, 0.3));
    let rays = shadow_rays(&scene);
    for tree in TREES {
        let shadow = tree.all_params().find(|p| p.name == "shadow").unwrap();
        let kernels = shadow
            .kind
            .options()
            .expect("kernels of shadow rays have names");
        let trace = |shadow: &str, traversal: &str| {
            let structure = build(&scene, &format!("{}:shadow={shadow}{traversal}", tree.id));
            let mut blocked = vec![false; rays.len()];
            let mut counters = vec![RayCounters::default(); rays.len()];
            structure.occluded(&rays, &mut blocked, Some(&mut counters));
            let mut uncounted = vec![false; rays.len()];
            structure.occluded(&rays, &mut uncounted, None);
            assert_eq!(blocked, uncounted, "{}", tree.id);
            let spared = counters.iter().map(|c| c.spared).sum::<u32>();
            let steps = counters.iter().map(|c| c.steps() + c.tests);
            (blocked, spared, steps.sum::<u32>())
        };
        let (expected, none, _) = trace("none", "");
        assert_eq!(none, 0, "{}", tree.id);
        // Compare steps of rays one by one: those of a stream are shared.
        let single = tree.ways.iter().find(|way| way.rays == Rays::Single);
        let alone = match single.map_or("", |way| way.traversal) {
            "" => String::new(),
            traversal => format!(",traversal={traversal}"),
        };
        let (_, _, steps) = trace("none", &alone);
        for kernel in &kernels[1..] {
            for traversal in tree.traversals() {
                let (blocked, ..) = trace(kernel, &format!(",traversal={traversal}"));
                assert_eq!(blocked, expected, "{}, {kernel}, {traversal}", tree.id);
            }
            let (blocked, spared, fewer) = trace(kernel, &alone);
            assert_eq!(blocked, expected, "{}, {kernel}", tree.id);
            if *kernel == "cache" {
                assert!(
                    spared > 500 && fewer < steps,
                    "{}: {spared} spared",
                    tree.id
                );
            }
        }
    }
}

/// Rays of one light in tiles and packets, half of them behind one wall: the leaf that blocked the last ones answers most
/// of those, and no answer changes where the wall ends.
#[test]
fn tiles_and_packets_try_the_last_blocker_first() {
    // A wall of two triangles over half of the floor, and many triangles above it, where rays would go on.
    let mut corners = vec![[-9.0, -9.0, 4.0], [0.1, -9.0, 4.0], [-9.0, 9.0, 4.0]];
    corners.extend([[0.1, -9.0, 4.0], [0.1, 9.0, 4.0], [-9.0, 9.0, 4.0]]);
    let above = |[x, y, z]: [f32; 3]| [x - 4.0, y - 1.5, 0.1 * z + 5.0];
    corners.extend(grid(3, 0.0).into_iter().map(above));
    let scene = soup(corners);
    let light = [0.0, 0.0, 9.0];
    // Eight by eight tiles of eight by eight rays.
    let rays: Vec<Ray> = (0..4096)
        .map(|i: usize| {
            let at = |tile: usize, pixel: usize| 0.1 * (8 * (tile % 8) + pixel % 8) as f32 - 3.2;
            let o = [at(i / 64, i), at(i / 512, i / 8), 0.0];
            let d = std::array::from_fn(|k| light[k] - o[k]);
            Ray {
                t_max: 0.999,
                ..ray(o, d)
            }
        })
        .collect();
    let mut tried = 0;
    for tree in TREES {
        if tree.all_params().all(|p| p.name != "shadow") {
            continue;
        }
        let together = |way: &&Way| matches!(way.rays, Rays::Tile | Rays::Packet);
        for way in tree.ways.iter().filter(together) {
            let trace = |shadow: &str| {
                let mut parts = vec![tree.spelled(way), format!("shadow={shadow}")];
                parts.retain(|part| !part.is_empty());
                let spec = format!("{}:{}", tree.id, parts.join(","));
                let structure = build(&scene, &spec);
                let mut blocked = vec![false; rays.len()];
                let mut counters = vec![RayCounters::default(); rays.len()];
                structure.occluded(&rays, &mut blocked, Some(&mut counters));
                let mut uncounted = vec![false; rays.len()];
                structure.occluded(&rays, &mut uncounted, None);
                assert_eq!(blocked, uncounted, "{spec}");
                let spared = counters.iter().map(|c| c.spared).sum::<u32>();
                (blocked, spared)
            };
            let (expected, none) = trace("none");
            let behind = expected.iter().filter(|&&blocked| blocked).count();
            assert!(
                (1024..4096).contains(&behind),
                "{}: {behind}",
                way.traversal
            );
            let (blocked, spared) = trace("cache");
            assert_eq!((blocked == expected, none), (true, 0), "{}", tree.id);
            assert!(spared > 512, "{}: {spared} of {behind} spared", tree.id);
            tried += 1;
        }
    }
    assert!(tried > 20, "{tried} ways in tiles and packets");
}
