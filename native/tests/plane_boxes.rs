// SPDX-License-Identifier: GPL-3.0-or-later
//! Object hierarchies and boxes that are made from trees of planes.

use halfspace::base::Monitor;
use halfspace::base::error::Result;
use halfspace::builders::plane_boxes::PlaneBoxes;
use halfspace::builders::plane_objects::{self, SHARE};
use halfspace::geom::Aabb;
use halfspace::nodes::nested::{Content, Nested};
use halfspace::nodes::object_tree::{ItemKind, ObjectTree};
use halfspace::nodes::plane_boxes::PlaneBoxTree;
use halfspace::nodes::plane_tree::PlaneTree;
use halfspace::nodes::tree::{Body, Tree};
use halfspace::oracle::cases::{Random, grid, soup};
use halfspace::ray::FramedScene;
use halfspace::registry;
use halfspace::scene::Triangles;
use halfspace::structure::Structure;
use halfspace::structure::way::Rays;
use std::collections::BTreeSet;
use std::sync::Arc;

/// Builds a structure on one thread; its tree is kept where brute force would be less work.
fn build(scene: &Arc<Triangles>, spec: &str) -> Structure {
    let config = registry::parse(spec).expect("a valid configuration");
    Structure::build_kept(scene.clone(), config, 1, &Monitor::new()).expect("enough memory")
}

/// Returns the tree of planes of a structure.
fn planes(structure: &Structure) -> &PlaneTree {
    let tree = structure.built().tree.as_deref();
    let planes = tree.and_then(|tree| tree.downcast_ref());
    planes.expect("a tree of planes")
}

/// Builds the object hierarchy of a tree of planes.
fn objects(structure: &Structure, monitor: &Monitor) -> Result<ObjectTree> {
    let framed = FramedScene {
        scene: structure.scene(),
        frame: structure.frame(),
    };
    plane_objects::build(planes(structure), framed, monitor)
}

/// Returns the boxes that are made from the planes of a structure.
fn boxes(structure: &Structure) -> &PlaneBoxTree {
    let tree = structure.built().tree.as_deref();
    let boxes = tree.and_then(|tree| tree.downcast_ref());
    boxes.expect("boxes made from planes")
}

/// Returns the leaves of a tree, each as a box and the triangles in it.
fn leaves(tree: &ObjectTree) -> Vec<(Aabb, &[u32])> {
    let firsts = tree.firsts();
    let items = tree.items.iter().enumerate();
    items
        .filter_map(|(index, item)| match tree.kind(index) {
            ItemKind::Leaf { count } => {
                let first = firsts[index] as usize;
                Some((item.bounds, &tree.ids[first..first + count]))
            }
            ItemKind::Inner { .. } => None,
        })
        .collect()
}

fn around_ids(structure: &Structure, ids: &[u32]) -> Aabb {
    let boxes = ids
        .iter()
        .map(|&id| Aabb::of_triangle(structure.scene().corners(id)));
    boxes.fold(Aabb::EMPTY, |all, own| all.union(&own))
}

fn random_points(seed: u64, count: usize) -> Vec<[f32; 3]> {
    let mut random = Random(seed);
    (0..count).map(|_| random.point(-1.0, 1.0)).collect()
}

/// Returns the corners of triangles a tenth as large as the scene.
fn chips(seed: u64, count: usize) -> Vec<[f32; 3]> {
    let mut random = Random(seed);
    let mut chip = || {
        let at = random.point(-1.0, 1.0);
        [0, 1, 2].map(|_| {
            let from = random.point(-0.1, 0.1);
            [0, 1, 2].map(|k| at[k] + from[k])
        })
    };
    (0..count).flat_map(|_| chip()).collect()
}

/// Returns the corners of overlapping slivers along one skew line.
fn slivers(count: usize) -> Vec<[f32; 3]> {
    let mut random = Random(11);
    let mut point = || {
        let t = random.unit();
        [t, 0.7 * t, 0.3 * t]
    };
    (0..3 * count).map(|_| point()).collect()
}

#[test]
fn leaves_hold_all_triangles_and_are_no_larger_than_they() {
    for corners in [grid(3, 0.3), random_points(3, 900), Vec::new()] {
        for spec in ["kd", "bsp-cn-plus-kd", "kd-sah:traversal=dir"] {
            let structure = build(&soup(corners.clone()), spec);
            let tree = objects(&structure, &Monitor::new()).unwrap();
            let mut found = Vec::new();
            for (bounds, ids) in leaves(&tree) {
                let whole = around_ids(&structure, ids);
                assert_eq!(whole.union(&bounds), whole, "{spec}");
                let mut own = ids.to_vec();
                own.sort_unstable();
                own.dedup();
                assert_eq!(own.len(), ids.len(), "{spec}: a triangle twice in a leaf");
                found.extend(own);
            }
            found.sort_unstable();
            found.dedup();
            assert_eq!(found, structure.scene().live(), "{spec}");
        }
    }
}

#[test]
fn every_point_of_a_triangle_lies_in_the_box_of_a_leaf_that_holds_it() {
    let mut random = Random(17);
    for corners in [slivers(150), random_points(5, 600), grid(3, 0.3)] {
        for spec in [
            "kd",
            "rbsp",
            "rbsp:clip=0",
            "bsp-ize",
            "bsp-random:ties=pbrt",
        ] {
            let structure = build(&soup(corners.clone()), spec);
            let tree = objects(&structure, &Monitor::new()).unwrap();
            let mut held = vec![Vec::new(); corners.len() / 3];
            for (bounds, ids) in leaves(&tree) {
                for &id in ids {
                    held[id as usize].push(bounds);
                }
            }
            for _ in 0..4000 {
                let id = random.below(held.len());
                let [a, b, c] = [0, 1, 2].map(|i| corners[3 * id + i]);
                let (s, t) = (random.unit(), random.unit());
                let p = [0, 1, 2]
                    .map(|k: usize| a[k] + s * (b[k] - a[k]) + (1.0 - s) * t * (c[k] - a[k]));
                // The point itself is rounded.
                let holds = |bounds: &Aabb| {
                    (0..3).all(|k| bounds.min[k] - 3e-7 <= p[k] && p[k] <= bounds.max[k] + 3e-7)
                };
                // Slivers without area are in no leaf.
                let found = held[id].is_empty() || held[id].iter().any(holds);
                assert!(found, "{spec}: {id} {p:?}");
            }
        }
    }
}

#[test]
fn leaves_are_small_where_oblique_planes_split_slivers() {
    let structure = build(&soup(slivers(300)), "rbsp");
    let tree = objects(&structure, &Monitor::new()).unwrap();
    let leaves = leaves(&tree);
    assert!(leaves.len() > 20, "{}", leaves.len());
    let p = [0.5, 0.35, 0.15];
    let holds = |bounds: &Aabb| (0..3).all(|k| bounds.min[k] <= p[k] && p[k] <= bounds.max[k]);
    let there = leaves.iter().filter(|(bounds, _)| holds(bounds)).count();
    assert!(4 * there < leaves.len(), "{there} of {}", leaves.len());
}

#[test]
fn trees_are_the_same_for_any_number_of_threads() {
    for spec in ["kd", "bsp-wn-plus-kd"] {
        let structure = build(&soup(chips(5, 45_000)), spec);
        let made = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            (pool.unwrap()).install(|| objects(&structure, &Monitor::new()).unwrap())
        };
        let (one, three) = (made(1), made(3));
        assert!(one.items == three.items && one.ids == three.ids, "{spec}");
        let ids: BTreeSet<_> = one.ids.iter().copied().collect();
        assert!(ids.into_iter().eq(0..45_000), "{spec}");
    }
}

#[test]
fn all_work_is_reported_once() {
    for (spec, count) in [
        ("kd", 900),
        ("bsp-wn-plus-kd", 45_000),
        ("kd", 40),
        ("kd", 0),
    ] {
        let structure = build(&soup(random_points(4, 3 * count)), spec);
        let monitor = Monitor::new();
        objects(&structure, &monitor).unwrap();
        let done = monitor.advanced();
        assert!((done - SHARE).abs() < 1e-6, "{spec}, {count}: {done}");
    }
}

#[test]
fn the_hierarchy_counts_towards_the_memory() {
    let structure = build(&soup(random_points(9, 900)), "kd");
    let monitor = Monitor::new();
    monitor.limit_memory(4_000_000);
    let before = monitor.room();
    let tree = objects(&structure, &monitor).unwrap();
    let kept = size_of_val(&tree.items[..]) + size_of_val(&tree.ids[..]);
    let counted = before - monitor.room();
    assert!(
        (kept as u64..2 * kept as u64).contains(&counted),
        "{kept}: {counted}"
    );
    monitor.limit_memory(kept as u64 - 1);
    assert!(objects(&structure, &monitor).is_err());
    monitor.limit_memory(4_000_000);
    monitor.cancel();
    assert!(objects(&structure, &monitor).is_err());
}

#[test]
fn each_leaf_occurs_once_in_the_boxes_and_their_memory_counts() {
    let mut random = Random(31);
    let corners: Vec<_> = (0..6000).map(|_| random.point(-1.0, 1.0)).collect();
    let structure = build(&soup(corners), "kd");
    let planes = planes(&structure);
    let framed = FramedScene {
        scene: structure.scene(),
        frame: structure.frame(),
    };
    let made = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        (pool.unwrap()).install(|| PlaneBoxes::new(planes, framed, &Monitor::new()).unwrap())
    };
    let (boxes, others) = (made(1), made(3));
    assert!(boxes.tree == others.tree && boxes.blocks == others.blocks);

    let (mut leaves, mut ids) = (BTreeSet::new(), BTreeSet::new());
    let mut open = vec![(boxes.tree.top(), Aabb::EMPTY)];
    while let Some((node, bounds)) = open.pop() {
        if let Content::Leaf { first, count } = boxes.tree.content(node, &bounds, &mut open) {
            assert!(leaves.insert(first), "twice");
            ids.extend(boxes.blocks.ids(first, count));
        }
    }
    assert!(ids.into_iter().eq(structure.scene().live().iter().copied()));

    let monitor = Monitor::new();
    PlaneBoxes::new(planes, framed, &monitor).unwrap();
    assert!((monitor.advanced() - 1.0).abs() < 1e-6);

    let limited = Monitor::new();
    limited.limit_memory(boxes.bytes() as u64);
    assert!(PlaneBoxes::new(planes, framed, &limited).is_err());
    limited.limit_memory(4 * boxes.bytes() as u64);
    assert!(PlaneBoxes::new(planes, framed, &limited).is_ok());
}

/// Without boxes no answer would change, only the time of tracing.
#[test]
fn all_rays_go_through_the_boxes_and_the_planes_are_freed() {
    let mut random = Random(13);
    let corners: Vec<_> = (0..900).map(|_| random.point(-1.0, 1.0)).collect();
    for id in ["kd", "rbsp", "bsp-random", "bsp-wn", "bsp-ize"] {
        let structure = build(&soup(corners.clone()), &format!("{id}:nodes=boxes"));
        let boxes = boxes(&structure);
        assert!(structure.built().derived.is_empty(), "{id}");
        let bytes = Tree::bytes(boxes) + structure.leaves().bytes();
        assert_eq!(structure.bytes(), bytes, "{id}");
        for route in structure.routes() {
            assert_eq!(route.nodes, "boxes", "{id}: {}", route.batch);
        }
        let rays = structure.routes().map(|route| route.rays);
        assert_eq!(
            rays,
            [Rays::Single, Rays::Stream, Rays::Auto, Rays::Auto],
            "{id}"
        );
    }
}

#[test]
fn boxes_at_other_positions_are_reported() {
    let [structure, other] = [0.3, 0.2].map(|size| build(&soup(grid(4, size)), "kd:nodes=boxes"));
    let shape = structure.shape();
    let check = |made: &Structure, broken: &mut Vec<String>| {
        let body = Body {
            monitor: &Monitor::new(),
            scene: structure.scene(),
            frame: structure.frame(),
            blocks: made.leaves(),
            shape: &shape,
        };
        boxes(made).validate(&body, broken);
    };
    let mut broken = Vec::new();
    check(&structure, &mut broken);
    assert!(broken.is_empty(), "{broken:?}");
    check(&other, &mut broken);
    let corners = broken.iter().filter(|line| line.contains("a vertex of"));
    assert!(corners.count() > 10, "{broken:?}");
}
