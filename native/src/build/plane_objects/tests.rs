// SPDX-License-Identifier: GPL-3.0-or-later
use super::*;
use crate::build::object_tree::Kind;
use crate::oracle::cases::{Random, grid, soup};
use crate::structure::{Layout, Structure};
use std::collections::BTreeSet;

/// The tree of objects of a structure that is a tree of planes.
fn built(structure: &Structure, monitor: &Monitor) -> Result<ObjectTree> {
    let own = structure.built();
    let Layout::Plane(planes, _) = &own.layout else {
        panic!("a tree of planes")
    };
    build(planes, (structure.scene(), &own.frame), monitor)
}

/// Hands what builds the tree of objects of such a structure to `then`.
fn with_builder(structure: &Structure, then: impl FnOnce(&Builder<'_>)) {
    let own = structure.built();
    let Layout::Plane(planes, _) = &own.layout else {
        panic!("a tree of planes")
    };
    then(&Builder {
        planes,
        scene: structure.scene(),
        frame: &own.frame,
        monitor: &Monitor::new(),
        magnitude: 1.0,
    });
}

/// The leaves of a tree: a box and the triangles in it.
fn leaves(tree: &ObjectTree) -> Vec<(Aabb, &[u32])> {
    let firsts = tree.firsts();
    let places = tree.items.iter().enumerate();
    places
        .filter_map(|(place, item)| match tree.kind(place) {
            Kind::Leaf { count } => {
                let first = firsts[place] as usize;
                Some((item.bounds, &tree.ids[first..first + count]))
            }
            Kind::Inner { .. } => None,
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

/// Triangles a tenth as large as the scene.
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

/// Slivers on one skew line, lying over each other.
fn slivers(count: usize) -> Vec<[f32; 3]> {
    let mut random = Random(11);
    let mut point = || {
        let t = random.unit();
        [t, 0.7 * t, 0.3 * t]
    };
    (0..3 * count).map(|_| point()).collect()
}

#[test]
fn leaves_hold_all_triangles_and_are_no_larger_than_these() {
    for corners in [grid(3, 0.3), random_points(3, 900), Vec::new()] {
        for spec in ["kd", "bsp-cn-plus-kd", "kd-sah:traversal=dir"] {
            let structure = Structure::of(&soup(corners.clone()), spec);
            let tree = built(&structure, &Monitor::new()).unwrap();
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
            let structure = Structure::of(&soup(corners.clone()), spec);
            let tree = built(&structure, &Monitor::new()).unwrap();
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
fn leaves_are_small_where_oblique_planes_part_slivers() {
    let structure = Structure::of(&soup(slivers(300)), "rbsp");
    let tree = built(&structure, &Monitor::new()).unwrap();
    let leaves = leaves(&tree);
    assert!(leaves.len() > 20, "{}", leaves.len());
    let p = [0.5, 0.35, 0.15];
    let holds = |bounds: &Aabb| (0..3).all(|k| bounds.min[k] <= p[k] && p[k] <= bounds.max[k]);
    let there = leaves.iter().filter(|(bounds, _)| holds(bounds)).count();
    assert!(4 * there < leaves.len(), "{there} of {}", leaves.len());
}

/// An object whose box spans these two points, and its parts on both sides of a height along x.
fn cut_at(x: f32, [min, max]: [[f32; 3]; 2]) -> (Object, [Aabb; 2]) {
    let bounds = Aabb { min, max };
    let mut parts = [bounds; 2];
    parts[0].max[0] = x;
    parts[1].min[0] = x;
    (Object { bounds, id: 7 }, parts)
}

#[test]
fn what_reaches_little_over_a_plane_stays_whole_and_what_reaches_far_is_cut() {
    let row = |from: f32| {
        (0..9_u8).map(move |i| {
            let min = [from + f32::from(i), 0.0, 0.0];
            let max = [min[0] + 0.9, 1.0, 1.0];
            Object {
                bounds: Aabb { min, max },
                id: u32::from(i),
            }
        })
    };
    let shared = |reach: [f32; 2]| {
        let mut sides = Sides {
            apart: [row(0.0).collect(), row(10.0).collect()],
            cut: Vec::new(),
        };
        let (whole, parts) = cut_at(10.0, [[reach[0], 0.4, 0.4], [reach[1], 0.6, 0.6]]);
        assert!(sides.take(whole, parts).is_none());
        let shared = sides.share_out(|_, parts| parts, &Monitor::new()).unwrap();
        shared.map(|side| {
            let own = side
                .iter()
                .filter(|object| object.id == 7 && object.bounds.min[1] > 0.3);
            own.map(|object| [object.bounds.min[0], object.bounds.max[0]])
                .collect::<Vec<_>>()
        })
    };
    assert_eq!(shared([9.0, 10.1]), [vec![[9.0, 10.1]], vec![]]);
    assert_eq!(shared([9.9, 11.0]), [vec![], vec![[9.9, 11.0]]]);
    assert_eq!(shared([2.0, 17.0]), [vec![[2.0, 10.0]], vec![[10.0, 17.0]]]);
}

#[test]
fn trees_are_the_same_whatever_the_number_of_threads() {
    for spec in ["kd", "bsp-wn-plus-kd"] {
        let structure = Structure::of(&soup(chips(5, 45_000)), spec);
        let made = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            (pool.unwrap()).install(|| built(&structure, &Monitor::new()).unwrap())
        };
        let (one, three) = (made(1), made(3));
        assert!(one.items == three.items && one.ids == three.ids, "{spec}");
        let ids: BTreeSet<_> = one.ids.iter().copied().collect();
        assert!(ids.into_iter().eq(0..45_000), "{spec}");
    }
}

#[test]
fn many_objects_are_parted_as_few_are() {
    for (spec, oblique) in [("kd", false), ("bsp-random", true)] {
        let structure = Structure::of(&soup(chips(8, 40_000)), spec);
        with_builder(&structure, |builder| {
            let objects = object::gather(structure.scene(), builder.frame);
            let node = builder.planes.node(builder.planes.root());
            assert_eq!(matches!(node, Node::Oblique { .. }), oblique);
            let whole = builder.sides(objects.clone(), &node).unwrap();
            assert!(whole.cut.len() > 1000 && whole.apart.iter().all(|side| side.len() > 1000));
            assert!(whole == builder.sides_of_many(objects, &node).unwrap());
        });
    }
}

#[test]
fn trees_are_no_deeper_than_any_may_be() {
    fn height(tree: &ObjectTree) -> usize {
        usize::from(tree.heights()[0])
    }
    let structure = Structure::of(&soup(random_points(23, 900)), "kd");
    with_builder(&structure, |builder| {
        for (depth, parted) in [(0, true), (MAX_DEPTH - 12, true), (MAX_DEPTH - 2, false)] {
            let objects = object::gather(structure.scene(), builder.frame);
            let mut tree = ObjectTree::default();
            builder
                .objects(objects, (depth, Some(1.0)), &mut tree)
                .unwrap();
            assert!(depth + height(&tree) <= MAX_DEPTH, "{depth}");
            assert_eq!(height(&tree) > 0, parted);
        }
    });
}

#[test]
fn all_of_the_work_is_told_once() {
    for (spec, count) in [
        ("kd", 900),
        ("bsp-wn-plus-kd", 45_000),
        ("kd", 40),
        ("kd", 0),
    ] {
        let structure = Structure::of(&soup(random_points(4, 3 * count)), spec);
        let monitor = Monitor::new();
        built(&structure, &monitor).unwrap();
        let done = monitor.told();
        assert!((done - SHARE).abs() < 1e-6, "{spec}, {count}: {done}");
    }
}

#[test]
fn what_it_takes_counts() {
    let structure = Structure::of(&soup(random_points(9, 900)), "kd");
    let monitor = Monitor::new();
    monitor.limit_memory(4_000_000);
    let before = monitor.room();
    let tree = built(&structure, &monitor).unwrap();
    let kept = size_of_val(&tree.items[..]) + size_of_val(&tree.ids[..]);
    let counted = before - monitor.room();
    assert!(
        (kept as u64..2 * kept as u64).contains(&counted),
        "{kept}: {counted}"
    );
    monitor.limit_memory(kept as u64 - 1);
    assert!(built(&structure, &monitor).is_err());
    monitor.limit_memory(4_000_000);
    monitor.cancel();
    assert!(built(&structure, &monitor).is_err());
}
