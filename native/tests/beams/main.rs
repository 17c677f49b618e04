// SPDX-License-Identifier: GPL-3.0-or-later
//! Tiles of rays traced as beams: every pixel equals that of single rays, for any camera.

#[path = "../hard/mod.rs"]
mod hard;
mod parallel;
mod polygons;

use halfspace::base::Monitor;
use halfspace::beam::planes as plane_beam;
use halfspace::nodes::octree_nodes::Octree;
use halfspace::oracle::cases::{Random, box_triangles, grid, lattice_rays, ray, soup};
use halfspace::ray::{Hit, Order, Ray, RayCounters, Tracer};
use halfspace::registry;
use halfspace::scene::Triangles;
use halfspace::structure::Structure;
use std::sync::Arc;

fn build(scene: &Arc<Triangles>, spec: &str) -> Structure {
    let config = registry::parse(spec).unwrap();
    Structure::build(scene.clone(), config, 1, &Monitor::new()).unwrap()
}

/// The rays of an image in tiles of 8 x 8 pixels. Tiles are cut off at the edges, so that 64 consecutive rays then
/// belong to several tiles.
fn image([width, height]: [usize; 2], pixel: impl Fn(f32, f32) -> Ray) -> Vec<Ray> {
    let mut rays = Vec::with_capacity(width * height);
    for top in (0..height).step_by(8) {
        for left in (0..width).step_by(8) {
            for y in top..height.min(top + 8) {
                for x in left..width.min(left + 8) {
                    let at = |i: usize, n: usize| (2 * i + 1) as f32 / n as f32 - 1.0;
                    rays.push(pixel(at(x, width), at(y, height)));
                }
            }
        }
    }
    rays
}

/// A pinhole at `o` that looks along +Y; `wide` is the tangent of half its angle of view.
fn pinhole(o: [f32; 3], wide: f32) -> impl Fn(f32, f32) -> Ray {
    move |x, y| ray(o, [x * wide, 1.0, y * wide])
}

fn traced(structure: &Structure, rays: &[Ray], order: Order) -> Vec<[u32; 4]> {
    let mut hits = vec![Hit::MISS; rays.len()];
    structure.closest_ordered(rays, &mut hits, None, order);
    let bits = |h: &Hit| [h.t.to_bits(), h.triangle, h.u.to_bits(), h.v.to_bits()];
    hits.iter().map(bits).collect()
}

const SPECS: [&str; 20] = [
    "octree-beam",
    "octree-beam:beam_least=1",
    "octree-beam:beam_least=65",
    "octree-beam:beam_least=30,leaf_size=0,max_depth=9",
    "octree-beam:traversal=polygon",
    "octree-beam:beam_min=1,traversal=polygon",
    "octree-beam:beam_min=4096,traversal=polygon",
    "octree-beam:beam_min=5,leaf_size=0,max_depth=9,traversal=polygon",
    "beam-hh",
    "beam-hh:beam_least=1",
    "beam-hh:beam_least=65",
    "beam-hh:beam_least=30,costs=thesis",
    "kd:traversal=tile",
    "kd:traversal=tile16",
    "kd-sah:traversal=tile",
    "bvh-sah:traversal=tile",
    "bvh-sah:traversal=tile16",
    "bsp-random:traversal=tile",
    "bsp-random",
    "bsp-wn-plus-kd:traversal=tile16",
];

fn compare(name: &str, scene: &Arc<Triangles>, images: &[Vec<Ray>]) {
    let net = build(scene, "octree-net");
    let expected: Vec<_> = images
        .iter()
        .map(|rays| traced(&net, rays, Order::None))
        .collect();
    for spec in SPECS {
        let structure = build(scene, spec);
        for (rays, expected) in images.iter().zip(&expected) {
            let found = traced(&structure, rays, Order::Tiles);
            let wrong = found.iter().zip(expected).filter(|(a, b)| a != b).count();
            assert_eq!(wrong, 0, "{name}, {spec}: of {} rays", rays.len());
        }
    }
}

#[test]
fn pixels_are_those_of_single_rays_at_every_size() {
    let scene = soup(grid(4, 0.3));
    let sizes = [[1, 1], [1, 37], [64, 1], [3, 5], [320, 200]];
    let images: Vec<_> = sizes
        .iter()
        .map(|size| image(*size, pinhole([1.9, -7.0, 2.2], 0.6)))
        .collect();
    compare("turned boxes", &scene, &images);
}

#[test]
fn beams_answer_like_single_rays_at_1280_by_1024() {
    let size = [1280, 1024].map(|side| side / hard::share());
    // Use few triangles, so that most of the time is spent on pixels.
    let scene = soup(grid(2, 0.3));
    let wide = (75.0_f32).to_radians().tan();
    for view in [([0.9, -3.0, 1.2], 0.6), ([1.1, -0.4, 0.8], wide)] {
        let rays = image(size, pinhole(view.0, view.1));
        for spec in ["octree-beam", "octree-beam:traversal=polygon", "beam-hh"] {
            let structure = build(&scene, spec);
            let expected = traced(&structure, &rays, Order::None);
            let found = traced(&structure, &rays, Order::Tiles);
            let wrong = found.iter().zip(&expected).filter(|(a, b)| a != b).count();
            assert_eq!(wrong, 0, "{spec}: of {} rays", rays.len());
            let hits = found.iter().filter(|hit| hit[1] != Hit::NONE).count();
            assert!(10 * hits > rays.len(), "{spec}: {hits} hits");
        }
    }
}

#[test]
fn wide_angles_parallel_rays_and_apexes_on_cell_corners_change_nothing() {
    let scene = soup(grid(4, 0.0));
    let wide = (75.0_f32).to_radians().tan();
    let size = [128, 80];
    let images = vec![
        // Look from between the boxes, with half of the octants visible, and backwards.
        image(size, pinhole([2.3, 1.7, 2.1], wide)),
        // Start on a corner of cells and boxes, in a wall of every axis.
        image(size, pinhole([2.0, 2.0, 2.0], wide)),
        image([127, 79], pinhole([2.0, -3.0, 2.0], 1.0)),
        // Send pixels along walls.
        image([65, 65], |x, y| {
            ray(
                [2.0, -4.0, 2.0],
                [(x * 32.5).round() / 8.0, 1.0, (y * 32.5).round() / 8.0],
            )
        }),
        // Orthographic: no common origin, but a common direction.
        image(size, |x, y| {
            ray([2.0 + 3.0 * x, -5.0, 2.0 + 3.0 * y], [0.0, 1.0, 0.0])
        }),
        image(size, |x, y| {
            ray([2.0 + 3.0 * x, -5.0, 2.0 + 3.0 * y], [0.1, 1.0, -0.2])
        }),
        // Send one pixel along each edge of a cell.
        image([17, 17], |x, y| {
            ray([2.0 + 2.125 * x, -5.0, 2.0 + 2.125 * y], [-0.0, 1.0, 0.0])
        }),
        image([17, 17], |x, y| {
            ray([2.0 + 2.125 * x, 7.0 - y, 9.0], [0.0, -1.0, -1.0])
        }),
        // Shift the window off the axis.
        image(size, |x, y| {
            ray([1.9, -3.0, 2.2], [0.8 * x + 0.9, 1.0, 0.5 * y - 0.7])
        }),
        // Give each ray its own direction.
        image(size, |x, y| ray([2.0 + x, -3.0, 2.0 + y], [y, 1.0, x])),
        // Start too far away for a traversal from cell to cell.
        image(size, pinhole([2.0, -1.0e6, 2.0], 4.0e-6)),
        // Give the rays their own intervals, and make some invalid.
        image(size, |x, y| Ray {
            t_min: 3.0 + x,
            t_max: 5.0 + 2.0 * y,
            ..pinhole([1.9, -3.0, 2.2], 0.7)(x, y)
        }),
        image(size, |x, y| {
            let d = if x > y {
                [0.0; 3]
            } else {
                [x, 1.0, f32::NAN * (y > 0.5) as u8 as f32]
            };
            ray([1.9, -3.0, 2.2], d)
        }),
    ];
    compare("touching boxes", &scene, &images);
}

#[test]
fn small_cells_next_to_large_ones_lose_no_pixel() {
    // Put tiny boxes into a large one: neighbours are many levels finer.
    let mut corners = box_triangles([-10.0; 3], [10.0; 3]);
    let mut random = Random(4);
    for _ in 0..300 {
        let p = random.point(0.9, 1.1);
        corners.extend(box_triangles(p, p.map(|x| x + 0.01)));
    }
    let scene = soup(corners);
    let images = vec![
        image([160, 100], pinhole([1.0, -3.0, 1.0], 0.5)),
        image([160, 100], pinhole([1.0, 0.5, 1.0], 0.5)),
        image([160, 100], pinhole([-30.0, -30.0, 1.0], 1.5)),
    ];
    compare("tiny among large", &scene, &images);
}

#[test]
fn beams_change_no_pixel_of_hard_scenes() {
    for case in hard::cases(7) {
        let bounds = case.scene.bounds();
        if bounds.is_empty() {
            continue;
        }
        let size = (0..3)
            .map(|k| bounds.max[k] - bounds.min[k])
            .fold(0.0, f32::max);
        let middle: [f32; 3] = std::array::from_fn(|k| 0.5 * (bounds.min[k] + bounds.max[k]));
        let aside = [
            middle[0] + 0.1 * size,
            middle[1] - 1.5 * size,
            middle[2] + 0.05 * size,
        ];
        let images = vec![
            image([72, 40], pinhole(aside, 0.5)),
            image([72, 40], pinhole(middle, 3.0)),
            image([72, 40], pinhole(bounds.min, 1.0)),
        ];
        compare(case.name, &case.scene, &images);
    }
}

#[test]
fn every_beam_ends_within_the_number_of_planes_of_the_grid() {
    let scene = soup(grid(4, 0.0));
    let mut rays = lattice_rays(4, &mut Random(5), 3000);
    // Follow the main diagonal through all corners, and edges of cells in all directions.
    for signs in 0..8 {
        let side = |k: usize| if signs >> k & 1 == 1 { -1.0 } else { 1.0 };
        let o = std::array::from_fn(|k| 2.0 - 4.0 * side(k));
        rays.push(ray(o, [side(0), side(1), side(2)]));
        rays.push(ray(o, [side(0), side(1), 0.0_f32.copysign(side(2))]));
    }
    for spec in ["octree-net", "octree-samet", "octree-glassner"] {
        let structure = build(&scene, &format!("{spec}:leaf_size=0"));
        let tree = structure.built().tree.as_ref().unwrap();
        let tree = tree.downcast_ref::<Octree>().unwrap();
        let mut hits = vec![Hit::MISS; rays.len()];
        let mut counters = vec![RayCounters::default(); rays.len()];
        structure.closest(&rays, &mut hits, Some(&mut counters));
        let most = counters.iter().map(|c| c.leaves + c.leaves_empty).max();
        let bound = 3 << tree.cube().depth;
        assert!(most.unwrap() <= bound, "{spec}: {most:?} of {bound}");
    }
}

#[test]
fn beams_take_fewer_steps_and_count_them() {
    let scene = soup(grid(4, 0.3));
    let structure = build(&scene, "octree-beam");
    let perspective = image([320, 200], pinhole([1.9, -7.0, 2.2], 0.6));
    let parallel = image([320, 200], |x, y| {
        ray([2.0 + 3.0 * x, -5.0, 2.0 + 3.0 * y], [0.1, 1.0, -0.2])
    });
    for rays in [perspective, parallel] {
        let (beams, single) = (
            steps(&structure, &rays, Order::Tiles),
            steps(&structure, &rays, Order::None),
        );
        assert!(4 * beams < single, "{beams} against {single}");
    }
}

#[test]
fn beams_cut_by_polygons_count_fewer_visits_than_their_rays() {
    let scene = soup(grid(4, 0.3));
    let structure = build(&scene, "beam-hh");
    assert_eq!(structure.cases(), plane_beam::NAMES);
    let rays = image([320, 200], pinhole([1.9, -7.0, 2.2], 0.6));
    let (beams, single) = (
        steps(&structure, &rays, Order::Tiles),
        steps(&structure, &rays, Order::None),
    );
    assert!(4 * beams < single, "{beams} against {single}");
    let mut hits = vec![Hit::MISS; rays.len()];
    let mut counters = vec![RayCounters::default(); rays.len()];
    structure.closest_ordered(&rays, &mut hits, Some(&mut counters), Order::Tiles);
    let sum = |i: usize| counters.iter().map(|c| u64::from(c.cases[i])).sum::<u64>();
    let (visits, cuts, singles) = (sum(0), sum(1), sum(2));
    // Some tiles contain several faces, and some edges so narrow that few rays remain.
    assert!(visits > 1000 && cuts > 100, "{visits} visits, {cuts} cuts");
    assert!(singles > 0 && singles < rays.len() as u64 / 8, "{singles}");
}

fn steps(structure: &Structure, rays: &[Ray], order: Order) -> u64 {
    let mut hits = vec![Hit::MISS; rays.len()];
    let mut counters = vec![RayCounters::default(); rays.len()];
    structure.closest_ordered(rays, &mut hits, Some(&mut counters), order);
    let sum = |c: &RayCounters| u64::from(c.steps() + c.leaves + c.leaves_empty);
    counters.iter().map(sum).sum()
}

/// Shadow rays from a plane of points below a scene, in no order, to one light.
fn shadow_rays(count: usize, target: impl Fn([f32; 3]) -> Ray) -> Vec<Ray> {
    let mut random = Random(31);
    (0..count)
        .map(|_| {
            let p = random.point(-2.0, 6.0);
            target([p[0], p[1], -0.5])
        })
        .collect()
}

fn shadows(structure: &Structure, rays: &[Ray]) -> (Vec<bool>, Vec<RayCounters>) {
    let mut blocked = vec![false; rays.len()];
    let mut counters = vec![RayCounters::default(); rays.len()];
    structure.occluded(rays, &mut blocked, Some(&mut counters));
    (blocked, counters)
}

#[test]
fn shadow_beams_answer_like_single_rays_and_mostly_at_once() {
    // A receiving floor with boxes above it.
    let mut corners = grid(4, 0.3);
    corners.extend([[-2.0, -2.0, -0.6], [6.0, -2.0, -0.6], [2.0, 9.0, -0.6]]);
    let scene = soup(corners);
    let to = |light: [f32; 3]| {
        move |o: [f32; 3]| Ray {
            t_max: 0.9999,
            ..ray(o, std::array::from_fn(|k| light[k] - o[k]))
        }
    };
    let lights = [
        shadow_rays(20_000, to([9.0, 9.0, 12.0])),
        // Inside, on a corner of boxes, and below the floor.
        shadow_rays(20_000, to([2.2, 1.7, 2.1])),
        shadow_rays(20_000, to([2.0, 2.0, 2.0])),
        shadow_rays(20_000, to([2.0, 2.0, -9.0])),
        // Suns, one of them along the walls.
        shadow_rays(20_000, |o| ray(o, [0.3, 0.2, 1.0])),
        shadow_rays(20_000, |o| ray(o, [0.0, -0.0, 1.0])),
    ];
    let single = build(&scene, "octree-net");
    let beams = build(&scene, "octree-net:shadow=beam");
    for (i, rays) in lights.iter().enumerate() {
        let (expected, plain) = shadows(&single, rays);
        let (found, counted) = shadows(&beams, rays);
        assert_eq!(found, expected, "light {i}");
        let steps = |all: &[RayCounters]| all.iter().map(|c| u64::from(c.steps())).sum::<u64>();
        let saved = (steps(&counted), steps(&plain));
        assert!(saved.0 < saved.1, "light {i}: {saved:?}");
        // Unoccluded rays without a traversal were in empty beams; the cache answers others.
        let lit = counted.iter().zip(&found).filter(|(_, blocked)| !**blocked);
        let empty = lit.clone().filter(|(c, _)| c.spared == 1).count();
        let lit = lit.count();
        assert!(i % 4 != 0 || 4 * empty > lit, "light {i}: {empty} of {lit}");
    }
    for tree in ["kd", "bsp-random"] {
        let beams = build(&scene, &format!("{tree}:shadow=beam"));
        for (i, rays) in lights.iter().enumerate() {
            let (found, counted) = shadows(&beams, rays);
            assert_eq!(found, shadows(&single, rays).0, "{tree}, light {i}");
            let spared = counted.iter().filter(|c| c.spared == 1).count();
            assert!(spared > rays.len() / 50, "{tree}, light {i}: {spared}");
        }
    }
}

#[test]
fn shadow_beams_answer_like_brute_force_on_hard_scenes() {
    for case in hard::cases(8) {
        let bounds = case.scene.bounds();
        if bounds.is_empty() {
            continue;
        }
        let single = build(&case.scene, "octree-net");
        // Trace the rays of the case, and rays from their origins to the corners of the scene.
        let mut rays = case.rays.clone();
        for light in [bounds.min, bounds.max] {
            rays.extend(case.rays.iter().take(2000).map(|r| Ray {
                t_max: 1.0,
                ..ray(r.o, std::array::from_fn(|k| light[k] - r.o[k]))
            }));
        }
        let expected = shadows(&single, &rays).0;
        for tree in ["octree-param", "kd", "bsp-wn-plus-kd"] {
            let beams = build(&case.scene, &format!("{tree}:shadow=beam"));
            let found = shadows(&beams, &rays).0;
            let wrong = found.iter().zip(&expected).filter(|(a, b)| a != b).count();
            assert_eq!(wrong, 0, "{}, {tree}: of {}", case.name, rays.len());
        }
    }
}
