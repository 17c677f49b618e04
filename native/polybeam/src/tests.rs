// SPDX-License-Identifier: GPL-3.0-or-later
//! Ownership: each ray is in exactly one beam, in exactly the cells that its own comparisons name.

use crate::line::{Ahead, Line};
use crate::traversal::{NAMES, Octant};
use fearless_simd::Level;
use halfspace_base::Monitor;
use halfspace_builders::octree::{self, Params};
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::octants::Cube;
use halfspace_nodes::octree_nodes::Octree;
use halfspace_ray::frame::Frame;
use halfspace_ray::{FramedScene, Hit, Ray, RayCounters};
use halfspace_scene::Triangles;
use halfspace_trace::batch::Batch;
use std::sync::Arc;

/// A generator of numbers between -1 and 1.
pub struct Random(pub u64);

impl Random {
    pub fn number(&mut self) -> f32 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (self.0 >> 40) as f32 / (1 << 23) as f32 - 1.0
    }

    pub fn point(&mut self) -> [f32; 3] {
        [self.number(), self.number(), self.number()]
    }
}

fn small_triangles(random: &mut Random, count: usize) -> Triangles {
    let mut corners = Vec::new();
    for _ in 0..count {
        let centre = random.point();
        for _ in 0..3 {
            let aside = random.point();
            corners.push(std::array::from_fn(|k| 0.9 * centre[k] + 0.02 * aside[k]));
        }
    }
    let numbers = (0..u32::try_from(count).unwrap()).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]);
    Triangles::new(corners, numbers.collect()).unwrap()
}

pub fn tree_over(scene: &Triangles, frame: &Frame) -> (Octree, Blocks) {
    let cube = Cube::new(frame, 7, true);
    let params = Params {
        cube,
        leaf_size: 1,
        budget: 8,
        margin: cube.step_margin(frame),
    };
    let octants = octree::build(scene, frame, &params, &Monitor::new()).unwrap();
    let mut blocks = Blocks::new();
    let tree = Octree::new(&octants, cube, FramedScene { scene, frame }, &mut blocks).unwrap();
    (tree.with_links(), blocks)
}

/// Whether a ray crosses the plane `one` before the plane `other`.
fn before(one: Ahead, other: Ahead, m: [f32; 3]) -> bool {
    Line::first(one, other).holds(m)
}

/// Number of nodes on the way of one ray without a hit, by its own comparisons.
fn visits(tree: &Octree, octant: &Octant, m: [f32; 3]) -> u32 {
    let grid = &octant.grid;
    let (near, far) = (octant.planes([0; 3]), octant.planes([grid.size; 3]));
    // Find the face of the root through which the ray enters.
    let mut entry = None;
    for face in near.into_iter().filter(|plane| plane.offset > 0.0) {
        let last = (0..3).all(|k| {
            k == face.axis
                || ((near[k].offset <= 0.0 || before(near[k], face, m)) && before(face, far[k], m))
        });
        if last {
            assert!(entry.is_none(), "one face");
            entry = Some(face);
        }
    }
    if far.iter().any(|plane| plane.offset <= 0.0)
        || (entry.is_none() && near.iter().any(|plane| plane.offset > 0.0))
    {
        return 0;
    }
    let (mut index, mut low, mut count) = (0, [0_u32; 3], 0);
    loop {
        count += 1;
        let node = tree.node(index);
        let edge = grid.edge(node);
        if node.is_inner() {
            // Choose the child by the planes crossed before the entry face.
            let mut child = 0;
            for (k, low) in low.iter_mut().enumerate() {
                let mid = *low + edge / 2;
                let beyond = match entry {
                    None => grid.cell(k, octant.origin[k], 0, grid.size - 1) >= mid,
                    Some(face) => face.axis != k && !before(face, octant.ahead(k, mid), m),
                };
                if beyond {
                    child |= 1 << k;
                    *low = mid;
                }
            }
            index = node.children() + (child ^ grid.signs);
            continue;
        }
        // Leave through the first face.
        let planes = octant.planes(low.map(|x| x + edge));
        let first = |k: usize| (0..3).all(|j| j == k || before(planes[k], planes[j], m));
        let mut axes = (0..3).filter(|k| first(*k));
        let axis = axes.next().expect("a first face");
        assert!(axes.next().is_none(), "one first face");
        low[axis] += edge;
        if low[axis] == grid.size {
            return count;
        }
        let side = usize::from(grid.signs >> axis & 1 == 0);
        index = tree.links(node.leaf_index())[2 * axis + side];
        entry = Some(octant.ahead(axis, low[axis]));
        let edge = grid.edge(tree.node(index));
        low = low.map(|x| x & !(edge - 1));
    }
}

#[test]
fn each_ray_is_in_one_beam_in_the_cells_on_its_way() {
    let mut random = Random(5);
    let (mut compared, mut longest, mut inside) = (0, 0, 0);
    for round in 0..30 {
        let scene = small_triangles(&mut random, 20 + 4 * round);
        let frame = Frame::new(scene.bounds());
        let (tree, blocks) = tree_over(&scene, &frame);
        // Look from anywhere, in half of the rounds from a corner of cells, along their walls.
        let mut o = random.point().map(|x| 2.5 * x);
        let lattice = round % 2 == 0;
        if lattice {
            let unit = tree.cube().edge(3);
            o = std::array::from_fn(|k| {
                tree.cube().corner[k] + unit * ((o[k] + 1.0) * 4.0).round()
            });
        }
        let (across, up) = (random.point(), random.point());
        let towards = random.point();
        let rays: Vec<_> = (0..2500)
            .map(|i| {
                let (x, y) = ((i % 50) as f32 / 25.0 - 1.0, (i / 50) as f32 / 25.0 - 1.0);
                let d = if lattice {
                    [4.0 * x, 4.0 * y, 4.0].map(f32::round)
                } else {
                    std::array::from_fn(|k| towards[k] + x * across[k] + y * up[k])
                };
                Ray {
                    o,
                    d,
                    t_min: 0.0,
                    t_max: f32::INFINITY,
                }
            })
            .collect();
        // Trace beams of any number of rays, and count.
        let kernel = crate::octants(&Arc::new(tree.clone()), &Arc::new(blocks), 1);
        let batch = Batch {
            scene: &scene,
            frame: &frame,
            rays: &rays,
            level: Level::new(),
            shadow_cache: false,
            placed: None,
        };
        let mut hits = vec![Hit::MISS; rays.len()];
        let mut counters = vec![RayCounters::default(); rays.len()];
        assert!(kernel.count(&batch, &mut hits, &mut counters));
        let empty = NAMES.iter().position(|name| *name == "beam_empty").unwrap();
        for ((ray, hit), counters) in rays.iter().zip(&hits).zip(&counters) {
            let signs = (0..3)
                .map(|k| u32::from(ray.d[k].is_sign_negative()) << k)
                .sum();
            let octant = Octant::new(&tree, signs, frame.point(o));
            let longest_component = ray.d.iter().fold(0.0_f32, |a, x| a.max(x.abs()));
            let unit = f32::from_bits(longest_component.to_bits() & 0x7f80_0000);
            let own = visits(&tree, &octant, ray.d.map(|x| x.abs() / unit));
            let found = counters.visits() - counters.cases[empty];
            if hit.is_hit() {
                assert!(found <= own && found > 0, "{round}: {found} of {own}");
                continue;
            }
            assert_eq!(found, own, "{round}: {ray:?}");
            compared += 1;
            longest = longest.max(own);
        }
        inside += u32::from(o.iter().all(|x| x.abs() < 0.9));
    }
    assert!(
        compared > 50_000 && longest > 20 && inside > 0,
        "{compared} {longest} {inside}"
    );
}
