// SPDX-License-Identifier: GPL-3.0-or-later
//! Shadow beams: rays to one light go through a tree together, as González López and Gisbert
//! Cantó announce but do not build.
//!
//! Seen from the light the ends of its shadow rays are pixels on the six faces of a cube (on one
//! plane, for a sun). Sorted by face and place they fall into beams of up to 64 rays that are
//! narrow at both ends. A beam's shaft meets few cells; in those, triangles are left out that the
//! shaft passes by, and those whose plane has all the beam on one side, as the receivers' own
//! have. Mostly nothing is left: the beam is empty, and one walk has answered all its rays. What is
//! left is put to the rays, eight at a time, and then to the verdict; what blocked the beam before is
//! put to them first. A beam that meets many cells or triangles is not worth its name; its rays go on
//! singly. So no answer changes.

use super::batch::{Batch, Walk, baseline};
use super::block_boxes::BlockBoxes;
use super::bundle::{LANES, RAYS, Row, Rows, all, lanes, load};
use super::frame::FrameRay;
use super::lanes::{Free, Plane};
use super::light_cube;
use super::query::{Any, Best, Count, Counters, NoCount, Notes};
use super::ray::{Hit, RayCounters};
use super::shadow_cache::ShadowCache;
use super::shaft::{Extent, Shaft};
use super::shaft_tree::ShaftTree;
use fearless_simd::{Simd, dispatch};

/// Beams of fewer rays are not worth their walk.
const LEAST: u32 = 4;

/// It may put one triangle to its rays for so many of them.
const RAYS_PER_TRIANGLE: u32 = 4;

/// The rays of a beam.
struct Beam {
    /// Their places in the batch.
    ids: Vec<usize>,
    framed: Vec<FrameRay<'static>>,
    rays: Rows,
    /// From where each ray may be blocked, and to where.
    start: [Row; 3],
    end: [Row; 3],
    reach: Row,
    /// Rays without an answer.
    open: u64,
    /// Bound on the error of a start or an end.
    pad: f32,
}

impl Batch<'_> {
    /// Finds any hit of each ray by beams through a tree that divides space; `walk` serves rays that go singly.
    pub fn shadow_beams<T: ShaftTree, W: Walk>(
        &self,
        (tree, walk): (&T, &W),
        mut write: impl FnMut(usize, Hit),
        counters: Option<&mut [RayCounters]>,
    ) {
        let sorted = light_cube::sorted(self.rays, self.scene.bounds());
        match counters {
            None => {
                let mut none = vec![NoCount; self.rays.len()];
                dispatch!(self.level, simd => {
                    self.each_beam(simd, (tree, walk), &sorted, &mut write, &mut none);
                });
            }
            Some(counters) => {
                let mut counters: Vec<_> = counters
                    .iter_mut()
                    .map(|c| Count(c, Notes::Nothing))
                    .collect();
                baseline!(simd => {
                    self.each_beam(simd, (tree, walk), &sorted, &mut write, &mut counters);
                });
            }
        }
    }

    #[inline(always)]
    fn each_beam<S: Simd, T: ShaftTree, W: Walk, C: Counters>(
        &self,
        simd: S,
        (tree, walk): (&T, &W),
        sorted: &[u64],
        write: &mut impl FnMut(usize, Hit),
        counters: &mut [C],
    ) {
        let mut scratch = walk.scratch();
        let mut beam = Beam::new();
        let mut waiting = Vec::with_capacity(64);
        let mut cache = ShadowCache::new(self.scene.bounds());
        for run in sorted.chunk_by(|a, b| light_cube::same_face(*a, *b)) {
            for keys in run.chunks(RAYS) {
                beam.fill(self, keys, write);
                let Some(&first) = beam.ids.first() else {
                    continue;
                };
                let entry = cache.entry(&self.rays[first]);
                let mut blocker = Hit::MISS;
                if beam.open.count_ones() >= LEAST {
                    let id = cache.blocker(entry);
                    if id != Hit::NONE {
                        let known = (id, self.scene.corners(id).map(|p| self.frame.point(p)));
                        self.put(simd, &mut beam, known, &mut blocker, write, counters);
                        for i in lanes(beam.everyone() & !beam.open) {
                            counters[beam.ids[i]].spared();
                        }
                    }
                    if beam.open.count_ones() >= LEAST {
                        let tree = (tree, &mut waiting);
                        self.follow(simd, tree, &mut beam, &mut blocker, write, counters);
                    }
                }
                for i in lanes(beam.open) {
                    let id = beam.ids[i];
                    let ray = (&self.rays[id], &beam.framed[i]);
                    if let Some(hit) = self.blocked(blocker.triangle, ray, &mut counters[id]) {
                        write(id, hit);
                        continue;
                    }
                    let triangles = (self.scene, self.blocks);
                    let count = &mut counters[id];
                    let hit = walk.cast::<S, Any, C>(simd, triangles, ray, &mut scratch, count);
                    blocker = hit;
                    write(id, hit);
                }
                cache.remember(entry, &blocker);
            }
        }
    }

    /// Walks a beam; what stays open must go on singly.
    #[inline(always)]
    fn follow<S: Simd, T: ShaftTree, C: Counters>(
        &self,
        simd: S,
        (tree, waiting): (&T, &mut Vec<T::Place>),
        beam: &mut Beam,
        blocker: &mut Hit,
        write: &mut impl FnMut(usize, Hit),
        counters: &mut [C],
    ) {
        let shaft = beam.shaft(self.frame.bounds().magnitude());
        let open = beam.open.count_ones();
        let mut steps = T::STEPS_PER_RAY * open;
        let mut triangles = open.div_ceil(RAYS_PER_TRIANGLE);
        // What a beam does for all is charged to its first ray.
        let charged = beam.ids[beam.open.trailing_zeros() as usize];
        let mut empty = true;
        waiting.clear();
        waiting.push(tree.top(self.frame.bounds()));
        while let Some(place) = waiting.pop() {
            if let Some((first, count)) = tree.step(simd, place, &shaft, waiting) {
                counters[charged].leaf(count);
                let (mut at, mut left) = (first as usize, count);
                while left > 0 {
                    let block = BlockBoxes::new(simd, self.blocks, at, left);
                    counters[charged].tests(block.n);
                    let met = shaft.meets(simd, &block.low, &block.high);
                    for lane in lanes(met & ((1 << block.n) - 1)) {
                        let triangle = block.triangle(lane);
                        if beam.is_beside(simd, triangle.1) {
                            continue;
                        }
                        if triangles == 0 {
                            return;
                        }
                        triangles -= 1;
                        empty = false;
                        self.put(simd, beam, triangle, blocker, write, counters);
                        if beam.open == 0 {
                            return;
                        }
                    }
                    at = block.next;
                    left -= block.n;
                    if steps == 0 {
                        return;
                    }
                    steps -= 1;
                }
                continue;
            }
            counters[charged].step_axis();
            if steps == 0 {
                return;
            }
            steps -= 1;
        }
        for i in lanes(beam.open) {
            write(beam.ids[i], Hit::MISS);
            if empty {
                counters[beam.ids[i]].spared();
            }
        }
        beam.open = 0;
    }

    /// Puts a triangle to the open rays; those that it blocks are answered and closed.
    #[inline(always)]
    fn put<S: Simd, C: Counters>(
        &self,
        simd: S,
        beam: &mut Beam,
        (id, corners): (u32, [[f32; 3]; 3]),
        blocker: &mut Hit,
        write: &mut impl FnMut(usize, Hit),
        counters: &mut [C],
    ) {
        let free = Free::new(corners);
        for row in (0..beam.ids.len()).step_by(LANES) {
            let bits = beam.open >> row & 0xff;
            if bits == 0 {
                continue;
            }
            let (o, d) = (all(simd, &beam.rays.o, row), all(simd, &beam.rays.d, row));
            let found = free.candidates(simd, o, d, load(simd, &beam.reach, row)) & bits;
            for lane in lanes(bits) {
                counters[beam.ids[row + lane]].tests(1);
            }
            for lane in lanes(found) {
                let (i, own) = (row + lane, beam.ids[row + lane]);
                let ray = (&self.rays[own], &beam.framed[i]);
                let mut best = Best::new(ray.1);
                let blocked = best.offer::<Any, C>(
                    ray,
                    id,
                    #[inline(always)]
                    || self.blocks.scene_corners(self.scene, id, corners),
                    &mut counters[own],
                );
                if blocked {
                    beam.open &= !(1 << i);
                    *blocker = best.hit();
                    write(own, best.hit());
                }
            }
        }
    }
}

impl Beam {
    /// Without rays.
    fn new() -> Self {
        Self {
            ids: Vec::with_capacity(RAYS),
            framed: Vec::with_capacity(RAYS),
            rays: Rows::blank(),
            start: [[0.0; RAYS]; 3],
            end: [[0.0; RAYS]; 3],
            reach: [0.0; RAYS],
            open: 0,
            pad: 0.0,
        }
    }

    /// Takes the rays of some keys; those that miss the scene are answered.
    #[inline(always)]
    fn fill(&mut self, batch: &Batch<'_>, keys: &[u64], write: &mut impl FnMut(usize, Hit)) {
        self.ids.clear();
        self.framed.clear();
        self.pad = 0.0;
        for key in keys {
            #[expect(clippy::cast_possible_truncation, reason = "the low half")]
            let id = *key as u32 as usize;
            let Some(ray) = batch.frame.ray(&batch.rays[id]) else {
                write(id, Hit::MISS);
                continue;
            };
            let i = self.ids.len();
            for k in 0..3 {
                self.rays.o[k][i] = ray.o[k];
                self.rays.d[k][i] = ray.d[k];
                self.start[k][i] = ray.o[k] + ray.t_min * ray.d[k];
                self.end[k][i] = ray.o[k] + ray.t_max * ray.d[k];
                self.pad = self.pad.max(ray.pad[k]);
            }
            self.reach[i] = ray.t_max;
            self.ids.push(id);
            self.framed.push(ray);
        }
        self.open = self.everyone();
    }

    /// The places of all rays.
    fn everyone(&self) -> u64 {
        match self.ids.len() {
            0 => 0,
            n => u64::MAX >> (RAYS - n),
        }
    }

    /// The shaft of the open rays.
    #[inline(always)]
    fn shaft(&self, magnitude: f32) -> Shaft {
        let (mut from, mut to) = (Extent::NOTHING, Extent::NOTHING);
        for i in lanes(self.open) {
            from.add([self.start[0][i], self.start[1][i], self.start[2][i]]);
            to.add([self.end[0][i], self.end[1][i], self.end[2][i]]);
        }
        // No cell reaches farther out than its root, which is at most twice the scene and a cell wide.
        Shaft::new(&from, &to, self.pad, 8.0 * magnitude)
    }

    /// Whether all open rays lie on one side of a triangle's plane.
    #[inline(always)]
    fn is_beside<S: Simd>(&self, simd: S, corners: [[f32; 3]; 3]) -> bool {
        let plane = Plane::new(corners);
        let (mut above, mut below) = (true, true);
        for row in (0..self.ids.len()).step_by(LANES) {
            let own = self.open >> row & 0xff;
            if own == 0 {
                continue;
            }
            for points in [&self.start, &self.end] {
                let sides = plane.sides(simd, all(simd, points, row), self.pad);
                above &= sides[0] & own == own;
                below &= sides[1] & own == own;
            }
            if !above && !below {
                return false;
            }
        }
        true
    }
}
