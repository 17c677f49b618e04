// SPDX-License-Identifier: GPL-3.0-or-later
//! The number of references per triangle in trees of split planes, and the work of rays where triangles of very
//! different sizes, or very many in one place, make trees useless.

mod common;

use common::build;
use halfspace::inspect::validate::validate;
use halfspace::oracle::cases::{Random, cloud, placed, ray, soup};
use halfspace::ray::{Hit, Order, Ray, RayCounters, Tracer};
use halfspace::registry::TREES;
use halfspace::structure::Structure;

/// Returns `n` triangles around a point, in a disc.
fn fan(n: usize) -> Vec<[f32; 3]> {
    let rim = |i: usize| {
        let angle = std::f32::consts::TAU * (i % n) as f32 / n as f32;
        [angle.cos(), angle.sin(), 0.0]
    };
    (0..n)
        .flat_map(|i| [[0.0; 3], rim(i), rim(i + 1)])
        .collect()
}

/// References per triangle.
fn copies(corners: &[[f32; 3]], spec: &str) -> f64 {
    let triangles = corners.len() / 3;
    let shape = build(&soup(corners.to_vec()), spec).shape();
    shape.references as f64 / triangles as f64
}

#[test]
fn references_to_slivers_along_one_line_are_bounded() {
    let mut random = Random(5);
    let corners: Vec<_> = (0..3 * 1500)
        .map(|_| random.unit())
        .map(|t| [t, 0.7 * t, 0.3 * t])
        .collect();
    for spec in ["rbsp", "rbsp-kd", "bsp-wn-plus-kd"] {
        let copies = copies(&corners, spec);
        assert!(copies < 140.0, "{spec}: {copies}");
    }
}

#[test]
fn references_to_spokes_of_a_wheel_are_bounded() {
    for (n, spec, most) in [
        (6000, "kd", 100.0),
        (6000, "bsp-wn-plus-kd", 100.0),
        (40_000, "kd-sah", 40.0),
        (40_000, "grid", 40.0),
    ] {
        let copies = copies(&fan(n), spec);
        assert!(copies < most, "{spec}: {copies}");
    }
}

#[test]
fn references_to_overlapping_coplanar_triangles_are_bounded() {
    let mut random = Random(7);
    let corners: Vec<_> = (0..3 * 1000)
        .map(|_| [random.unit(), random.unit(), 0.0])
        .collect();
    let copies = copies(&corners, "kd");
    assert!(copies < 100.0, "{copies}");
}

/// Around the centre of nested tetrahedra their triangles have more references than anywhere in other scenes, and
/// planes still separate them.
#[test]
fn separable_triangles_are_split_for_any_number_of_references() {
    let corner = [
        [1.0, 1.0, 1.0],
        [1.0, -1.0, -1.0],
        [-1.0, 1.0, -1.0],
        [-1.0, -1.0, 1.0],
    ];
    let faces = [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]];
    let n = 500;
    let corners: Vec<_> = (0..n)
        .map(|i| 0.01 + 0.99 * i as f32 / (n - 1) as f32)
        .flat_map(|size| faces.map(|face| face.map(|i: usize| corner[i].map(|x: f32| size * x))))
        .flatten()
        .collect();
    for spec in ["rbsp", "bsp-wn-plus", "bsp-cn-plus"] {
        let shape = build(&soup(corners.clone()), spec).shape();
        assert_eq!(shape.leaves_large, 0, "{spec}: {}", shape.leaf_max);
    }
}

/// Every structure, and trees whose leaves test one triangle at a time or that rays build.
fn specs() -> Vec<String> {
    let trees = TREES.iter().filter(|tree| tree.id != "brute");
    let more = [
        "kd-sah:leaves=scalar",
        "kd:leaves=scalar",
        "kd:lazy=1",
        "kd:nodes=boxes",
        "bbox-gs:fanout=any,leaf_size=1",
        "octree-beam:traversal=polygon",
    ];
    let ids = trees.map(|tree| tree.id.to_owned());
    ids.chain(more.map(str::to_owned)).collect()
}

/// Returns rays from around a point to points of triangles that lie around it.
fn rays_around(corners: &[[f32; 3]], reach: f32, random: &mut Random) -> Vec<Ray> {
    let rays = (0..512).map(|_| {
        let o = random.point(-reach, reach);
        let first = 3 * random.below(corners.len() / 3);
        let [a, b, c] = [0, 1, 2].map(|i: usize| corners[first + i]);
        let target = [0, 1, 2].map(|k: usize| 0.5 * a[k] + 0.25 * b[k] + 0.25 * c[k]);
        ray(o, [0, 1, 2].map(|k: usize| target[k] - o[k]))
    });
    rays.collect()
}

/// Returns the hits of rays, and the nodes, leaves and triangles that a ray visits on average.
fn traced(structure: &Structure, rays: &[Ray]) -> (Vec<Hit>, f64) {
    let mut hits = vec![Hit::MISS; rays.len()];
    let mut counters = vec![RayCounters::default(); rays.len()];
    structure.closest(rays, &mut hits, Some(&mut counters));
    let work = |c: &RayCounters| f64::from(c.visits()) + f64::from(c.tests);
    (
        hits,
        counters.iter().map(work).sum::<f64>() / rays.len() as f64,
    )
}

/// Checks that a structure is sound and has the hits of brute force, as single rays, in tiles and as any hits.
fn check(structure: &Structure, rays: &[Ray], right: &[Hit], about: &str) {
    assert_eq!(validate(structure), Vec::<String>::new(), "{about}");
    let mut hits = vec![Hit::MISS; rays.len()];
    let mut occluded = vec![false; rays.len()];
    for order in [Order::None, Order::Tiles] {
        structure.closest_ordered(rays, &mut hits, None, order);
        assert!(hits == right, "{about}: {order:?}");
    }
    structure.occluded(rays, &mut occluded, None);
    let same = occluded
        .iter()
        .zip(right)
        .all(|(any, hit)| *any == hit.is_hit());
    assert!(same, "{about}: any hits");
    let (first, _) = structure.path(&rays[0], false, None);
    assert!(first == right[0], "{about}: path");
}

#[test]
fn triangles_of_another_scale_cost_the_rays_of_small_ones_nothing() {
    let mut random = Random(3);
    let tiny = placed(&cloud(3000, 0.05, &mut random), 1e-8, [0.0; 3]);
    let far = placed(&cloud(100, 0.2, &mut random), 1e-8, [0.7, -0.4, 0.6]);
    let huge = vec![[-1.0, -1.0, -0.3], [1.0, -1.0, -0.31], [0.0, 1.0, -0.3]];
    let rays = rays_around(&tiny, 3e-8, &mut random);
    // One huge triangle, before and behind all others; several of all sizes; a second cluster.
    let sizes: Vec<_> = (0..12)
        .flat_map(|i| placed(&huge, 4.0_f32.powi(-i), [0.0; 3]))
        .collect();
    let scenes = [
        ("behind", [tiny.clone(), huge.clone()].concat()),
        ("before", [huge.clone(), tiny.clone()].concat()),
        ("sizes", [tiny.clone(), sizes].concat()),
        ("clusters", [huge, tiny.clone(), far].concat()),
    ];
    for (name, corners) in scenes {
        let (alone, all) = (soup(tiny.clone()), soup(corners));
        let (right, _) = traced(&build(&all, "brute"), &rays);
        for spec in specs() {
            let structure = build(&all, &spec);
            let about = format!("{name}, {spec}");
            check(&structure, &rays, &right, &about);
            let (_, without) = traced(&build(&alone, &spec), &rays);
            let (_, with) = traced(&structure, &rays);
            assert!(
                with <= 3.0 * without + 16.0,
                "{about}: {with} and {without}"
            );
            let lines = structure.left_out();
            let divided = lines
                .iter()
                .any(|line| line.starts_with("one tree of the whole scene"));
            assert!(divided, "{about}: {lines:?}");
        }
    }
}

#[test]
fn scenes_of_one_scale_keep_one_tree() {
    let mut random = Random(4);
    let corners = cloud(2000, 0.1, &mut random);
    for spec in specs() {
        let structure = build(&soup(corners.clone()), &spec);
        assert!(structure.apart().is_empty(), "{spec}");
        assert!(structure.built().tree.is_some(), "{spec}");
    }
}

#[test]
fn no_structure_does_more_work_than_brute_force() {
    let mut random = Random(6);
    let n = 2000;
    let one = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.1], [0.0, 1.0, 0.0]];
    let few = cloud(40, 0.5, &mut random);
    let scenes = [
        ("fan", fan(n)),
        ("one triangle many times", one.repeat(n)),
        ("few triangles many times", few.repeat(100)),
        ("all overlap", cloud(1000, 2.0, &mut random)),
    ];
    for (name, corners) in scenes {
        let scene = soup(corners.clone());
        let mut rays = rays_around(&corners, 2.0, &mut random);
        rays.iter_mut().for_each(|ray| ray.o[2] += 3.0);
        let (right, _) = traced(&build(&scene, "brute"), &rays);
        let all = scene.live().len() as f64;
        for spec in specs() {
            let structure = build(&scene, &spec);
            let about = format!("{name}, {spec}");
            check(&structure, &rays, &right, &about);
            let (_, work) = traced(&structure, &rays);
            assert!(work <= 1.25 * all, "{about}: {work} of {all}");
        }
    }
}
