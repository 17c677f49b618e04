// SPDX-License-Identifier: GPL-3.0-or-later
//! Ownership: each ray is in exactly one beam, in exactly the cells that its own comparisons name.

use crate::form::{Eye, Form, Parallel};
use crate::line::{Ahead, Line};
use crate::traversal::{NAMES, Octant};
use fearless_simd::Level;
use halfspace_base::Monitor;
use halfspace_builders::octree::{self, Params};
use halfspace_geom::verdict::verdict_within;
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::octants::Cube;
use halfspace_nodes::octree_nodes::Octree;
use halfspace_ray::frame::Frame;
use halfspace_ray::ray::HitKey;
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

pub fn small_triangles(random: &mut Random, count: usize) -> Triangles {
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
    deep_tree_over(scene, frame, 7, 1)
}

fn deep_tree_over(
    scene: &Triangles,
    frame: &Frame,
    depth: u32,
    leaf_size: usize,
) -> (Octree, Blocks) {
    let cube = Cube::new(frame, depth, true);
    let params = Params {
        cube,
        leaf_size,
        budget: 8,
        margin: cube.step_margin(frame),
    };
    let octants = octree::build(scene, frame, &params, &Monitor::new()).unwrap();
    let mut blocks = Blocks::new();
    let tree = Octree::new(&octants, cube, FramedScene { scene, frame }, &mut blocks).unwrap();
    (tree.with_links(), blocks)
}

/// Number of nodes on the way of one ray without a hit, by its own comparisons.
fn visits<F: Form>(tree: &Octree, octant: &Octant<F>, way: [f32; 3]) -> u32 {
    let grid = &octant.grid;
    let before = |one: Ahead, other: Ahead| Line::first(one, other).holds(&octant.form, way);
    let origin = octant.form.origin();
    let ahead = |plane: &Ahead| origin.is_none() || plane.offset > 0.0;
    let (near, far) = (octant.planes([0; 3]), octant.planes([grid.size; 3]));
    // Find the face of the root through which the ray enters.
    let mut entry = None;
    for face in near.into_iter().filter(ahead) {
        let last = (0..3).all(|k| {
            k == face.axis || ((!ahead(&near[k]) || before(near[k], face)) && before(face, far[k]))
        });
        if last {
            assert!(entry.is_none(), "one face");
            entry = Some(face);
        }
    }
    if !far.iter().all(ahead) || (entry.is_none() && near.iter().any(ahead)) {
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
                    None => grid.cell(k, origin.unwrap()[k], 0, grid.size - 1) >= mid,
                    Some(face) => face.axis != k && !before(face, octant.ahead(k, mid)),
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
        let first = |k: usize| (0..3).all(|j| j == k || before(planes[k], planes[j]));
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

/// Triangles and an octree over them.
struct Setup {
    scene: Triangles,
    frame: Frame,
    tree: Arc<Octree>,
    blocks: Arc<Blocks>,
}

impl Setup {
    fn new(scene: Triangles) -> Self {
        Self::deep(scene, 7, 1)
    }

    fn deep(scene: Triangles, depth: u32, leaf_size: usize) -> Self {
        let frame = Frame::new(scene.bounds());
        let (tree, blocks) = deep_tree_over(&scene, &frame, depth, leaf_size);
        Self {
            scene,
            frame,
            tree: Arc::new(tree),
            blocks: Arc::new(blocks),
        }
    }
}

/// The nearest hit of a ray, by all triangles.
fn nearest(scene: &Triangles, ray: &Ray) -> (f32, u32) {
    let mut best = (f32::INFINITY, Hit::NONE);
    for &id in scene.live() {
        let span = [ray.t_min, ray.t_max];
        let found = verdict_within(ray.o, ray.d, scene.corners(id), span);
        if let Some(found) = found.filter(|found| ray.reaches(found.t)) {
            let key = HitKey::new(found.t, id);
            if key.precedes(HitKey::new(best.0, best.1)) {
                best = (found.t, id);
            }
        }
    }
    best
}

/// Traces beams of any number of rays. Compares the answers with those of all triangles, and the number of nodes that
/// each ray visits with its own; returns the number of rays of which all nodes were compared, and the largest number of
/// nodes.
fn compare(place: &Setup, rays: &[Ray], visits: impl Fn(&Ray) -> u32) -> [u32; 2] {
    let Setup {
        scene,
        frame,
        tree,
        blocks,
    } = place;
    let batch = Batch {
        scene,
        frame,
        rays,
        level: Level::new(),
        shadow_cache: false,
        placed: None,
        monitor: None,
    };
    let answers: Vec<_> = rays.iter().map(|ray| nearest(scene, ray)).collect();
    let right = |hits: &[Hit]| {
        let own = hits.iter().map(|hit| (hit.t, hit.triangle));
        own.eq(answers.iter().copied())
    };
    // Rays that go on singly find the same.
    let mut hits = vec![Hit::MISS; rays.len()];
    crate::octants(tree, blocks, 20).trace(&batch, &mut hits);
    assert!(right(&hits), "beams of at least 20 rays");
    let mut counters = vec![RayCounters::default(); rays.len()];
    let kernel = crate::octants(tree, blocks, 1);
    assert!(kernel.count(&batch, &mut hits, &mut counters));
    assert!(right(&hits), "beams of any size");
    let empty = NAMES.iter().position(|name| *name == "beam_empty").unwrap();
    let (mut compared, mut longest) = (0, 0);
    for ((ray, hit), counters) in rays.iter().zip(&hits).zip(&counters) {
        let own = visits(ray);
        let found = counters.visits() - counters.cases[empty];
        if hit.is_hit() {
            assert!(found <= own && found > 0, "{found} of {own}: {ray:?}");
            continue;
        }
        assert_eq!(found, own, "{ray:?}");
        compared += 1;
        longest = longest.max(own);
    }
    [compared, longest]
}

#[test]
fn each_ray_is_in_one_beam_in_the_cells_on_its_way() {
    let mut random = Random(5);
    let (mut compared, mut longest, mut inside) = (0, 0, 0);
    for round in 0..30 {
        let place = Setup::new(small_triangles(&mut random, 20 + 4 * round));
        let Setup { frame, tree, .. } = &place;
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
        let octant = |ray: &Ray| {
            let signs = (0..3).map(|k| u32::from(ray.d[k].is_sign_negative()) << k);
            Octant::new(tree, signs.sum(), Eye(frame.point(o)))
        };
        let own = |ray: &Ray| {
            let longest = ray.d.iter().fold(0.0_f32, |a, x| a.max(x.abs()));
            let unit = f32::from_bits(longest.to_bits() & 0x7f80_0000);
            visits(tree, &octant(ray), ray.d.map(|x| x.abs() / unit))
        };
        let [count, most] = compare(&place, &rays, own);
        compared += count;
        longest = longest.max(most);
        inside += u32::from(o.iter().all(|x| x.abs() < 0.9));
    }
    assert!(
        compared > 50_000 && longest > 20 && inside > 0,
        "{compared} {longest} {inside}"
    );
}

/// Small triangles in a cell of this size at a place, and one at the other end of a scene of size 100.
fn cluster(random: &mut Random, at: f32, size: f32) -> Triangles {
    let mut corners = vec![[0.0; 3], [100.0; 3], [99.9, 100.0, 99.8]];
    for _ in 0..60 {
        let centre = random.point();
        for _ in 0..3 {
            let aside = random.point();
            corners.push(std::array::from_fn(|k| {
                at + size * (0.5 + 0.48 * centre[k] + 0.02 * aside[k])
            }));
        }
    }
    let numbers = (0..61).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]);
    Triangles::new(corners, numbers.collect()).unwrap()
}

/// Rays of a view of 100 degrees, 32 by 32 of them, from an eye.
fn view(o: [f32; 3], towards: [f32; 3]) -> Vec<Ray> {
    let most = (0..3).max_by(|i, j| towards[*i].abs().total_cmp(&towards[*j].abs()));
    let most = most.unwrap();
    let (mut across, mut up) = ([0.0; 3], [0.0; 3]);
    let ([x, y], size) = ([(most + 1) % 3, (most + 2) % 3], towards[most]);
    // Both lie across the direction.
    (across[x], across[most]) = (size, -towards[x]);
    (up[y], up[most]) = (size, -towards[y]);
    let rays = (0..1024).map(|i| {
        let (u, v) = ((i % 32) as f32 / 13.0 - 1.2, (i / 32) as f32 / 13.0 - 1.2);
        Ray {
            o,
            d: std::array::from_fn(|k| towards[k] + u * across[k] + v * up[k]),
            t_min: 0.0,
            t_max: f32::INFINITY,
        }
    });
    rays.collect()
}

/// Many cells meet on a diagonal of the root, all with the same lines: parts of beams must not multiply from cell to cell.
#[test]
fn beams_along_symmetries_of_deep_trees_end() {
    let mut random = Random(7);
    let mut compared = 0;
    for (depth, at) in [(16, 4e-5), (18, 0.0), (20, 3e-4)] {
        let place = Setup::deep(cluster(&mut random, at, 1e-4), depth, 0);
        let Setup { frame, tree, .. } = &place;
        let cube = tree.cube();
        let corner = cube.corner[0];
        assert_eq!(cube.corner, [corner; 3]);
        let middle = corner + 0.5 * cube.side;
        // Stand on diagonals, in planes of the octants, at face centres, edges and vertices of the root and of small cells.
        let unit = cube.unit();
        let cell = corner + ((at - corner) / unit).floor() * unit;
        let places = [
            at,
            0.3 * at + 7e-5,
            cell,
            cell + 0.5 * unit,
            middle,
            corner,
            corner + cube.side,
        ];
        let mut eyes = Vec::new();
        for x in places {
            eyes.extend([
                [x; 3],
                [x, x, middle],
                [middle, x, cell],
                [x, cell, cell + unit],
            ]);
        }
        for (i, eye) in eyes.into_iter().enumerate() {
            let sign = if i % 2 == 0 { 1.0 } else { -1.0 };
            let towards = [
                [1.0, 1.0, 1.0],
                [1.0, 1.0, 0.0],
                [0.0, 0.0, 1.0],
                [1.0, -1.0, 1.0],
            ];
            for towards in [towards[0], towards[1 + i % 3]] {
                let rays = view(eye, towards.map(|x: f32| x * sign));
                let own = |ray: &Ray| {
                    let signs = (0..3).map(|k| u32::from(ray.d[k].is_sign_negative()) << k);
                    let octant = Octant::new(tree, signs.sum(), Eye(frame.point(eye)));
                    let longest = ray.d.iter().fold(0.0_f32, |a, x| a.max(x.abs()));
                    let unit = f32::from_bits(longest.to_bits() & 0x7f80_0000);
                    visits(tree, &octant, ray.d.map(|x| x.abs() / unit))
                };
                compared += compare(&place, &rays, own)[0];
            }
        }
    }
    assert!(compared > 100_000, "{compared}");
}

#[test]
fn each_parallel_ray_is_in_one_beam_in_the_cells_on_its_way() {
    let mut random = Random(6);
    let (mut compared, mut longest) = (0, 0);
    for round in 0..30_usize {
        let place = Setup::new(small_triangles(&mut random, 20 + 4 * round));
        let Setup { frame, tree, .. } = &place;
        // Look anywhere; in half of the rounds along walls or diagonals of cells, from their corners.
        let lattice = round % 2 == 0;
        let mut d = random.point();
        if lattice {
            d = d.map(|x| (1.4 * x).round());
            d[round % 3] = 1.0 - 2.0 * (round % 4 / 2) as f32;
        }
        let unit = tree.cube().edge(4);
        let rays: Vec<_> = (0..2500)
            .map(|_| {
                let mut o = random.point().map(|x| 1.5 * x);
                if lattice {
                    let corner = tree.cube().corner;
                    o = [0, 1, 2].map(|k: usize| corner[k] + unit * ((o[k] + 1.0) * 8.0).round());
                }
                Ray {
                    o,
                    d,
                    t_min: 0.0,
                    t_max: f32::INFINITY,
                }
            })
            .collect();
        let form = Parallel::new(tree, frame, d, false).unwrap();
        let octant = Octant::new(tree, form.signs, form);
        let own = |ray: &Ray| {
            let placed = form.place(frame.point(ray.o));
            placed.map_or(0, |placed| visits(tree, &octant, placed.way))
        };
        let [count, most] = compare(&place, &rays, own);
        compared += count;
        longest = longest.max(most);
    }
    assert!(
        compared > 50_000 && longest > 20,
        "{compared} rays, {longest} nodes"
    );
}
