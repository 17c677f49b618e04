// SPDX-License-Identifier: GPL-3.0-or-later
//! How the sides of a plane share out objects. Whole trees are checked by the integration tests.

use super::*;
use halfspace_geom::cell::{Direction, Plane};
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::preorder::{Item, Preorder};
use halfspace_oracle::cases::{Random, soup};

/// Passes what builds the objects of a tree with a single plane through the origin to `then`.
fn with_builder(scene: &Triangles, direction: Direction, then: impl FnOnce(&Builder<'_>)) {
    let frame = Frame::new(scene.bounds());
    let plane = Plane {
        direction,
        offset: 0.0,
    };
    let mut preorder = Preorder::default();
    preorder.items.push(Item::Inner { plane, share: 1.0 });
    preorder.leaf([], 0.5);
    preorder.leaf([], 0.5);
    then(&Builder {
        planes: &PlaneTree::new(&preorder, scene, &frame, &mut Blocks::new()).unwrap(),
        scene,
        frame: &frame,
        monitor: &Monitor::new(),
        magnitude: 1.0,
    });
}

fn random_points(seed: u64, count: usize) -> Vec<[f32; 3]> {
    let mut random = Random(seed);
    (0..count).map(|_| random.point(-1.0, 1.0)).collect()
}

/// Returns the vertices of triangles a tenth as large as the scene.
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

/// An object whose box spans these two points, and its parts on both sides of a height along x.
fn cut_at(x: f32, [min, max]: [[f32; 3]; 2]) -> (Object, [Aabb; 2]) {
    let bounds = Aabb { min, max };
    let mut parts = [bounds; 2];
    parts[0].max[0] = x;
    parts[1].min[0] = x;
    (Object { bounds, id: 7 }, parts)
}

#[test]
fn objects_little_over_a_plane_stay_whole_and_those_far_over_it_are_cut() {
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
fn many_objects_are_split_as_few_are() {
    for direction in [Direction::Axis(0), Direction::Oblique([0.6, 0.7, 0.3])] {
        let scene = soup(chips(8, 40_000));
        with_builder(&scene, direction, |builder| {
            let objects = object::gather(&scene, builder.frame);
            let node = builder.planes.node(builder.planes.root());
            let whole = builder.sides(objects.clone(), &node).unwrap();
            assert!(whole.cut.len() > 1000 && whole.apart.iter().all(|side| side.len() > 1000));
            assert!(whole == builder.sides_of_many(objects, &node).unwrap());
        });
    }
}

#[test]
fn trees_respect_the_depth_limit() {
    fn height(tree: &ObjectTree) -> usize {
        usize::from(tree.heights()[0])
    }
    let scene = soup(random_points(23, 900));
    with_builder(&scene, Direction::Axis(0), |builder| {
        for (depth, split) in [(0, true), (MAX_DEPTH - 12, true), (MAX_DEPTH - 2, false)] {
            let objects = object::gather(&scene, builder.frame);
            let mut tree = ObjectTree::default();
            let open = OpenNode {
                node: builder.planes.root(),
                depth,
                work: Some(1.0),
            };
            builder.objects(objects, open, &mut tree).unwrap();
            assert!(depth + height(&tree) <= MAX_DEPTH, "{depth}");
            assert_eq!(height(&tree) > 0, split);
        }
    });
}
