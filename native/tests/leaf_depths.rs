// SPDX-License-Identifier: GPL-3.0-or-later
//! The depths of leaves of the render pass.

mod common;

use common::build;
use halfspace::inspect::ray_path::ray_path;
use halfspace::ray::Ray;
use halfspace::scene::Triangles;
use halfspace::structure::leaf_depth::LeafDepths;
use std::sync::Arc;

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
            let visits = ray_path(&structure, &ray).visits;
            let expected = visits.iter().rfind(|visit| visit.tested);
            let expected = expected.map_or(0, |visit| visit.depth as u32);
            assert_eq!(depths.of(&structure, &ray), expected, "{spec}, ray {i}");
            deepest = deepest.max(expected);
        }
        assert_eq!(deepest > 0, spec != "brute", "{spec}");
    }
}
