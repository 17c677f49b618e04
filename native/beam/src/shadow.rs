// SPDX-License-Identifier: GPL-3.0-or-later
//! Shadow beams: rays to one light traverse a tree together, as González López and Gisbert Cantó announce but
//! do not build.
//!
//! Seen from the light, the ends of its shadow rays are pixels on the six faces of a cube (on one plane, for a
//! sun). Sorted by face and position they form beams of at most 64 rays that are narrow at both ends. The shaft of a
//! beam meets few cells. In these, it rejects the triangles that the shaft misses and those with the whole beam on one
//! side of their plane, such as the receivers' own. Mostly no triangle is left: the beam is empty, and one traversal
//! decides all its rays.
//!
//! A remaining triangle is tested against the rays, eight at a time, then by the exact verdict; the last
//! blocker is tested first. The rays of a beam that meets many cells or triangles are traced singly. No result
//! changes.

use crate::bundle::{LANES, RAYS, Row, Rows, all, lanes, load};
use crate::light_cube;
use crate::shaft::{Extent, Shaft};
use crate::shaft_tree::ShaftTree;
use fearless_simd::{Simd, dispatch};
use halfspace_leaf::block_boxes::BlockBoxes;
use halfspace_leaf::lanes::{Free, Plane};
use halfspace_ray::query::{Any, Best, Count, Counters, NoCount};
use halfspace_ray::{FrameRay, Hit, RayCounters, RayRef};
use halfspace_trace::batch::{Launch, SingleTraversal, baseline};
use halfspace_trace::shadow_cache::ShadowCache;
use std::ops::Deref;

/// Fewest rays for which a beam is traced.
const LEAST: u32 = 4;

/// A beam may test one triangle for each of this number of its rays; beyond it, its rays are traced singly.
const RAYS_PER_TRIANGLE: u32 = 4;

/// The rays of a beam.
struct Beam {
    /// Their indices in the batch.
    ids: Vec<usize>,
    framed: Vec<FrameRay<'static>>,
    rays: Rows,
    /// Start and end points between which each ray may be blocked.
    start: [Row; 3],
    end: [Row; 3],
    reach: Row,
    /// Mask of the undecided rays.
    open: u64,
    /// Error bound of the start and end points.
    pad: f32,
    /// Whether the frame rounds the origin of some ray: the tests of a beam do not allow for that.
    blurred: bool,
    /// The hit of the ray that was blocked last.
    blocker: Hit,
}

/// A launch of shadow rays.
pub struct Run<'a>(pub Launch<'a>);

impl<'a> Deref for Run<'a> {
    type Target = Launch<'a>;

    #[inline(always)]
    fn deref(&self) -> &Launch<'a> {
        &self.0
    }
}

impl Run<'_> {
    /// Finds any hit of each ray by beams through a spatial subdivision; `single` traces the remaining rays.
    pub fn shadow_beams<T: ShaftTree, R: SingleTraversal>(
        &self,
        tree: &T,
        single: &R,
        mut write: impl FnMut(usize, Hit),
        counters: Option<&mut [RayCounters]>,
    ) {
        let sorted = light_cube::sorted(self.rays, self.frame);
        match counters {
            None => {
                let mut none = vec![NoCount; self.rays.len()];
                dispatch!(self.level, simd => {
                    self.each_beam(simd, tree, single, &sorted, &mut write, &mut none);
                });
            }
            Some(counters) => {
                let mut counters: Vec<_> = counters.iter_mut().map(Count::new).collect();
                baseline!(simd => {
                    self.each_beam(simd, tree, single, &sorted, &mut write, &mut counters);
                });
            }
        }
    }

    /// Traces the sorted rays beam by beam.
    #[inline(always)]
    fn each_beam<S: Simd, T: ShaftTree, R: SingleTraversal, C: Counters>(
        &self,
        simd: S,
        tree: &T,
        single: &R,
        sorted: &[u64],
        write: &mut impl FnMut(usize, Hit),
        counters: &mut [C],
    ) {
        let mut scratch = single.scratch();
        let mut beam = Beam::new();
        let mut stack = Vec::with_capacity(64);
        let mut cache = ShadowCache::new(self.frame);
        for run in sorted.chunk_by(|a, b| light_cube::same_face(*a, *b)) {
            for keys in run.chunks(RAYS) {
                if C::COUNTS && self.is_cancelled() {
                    return;
                }
                beam.fill(self, keys, write);
                let Some(&first) = beam.ids.first() else {
                    continue;
                };
                let entry = cache.entry(&self.rays[first]);
                // Test the last blocker of this light first, then trace the beam.
                if beam.open.count_ones() >= LEAST && !beam.blurred {
                    let id = cache.blocker(entry);
                    if id != Hit::NONE {
                        let corners = self.scene.corners(id).map(|p| self.frame.point(p));
                        self.test(simd, &mut beam, id, corners, write, counters);
                        for i in lanes(beam.everyone() & !beam.open) {
                            counters[beam.ids[i]].spared();
                        }
                    }
                    if beam.open.count_ones() >= LEAST {
                        self.follow(simd, tree, &mut stack, &mut beam, write, counters);
                    }
                }
                // Trace the undecided rays singly, with the latest blocker first.
                for i in lanes(beam.open) {
                    let id = beam.ids[i];
                    let ray = RayRef {
                        ray: &self.rays[id],
                        frame: &beam.framed[i],
                    };
                    let count = &mut counters[id];
                    if let Some(hit) = self.blocked(beam.blocker.triangle, ray, count) {
                        write(id, hit);
                        continue;
                    }
                    let mut best =
                        single.cast::<S, Any, C>(simd, self.job(), ray, &mut scratch, count);
                    let hit = best.answer(ray);
                    beam.blocker = hit;
                    write(id, hit);
                }
                cache.remember(entry, &beam.blocker);
            }
        }
    }

    /// Traces a beam through the tree; rays that stay open must be traced singly.
    #[inline(always)]
    fn follow<S: Simd, T: ShaftTree, C: Counters>(
        &self,
        simd: S,
        tree: &T,
        stack: &mut Vec<T::Cell>,
        beam: &mut Beam,
        write: &mut impl FnMut(usize, Hit),
        counters: &mut [C],
    ) {
        let shaft = beam.shaft(self.frame.bounds().magnitude());
        let open = beam.open.count_ones();
        let mut steps = T::STEPS_PER_RAY * open;
        let mut triangles = open.div_ceil(RAYS_PER_TRIANGLE);
        // Count the work of the beam for its first ray.
        let charged = beam.ids[beam.open.trailing_zeros() as usize];
        let mut empty = true;
        stack.clear();
        stack.push(tree.root_cell(self.frame.bounds()));
        // Visit the cells that the shaft meets, until a budget is used up.
        while let Some(cell) = stack.pop() {
            // A leaf: test the triangles that may block the beam.
            if let Some(leaf) = tree.step(simd, cell, &shaft, stack) {
                counters[charged].leaf(leaf.count);
                beam.join(counters);
                let (mut at, mut left) = (leaf.first as usize, leaf.count);
                // Reject eight triangles at a time by their boxes, then each by its plane.
                while left > 0 {
                    let block = BlockBoxes::new(simd, self.blocks, at, left);
                    counters[charged].tests(block.n);
                    let met = shaft.meets(simd, &block.low, &block.high);
                    for lane in lanes(met & ((1 << block.n) - 1)) {
                        let (id, corners) = block.triangle(lane);
                        if beam.is_beside(simd, corners) {
                            continue;
                        }
                        if triangles == 0 {
                            return;
                        }
                        triangles -= 1;
                        empty = false;
                        self.test(simd, beam, id, corners, write, counters);
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
            counters[charged].step_boxes();
            beam.join(counters);
            if steps == 0 {
                return;
            }
            steps -= 1;
        }
        // The whole shaft was searched: the open rays are unoccluded.
        for i in lanes(beam.open) {
            write(beam.ids[i], Hit::MISS);
            if empty {
                counters[beam.ids[i]].spared();
            }
        }
        beam.open = 0;
    }

    /// Tests a triangle against the open rays; blocked rays are written and closed.
    #[inline(always)]
    fn test<S: Simd, C: Counters>(
        &self,
        simd: S,
        beam: &mut Beam,
        id: u32,
        corners: [[f32; 3]; 3],
        write: &mut impl FnMut(usize, Hit),
        counters: &mut [C],
    ) {
        let free = Free::new(corners);
        // Test eight rays at a time in f32, then apply the exact verdict to the candidates.
        for row in (0..beam.ids.len()).step_by(LANES) {
            let bits = beam.open >> row & 0xff;
            if bits == 0 {
                continue;
            }
            let (o, d) = (all(simd, &beam.rays.o, row), all(simd, &beam.rays.d, row));
            let found = free.candidates(simd, o, d, load(simd, &beam.reach, row)) & bits;
            for lane in lanes(bits) {
                counters[beam.ids[row + lane]].test_alone();
            }
            for lane in lanes(found) {
                let (i, own) = (row + lane, beam.ids[row + lane]);
                let ray = RayRef {
                    ray: &self.rays[own],
                    frame: &beam.framed[i],
                };
                let mut best = Best::new(ray.frame);
                let blocked = best.offer::<Any, C>(
                    ray,
                    id,
                    #[inline(always)]
                    || self.blocks.scene_corners(self.scene, id, corners),
                    &mut counters[own],
                );
                if blocked {
                    beam.open &= !(1 << i);
                    beam.blocker = best.hit();
                    write(own, best.hit());
                }
            }
        }
    }
}

impl Beam {
    /// A beam without rays.
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
            blurred: false,
            blocker: Hit::MISS,
        }
    }

    /// Takes the rays of some sorted keys; writes the answers of those that miss the scene.
    #[inline(always)]
    fn fill(&mut self, launch: &Launch<'_>, keys: &[u64], write: &mut impl FnMut(usize, Hit)) {
        self.ids.clear();
        self.framed.clear();
        self.pad = 0.0;
        self.blurred = false;
        self.blocker = Hit::MISS;
        for key in keys {
            #[expect(clippy::cast_possible_truncation, reason = "the low half")]
            let id = *key as u32 as usize;
            let Some(ray) = launch.frame.ray(&launch.rays[id]) else {
                write(id, Hit::MISS);
                continue;
            };
            let i = self.ids.len();
            // Store the ray and the ends of its segment.
            for k in 0..3 {
                self.rays.o[k][i] = ray.o[k];
                self.rays.d[k][i] = ray.d[k];
                self.start[k][i] = ray.o[k] + ray.t_min * ray.d[k];
                self.end[k][i] = ray.o[k] + ray.t_max * ray.d[k];
                self.pad = self.pad.max(ray.pad[k]);
            }
            self.blurred |= ray.is_blurred();
            self.reach[i] = ray.t_max;
            self.ids.push(id);
            self.framed.push(ray);
        }
        self.open = self.everyone();
    }

    /// Counts a visit for all open rays but the first.
    #[inline(always)]
    fn join<C: Counters>(&self, counters: &mut [C]) {
        if C::COUNTS {
            for i in lanes(self.open).skip(1) {
                counters[self.ids[i]].joined();
            }
        }
    }

    /// Mask of all rays.
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
        // No cell extends beyond the root cell, which is at most twice as wide as the scene and one cell.
        Shaft::new(&from, &to, self.pad, 8.0 * magnitude)
    }

    /// Whether all open rays certainly lie on one side of a triangle's plane.
    #[inline(always)]
    fn is_beside<S: Simd>(&self, simd: S, corners: [[f32; 3]; 3]) -> bool {
        let plane = Plane::new(corners);
        let (mut above, mut below) = (true, true);
        // Compare the starts and ends of eight rays at a time with the plane.
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
