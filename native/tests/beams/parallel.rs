// SPDX-License-Identifier: GPL-3.0-or-later
//! Polygon beams of one direction, those of orthographic cameras and of suns: every answer is that of brute force, and
//! the counters say which rays were in beams.

use crate::hard;
use halfspace::base::Monitor;
use halfspace::oracle::cases::{Random, grid, ray, soup, strew};
use halfspace::polybeam::NAMES;
use halfspace::ray::rays::Limits;
use halfspace::ray::{Hit, Order, Ray, RayCounters, Rays, Tracer};
use halfspace::registry;
use halfspace::scene::Triangles;
use halfspace::structure::Structure;
use halfspace::structure::threads;
use std::sync::Arc;

const POLYGONS: &str = "octree-beam:traversal=polygon,shadow=beam";

fn build(scene: &Arc<Triangles>, spec: &str) -> Structure {
    let config = registry::parse(spec).unwrap();
    Structure::build(scene.clone(), config, 1, &Monitor::new()).unwrap()
}

/// Structures with several thresholds of beams.
fn structures(scene: &Arc<Triangles>) -> [Structure; 2] {
    [1, 16].map(|least| build(scene, &format!("{POLYGONS},beam_min={least}")))
}

fn scattered(random: &mut Random, count: usize, size: f32) -> Arc<Triangles> {
    let mut corners = Vec::new();
    for _ in 0..count {
        let centre = random.point(-1.0, 1.0);
        for _ in 0..3 {
            let aside = random.point(-size, size);
            corners.push(std::array::from_fn(|k| centre[k] + aside[k]));
        }
    }
    soup(corners)
}

/// Compares nearest hits, bit for bit, and any hits with brute force; returns the number of hits, and the numbers of
/// single rays of both.
fn compare(structure: &Structure, brute: &Structure, rays: &[Ray], name: &str) -> [u64; 3] {
    let bits = |h: &Hit| [h.t.to_bits(), h.triangle, h.u.to_bits(), h.v.to_bits()];
    let mut expected = vec![Hit::MISS; rays.len()];
    brute.closest(rays, &mut expected, None);
    let mut hits = vec![Hit::MISS; rays.len()];
    structure.closest_ordered(rays, &mut hits, None, Order::Tiles);
    for ((own, other), ray) in hits.iter().zip(&expected).zip(rays) {
        assert_eq!(bits(own), bits(other), "{name}: {ray:?}");
    }
    let mut blocked = vec![false; rays.len()];
    structure.occluded(rays, &mut blocked, None);
    for ((own, other), ray) in blocked.iter().zip(&expected).zip(rays) {
        assert_eq!(*own, other.is_hit(), "{name}: {ray:?}");
    }
    // Count both, with the same answers.
    let mut counters = vec![RayCounters::default(); rays.len()];
    let mut again = vec![Hit::MISS; rays.len()];
    structure.closest_ordered(rays, &mut again, Some(&mut counters), Order::Tiles);
    assert!(again.iter().map(bits).eq(hits.iter().map(bits)), "{name}");
    let nearest = events(&counters, "beam_singles");
    let mut counters = vec![RayCounters::default(); rays.len()];
    let mut again = vec![false; rays.len()];
    structure.occluded(rays, &mut again, Some(&mut counters));
    assert_eq!(again, blocked, "{name}");
    let count = blocked.iter().filter(|own| **own).count() as u64;
    [count, nearest, events(&counters, "beam_singles")]
}

fn events(counters: &[RayCounters], name: &str) -> u64 {
    let i = NAMES.iter().position(|own| *own == name).unwrap();
    counters.iter().map(|own| u64::from(own.cases[i])).sum()
}

/// A window of `size` pixels around the origin that looks along `d`, from `far` in front of it.
fn window(d: [f32; 3], [width, height]: [usize; 2], wide: f32, far: f32) -> Vec<Ray> {
    let across = if d[0].abs() < 0.5 {
        [1.0, 0.0, 0.0]
    } else {
        [0.0, 1.0, 0.0]
    };
    let up = [0, 1, 2].map(|k: usize| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        d[i] * across[j] - d[j] * across[i]
    });
    let pixel = |i: usize| {
        let at = |i: usize, n: usize| wide * ((2 * i + 1) as f32 / n as f32 - 1.0);
        let (x, y) = (at(i % width, width), at(i / width, height));
        ray(
            [0, 1, 2].map(|k: usize| x * across[k] + y * up[k] - far * d[k]),
            d,
        )
    };
    (0..width * height).map(pixel).collect()
}

#[test]
fn orthographic_cameras_and_suns_see_what_brute_force_sees() {
    let mut random = Random(21);
    let mut hits = 0;
    for round in 0..16 {
        let (count, size) = ([30, 300, 1500][round % 3], [0.3, 0.1, 0.05][round % 3]);
        let scene = scattered(&mut random, count, size);
        let brute = build(&scene, "brute");
        for structure in structures(&scene) {
            // Look from outside, from far away, and from inside.
            for far in [3.0, 50.0, 0.2] {
                let mut d = random.point(-1.0, 1.0);
                if round % 4 == 0 {
                    d[round % 3] = 0.0;
                }
                let wide = 0.4 + random.unit();
                let rays = window(d, [56, 40], wide, far);
                let own = compare(&structure, &brute, &rays, &format!("{round} from {far}"));
                hits += own[0];
                // Rays from surfaces, as shadow rays begin.
                let triangles = scene.live().len();
                let rays: Vec<_> = (0..1500)
                    .map(|i| {
                        let [a, b, c] = scene.corners(u32::try_from(i % triangles).unwrap());
                        let o = [0, 1, 2].map(|k: usize| (a[k] + b[k] + c[k]) / 3.0);
                        Ray {
                            t_min: [0.0, 1e-3][i % 2],
                            ..ray(o, d)
                        }
                    })
                    .collect();
                hits += compare(&structure, &brute, &rays, &format!("{round} from surfaces"))[0];
            }
        }
    }
    assert!(hits > 20_000, "{hits} hits");
}

/// Rays that cross a large wall at a small angle pass small triangles on the way, in later cells than the first in
/// which the hit with the wall is found: a ray must go on up to that hit.
#[test]
fn rays_pass_all_cells_before_a_hit_far_behind_the_first() {
    let mut random = Random(31);
    let wall = [[-2.0, -1.5, -0.05], [2.0, -1.5, -0.05], [0.0, 4.0, 0.1]];
    let mut corners: Vec<_> = wall.to_vec();
    for _ in 0..250 {
        let centre = random.point(-0.9, 0.9);
        for _ in 0..3 {
            let aside = random.point(-0.06, 0.06);
            corners.push([0, 1, 2].map(|k| [1.0, 1.0, 0.15][k] * centre[k] + aside[k]));
        }
    }
    let scene = soup(corners);
    let brute = build(&scene, "brute");
    for structure in structures(&scene) {
        // Half of the distance to a hit lies before the scene, or well before the hit.
        for (far, slope) in [(1.0, 0.1), (1.5, 0.06), (40.0, 0.15), (1.2, -0.1)] {
            let rays = window([0.02, 1.0, slope], [80, 60], 0.8, far);
            let name = format!("slope {slope} from {far}");
            let [hits, nearest, _] = compare(&structure, &brute, &rays, &name);
            assert!(hits > 300, "{name}: {hits} hits");
            assert!(nearest < rays.len() as u64, "{name}: all rays went singly");
        }
    }
}

#[test]
fn directions_along_axes_and_walls_answer_like_brute_force() {
    let scene = soup(grid(3, 0.2));
    let brute = build(&scene, "brute");
    let mut random = Random(4);
    let steps = [0.0, -0.0, 1.0, -1.0, 0.5, 1e-20, -1e-38, 1e-7];
    for structure in structures(&scene) {
        for round in 0..60 {
            let mut d = [(); 3].map(|()| random.pick(&steps));
            d[round % 3] = [1.0, -1.0][round / 3 % 2];
            let rays: Vec<_> = (0..600)
                .map(|_| {
                    let place = |random: &mut Random| random.below(21) as f32 / 4.0 - 1.0;
                    ray([(); 3].map(|()| place(&mut random)), d)
                })
                .collect();
            let own = compare(&structure, &brute, &rays, &format!("{d:?}"));
            assert!(own[1] <= rays.len() as u64 && own[2] <= rays.len() as u64);
        }
    }
}

#[test]
fn extreme_scenes_in_parallel_light_answer_like_brute_force() {
    let mut random = Random(5);
    for case in hard::cases(11) {
        let brute = build(&case.scene, "brute");
        for structure in structures(&case.scene) {
            for odd in [usize::MAX, 5] {
                let d = case.rays[random.below(case.rays.len())].d;
                let mut rays: Vec<_> = case.rays.iter().map(|ray| Ray { d, ..*ray }).collect();
                strew(&mut rays, odd);
                compare(&structure, &brute, &rays, &format!("{}: {d:?}", case.name));
            }
        }
    }
}

/// A batch and its name, whether all nearest-hit rays go singly, and whether all any-hit rays do.
type Odd = (&'static str, Vec<Ray>, [bool; 2]);

fn odd_batches() -> Vec<Odd> {
    let (d, n) = ([0.1, 1.0, 0.2], 400);
    let from = |x: f32, y: f32| ray([x, -4.0, y], d);
    let spread = |i: i32| from(0.01 * i as f32 - 0.5, (0.03 * i as f32) % 4.0 - 0.5);
    let each = |of: &dyn Fn(i32) -> Ray| (0..n).map(of).collect::<Vec<_>>();
    vec![
        ("no ray", vec![], [false; 2]),
        ("one ray", vec![from(1.0, 1.0)], [true; 2]),
        (
            "a line",
            each(&|i| from(0.01 * i as f32 - 0.5, 1.1)),
            [false; 2],
        ),
        (
            "next to the scene",
            each(&|i| from(90.0 + i as f32, 1.0)),
            [false; 2],
        ),
        (
            "away from the scene",
            each(&|i| Ray {
                d: d.map(|x| -x),
                ..spread(i)
            }),
            [false; 2],
        ),
        (
            "backwards",
            each(&|i| Ray {
                d: d.map(|x| -x),
                t_min: f32::NEG_INFINITY,
                t_max: 0.0,
                ..spread(i)
            }),
            [false; 2],
        ),
        (
            "empty intervals",
            each(&|i| Ray {
                t_min: 5.0,
                t_max: 4.0,
                ..spread(i)
            }),
            [true; 2],
        ),
        (
            "mixed directions",
            each(&|i| Ray {
                d: [0.1 + 1e-3 * i as f32, 1.0, 0.2],
                ..spread(i)
            }),
            [true; 2],
        ),
        (
            "no direction",
            each(&|i| Ray {
                d: [0.0; 3],
                ..spread(i)
            }),
            [true; 2],
        ),
        (
            "two directions",
            each(&|i| Ray {
                d: [0.1, 1.0, [0.2, -0.2][i as usize % 2]],
                ..spread(i)
            }),
            [false; 2],
        ),
    ]
}

#[test]
fn odd_batches_are_answered_and_counted() {
    let scene = soup(grid(3, 0.2));
    let brute = build(&scene, "brute");
    for structure in structures(&scene) {
        let least = structure.config().integer("beam_min");
        for (name, rays, singly) in odd_batches() {
            let [_, nearest, any] = compare(&structure, &brute, &rays, name);
            for (count, all) in [nearest, any].into_iter().zip(singly) {
                let most = rays.len() as u64;
                if all {
                    assert!(
                        count == most || (least == 1 && most == 1),
                        "{name}: {count}"
                    );
                } else {
                    assert!(rays.is_empty() || count < most, "{name}: {count} of {most}");
                }
            }
        }
    }
}

#[test]
fn counters_do_not_depend_on_the_number_of_threads() {
    let mut random = Random(13);
    let scene = scattered(&mut random, 400, 0.1);
    let structure = build(&scene, POLYGONS);
    let d = [0.2, 1.0, -0.3];
    let rays = window(d, [512, 320], 1.2, 3.0);
    assert!(rays.len() > 2 * threads::CHUNK);
    let (origins, directions): (Vec<_>, Vec<_>) = rays.iter().map(|ray| (ray.o, ray.d)).unzip();
    let batch = || Rays {
        origins: &origins,
        directions: &directions,
        t_min: Limits::Same(0.0),
        t_max: Limits::Same(f32::INFINITY),
        order: Order::Tiles,
        monitor: None,
    };
    let nearest = [1, 2, 3].map(|n| threads::closest(&structure, batch(), n, true).unwrap());
    let any = [1, 2, 3].map(|n| threads::occluded(&structure, batch(), n, true).unwrap());
    for i in 1..3 {
        assert!(nearest[i] == nearest[0], "nearest hits");
        assert!(any[i] == any[0], "any hits");
    }
    let counters = nearest[0].1.as_ref().unwrap();
    for name in NAMES {
        assert!(events(counters, name) > 0, "{name}");
    }
}

#[test]
fn an_extra_parallel_ray_costs_a_quarter_of_a_single_ray_in_steps() {
    let mut random = Random(8);
    let scene = scattered(&mut random, 100, 0.06);
    let structure = build(&scene, POLYGONS);
    let d = [0.1, 1.0, -0.2];
    let nodes = |counters: &[RayCounters]| -> i64 {
        let own = |c: &RayCounters| i64::from(c.steps() + c.leaves + c.leaves_empty);
        counters.iter().map(own).sum()
    };
    let nearest = |n: usize, order| {
        let rays = window(d, [n, n], 0.9, 3.0);
        let mut hits = vec![Hit::MISS; rays.len()];
        let mut counters = vec![RayCounters::default(); rays.len()];
        structure.closest_ordered(&rays, &mut hits, Some(&mut counters), order);
        nodes(&counters)
    };
    let more = |order| nearest(400, order) - nearest(200, order);
    let (beams, single) = (more(Order::Tiles), more(Order::None));
    assert!(4 * beams < single, "{beams} against {single}");
    // Shadow rays of a sun.
    let sunny = build(&scene, "octree-net");
    let any = |structure: &Structure, n: usize| {
        let rays = window(d, [n, n], 0.9, 0.0);
        let mut blocked = vec![false; rays.len()];
        let mut counters = vec![RayCounters::default(); rays.len()];
        structure.occluded(&rays, &mut blocked, Some(&mut counters));
        nodes(&counters)
    };
    let more = |structure: &Structure| any(structure, 400) - any(structure, 200);
    let (beams, single) = (more(&structure), more(&sunny));
    assert!(2 * beams < single, "{beams} against {single}");
}
