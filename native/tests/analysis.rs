// SPDX-License-Identifier: GPL-3.0-or-later
//! Statistics and export of trees: hand-computed values, and agreement with the counts of the build.

mod common;

use common::build;
use halfspace::base::Monitor;
use halfspace::inspect::analysis::{self, Analysis, Beta};
use halfspace::inspect::export::{self, Export, LEAF};
use halfspace::inspect::ray_path::ray_path;
use halfspace::oracle::cases::{Random, cloud, soup};
use halfspace::ray::Ray;
use halfspace::scene::Triangles;
use halfspace::structure::Structure;
use halfspace::structure::leaf_depth::LeafDepths;
use std::collections::BTreeSet;
use std::sync::Arc;

fn analysis(structure: &Structure, max_nodes: usize) -> Analysis {
    analysis::analysis(structure, max_nodes, &Monitor::new()).unwrap()
}

fn export(structure: &Structure) -> Export {
    export::export(structure, &Monitor::new()).unwrap()
}

/// One structure per node layout.
const SPECS: [&str; 12] = [
    "kd",
    "kd:lazy=1",
    "rbsp",
    "bsp-wn-plus-kd",
    "bih",
    "bih-obl",
    "octree-net",
    "bvh-sah",
    "bvh-sah:width=2",
    "obb",
    "grid",
    "brute",
];

/// Structures whose nodes partition space.
const PARTITIONS: [&str; 6] = [
    "kd",
    "kd:lazy=1",
    "rbsp",
    "bsp-wn-plus-kd",
    "octree-net",
    "grid",
];

fn scene(corners: &[[[f32; 3]; 3]]) -> Arc<Triangles> {
    let count = u32::try_from(corners.len()).unwrap();
    let triangles = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]);
    Arc::new(Triangles::new(corners.concat(), triangles.collect()).unwrap())
}

/// Triangles of many sizes, and walls that lie in planes across axes.
fn mixed() -> Arc<Triangles> {
    let mut random = Random(3);
    let mut corners = Vec::new();
    for i in 0..400_u16 {
        let origin = random.point(-2.0, 2.0);
        let size = if i % 20 == 0 { 3.0 } else { 0.2 };
        let mut next = || {
            let offset = random.point(-size, size);
            [0, 1, 2].map(|k| origin[k] + offset[k])
        };
        let mut triangle = [origin, next(), next()];
        if i % 4 == 0 {
            triangle
                .iter_mut()
                .for_each(|p| p[usize::from(i / 4 % 3)] = f32::from(i / 50) - 4.0);
        }
        corners.push(triangle);
    }
    scene(&corners)
}

/// The sum of a list of counts.
fn total(counts: &[u64]) -> u64 {
    counts.iter().sum()
}

fn check_counts(structure: &Structure, found: &Analysis, spec: &str) {
    let shape = structure.shape();
    assert_eq!(total(&found.leaf_depths), shape.leaves as u64, "{spec}");
    assert_eq!(found.leaf_depths.len(), shape.depth_max + 1, "{spec}");
    assert_eq!(
        found.leaf_sizes.iter().map(|row| row[1]).sum::<u64>(),
        shape.leaves as u64
    );
    let references: u64 = found.leaf_sizes.iter().map(|row| row[0] * row[1]).sum();
    assert_eq!(references, shape.references as u64, "{spec}");
    assert_eq!(
        found.leaf_sizes.last().unwrap()[0],
        shape.leaf_max as u64,
        "{spec}"
    );
    assert_eq!(total(&found.children), found.nodes, "{spec}");
    assert_eq!(total(&found.levels.nodes), found.nodes, "{spec}");
    // Every node except the root is a child.
    let children: u64 = (0..)
        .zip(&found.children)
        .map(|(n, count): (u64, _)| n * count)
        .sum();
    assert_eq!(
        children + 1,
        found.nodes + total(&found.leaf_depths),
        "{spec}"
    );
    if spec != "grid" {
        assert_eq!(
            found.nodes,
            (shape.nodes_axis + shape.nodes_oblique) as u64,
            "{spec}"
        );
    }
    // The terms of the expected cost add up to that of the build, which rounds shares to f32.
    let (cost, stated) = (found.visits.cost(), shape.sah_cost);
    if spec == "obb" {
        assert!(
            cost < stated && cost > 0.5 * stated,
            "{spec}: {cost}, not {stated}"
        );
    } else {
        assert!(
            (cost - stated).abs() <= 1e-4 * stated,
            "{spec}: {cost}, not {stated}"
        );
    }
}

#[test]
fn counts_agree_with_those_of_the_build() {
    let scene = mixed();
    for spec in SPECS {
        let structure = build(&scene, spec);
        check_counts(&structure, &analysis(&structure, usize::MAX), spec);
    }
}

#[test]
fn trees_that_partition_space_have_no_overlap_and_others_do() {
    let scene = mixed();
    for spec in SPECS {
        let found = analysis(&build(&scene, spec), usize::MAX);
        let cost = found.overlap.charges.cost();
        if PARTITIONS.contains(&spec) || spec == "brute" {
            assert_eq!(cost, 0.0, "{spec}");
        } else {
            assert!(cost > 1.0, "{spec}: {cost}");
        }
        assert_eq!(
            (found.overlap.sample, found.overlap.error),
            (400, 0.0),
            "{spec}"
        );
    }
}

#[test]
fn directions_are_counted_per_level() {
    let scene = mixed();
    let kd = analysis(&build(&scene, "kd"), usize::MAX).levels;
    assert_eq!(
        (kd.nodes[0], kd.planes_axis[0], kd.directions_axis[0]),
        (1, 1, 1)
    );
    assert_eq!(kd.planes_axis, kd.nodes);
    assert!(kd.directions_axis.iter().all(|&n| n <= 3) && kd.directions_axis.contains(&3));
    assert_eq!(total(&kd.planes_oblique) + total(&kd.directions_oblique), 0);
    // A tree of restricted directions has at most the given number; any other direction is an axis.
    let rbsp = analysis(&build(&scene, "rbsp:k=7"), usize::MAX).levels;
    assert!(total(&rbsp.planes_oblique) > 0);
    assert!(
        rbsp.directions_oblique
            .iter()
            .zip(&rbsp.directions_axis)
            .all(|(a, b)| a + b <= 7)
    );
    let octree = analysis(&build(&scene, "octree-net"), usize::MAX);
    assert_eq!(octree.levels.planes_axis[0], 3);
    assert_eq!(octree.children.iter().position(|&n| n > 0), Some(8));
}

/// Two triangles in one plane whose boxes overlap. The box of the scene has surface area 32, that of the first
/// triangle too, that of the second 8, which the first triangle covers with an area of 4.
#[test]
fn overlap_of_two_boxes_is_that_computed_by_hand() {
    let scene = scene(&[
        [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]],
        [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]],
    ]);
    let structure = build(&scene, "bvh-sah:width=2,step_cost=0,leaf_max=1");
    let found = analysis(&structure, usize::MAX);
    assert_eq!(
        (found.leaf_depths, found.leaf_sizes),
        (vec![0, 2], vec![[1, 2]])
    );
    assert_eq!(
        (found.visits.nodes(), found.visits.leaves()),
        (1.0, 80.0 * 1.25)
    );
    // An area of 4 of the first triangle and the whole second one, 2, lie in each other's leaves: 6 of 10.
    let charges = found.overlap.charges;
    assert!(
        (charges.tests - 0.6).abs() < 1e-9 && charges.nodes() == 0.0,
        "{charges:?}"
    );
    assert_eq!(found.beta, Beta::default());
}

/// Two triangles at the ends of a box of 4 by 1 by 1, which one plane at x = a separates: the box has surface area 18,
/// the section 1.
#[test]
fn beta_of_one_plane_is_that_computed_by_hand() {
    let scene = scene(&[
        [[0.0, 0.0, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, 1.0]],
        [[4.0, 0.0, 0.0], [3.5, 1.0, 0.0], [4.0, 0.0, 1.0]],
    ]);
    let structure = build(&scene, "bsp-wn-plus-kd:costs=thesis,k=3,max_depth=1");
    let found = analysis(&structure, usize::MAX);
    assert_eq!(found.children, [0, 0, 1]);
    let beta = found.beta.axis.unwrap();
    assert!((beta - (1.0 - 2.0 / 18.0)).abs() < 1e-6, "{beta}");
    assert_eq!(
        (found.beta.all, found.beta.oblique),
        (found.beta.axis, None)
    );
}

#[test]
fn a_sample_estimates_the_overlap_and_is_the_same_each_time() {
    let scene = soup(cloud(20_000, 0.1, &mut Random(5)));
    let structure = build(&scene, "bvh-sah:width=2");
    let exact = analysis(&structure, usize::MAX).overlap;
    let estimate = analysis(&structure, 2_000).overlap;
    assert!(
        estimate.sample >= 1024 && estimate.sample < 20_000,
        "{}",
        estimate.sample
    );
    assert_eq!(
        (estimate.triangles, exact.sample),
        (exact.triangles, exact.triangles)
    );
    let (a, b) = (exact.charges.cost(), estimate.charges.cost());
    assert!(
        estimate.error > 0.0 && (a - b).abs() < 4.0 * estimate.error,
        "{a}, {b}, {}",
        estimate.error
    );
    assert_eq!(analysis(&structure, 2_000).overlap, estimate);
}

/// The nodes of an exported tree, visited from the root by its links: leaves, depth and triangles.
fn check_links(tree: &Export, spec: &str) -> (Vec<usize>, BTreeSet<u32>) {
    let (mut leaves, mut ids, mut seen) = (Vec::new(), BTreeSet::new(), 0);
    let range = |offsets: &[u32], node: usize| offsets[node] as usize..offsets[node + 1] as usize;
    let mut open = vec![0_usize];
    while let Some(node) = open.pop() {
        seen += 1;
        let children = &tree.children.entries[range(&tree.children.offsets, node)];
        let triangles = &tree.triangles.entries[range(&tree.triangles.offsets, node)];
        assert_eq!(tree.kinds[node] == LEAF, children.is_empty(), "{spec}");
        if tree.kinds[node] == LEAF {
            leaves.push(node);
            ids.extend(triangles);
        } else {
            assert!(triangles.is_empty(), "{spec}");
        }
        for &child in children.iter().rev() {
            let child = child as usize;
            assert_eq!(
                (tree.parents[child], tree.depths[child]),
                (node as i32, tree.depths[node] + 1)
            );
            open.push(child);
        }
    }
    assert_eq!((seen, tree.parents[0]), (tree.kinds.len(), -1), "{spec}");
    (leaves, ids)
}

#[test]
fn an_exported_tree_is_complete() {
    let scene = mixed();
    for spec in SPECS {
        let structure = build(&scene, spec);
        let (tree, shape) = (export(&structure), structure.shape());
        let (leaves, ids) = check_links(&tree, spec);
        assert_eq!(leaves.len(), shape.leaves, "{spec}");
        assert_eq!(tree.triangles.entries.len(), shape.references, "{spec}");
        assert_eq!(ids.len(), scene.live().len(), "{spec}");
        let nodes = tree.kinds.len() - leaves.len();
        if spec != "grid" {
            assert_eq!(nodes, shape.nodes_axis + shape.nodes_oblique, "{spec}");
        }
        assert_eq!(tree.plane_kinds.len(), tree.planes.entries.len(), "{spec}");
        assert_eq!(
            (tree.bounds.len(), tree.walls.offsets.len()),
            (tree.kinds.len(), tree.kinds.len() + 1)
        );
        assert_eq!(tree, export(&structure), "{spec}");
    }
}

/// Exported planes and boxes are in the frame of the scene, also where the tree's own frame is scaled.
#[test]
fn an_exported_tree_is_in_the_frame_of_the_scene() {
    let far = 2.0_f32.powi(60);
    let scene = scene(&[
        [[0.0, 0.0, 0.0], [far, far, 0.0], [0.0, 0.0, far]],
        [
            [8.0 * far, 0.0, 0.0],
            [7.0 * far, far, 0.0],
            [8.0 * far, 0.0, far],
        ],
    ]);
    let structure = build(&scene, "bsp-wn-plus-kd:costs=thesis,k=3,max_depth=1");
    assert!(!structure.frame().is_unscaled());
    let (tree, far) = (export(&structure), f64::from(far));
    assert_eq!(tree.bounds[0], [0.0, 0.0, 0.0, 8.0 * far, far, far]);
    let [x, y, z, height] = tree.planes.entries[0];
    assert_eq!([x, y, z], [1.0, 0.0, 0.0]);
    assert!(far <= height && height <= 7.0 * far);
}

#[test]
fn an_empty_scene_is_one_empty_leaf() {
    for spec in SPECS {
        let structure = build(&scene(&[]), spec);
        let found = analysis(&structure, 10);
        assert_eq!((found.nodes, found.leaf_sizes), (0, vec![[0, 1]]), "{spec}");
        assert_eq!(found.overlap.charges.cost(), 0.0, "{spec}");
        assert_eq!(export(&structure).kinds, [LEAF], "{spec}");
    }
}

/// The leaf depths of the render pass.
#[test]
fn depths_are_those_of_the_ray_s_path() {
    let mut corners = Vec::new();
    for i in 0..40_u8 {
        let x = f32::from(i);
        corners.push([[x, 0.0, 0.0], [x + 0.9, 0.0, 0.1], [x, 1.0, 0.2]]);
    }
    let vertices: Vec<[f32; 3]> = corners.concat();
    let triangles: Vec<[u32; 3]> = (0..40).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let scene = Arc::new(Triangles::new(vertices, triangles).unwrap());
    let boxes = ["kd:nodes=boxes", "rbsp:nodes=boxes"];
    for spec in ["kd", "bvh-sah", "octree-net", "brute"]
        .into_iter()
        .chain(boxes)
    {
        let structure = build(&scene, spec);
        let depths = LeafDepths::new(&structure);
        let mut deepest = 0;
        for i in 0..40_u8 {
            let ray = Ray {
                o: [f32::from(i) + 0.2, 0.2, 5.0],
                d: [0.0, 0.0, -1.0],
                t_min: 0.0,
                t_max: f32::INFINITY,
            };
            let visits = ray_path(&structure, &ray, false, &Monitor::new())
                .unwrap()
                .visits;
            let expected = visits.iter().rfind(|visit| visit.tested.is_some());
            let expected = expected.map_or(0, |visit| visit.depth as u32);
            assert_eq!(depths.of(&structure, &ray), expected, "{spec}, ray {i}");
            deepest = deepest.max(expected);
        }
        assert_eq!(deepest > 0, spec != "brute", "{spec}");
    }
}
