// SPDX-License-Identifier: GPL-3.0-or-later
//! Rays that go together, in streams, packets and tiles, through every kind of nodes: they answer like brute force, and
//! share the visits that they make alone.

mod common;

use common::build;
use halfspace::oracle::cases::{Random, aimed, cloud, everywhere, ray, soup, strew};
use halfspace::oracle::levels;
use halfspace::ray::{Hit, Order, Ray, RayCounters, Tracer};
use halfspace::scene::Triangles;
use halfspace::stream::OCTANTS;
use proptest::prelude::*;
use std::sync::Arc;

/// Trees with each kind of nodes, and whether each ray of a list makes the visits that it makes alone: the octant alone
/// puts children in order, and they lie in their parents. Otherwise the first ray of a list decides for the others which
/// leaves come first, or, at turned boxes, a ray alone ends before a node whose children it would meet.
const TREES: [(&str, bool); 18] = [
    ("kd", true),
    ("bsp-wn-plus-kd", false),
    ("kd:nodes=wide", false),
    ("bsp-wn-plus-kd:nodes=wide", false),
    ("bvh-sah", true),
    ("bvh-sah:width=4", true),
    ("bvh-sah:width=2", true),
    ("obb", false),
    ("bih", true),
    ("bih5:leaves=corners", true),
    ("bih5:cut=split", true),
    ("bih-bvh", true),
    ("bih1", true),
    ("bih-n:n=2", true),
    ("bih-n:n=8", true),
    ("bih-obl", false),
    ("octree-param", true),
    ("grid", true),
];

/// Number of times that each ray is sent.
const COPIES: usize = 4;

/// Builds a tree whose rays go this way.
fn going(scene: &Arc<Triangles>, tree: &str, way: &str) -> halfspace::structure::Structure {
    let separator = if tree.contains(':') { ',' } else { ':' };
    build(scene, &format!("{tree}{separator}traversal={way}"))
}

/// The nearest hits of rays in tiles, and whether each ray hits anything.
fn answers(tracer: &impl Tracer, rays: &[Ray]) -> (Vec<[u32; 4]>, Vec<bool>) {
    let mut hits = vec![Hit::MISS; rays.len()];
    tracer.closest_ordered(rays, &mut hits, None, Order::Tiles);
    let mut blocked = vec![false; rays.len()];
    tracer.occluded(rays, &mut blocked, None);
    let bits = |hit: &Hit| {
        let [t, u, v] = [hit.t, hit.u, hit.v].map(f32::to_bits);
        [t, hit.triangle, u, v]
    };
    (hits.iter().map(bits).collect(), blocked)
}

/// Checks every tree with these ways on every instruction set. Returns the distances of the nearest hits.
fn agree(scene: &Arc<Triangles>, rays: &[Ray], ways: &[&str]) -> Vec<f32> {
    let expected = answers(&build(scene, "brute"), rays);
    for (tree, _) in TREES {
        for way in ways {
            let structure = going(scene, tree, way);
            for (set, level) in levels() {
                let found = answers(&structure.at_level(level), rays);
                let wrong = (0..rays.len())
                    .find(|&i| found.0[i] != expected.0[i] || found.1[i] != expected.1[i]);
                assert_eq!(wrong, None, "{tree}, {way}, {set}: number of a ray");
            }
        }
    }
    expected
        .0
        .iter()
        .map(|hit| f32::from_bits(hit[0]))
        .collect()
}

/// Rays from an eye through `n` squares of 8 by 8 pixels.
fn pixels(eye: [f32; 3], n: usize) -> Vec<Ray> {
    let square = |i: usize| (0..64).map(move |pixel| (i, pixel));
    let pixels = (0..n).flat_map(square);
    let rays = pixels.map(|(i, pixel)| {
        let x = (8 * (i % 6) + pixel % 8) as f32 / 24.0 - 1.0;
        let y = (8 * (i / 6) + pixel / 8) as f32 / 24.0 - 0.7;
        let forward = [0, 1, 2].map(|k: usize| -eye[k]);
        ray(
            eye,
            [forward[0] + x, forward[1] + y, forward[2] + 0.3 * (x - y)],
        )
    });
    rays.collect()
}

/// Camera rays and shadow rays of one light, in order of pixels: whole tiles, tiles with missing rays and a part of one.
#[test]
fn tiles_of_a_camera_and_of_a_light_answer_like_brute_force() {
    let mut random = Random(8);
    let ways = ["packet", "tile"];
    for size in [0.05, 0.3] {
        let scene = soup(cloud(300, size, &mut random));
        for eye in [[0.0, 0.0, 4.0], [0.1, 0.2, 0.05], [3.0, -2.0, 2.5]] {
            let rays = pixels(eye, 24);
            let distances = agree(&scene, &rays, &ways);
            // Send rays from each hit back to the eye, as to a light.
            let hits = rays.iter().zip(&distances).filter(|(_, t)| t.is_finite());
            let to_light: Vec<_> = hits
                .map(|(seen, &t)| {
                    let point = [0, 1, 2].map(|k: usize| seen.o[k] + t * seen.d[k]);
                    Ray {
                        t_min: 1e-4,
                        t_max: 1.0 - 1e-4,
                        ..ray(point, [0, 1, 2].map(|k: usize| eye[k] - point[k]))
                    }
                })
                .collect();
            assert!(to_light.len() > 20);
            agree(&scene, &to_light, &ways);
            agree(&scene, &rays[..37], &ways);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn rays_that_go_together_answer_like_brute_force(
        seed: u64,
        triangles in 1_usize..200,
        size in 0.001_f32..1.0,
        count in 1_usize..400,
        every in 2_usize..50,
    ) {
        let mut random = Random(seed);
        let scene = soup(cloud(triangles, size, &mut random));
        let mut rays = aimed(&scene, count, &mut random);
        rays.extend(everywhere(count / 4, &mut random));
        strew(&mut rays, every);
        agree(&scene, &rays, &["stream", "packet", "tile"]);
    }
}

/// Which rays are counted.
#[derive(Clone, Copy, Debug)]
enum Wanted {
    Nearest,
    Any,
}

/// Counts a batch in order of tiles; the answers are compared with those of the timed kernel.
fn counted(tracer: &impl Tracer, rays: &[Ray], wanted: Wanted) -> Vec<RayCounters> {
    let mut counters = vec![RayCounters::default(); rays.len()];
    let (hits, blocked) = answers(tracer, rays);
    match wanted {
        Wanted::Nearest => {
            let mut found = vec![Hit::MISS; rays.len()];
            tracer.closest_ordered(rays, &mut found, Some(&mut counters), Order::Tiles);
            assert!(found.iter().zip(&hits).all(|(a, b)| a.t.to_bits() == b[0]));
        }
        Wanted::Any => {
            let mut found = vec![false; rays.len()];
            tracer.occluded(rays, &mut found, Some(&mut counters));
            assert_eq!(found, blocked);
        }
    }
    counters
}

/// Number of visits to nodes and leaves that these rays pay for.
fn paid(all: &[RayCounters]) -> u32 {
    all.iter().map(|own| own.steps() + own.leaves).sum()
}

/// Number of visits that these rays share with another ray, which pays.
fn shared(all: &[RayCounters]) -> u32 {
    all.iter().map(|own| own.joined).sum()
}

/// Rays of the tests of counters.
fn scene_and_rays(seed: u64) -> (Arc<Triangles>, Vec<Ray>) {
    let mut random = Random(seed);
    let scene = soup(cloud(400, 0.2, &mut random));
    let mut rays = aimed(&scene, 600, &mut random);
    strew(&mut rays, 40);
    (scene, rays)
}

/// Streams visit what their rays visit alone, and one of them pays for each visit.
#[test]
fn rays_of_streams_share_the_visits_that_they_make_alone() {
    let (scene, rays) = scene_and_rays(11);
    for (tree, ordered) in TREES {
        let structure = going(&scene, tree, "stream");
        for wanted in [Wanted::Nearest, Wanted::Any] {
            let name = format!("{tree}, {wanted:?}");
            let together = counted(&structure, &rays, wanted);
            let alone: Vec<_> = (rays.iter())
                .flat_map(|ray| counted(&structure, std::slice::from_ref(ray), wanted))
                .collect();
            assert!(alone.iter().all(|own| own.joined == 0), "{name}");
            // Alone, each ray pays for its visit to the root; together, one ray of an octant does.
            let at_root: u32 = alone.iter().map(|own| u32::from(own.steps() > 0)).sum();
            assert!(at_root > 100, "{name}: {at_root} rays enter the tree");
            let most = paid(&alone) + u32::try_from(OCTANTS).unwrap();
            assert!(
                paid(&together) + at_root <= most,
                "{name}: visits are shared"
            );
            // Equal rays visit the same nodes: the first pays, the others join.
            let repeated: Vec<_> = rays.iter().flat_map(|&ray| [ray; COPIES]).collect();
            let repeated = counted(&structure, &repeated, wanted);
            assert_eq!(paid(&repeated), paid(&together), "{name}: equal rays");
            let visits = paid(&together) + shared(&together);
            let copies = u32::try_from(COPIES).unwrap();
            assert_eq!(
                paid(&repeated) + shared(&repeated),
                copies * visits,
                "{name}"
            );
            if ordered {
                assert_eq!(visits, paid(&alone), "{name}: a visit is paid or shared");
                for (own, all) in alone.iter().zip(&together) {
                    let work = |one: &RayCounters| (one.visits(), one.tests, one.verdicts);
                    assert_eq!(work(own), work(all), "{name}");
                }
            }
        }
    }
}

#[test]
fn packets_and_tiles_count_themselves() {
    let (scene, rays) = scene_and_rays(12);
    for (tree, _) in TREES {
        for way in ["packet", "tile"] {
            let structure = going(&scene, tree, way);
            assert!(structure.routes().iter().skip(1).all(|route| route.counted));
            for wanted in [Wanted::Nearest, Wanted::Any] {
                let all = counted(&structure, &rays, wanted);
                let tests: u32 = all.iter().map(|own| own.tests).sum();
                // Every ray that hits has visited nodes, and some share them.
                let (hits, _) = answers(&structure, &rays);
                let hit = hits.iter().map(|hit| hit[1] != Hit::NONE);
                let lost = hit.zip(&all).filter(|(hit, own)| *hit && own.visits() < 2);
                assert_eq!(lost.count(), 0, "{tree}, {way}, {wanted:?}");
                assert!(shared(&all) > 0, "{tree}, {way}, {wanted:?}");
                assert!(paid(&all) > 600 && tests > 600, "{tree}, {way}, {wanted:?}");
            }
        }
    }
}
