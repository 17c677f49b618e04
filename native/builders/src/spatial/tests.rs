// SPDX-License-Identifier: GPL-3.0-or-later
//! The parts of triangles: their boxes, their number, and their leaves.

use super::*;
use halfspace_nodes::cost::Costs;
use halfspace_nodes::object_tree::ItemKind;
use halfspace_oracle::cases::{Random, Size, box_triangles, cases, cloud, soup};
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;

const POLICY: SurfaceArea = SurfaceArea {
    costs: Costs::BOXES,
    leaf_max: 64,
};

/// Passes the tree of a scene to `see`, as a list of leaves, each a box and the triangles in it.
fn with_leaves(scene: &Triangles, share: f32, see: impl FnOnce(&[(Aabb, &[u32])], &Frame)) {
    let frame = Frame::new(scene.bounds());
    let framed = FramedScene {
        scene,
        frame: &frame,
    };
    let tree = build(framed, share, &POLICY, &Monitor::new()).unwrap();
    let leaves: Vec<_> = (tree.firsts().into_iter().enumerate())
        .filter_map(|(index, first)| match tree.kind(index) {
            ItemKind::Leaf { count } => {
                let ids = &tree.ids[first as usize..first as usize + count];
                Some((tree.items[index].bounds, ids))
            }
            ItemKind::Inner { .. } => None,
        })
        .collect();
    see(&leaves, &frame);
}

/// Returns the point of a triangle with weights `i / 16` and `j / 16`, within its box.
fn point([a, b, c]: [[f32; 3]; 3], i: u8, j: u8) -> [f64; 3] {
    let bounds = Aabb::of_triangle([a, b, c]);
    let (u, v) = (f64::from(i) / 16.0, f64::from(j) / 16.0);
    [0, 1, 2].map(|k| {
        let [a, b, c] = [a[k], b[k], c[k]].map(f64::from);
        let at = a * (1.0 - u - v) + b * u + c * v;
        at.clamp(f64::from(bounds.min[k]), f64::from(bounds.max[k]))
    })
}

fn contains(bounds: &Aabb, p: [f64; 3]) -> bool {
    (0..3).all(|k| f64::from(bounds.min[k]) <= p[k] && p[k] <= f64::from(bounds.max[k]))
}

/// Checks that every sampled point of every triangle lies in the box of a leaf with the triangle.
fn assert_covered(scene: &Triangles, leaves: &[(Aabb, &[u32])], frame: &Frame, name: &str) {
    let mut boxes = vec![Vec::new(); scene.len()];
    for (bounds, ids) in leaves {
        ids.iter().for_each(|&id| boxes[id as usize].push(bounds));
    }
    for &id in scene.live() {
        let corners = scene.corners(id).map(|p| frame.point(p));
        for (i, j) in (0..=16).flat_map(|i| (0..=16 - i).map(move |j| (i, j))) {
            let p = point(corners, i, j);
            let covered = boxes[id as usize].iter().any(|own| contains(own, p));
            assert!(covered, "{name}: {p:?} of {corners:?}");
        }
    }
}

/// Returns the number of references in leaves.
fn references(leaves: &[(Aabb, &[u32])]) -> usize {
    leaves.iter().map(|(_, ids)| ids.len()).sum()
}

/// Long thin triangles across a room, in all directions.
fn beams(count: usize) -> Vec<[f32; 3]> {
    let mut random = Random(8);
    let mut beam = || {
        let (from, to) = (random.point(-1.0, 1.0), random.point(-1.0, 1.0));
        let beside = random.point(-0.01, 0.01);
        [from, to, [0, 1, 2].map(|k| to[k] + beside[k])]
    };
    (0..count).flat_map(|_| beam()).collect()
}

#[test]
fn the_boxes_of_the_leaves_cover_every_triangle_of_every_contract_scene() {
    let mut cut = 0;
    for case in cases(Size::Small, 7) {
        with_leaves(&case.scene, 4.0, |leaves, frame| {
            cut += references(leaves) - case.scene.live().len();
            assert_covered(&case.scene, leaves, frame, case.name);
        });
    }
    assert!(cut > 1000, "only {cut} further references");
}

#[test]
fn the_boxes_of_parts_cover_long_triangles() {
    let scene = soup(beams(500));
    with_leaves(&scene, 4.0, |leaves, frame| {
        assert!(references(leaves) > scene.len() * 3 / 2);
        assert_covered(&scene, leaves, frame, "beams");
    });
}

/// A part of a triangle may begin between two numbers of f32, at any height over the cell.
#[test]
fn the_box_of_a_part_is_rounded_outwards() {
    let mut random = Random(21);
    for _ in 0..2000 {
        let corners = [(); 3].map(|()| random.point(0.5, 1.0));
        let scene = soup(corners.to_vec());
        let frame = Frame::new(scene.bounds());
        let framed = FramedScene {
            scene: &scene,
            frame: &frame,
        };
        let object = object::gather(&scene, &frame)[0];
        let mut cell = object.bounds;
        cell.max[0] = 0.5 * cell.min[0] + 0.5 * cell.max[0];
        let part = Cutter::new(framed).around(&object, &cell).unwrap();
        // Cut the three edges with the plane, in f64.
        let plane = f64::from(cell.max[0]);
        for i in 0..3 {
            let [a, b] = [corners[i], corners[(i + 1) % 3]].map(|p| p.map(f64::from));
            let s = (plane - a[0]) / (b[0] - a[0]);
            if !(0.0..=1.0).contains(&s) {
                continue;
            }
            let p = [plane, a[1] + s * (b[1] - a[1]), a[2] + s * (b[2] - a[2])];
            assert!(contains(&part, p), "{p:?} in {part:?}");
        }
    }
}

#[test]
fn references_stay_within_the_budget() {
    let scene = soup(beams(2000));
    let mut before = 0;
    for share in [0.0001, 0.01, 0.1, 0.5, 2.0, 4.0] {
        with_leaves(&scene, share, |leaves, _| {
            let more = references(leaves) - scene.len();
            assert!(more <= budget(scene.len(), share), "{share}: {more}");
            assert!(more >= before, "{share}: {more} after {before}");
            before = more;
        });
    }
    assert!(before > scene.len() / 2, "{before}");
}

#[test]
fn leaves_list_each_triangle_once_and_together_all_of_them() {
    for corners in [beams(800), cloud(3000, 0.2, &mut Random(3)), Vec::new()] {
        let scene = soup(corners);
        with_leaves(&scene, 4.0, |leaves, _| {
            let mut found = Vec::new();
            for (_, ids) in leaves {
                let mut own = ids.to_vec();
                own.sort_unstable();
                own.dedup();
                assert_eq!(own.len(), ids.len(), "a triangle twice in a leaf");
                found.extend(own);
            }
            found.sort_unstable();
            found.dedup();
            assert_eq!(found, scene.live());
        });
    }
}

#[test]
fn scenes_whose_boxes_do_not_overlap_are_not_cut() {
    let apart = [0.0, 4.0, 8.0].map(|x| box_triangles([x, 0.0, 0.0], [x + 1.0, 1.0, 1.0]));
    let point = vec![[3.0, 4.0, 5.0]; 9];
    for corners in [apart.concat(), point] {
        let scene = soup(corners);
        with_leaves(&scene, 4.0, |leaves, _| {
            assert_eq!(references(leaves), scene.live().len());
        });
    }
}
