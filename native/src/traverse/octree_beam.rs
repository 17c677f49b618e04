// SPDX-License-Identifier: GPL-3.0-or-later
//! Octrees walked by beams: up to 64 rays of one origin, or of one direction, go from leaf to leaf
//! together (González López and Gisbert Cantó, Trazado de haces, section 2).
//!
//! As there, a beam in an empty leaf goes on to the neighbours behind the faces by which its rays leave,
//! cut in parts where there are several; in a full leaf its rays are tested one by one, those
//! that are settled end, and the others go on as a beam, or singly when fewer than a threshold
//! are left. A beam there is a pyramid, and the pixels inside are found by scan conversion; here it
//! is the set of its rays itself. Each ray owns its place: it belongs to a cell if and only if its
//! own step from cell to cell ([`super::octree_step`]) leads there, with the same floats. So
//! no ray is lost or doubled at the edge of a cell, whatever the camera. The planes of a cell are
//! the same for the whole beam, and eight rays at a time are compared with them.

use super::batch::{TileWalk, Walk as _};
use super::blocks::Blocks;
use super::bound::{keep_max_each, keep_min};
use super::bundle::{self, Bundle, Common, LANES, Parallel, RAYS, Row, all, lanes, load};
use super::frame::{Frame, FrameRay};
use super::frame_rows::FrameRows;
use super::octree_net::Links;
use super::octree_step::{self, Grid};
use super::query::{Best, Closest, Counters};
use super::ray::{Hit, Ray};
use crate::build::octree_nodes::{Node, OUTSIDE, Octree};
use crate::geom::vec3::map;
use crate::scene::Triangles;
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask, f32x8, mask32x8};

/// The walk over one tree, and the number of rays below which they go on singly.
pub struct Walk<'a>(pub &'a Octree, pub u32);

/// The rays of a beam, a row per quantity.
struct Beam {
    rows: FrameRows,
    /// The smallest cell where each ray is, counted along its direction.
    at: [Row; 3],
    /// When it leaves its leaf.
    leave: Row,
    best: Vec<Best>,
}

/// What tiles share one after another.
pub struct Scratch {
    beam: Beam,
    /// Parts of the beam that wait at a node.
    waiting: Vec<(u32, u64)>,
}

impl TileWalk for Walk<'_> {
    const RAYS: usize = RAYS;
    type Scratch = Scratch;

    fn scratch(&self) -> Scratch {
        Scratch {
            beam: Beam {
                rows: FrameRows::blank(),
                at: [[0.0; RAYS]; 3],
                leave: [0.0; RAYS],
                best: Vec::with_capacity(RAYS),
            },
            waiting: Vec::with_capacity(64),
        }
    }

    #[inline(always)]
    fn cast_tile<S: Simd, C: Counters>(
        &self,
        simd: S,
        triangles: (&Triangles, &Blocks),
        (frame, rays): (&Frame, &[Ray]),
        scratch: &mut Scratch,
        write: &mut impl FnMut(usize, Hit),
        counters: &mut [C],
    ) {
        let tree = self.0;
        let Scratch { beam, waiting } = scratch;
        beam.rows.fill(simd, frame, rays);
        beam.best.clear();
        beam.best.resize_with(rays.len(), Best::blank);
        // Rays that share nothing with the first ones go singly, and so do all from far away.
        let (parallel, mut alike) = bundle::alike(rays);
        for i in lanes(if parallel { alike } else { 1 }) {
            if !tree.is_near(frame.point(rays[i].o)) {
                alike = 0;
            }
        }
        let live = beam.rows.live;
        let mut rest = live & !alike;
        for signs in 0..8_u32 {
            let mut group = live & alike;
            for (k, negative) in beam.rows.negative.iter().enumerate() {
                group &= if signs >> k & 1 == 1 {
                    *negative
                } else {
                    !negative
                };
            }
            if group.count_ones() < self.1.max(1) {
                rest |= group;
                continue;
            }
            let grid = Grid::new(tree, signs);
            let first = group.trailing_zeros() as usize;
            let of = |rows: &[Row; 3]| [rows[0][first], rows[1][first], rows[2][first]];
            let all = (frame, rays);
            if parallel {
                let shared = Parallel(of(&beam.rows.rays.d));
                start(simd, &grid, &shared, (beam, group));
                let beam = (&mut *beam, group, &mut *waiting);
                self.follow(simd, triangles, &shared, (&grid, all), beam, counters);
            } else {
                let shared = Common(of(&beam.rows.rays.o));
                start(simd, &grid, &shared, (beam, group));
                let beam = (&mut *beam, group, &mut *waiting);
                self.follow(simd, triangles, &shared, (&grid, all), beam, counters);
            }
        }
        if rest != 0 {
            let single = octree_step::Walk(tree, Links);
            let mut scratch = single.scratch();
            for i in lanes(rest) {
                let framed = frame.ray(&rays[i]).unwrap_or(FrameRay::NOTHING);
                let ray = (&rays[i], &framed);
                let count = &mut counters[i];
                let hit = single.cast::<S, Closest, C>(simd, triangles, ray, &mut scratch, count);
                beam.best[i] = Best::known(hit);
            }
        }
        for (i, best) in beam.best.iter().enumerate() {
            write(i, best.hit());
        }
    }
}

/// Puts each ray into the smallest cell where it enters the scene.
#[inline(always)]
fn start<S: Simd, B: Bundle>(simd: S, grid: &Grid, shared: &B, (beam, mask): (&mut Beam, u64)) {
    for row in (0..RAYS).step_by(LANES) {
        if mask >> row & 0xff == 0 {
            continue;
        }
        let o = shared.origins(simd, &beam.rows.rays, row);
        let d = shared.directions(simd, &beam.rows.rays, row);
        let enter = load(simd, &beam.rows.enter, row);
        for k in 0..3 {
            let moved = enter * d[k];
            let number = grid.numbers(simd, k, o[k] + moved);
            let inside = number
                .max(f32x8::splat(simd, 0.0))
                .min(f32x8::splat(simd, (grid.size - 1) as f32))
                .floor();
            let own = mask32x8::from_bitmask(simd, mask >> row & 0xff);
            let at: f32x8<S> = own.select(inside, load(simd, &beam.at[k], row));
            at.store_slice(&mut beam.at[k][row..row + LANES]);
        }
    }
}

impl Walk<'_> {
    /// Walks a beam to its end.
    #[inline(always)]
    fn follow<S: Simd, C: Counters, B: Bundle>(
        &self,
        simd: S,
        triangles: (&Triangles, &Blocks),
        shared: &B,
        (grid, (frame, rays)): (&Grid, (&Frame, &[Ray])),
        (beam, group, waiting): (&mut Beam, u64, &mut Vec<(u32, u64)>),
        counters: &mut [C],
    ) {
        let tree = self.0;
        waiting.clear();
        waiting.push((0_u32, group));
        while let Some((index, mask)) = waiting.pop() {
            let first = mask.trailing_zeros() as usize;
            if mask.count_ones() < self.1 {
                for i in lanes(mask) {
                    let Some(framed) = frame.ray(&rays[i]) else {
                        continue;
                    };
                    let ray = (&rays[i], &framed, grid);
                    let best = &mut beam.best[i];
                    best.reach = keep_min(best.reach, beam.rows.reach[i]);
                    let at = map([0, 1, 2], |k: usize| whole(beam.at[k][i]));
                    let leaf = grid.descend(tree, index, at, &mut counters[i]);
                    octree_step::go_on::<S, Closest, C, Links>(
                        simd,
                        tree,
                        triangles,
                        ray,
                        (leaf, at, beam.rows.enter[i]),
                        best,
                        &mut counters[i],
                    );
                }
                continue;
            }
            // One step of a beam is charged to its first ray.
            let node = tree.node(index);
            let edge = grid.edge(node);
            let low: [u32; 3] = map([0, 1, 2], |k: usize| whole(beam.at[k][first]) & !(edge - 1));
            if node.is_inner() {
                counters[first].step_axis();
                part(
                    simd,
                    (node, grid.signs),
                    map(low, |x| x + edge / 2),
                    (beam, mask),
                    waiting,
                );
                continue;
            }
            let next = map(low, |x| x + edge);
            let by_axis = leave(simd, (grid, next), shared, (beam, mask));
            let (block, count) = node.blocks();
            counters[first].leaf(count);
            if count != 0 {
                test(
                    simd,
                    triangles,
                    (block, count),
                    shared,
                    (beam, mask),
                    (frame, rays),
                    counters,
                );
            }
            let open = advance(simd, (grid, next), shared, (beam, mask), by_axis);
            for (axis, by) in by_axis.into_iter().enumerate() {
                if by & open != 0 && next[axis] != grid.size {
                    let side = usize::from(grid.signs >> axis & 1 == 0);
                    let neighbour = tree.links(node.place())[2 * axis + side];
                    if neighbour != OUTSIDE {
                        waiting.push((neighbour, by & open));
                    }
                }
            }
        }
    }
}

#[inline(always)]
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a whole number below 2^20"
)]
fn whole(x: f32) -> u32 {
    x as u32
}

/// Parts a beam in an inner node by the octants where its rays are.
#[inline(always)]
fn part<S: Simd>(
    simd: S,
    (node, signs): (Node, u32),
    mid: [u32; 3],
    (beam, mask): (&Beam, u64),
    waiting: &mut Vec<(u32, u64)>,
) {
    let mut beyond = [0_u64; 3];
    for row in (0..RAYS).step_by(LANES) {
        if mask >> row & 0xff == 0 {
            continue;
        }
        for k in 0..3 {
            let at = load(simd, &beam.at[k], row);
            let bits = at.simd_ge(f32x8::splat(simd, mid[k] as f32)).to_bitmask();
            beyond[k] |= (bits & 0xff) << row;
        }
    }
    for octant in 0..8_u32 {
        let mut own = mask;
        for (k, beyond) in beyond.iter().enumerate() {
            own &= if octant >> k & 1 == 1 {
                *beyond
            } else {
                !beyond
            };
        }
        if own != 0 {
            waiting.push((node.children() + (octant ^ signs), own));
        }
    }
}

/// When each ray leaves the cell that ends at the planes `next`; returns the rays by exit axis.
#[inline(always)]
fn leave<S: Simd, B: Bundle>(
    simd: S,
    (grid, next): (&Grid, [u32; 3]),
    shared: &B,
    (beam, mask): (&mut Beam, u64),
) -> [u64; 3] {
    let mut by_axis = [0_u64; 3];
    for row in (0..RAYS).step_by(LANES) {
        let bits = mask >> row & 0xff;
        if bits == 0 {
            continue;
        }
        let o = shared.origins(simd, &beam.rows.rays, row);
        let inv = all(simd, &beam.rows.inv, row);
        let times = [
            grid.all_ahead(simd, 0, next[0], o[0]) * inv[0],
            grid.all_ahead(simd, 1, next[1], o[1]) * inv[1],
            grid.all_ahead(simd, 2, next[2], o[2]) * inv[2],
        ];
        let second = times[1].simd_lt(times[0]);
        let nearer = second.select(times[1], times[0]);
        let third = times[2].simd_lt(nearer);
        let leave = keep_max_each(
            third.select(times[2], nearer),
            load(simd, &beam.rows.enter, row),
        );
        leave.store_slice(&mut beam.leave[row..row + LANES]);
        let third = third.to_bitmask() & bits;
        let second = second.to_bitmask() & bits & !third;
        by_axis[0] |= (bits & !second & !third) << row;
        by_axis[1] |= second << row;
        by_axis[2] |= third << row;
    }
    by_axis
}

/// Moves each ray on into the cell behind the face by which it leaves; returns those that go on.
#[inline(always)]
fn advance<S: Simd, B: Bundle>(
    simd: S,
    (grid, next): (&Grid, [u32; 3]),
    shared: &B,
    (beam, mask): (&mut Beam, u64),
    by_axis: [u64; 3],
) -> u64 {
    let mut open = 0;
    for row in (0..RAYS).step_by(LANES) {
        let bits = mask >> row & 0xff;
        if bits == 0 {
            continue;
        }
        let leave = load(simd, &beam.leave, row);
        let reach = load(simd, &beam.rows.reach, row);
        let done = leave.simd_gt(reach).to_bitmask();
        open |= (bits & !done) << row;
        // Lanes of other beams stay as they are.
        let own = mask32x8::from_bitmask(simd, bits);
        let enter = load(simd, &beam.rows.enter, row);
        let enter: f32x8<S> = own.select(leave, enter);
        enter.store_slice(&mut beam.rows.enter[row..row + LANES]);
        let o = shared.origins(simd, &beam.rows.rays, row);
        let d = shared.directions(simd, &beam.rows.rays, row);
        for k in 0..3 {
            let at = load(simd, &beam.at[k], row);
            // Products and sums round one by one, as for single rays.
            let moved = leave * d[k];
            let x = o[k] + moved;
            let number = grid.numbers(simd, k, x);
            let inside = keep_max_each(number, at)
                .min(f32x8::splat(simd, (next[k] - 1) as f32))
                .floor();
            let across = mask32x8::from_bitmask(simd, by_axis[k] >> row & 0xff);
            let moved: f32x8<S> = across.select(f32x8::splat(simd, next[k] as f32), inside);
            let at: f32x8<S> = own.select(moved, at);
            at.store_slice(&mut beam.at[k][row..row + LANES]);
        }
    }
    open
}

/// Tests the rays of a beam against the triangles of its leaf.
#[inline(always)]
fn test<S: Simd, C: Counters, B: Bundle>(
    simd: S,
    (scene, blocks): (&Triangles, &Blocks),
    leaf: (u32, usize),
    shared: &B,
    (beam, mask): (&mut Beam, u64),
    (frame, rays): (&Frame, &[Ray]),
    counters: &mut [C],
) {
    for i in lanes(mask) {
        counters[i].tests(leaf.1);
    }
    blocks.each(leaf, |id, corners| {
        let seen = shared.see(corners);
        for row in (0..RAYS).step_by(LANES) {
            let bits = mask >> row & 0xff;
            if bits == 0 {
                continue;
            }
            let reach = load(simd, &beam.leave, row).min(load(simd, &beam.rows.reach, row));
            for lane in lanes(shared.candidates(simd, &seen, (&beam.rows.rays, row), reach) & bits)
            {
                let i = row + lane;
                // Of the ray in the frame, only the scale of its distances is needed.
                let framed = frame.limits_of(&rays[i]);
                let ray = (&rays[i], &framed);
                let best = &mut beam.best[i];
                best.offer::<Closest, C>(
                    ray,
                    id,
                    #[inline(always)]
                    || blocks.scene_corners(scene, id, corners),
                    &mut counters[i],
                );
                beam.rows.reach[i] = keep_min(best.reach, beam.rows.reach[i]);
            }
        }
    });
}
