// SPDX-License-Identifier: GPL-3.0-or-later
//! Hits of streams are those of brute force bit for bit, in every scene of the contract tests.

use super::trees::{self, Grown, answers, brute_force};
use crate::kernel::Kernel;
use crate::packet;
use crate::stream::{STREAM, kernel};
use crate::tile;
use halfspace_leaf::keep::Keep;
use halfspace_nodes::box_tree::BoxTree;
use halfspace_nodes::plane_tree::PlaneTree;
use halfspace_nodes::wide_tree::WideTree;
use halfspace_oracle::cases::{
    Case, Random, Size, aimed, cases, cloud, everywhere, ray, soup, strew,
};
use halfspace_oracle::levels;
use halfspace_ray::query::{Any, Closest};
use halfspace_ray::{Hit, Ray};
use halfspace_scene::Triangles;
use proptest::prelude::*;
use std::sync::Arc;

/// The kernels of one scene, each with its name.
pub type Kernels<Q> = Vec<(&'static str, Arc<dyn Kernel<Q>>)>;

/// Makes both kernels of streams through a tree.
macro_rules! streams {
    ($all:ident, $name:literal, $grown:expr, $closest:ident, $shadow:ident) => {{
        let Grown { tree, leaves } = $grown;
        ($all.closest).push(($name, kernel::$closest(&tree, &leaves)));
        ($all.shadow).push(($name, kernel::$shadow(&tree, &leaves)));
    }};
}

/// Makes the kernels of streams, packets and tiles through a tree.
macro_rules! every {
    ($all:ident, $name:literal, $grown:expr, $closest:ident, $shadow:ident) => {{
        let Grown { tree, leaves } = $grown;
        let (packets, tiles) = (
            concat!("packets through ", $name),
            concat!("tiles through ", $name),
        );
        ($all.closest).push(($name, kernel::$closest(&tree, &leaves)));
        ($all.shadow).push(($name, kernel::$shadow(&tree, &leaves)));
        let groups = &mut $all.groups;
        (groups.closest).push((packets, packet::kernel::$closest(&tree, &leaves)));
        (groups.shadow).push((packets, packet::kernel::$shadow(&tree, &leaves)));
        (groups.closest).push((tiles, tile::kernel::$closest(&tree, &leaves)));
        (groups.shadow).push((tiles, tile::kernel::$shadow(&tree, &leaves)));
    }};
}

/// The kernels of streams through trees of all kinds over one scene.
pub struct All {
    pub closest: Kernels<Closest>,
    pub shadow: Kernels<Any>,
    /// Packets and tiles through the same trees.
    pub groups: Groups,
}

/// Kernels of packets and tiles.
#[derive(Default)]
pub struct Groups {
    pub closest: Kernels<Closest>,
    pub shadow: Kernels<Any>,
}

impl All {
    pub fn new(scene: &Triangles) -> Self {
        let mut all = Self {
            closest: Vec::new(),
            shadow: Vec::new(),
            groups: Groups::default(),
        };
        let (axis, any) = (trees::planes(scene, false), trees::planes(scene, true));
        streams!(all, "axis planes", axis, planes, shadow_planes);
        streams!(all, "oblique planes", any, planes, shadow_planes);
        for oblique in [false, true] {
            let Grown { tree, leaves } = trees::planes(scene, oblique);
            let tree = Arc::new(WideTree::new(&tree));
            let wide = Grown { tree, leaves };
            every!(all, "wide planes", wide, wide_planes, shadow_wide_planes);
        }
        let Grown { tree, leaves } = trees::boxes::<8>(scene);
        let tree = Arc::new(BoxTree::by_corners((*tree).clone()));
        let eight = Grown { tree, leaves };
        streams!(all, "eight boxes", eight, boxes, shadow_boxes);
        let (four, two) = (trees::boxes(scene), trees::boxes(scene));
        every!(all, "four boxes", four, boxes4, shadow_boxes4);
        every!(all, "two boxes", two, boxes2, shadow_boxes2);
        for keep in [Keep::Corners, Keep::Indices] {
            let double = trees::slabs(scene, keep);
            every!(all, "intervals", double, intervals, shadow_intervals);
            let Grown { tree, leaves } = trees::slabs(scene, keep);
            let one = Grown { tree, leaves };
            every!(
                all,
                "single",
                one,
                single_intervals,
                shadow_single_intervals
            );
        }
        let two = trees::wide_slabs(scene);
        every!(all, "two intervals", two, intervals2, shadow_intervals2);
        let four = trees::wide_slabs(scene);
        every!(all, "four intervals", four, intervals4, shadow_intervals4);
        let eight = trees::wide_slabs(scene);
        every!(all, "eight intervals", eight, intervals8, shadow_intervals8);
        let slanted = trees::slanted(scene);
        every!(all, "slanted", slanted, slanted, shadow_slanted);
        every!(all, "cells", trees::cells(scene), cells, shadow_cells);
        let octree = trees::octree(scene);
        every!(all, "octants", octree, octants, shadow_octants);
        all
    }
}

fn bits(hits: &[Hit]) -> Vec<[u32; 4]> {
    let bits = |hit: &Hit| {
        let [t, u, v] = [hit.t, hit.u, hit.v].map(f32::to_bits);
        [t, hit.triangle, u, v]
    };
    hits.iter().map(bits).collect()
}

/// Checks every kernel on every instruction set. Returns the nearest hits.
fn agree(name: &str, scene: &Triangles, rays: &[Ray]) -> Vec<Hit> {
    agree_in_batches(name, scene, rays, &[rays.len().max(1)])
}

/// [`agree`] for the first batches of each of these sizes.
fn agree_in_batches(name: &str, scene: &Triangles, rays: &[Ray], sizes: &[usize]) -> Vec<Hit> {
    let (brute, all) = (brute_force(scene), All::new(scene));
    let closest: &dyn Kernel<Closest> = &*brute;
    let (_, best) = *levels().last().expect("there is one");
    let expected = answers(closest, scene, rays, best, Hit::MISS);
    let blocked: Vec<_> = expected.iter().map(Hit::is_hit).collect();
    let batches = sizes.iter().flat_map(|&size| {
        let batches = rays.chunks(size).zip(expected.chunks(size));
        batches.zip(blocked.chunks(size)).take(12)
    });
    for ((rays, expected), blocked) in batches {
        for (set, level) in levels() {
            for (tree, kernel) in all.closest.iter().chain(&all.groups.closest) {
                let found = answers(&**kernel, scene, rays, level, Hit::MISS);
                let wrong = || (0..rays.len()).find(|&i| bits(&found)[i] != bits(expected)[i]);
                let same = bits(&found) == bits(expected);
                assert!(same, "{name}, {tree}, {set}: ray {:?}", wrong());
            }
            for (tree, kernel) in all.shadow.iter().chain(&all.groups.shadow) {
                let found = answers(&**kernel, scene, rays, level, false);
                assert!(found == blocked, "any hits: {name}, {tree}, {set}");
            }
        }
    }
    expected
}

#[test]
fn streams_answer_like_brute_force_in_difficult_scenes() {
    for Case {
        name, scene, rays, ..
    } in cases(Size::Small, 1)
    {
        if !scene.live().is_empty() {
            agree(name, &scene, &rays);
        }
    }
}

/// There are more rays than a stream holds, the second time fewer than before.
#[test]
fn streams_follow_one_another() {
    let mut random = Random(3);
    let scene = soup(cloud(300, 0.3, &mut random));
    let mut rays = aimed(&scene, STREAM + 900, &mut random);
    rays.extend(everywhere(300, &mut random));
    strew(&mut rays, 13);
    let hits = agree("cloud", &scene, &rays);
    assert!(hits.iter().filter(|hit| hit.is_hit()).count() > rays.len() / 2);
}

#[test]
fn batches_of_any_size_answer_like_brute_force() {
    let mut random = Random(5);
    let scene = soup(cloud(800, 0.1, &mut random));
    let mut rays = aimed(&scene, 400, &mut random);
    strew(&mut rays, 9);
    let sizes = [1, 2, 3, 4, 7, 8, 9, 15, 16, 17, 33];
    agree_in_batches("cloud", &scene, &rays, &sizes);
}

/// Camera rays and shadow rays of one light, in order of pixels: tiles of such rays finish, and partly filled ones too.
#[test]
fn tiles_of_a_camera_and_of_a_light_answer_like_brute_force() {
    let mut random = Random(8);
    for size in [0.05, 0.3] {
        let scene = soup(cloud(300, size, &mut random));
        for eye in [[0.0, 0.0, 4.0], [0.1, 0.2, 0.05], [3.0, -2.0, 2.5]] {
            let rays = pixels(eye, 24);
            let hits = agree("camera", &scene, &rays);
            // Send rays from each hit back to the eye, as to a light.
            let to_light = rays.iter().zip(&hits).filter(|(_, hit)| hit.is_hit());
            let to_light: Vec<_> = to_light
                .map(|(ray, hit)| {
                    let point = [0, 1, 2].map(|k: usize| ray.o[k] + hit.t * ray.d[k]);
                    let mut shadow = *ray;
                    (shadow.o, shadow.d) = (point, [0, 1, 2].map(|k: usize| eye[k] - point[k]));
                    (shadow.t_min, shadow.t_max) = (1e-4, 1.0 - 1e-4);
                    shadow
                })
                .collect();
            agree("light", &scene, &to_light);
            agree("part of a tile", &scene, &rays[..37]);
        }
    }
}

/// Rays from an eye through `8 n` pixels a side, in tiles of 8 by 8.
fn pixels(eye: [f32; 3], n: usize) -> Vec<Ray> {
    let mut rays = Vec::new();
    for tile in 0..n {
        for pixel in 0..64 {
            let x = (8 * (tile % 6) + pixel % 8) as f32 / 24.0 - 1.0;
            let y = (8 * (tile / 6) + pixel / 8) as f32 / 24.0 - 0.7;
            let forward = [0, 1, 2].map(|k: usize| -eye[k]);
            let d = [forward[0] + x, forward[1] + y, forward[2] + 0.3 * (x - y)];
            rays.push(ray(eye, d));
        }
    }
    rays
}

/// The trees of the tests have oblique planes, else they would test nothing of them.
#[test]
fn some_planes_are_oblique() {
    let mut random = Random(6);
    let scene = soup(cloud(300, 0.3, &mut random));
    let count = |tree: &PlaneTree| {
        let mut count = 0;
        tree.visit(|_, node, _| {
            use halfspace_nodes::plane_tree::Node;
            count += usize::from(matches!(node, Node::Oblique { .. }));
        });
        count
    };
    assert_eq!(count(&trees::planes(&scene, false).tree), 0);
    assert!(count(&trees::planes(&scene, true).tree) > 20);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn streams_answer_like_brute_force(
        seed: u64,
        triangles in 1_usize..200,
        size in 0.001_f32..1.0,
        count in 1_usize..400,
        every in 2_usize..50,
    ) {
        let mut random = Random(seed);
        let scene = soup(cloud(triangles, size, &mut random));
        let mut rays = aimed(&scene, count, &mut random);
        rays.extend(everywhere(count / 4, &mut random));
        strew(&mut rays, every);
        agree("random", &scene, &rays);
    }
}
