// SPDX-License-Identifier: GPL-3.0-or-later
//! The number of references per triangle in trees of split planes.

mod common;

use common::build;
use halfspace::oracle::cases::{Random, soup};

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
    let n = 6000;
    let rim = |i: usize| {
        let angle = std::f32::consts::TAU * (i % n) as f32 / n as f32;
        [angle.cos(), angle.sin(), 0.0]
    };
    let corners: Vec<_> = (0..n)
        .flat_map(|i| [[0.0; 3], rim(i), rim(i + 1)])
        .collect();
    for spec in ["kd", "bsp-wn-plus-kd"] {
        let copies = copies(&corners, spec);
        assert!(copies < 100.0, "{spec}: {copies}");
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
