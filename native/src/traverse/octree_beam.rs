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
use super::bundle::{Bundle, Common, LANES, Parallel, RAYS, Row, Rows, all, lanes, load};
use super::frame::{Frame, FrameRay, keep_min};
use super::octree_net::Links;
use super::octree_step::{self, Grid};
use super::query::{Best, Closest, Counters};
use super::ray::{Hit, Ray};
use crate::build::octree_nodes::{Node, OUTSIDE, Octree};
use crate::scene::Triangles;
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask, f32x8, mask32x8};

/// The walk over one tree, and the number of rays below which they go on singly.
pub struct Walk<'a>(pub &'a Octree, pub u32);

/// The rays of a beam, a row per quantity.
struct Beam {
    rays: Rows,
    inv: [Row; 3],
    /// The smallest cell where each ray is, counted along its direction.
    at: [Row; 3],
    /// When it entered its leaf.
    enter: Row,
    /// When it leaves it.
    leave: Row,
    /// How far it still has to look.
    reach: Row,
}

/// The rays of a tile: as asked, in the frame, and their best hits.
struct Tile<'a> {
    rays: &'a [Ray],
    framed: Vec<FrameRay>,
    best: Vec<Best>,
}

impl TileWalk for Walk<'_> {
    #[inline(always)]
    fn cast_tile<S: Simd, C: Counters>(
        &self,
        simd: S,
        triangles: (&Triangles, &Blocks),
        (frame, rays): (&Frame, &[Ray]),
        write: &mut impl FnMut(usize, Hit),
        counters: &mut [C],
    ) {
        let tree = self.0;
        let mut tile = Tile {
            rays,
            framed: Vec::with_capacity(RAYS),
            best: Vec::with_capacity(RAYS),
        };
        let mut beam = Beam {
            rays: Rows::new(),
            inv: [[0.0; RAYS]; 3],
            at: [[0.0; RAYS]; 3],
            enter: [0.0; RAYS],
            leave: [0.0; RAYS],
            reach: [0.0; RAYS],
        };
        // Rays that meet the scene and share the first one's origin, or else its direction, per octant
        // of directions. Others are done, or go singly.
        let mut groups = [0_u64; 8];
        let mut rest = 0_u64;
        let bits = |v: [f32; 3]| v.map(f32::to_bits);
        let (origin, direction) = (bits(rays[0].o), bits(rays[0].d));
        let parallel = rays.len() > 1 && bits(rays[1].o) != origin;
        for (i, ray) in rays.iter().enumerate() {
            let framed = frame.ray(ray);
            write(i, Hit::MISS);
            if let Some(framed) = &framed {
                let alike = if parallel {
                    bits(ray.d) == direction
                } else {
                    bits(ray.o) == origin
                };
                if alike && tree.is_near(framed) {
                    groups[(framed.signs & 7) as usize] |= 1 << i;
                } else {
                    rest |= 1 << i;
                }
                for k in 0..3 {
                    beam.rays.o[k][i] = framed.o[k];
                    beam.rays.d[k][i] = framed.d[k];
                    beam.inv[k][i] = framed.inv[k];
                }
                beam.enter[i] = framed.t_min;
                beam.reach[i] = framed.t_max;
            }
            // A ray that misses the scene keeps its lane, and never a bit in a mask.
            let framed = framed.unwrap_or(FrameRay::NOTHING);
            tile.best.push(Best::new(&framed));
            tile.framed.push(framed);
        }
        for (signs, group) in (0_u32..).zip(groups) {
            if group.count_ones() < self.1.max(1) {
                rest |= group;
                continue;
            }
            let grid = Grid::new(tree, signs);
            for i in lanes(group) {
                let ray = &tile.framed[i];
                for k in 0..3 {
                    let x = ray.o[k] + ray.t_min * ray.d[k];
                    beam.at[k][i] = grid.cell(k, x, 0, grid.size - 1) as f32;
                }
            }
            let first = &tile.framed[group.trailing_zeros() as usize];
            let start = (&grid, group);
            if parallel {
                let shared = Parallel(first.d);
                self.follow(
                    simd, triangles, &shared, start, &mut beam, &mut tile, counters,
                );
            } else {
                let shared = Common(first.o);
                self.follow(
                    simd, triangles, &shared, start, &mut beam, &mut tile, counters,
                );
            }
            for i in lanes(group) {
                write(i, tile.best[i].hit());
            }
        }
        if rest != 0 {
            let single = octree_step::Walk(tree, Links);
            let mut scratch = single.scratch();
            for i in lanes(rest) {
                let ray = (&rays[i], &tile.framed[i]);
                let count = &mut counters[i];
                let hit = single.cast::<S, Closest, C>(simd, triangles, ray, &mut scratch, count);
                write(i, hit);
            }
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
        (grid, group): (&Grid, u64),
        beam: &mut Beam,
        tile: &mut Tile<'_>,
        counters: &mut [C],
    ) {
        let tree = self.0;
        let mut waiting = Vec::with_capacity(64);
        waiting.push((0_u32, group));
        while let Some((index, mask)) = waiting.pop() {
            let first = mask.trailing_zeros() as usize;
            if mask.count_ones() < self.1 {
                for i in lanes(mask) {
                    let ray = (&tile.rays[i], &tile.framed[i], grid);
                    let at = std::array::from_fn(|k| whole(beam.at[k][i]));
                    let leaf = grid.descend(tree, index, at, &mut counters[i]);
                    octree_step::go_on::<S, Closest, C, Links>(
                        simd,
                        tree,
                        triangles,
                        ray,
                        (leaf, at, beam.enter[i]),
                        &mut tile.best[i],
                        &mut counters[i],
                    );
                }
                continue;
            }
            // One step of a beam is charged to its first ray.
            let node = tree.node(index);
            let edge = grid.edge(node);
            let low: [u32; 3] = std::array::from_fn(|k| whole(beam.at[k][first]) & !(edge - 1));
            if node.is_inner() {
                counters[first].step_axis();
                part(
                    simd,
                    (node, grid.signs),
                    low.map(|x| x + edge / 2),
                    (beam, mask),
                    &mut waiting,
                );
                continue;
            }
            let next = low.map(|x| x + edge);
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
                    tile,
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
        let o = shared.origins(simd, &beam.rays, row);
        let inv = all(simd, &beam.inv, row);
        let times = [
            grid.all_ahead(simd, 0, next[0], o[0]) * inv[0],
            grid.all_ahead(simd, 1, next[1], o[1]) * inv[1],
            grid.all_ahead(simd, 2, next[2], o[2]) * inv[2],
        ];
        let second = times[1].simd_lt(times[0]);
        let nearer = second.select(times[1], times[0]);
        let third = times[2].simd_lt(nearer);
        let leave = third
            .select(times[2], nearer)
            .max(load(simd, &beam.enter, row));
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
        let reach = load(simd, &beam.reach, row);
        let done = leave.simd_gt(reach).to_bitmask();
        open |= (bits & !done) << row;
        // Lanes of other beams stay as they are.
        let own = mask32x8::from_bitmask(simd, bits);
        let enter = load(simd, &beam.enter, row);
        let enter: f32x8<S> = own.select(leave, enter);
        enter.store_slice(&mut beam.enter[row..row + LANES]);
        let o = shared.origins(simd, &beam.rays, row);
        let d = shared.directions(simd, &beam.rays, row);
        for k in 0..3 {
            let at = load(simd, &beam.at[k], row);
            // Products and sums round one by one, as for single rays.
            let moved = leave * d[k];
            let x = o[k] + moved;
            let number = grid.numbers(simd, k, x);
            let inside = number
                .max(at)
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
    tile: &mut Tile<'_>,
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
            let reach = load(simd, &beam.leave, row).min(load(simd, &beam.reach, row));
            for lane in lanes(shared.candidates(simd, &seen, (&beam.rays, row), reach) & bits) {
                let i = row + lane;
                let ray = (&tile.rays[i], &tile.framed[i]);
                let best = &mut tile.best[i];
                let scene_corners = || blocks.scene_corners(scene, id, corners);
                best.offer::<Closest, C>(ray, id, scene_corners, &mut counters[i]);
                beam.reach[i] = keep_min(best.reach, beam.reach[i]);
            }
        }
    });
}
