// SPDX-License-Identifier: GPL-3.0-or-later
//! Scenes far from the origin: every structure and traversal gives the exact answers, for rays that start in the scene,
//! near it, at the origin and beyond, where the frame rounds their origins; and far scenes take no more work than near
//! ones.

use super::{build, closest, on_all_cores, same};
use halfspace::oracle::cases::{Random, aimed, grid, ray, soup};
use halfspace::oracle::exact_closest;
use halfspace::ray::{Hit, Order, Ray, RayCounters, Tracer};
use halfspace::registry::TREES;
use halfspace::scene::Triangles;
use halfspace::structure::row::Kind;
use std::sync::Arc;

/// Offsets, with scenes that are scaled or translated along some axes only.
const OFFSETS: [([f32; 3], f32); 6] = [
    ([148_376.0, 1234.0, -223_423.0], 1.0),
    ([-3e7, 0.25, 40.0], 8.0),
    ([0.0, -17.0, 0.0], 1.0),
    ([1e-9, -1e-11, 0.0], 1e-14),
    ([6e16, 3e15, -9e16], 1e12),
    ([3e38, 2e38, -3e38], 1e36),
];

/// Returns every structure with each of its ways, and with each way of tracing shadow rays.
pub fn specs() -> Vec<String> {
    let mut specs = Vec::new();
    for tree in TREES {
        specs.extend(tree.spelled_ways());
        let shadow = tree.params.iter().find(|p| p.name == "shadow");
        if let Some(Kind::Choice(ways)) = shadow.map(|p| &p.kind) {
            let others = ways.iter().filter(|way| way.name != "none");
            specs.extend(others.map(|way| format!("{}:shadow={}", tree.id, way.name)));
        }
    }
    specs
}

/// Returns boxes that touch, and some free triangles, of this size at an offset.
fn scene(offset: [f32; 3], size: f32) -> Arc<Triangles> {
    let mut random = Random(5);
    let mut corners = grid(2, 0.5);
    for _ in 0..40 {
        let at = random.point(0.0, 2.0);
        corners.extend([0; 3].map(|_| {
            let by = random.point(-0.3, 0.3);
            std::array::from_fn(|k| at[k] + by[k])
        }));
    }
    soup(
        corners
            .iter()
            .map(|p| std::array::from_fn(|k| offset[k] + size * p[k]))
            .collect(),
    )
}

/// Returns rays of all kinds at a scene, 64 of each kind.
fn rays(scene: &Triangles, offset: [f32; 3], size: f32) -> Vec<Ray> {
    let mut random = Random(9);
    let mut rays = aimed(scene, 64, &mut random);
    let at = |p: [f32; 3]| -> [f32; 3] { std::array::from_fn(|k| offset[k] + size * p[k]) };
    // Aim from common origins near and far, among them some that the frame must round.
    let eyes = [
        at([1.1, 0.9, 1.2]),
        at([-9.0, 2.0, 5.0]),
        [0.1 * size, 0.3 * size, -0.7 * size],
        offset.map(|x| -0.37 * x),
        offset.map(|x| 0.49 * x + 0.3 * size),
    ];
    for eye in eyes {
        for _ in 0..64 {
            let to = at(random.point(0.0, 2.0));
            rays.push(ray(eye, std::array::from_fn(|k| to[k] - eye[k])));
        }
        // Send shadow rays to the same points, from the scene.
        for _ in 0..64 {
            let o = at(random.point(0.0, 2.0));
            rays.push(Ray {
                t_max: 1.0,
                ..ray(o, std::array::from_fn(|k| eye[k] - o[k]))
            });
        }
    }
    // Send parallel rays along an axis and aslant, from near and from far.
    for d in [[1.0, 0.0, 0.0], [0.6, -0.64, 0.48]] {
        for back in [3.0, 1e3, 1e9] {
            for _ in 0..32 {
                let to = at(random.point(0.0, 2.0));
                rays.push(ray(std::array::from_fn(|k| to[k] - back * size * d[k]), d));
            }
        }
    }
    rays.retain(|ray| ray.o.iter().chain(&ray.d).all(|x| x.is_finite()));
    rays
}

#[test]
fn far_scenes_get_exact_answers() {
    on_all_cores(OFFSETS.to_vec(), |(offset, size)| {
        let scene = scene(offset, size);
        let rays = rays(&scene, offset, size);
        assert!(scene.live().len() > 60 && rays.len() > 500, "{offset:?}");
        let exact: Vec<_> = rays
            .iter()
            .map(|ray| exact_closest(&scene, ray).hit)
            .collect();
        assert!(
            exact.iter().filter(|hit| hit.is_hit()).count() > 200,
            "{offset:?}"
        );
        for spec in specs() {
            let structure = build(&scene, &spec, 1);
            let (mut hits, mut occluded) = (vec![Hit::MISS; rays.len()], vec![false; rays.len()]);
            for order in [Order::None, Order::Tiles] {
                structure.closest_ordered(&rays, &mut hits, None, order);
                structure.occluded(&rays, &mut occluded, None);
                for (i, ray) in rays.iter().enumerate() {
                    let (hit, exact) = (hits[i], exact[i]);
                    let name = format!("{spec} at {offset:?}, ray {i}: {ray:?}");
                    assert!(same(&hit, &exact), "{name}: {hit:?} {exact:?}");
                    assert_eq!(occluded[i], exact.is_hit(), "{name}");
                }
            }
        }
    });
}

/// The frames of a far scene and of its twin differ by the middle of the scene, so that planes are rounded otherwise and
/// small trees may differ. Bounds that grow with the offset take many times as many tests.
#[test]
fn far_scenes_take_no_more_work() {
    let work = |offset: [f32; 3]| {
        let scene = scene(offset, 1.0);
        // The twin at the origin has the vertices that were rounded at the offset.
        let back = |p: [f32; 3]| -> [f32; 3] { std::array::from_fn(|k| p[k] - offset[k]) };
        let near = Arc::new(
            Triangles::new(
                scene.vertices().iter().map(|p| back(*p)).collect(),
                scene.indices().to_vec(),
            )
            .expect("as many vertices"),
        );
        let from = |o: [f32; 3]| -> Vec<Ray> {
            let mut random = Random(3);
            (0..512).map(|_| ray(o, random.point(-1.0, 1.0))).collect()
        };
        let inside = [offset[0] + 1.0, offset[1] + 1.0, offset[2] + 1.0];
        (scene, from(inside), near, from(back(inside)))
    };
    let (far, far_rays, near, near_rays) = work(OFFSETS[0].0);
    let count = |scene: &Arc<Triangles>, rays: &[Ray], spec: &str| {
        let mut counters = vec![RayCounters::default(); rays.len()];
        let mut hits = vec![Hit::MISS; rays.len()];
        build(scene, spec, 1).closest(rays, &mut hits, Some(&mut counters));
        let sum =
            |of: fn(&RayCounters) -> u32| counters.iter().map(|c| f64::from(of(c))).sum::<f64>();
        [sum(RayCounters::visits), sum(|c| c.tests)]
    };
    for spec in specs() {
        let (far, near) = (
            count(&far, &far_rays, &spec),
            count(&near, &near_rays, &spec),
        );
        for (far, near) in far.into_iter().zip(near) {
            assert!(far <= 1.5 * near, "{spec}: {far} instead of {near}");
        }
    }
}

/// Rays from far away are blurred as much as the scene is large: they meet nearly all leaves, and a triangle is in many.
#[test]
fn rays_from_far_away_test_no_triangle_often() {
    let scene = scene([0.0; 3], 1.0);
    for far in [1e6_f32, 1e8, 1e12] {
        let mut random = Random(4);
        let rays: Vec<_> = aimed(&scene, 64, &mut random)
            .iter()
            .map(|near| {
                let o = std::array::from_fn(|k| near.o[k] - far * near.d[k]);
                ray(o, near.d)
            })
            .collect();
        let expected = closest(&build(&scene, "brute", 1), &rays);
        for spec in specs() {
            let structure = build(&scene, &spec, 1);
            let mut counters = vec![RayCounters::default(); rays.len()];
            let mut hits = vec![Hit::MISS; rays.len()];
            structure.closest(&rays, &mut hits, Some(&mut counters));
            assert!(
                hits.iter().zip(&expected).all(|(a, b)| same(a, b)),
                "{spec} from {far}"
            );
            let tests: f64 = counters.iter().map(|c| f64::from(c.tests)).sum();
            let most = 1.5 * (rays.len() * scene.live().len()) as f64;
            assert!(tests <= most, "{spec} from {far}: {tests} of {most}");
        }
    }
}
