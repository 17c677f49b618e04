// SPDX-License-Identifier: GPL-3.0-or-later
//! Slab tests reject no ray that hits.

use super::*;
use halfspace_geom::Aabb;
use halfspace_geom::verdict::verdict;
use halfspace_nodes::dop_tree::height;
use halfspace_ray::Ray;
use halfspace_ray::frame::Frame;
use halfspace_scene::Triangles;
use halfspace_strategies::{near_triangle, point};
use proptest::prelude::*;

fn triangle_node(corners: [[f32; 3]; 3]) -> Node<13> {
    let heights = NORMALS.map(|n| corners.map(|p| height(n, p)));
    Node {
        low: heights.map(|ends| {
            ends.map(|(low, _)| low)
                .into_iter()
                .fold(f32::INFINITY, f32::min)
        }),
        high: heights.map(|ends| {
            ends.map(|(_, high)| high)
                .into_iter()
                .fold(f32::NEG_INFINITY, f32::max)
        }),
        link: 0,
        count: 0,
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20_000))]

    #[test]
    fn no_slab_rejects_a_hit(
        corners in [point(), point(), point()], o in point(), s in 0.0f32..1.0, t in 0.0f32..1.0,
    ) {
        let scene = Triangles::new(corners.to_vec(), vec![[0, 1, 2]]).unwrap();
        prop_assume!(!scene.live().is_empty());
        let frame = Frame::new(scene.bounds());
        let target = near_triangle(corners, [s, t]);
        let d: [f32; 3] = std::array::from_fn(|k| target[k] - o[k]);
        prop_assume!(d.iter().all(|x| x.is_finite()));
        let ray = Ray { o, d, t_min: 0.0, t_max: f32::INFINITY };
        let hit = verdict(o, d, corners).filter(|v| v.t >= 0.0 && v.t.is_finite());
        if let (Some(hit), Some(framed)) = (hit, frame.ray(&ray)) {
            let node = triangle_node(corners.map(|p| frame.point(p)));
            let range = Interval::new(framed.t_min, framed.t_max);
            let enter = Planes::<13>::new(&framed).meet(&node, range);
            prop_assert!(enter.is_some_and(|enter| enter <= framed.reach(hit.t)));
        }
    }
}

/// Shows that the test above can fail: without error bounds slabs are too thin for rounded distances.
#[test]
fn slabs_without_bounds_reject_hits() {
    let corners = [[1.0_f32, 2.0, 3.0], [7.0, 2.0, 5.0], [3.0, 6.0, 4.0]];
    let frame = Frame::new(Aabb::of_triangle(corners)).with_robust(false);
    let node = triangle_node(corners);
    let mut rejected = 0;
    for i in 0..2000_u16 {
        // Aim from far away exactly at a vertex, where planes of all slabs meet.
        let x = f32::from(i);
        let o = [
            -90_000.0 - 7.0 * x,
            30_001.0 + 13.0 * x,
            -70_003.0 - 5.0 * x,
        ];
        let target = corners[usize::from(i) % 3];
        let d = std::array::from_fn(|k| target[k] - o[k]);
        let ray = Ray {
            o,
            d,
            t_min: 0.0,
            t_max: f32::INFINITY,
        };
        let hit = verdict(o, d, corners).is_some();
        let met = frame.ray(&ray).is_some_and(|framed| {
            let range = Interval::new(framed.t_min, framed.t_max);
            Planes::<13>::new(&framed).meet(&node, range).is_some()
        });
        rejected += usize::from(hit && !met);
    }
    assert!(rejected > 0);
}
