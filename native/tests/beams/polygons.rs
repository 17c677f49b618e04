// SPDX-License-Identifier: GPL-3.0-or-later
//! Beams that begin with the whole image: every answer is that of brute force, whatever the camera and the order of the
//! rays, and the counters say what the beams did.

use halfspace::base::Monitor;
use halfspace::oracle::cases::{Random, Size, cases, grid, ray, soup};
use halfspace::polybeam::NAMES;
use halfspace::ray::rays::Limits;
use halfspace::ray::{Hit, Order, Ray, RayCounters, Rays, Tracer};
use halfspace::registry;
use halfspace::scene::Triangles;
use halfspace::structure::Structure;
use halfspace::structure::threads;
use std::sync::Arc;

const POLYGONS: &str = "octree-beam:traversal=polygon";

fn build(scene: &Arc<Triangles>, spec: &str) -> Structure {
    let config = registry::parse(spec).unwrap();
    Structure::build(scene.clone(), config, 1, &Monitor::new()).unwrap()
}

/// Random triangles of about `size`, in the cube from -1 to 1.
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

/// A picture of `size` pixels row by row, with `samples` random rays in each, from a random pinhole.
fn picture(random: &mut Random, size: [usize; 2], samples: usize, far: f32) -> Vec<Ray> {
    let o = random.point(-far, far);
    let axes = [(); 3].map(|()| random.point(-1.0, 1.0));
    let wide = 0.05 + 2.0 * random.unit() * random.unit();
    let mut rays = Vec::new();
    for y in 0..size[1] {
        for x in 0..size[0] {
            for _ in 0..samples {
                let at = |i: usize, n: usize, jitter: f32| {
                    wide * (2.0 * (i as f32 + jitter) / n as f32 - 1.0)
                };
                let (u, v) = (at(x, size[0], random.unit()), at(y, size[1], random.unit()));
                rays.push(ray(
                    o,
                    std::array::from_fn(|k| axes[0][k] + u * axes[1][k] + v * axes[2][k]),
                ));
            }
        }
    }
    rays
}

fn answers(structure: &Structure, rays: &[Ray], order: Order) -> Vec<[u32; 4]> {
    let mut hits = vec![Hit::MISS; rays.len()];
    structure.closest_ordered(rays, &mut hits, None, order);
    let bits = |h: &Hit| [h.t.to_bits(), h.triangle, h.u.to_bits(), h.v.to_bits()];
    hits.iter().map(bits).collect()
}

/// The counters of each ray, after their answers are compared with those without counters.
fn counted(structure: &Structure, rays: &[Ray]) -> Vec<RayCounters> {
    let mut hits = vec![Hit::MISS; rays.len()];
    let mut counters = vec![RayCounters::default(); rays.len()];
    structure.closest_ordered(rays, &mut hits, Some(&mut counters), Order::Tiles);
    let found: Vec<_> = hits
        .iter()
        .map(|hit| (hit.t.to_bits(), hit.triangle))
        .collect();
    let quick = answers(structure, rays, Order::Tiles);
    assert!(quick.iter().map(|hit| (hit[0], hit[1])).eq(found));
    counters
}

fn sum(counters: &[RayCounters], of: impl Fn(&RayCounters) -> u32) -> u64 {
    counters.iter().map(|own| u64::from(of(own))).sum()
}

fn events(counters: &[RayCounters], name: &str) -> u64 {
    let i = NAMES.iter().position(|own| *own == name).unwrap();
    sum(counters, |own| own.cases[i])
}

#[test]
fn random_cameras_see_what_brute_force_sees() {
    let mut random = Random(20);
    let mut hits = 0;
    for round in 0..24 {
        let (count, size) = ([30, 300, 1500][round % 3], [0.3, 0.1, 0.05][round % 3]);
        let scene = scattered(&mut random, count, size);
        let brute = build(&scene, "brute");
        let structures: Vec<_> = [1, 7, 64]
            .map(|least| format!("{POLYGONS},beam_min={least},leaf_size={}", 1 + least % 8))
            .map(|spec| build(&scene, &spec))
            .into();
        for far in [0.5, 2.5] {
            let rays = picture(&mut random, [48, 32], 1 + round % 4, far);
            let expected = answers(&brute, &rays, Order::None);
            hits += expected.iter().filter(|hit| hit[1] != Hit::NONE).count();
            for structure in &structures {
                let found = answers(structure, &rays, Order::Tiles);
                let wrong = found.iter().zip(&expected).filter(|(a, b)| a != b).count();
                assert_eq!(wrong, 0, "round {round}: of {} rays", rays.len());
            }
        }
    }
    assert!(hits > 10_000, "{hits} hits");
}

#[test]
fn the_order_of_the_rays_and_the_size_of_batches_change_nothing() {
    let mut random = Random(3);
    let scene = scattered(&mut random, 400, 0.1);
    let structure = build(&scene, POLYGONS);
    let mut rays = picture(&mut random, [64, 48], 3, 2.5);
    // Rays of a second camera have no beams, and those of a lens have no common origin.
    rays.extend(picture(&mut random, [16, 16], 1, 2.5));
    rays.extend((0..500).map(|_| ray(random.point(-2.0, 2.0), random.point(-1.0, 1.0))));
    for i in (1..rays.len()).rev() {
        rays.swap(i, random.below(i + 1));
    }
    let expected = answers(&build(&scene, "brute"), &rays, Order::None);
    assert_eq!(answers(&structure, &rays, Order::Tiles), expected);
    // Whole batches of the threads are larger than usual, and as good.
    let (origins, directions): (Vec<_>, Vec<_>) = rays.iter().map(|ray| (ray.o, ray.d)).unzip();
    let many = 12;
    let arrays = [origins, directions].map(|rows| rows.repeat(many));
    let batch = Rays {
        origins: &arrays[0],
        directions: &arrays[1],
        t_min: Limits::Same(0.0),
        t_max: Limits::Same(f32::INFINITY),
        order: Order::Tiles,
        monitor: None,
    };
    assert!(arrays[0].len() > 2 * threads::CHUNK);
    for count in [1, 2, 3] {
        let (hits, _) = threads::closest(&structure, batch, count, false).unwrap();
        let same = hits
            .iter()
            .zip(expected.iter().cycle())
            .all(|(hit, own)| [hit.t.to_bits(), hit.triangle] == [own[0], own[1]]);
        assert!(same && hits.len() == arrays[0].len(), "{count} threads");
    }
}

#[test]
fn beams_without_area_and_rays_without_beams_are_answered_singly() {
    let scene = soup(grid(3, 0.2));
    let brute = build(&scene, "brute");
    let eye = [1.4, -4.0, 1.7];
    let through = |x: f32, y: f32| ray(eye, [x, 1.0, y]);
    let batches: [(&str, Vec<Ray>, bool); 8] = [
        ("no ray", vec![], false),
        ("one ray", vec![through(0.1, 0.0)], true),
        ("the same ray", vec![through(0.1, 0.05); 300], false),
        (
            "a line",
            (0..300)
                .map(|i| through(0.002 * i as f32 - 0.3, 0.01))
                .collect(),
            false,
        ),
        (
            "a lens",
            (0..300)
                .map(|i| 0.001 * i as f32)
                .map(|x| ray([1.4 + x, -4.0, 1.7], [-0.1 * x, 1.0, 0.0]))
                .collect(),
            true,
        ),
        (
            "negative distances",
            (0..300)
                .map(|i| Ray {
                    t_min: -9.0,
                    ..through(0.002 * i as f32 - 0.3, 0.01)
                })
                .collect(),
            true,
        ),
        (
            "no direction",
            (0..300).map(|_| ray(eye, [0.0; 3])).collect(),
            true,
        ),
        (
            "from far away",
            (0..300)
                .map(|i| ray([1.5, -6.0e4, 1.5], [1e-7 * i as f32, 1.0, 0.0]))
                .collect(),
            true,
        ),
    ];
    for least in [1, 16] {
        let structure = build(&scene, &format!("{POLYGONS},beam_min={least}"));
        for (name, rays, all_singly) in &batches {
            let expected = answers(&brute, rays, Order::None);
            assert_eq!(answers(&structure, rays, Order::Tiles), expected, "{name}");
            let counters = counted(&structure, rays);
            let (beams, singles) = (
                events(&counters, "beams"),
                events(&counters, "beam_singles"),
            );
            if *all_singly && least > 1 {
                assert_eq!(singles, rays.len() as u64, "{name}");
            } else if *all_singly {
                // The first ray alone is a beam.
                assert!(singles + 1 >= rays.len() as u64, "{name}");
            } else {
                assert!(rays.is_empty() || beams > 0, "{name}");
            }
        }
    }
}

/// Rays exactly along the walls of cells leave polygons without area next to them; their parts without rays must end.
#[test]
fn beams_without_rays_end() {
    let all = cases(Size::Small, 7);
    let case = all
        .iter()
        .find(|case| case.name == "nested shells")
        .unwrap();
    let eye = case.scene.bounds().min;
    let pixels = (0..72 * 40).map(|i| {
        let at = |i: usize, n: usize| 2.0 * i as f32 / (n - 1) as f32 - 1.0;
        ray(eye, [at(i % 72, 72), 1.0, at(i / 72, 40)])
    });
    let rays: Vec<_> = pixels.collect();
    for least in [1, 2, 4, 16] {
        let structure = build(&case.scene, &format!("{POLYGONS},beam_min={least}"));
        let counters = counted(&structure, &rays);
        let beams = events(&counters, "beams");
        assert!(beams < 10 * rays.len() as u64, "{least}: {beams} beams");
    }
}

#[test]
fn an_extra_ray_costs_a_quarter_of_a_single_ray_in_steps() {
    let mut random = Random(8);
    let scene = scattered(&mut random, 100, 0.06);
    let structure = build(&scene, POLYGONS);
    assert_eq!(structure.cases(), NAMES);
    let eye = [0.3, -3.5, 0.8];
    let image = |n: usize| -> Vec<Ray> {
        let at = |i: usize| (2 * i + 1) as f32 / n as f32 - 1.0;
        let pixels = (0..n * n).map(|i| ray(eye, [0.4 * at(i % n), 1.0, 0.4 * at(i / n) - 0.2]));
        pixels.collect()
    };
    let steps = |rays: &[Ray], order| {
        let mut hits = vec![Hit::MISS; rays.len()];
        let mut counters = vec![RayCounters::default(); rays.len()];
        structure.closest_ordered(rays, &mut hits, Some(&mut counters), order);
        sum(&counters, |own| own.steps() + own.leaves + own.leaves_empty)
    };
    let (few, many) = (image(200), image(400));
    // Smaller pixels can even save nodes.
    let more = |order| steps(&many, order).cast_signed() - steps(&few, order).cast_signed();
    let (beams, single) = (more(Order::Tiles), more(Order::None));
    assert!(4 * beams < single, "{beams} against {single}");
    // Each kind of event occurs, and no ray goes on singly twice.
    let counters = counted(&structure, &many);
    for name in NAMES {
        assert!(events(&counters, name) > 0, "{name}");
    }
    let singles = NAMES.iter().position(|own| *own == "beam_singles").unwrap();
    assert!(counters.iter().all(|own| own.cases[singles] <= 1));
}
