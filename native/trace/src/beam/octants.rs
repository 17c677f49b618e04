// SPDX-License-Identifier: GPL-3.0-or-later
//! Beam traversal of octrees: up to 64 rays of a common origin or direction go from leaf to leaf together
//! (González López and Gisbert Cantó, Trazado de haces, section 2).
//!
//! As there, a beam in an empty leaf continues to the neighbours behind the faces through which its rays leave,
//! split if there are several; in a leaf with triangles its rays are tested one by one, those that are decided
//! end, and the others continue as a beam, or singly if fewer than a threshold are left. There a beam is a
//! pyramid, and the pixels inside are found by scan conversion; here it is the set of its rays.
//!
//! Each ray keeps its own cell: it belongs to a leaf if and only if its own traversal ([`crate::single::octants::step`])
//! visits that leaf, with the same floats. So no ray is lost or doubled at the edge of a cell, whatever the
//! camera. The planes of a cell are common to the beam and are compared with eight rays at a time.

use crate::batch::{TileWalk, Walk as _};
use crate::beam::bundle::{self, Bundle, Common, LANES, Parallel, RAYS, Row, all, lanes, load};
use crate::beam::frame_rows::FrameRows;
use crate::single::octants::net::Links;
use crate::single::octants::step as octree_step;
use crate::single::octants::step::Grid;
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask, f32x8, mask32x8};
use halfspace_geom::bound::{keep_max_each, keep_min};
use halfspace_geom::vec3::map;
use halfspace_leaf::{Job, Leaf};
use halfspace_nodes::octree_nodes::{Node, OUTSIDE, Octree};
use halfspace_ray::query::{Best, Closest, Counters, join};
use halfspace_ray::{FrameRay, Hit, RayRef, RaySlice};

/// The traversal of one tree, and the number of rays below which they continue singly.
pub struct Walk<'a>(pub &'a Octree, pub u32);

/// The rays of a beam, one row per quantity.
struct Beam {
    rows: FrameRows,
    /// The smallest cell that each ray is in, counted along its direction, per axis.
    at: [Row; 3],
    /// Distance at which each ray leaves its leaf.
    leave: Row,
    best: Vec<Best>,
}

/// Buffers that tiles reuse.
pub struct Scratch {
    beam: Beam,
    /// Stack of split beams: a node still to visit, and the mask of rays in it.
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
        triangles: Job<'_>,
        RaySlice { frame, rays }: RaySlice<'_>,
        scratch: &mut Scratch,
        write: &mut impl FnMut(usize, Hit),
        counters: &mut [C],
    ) {
        let tree = self.0;
        let Scratch { beam, waiting } = scratch;
        beam.rows.fill(simd, frame, rays);
        beam.best.clear();
        beam.best.resize_with(rays.len(), Best::blank);
        // Rays without the common half go singly, and all of them do if the origins are far away.
        let (parallel, mut alike) = bundle::alike(rays);
        for i in lanes(if parallel { alike } else { 1 }) {
            if !tree.is_near(frame.point(rays[i].o)) {
                alike = 0;
            }
        }
        let live = beam.rows.live;
        let mut rest = live & !alike;
        // Traverse a beam for each octant of directions with enough rays; all rays of a beam count cells the
        // same way.
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
            // Take the common half from the octant's first ray.
            let grid = Grid::new(tree, signs);
            let first = group.trailing_zeros() as usize;
            let of = |rows: &[Row; 3]| [rows[0][first], rows[1][first], rows[2][first]];
            let all = RaySlice { frame, rays };
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
        // Trace the remaining rays singly.
        if rest != 0 {
            let single = octree_step::Walk(tree, Links);
            let mut scratch = single.scratch();
            for i in lanes(rest) {
                // A ray that misses the scene has an empty interval.
                let framed = frame.ray(&rays[i]).unwrap_or(FrameRay::NOTHING);
                let ray = RayRef {
                    ray: &rays[i],
                    frame: &framed,
                };
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

/// Initializes the cell of each ray of the mask: the smallest cell where it enters the scene.
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
            // Compute the cell with the operations of [`Grid::cell`], and leave the lanes of other beams as
            // they are.
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
    /// Traverses the tree with a beam until no ray is left. Steps are counted for the first ray of a beam.
    #[inline(always)]
    fn follow<S: Simd, C: Counters, B: Bundle>(
        &self,
        simd: S,
        triangles: Job<'_>,
        shared: &B,
        (grid, RaySlice { frame, rays }): (&Grid, RaySlice<'_>),
        (beam, group, waiting): (&mut Beam, u64, &mut Vec<(u32, u64)>),
        counters: &mut [C],
    ) {
        let tree = self.0;
        waiting.clear();
        waiting.push((0_u32, group));
        while let Some((index, mask)) = waiting.pop() {
            let first = mask.trailing_zeros() as usize;
            // Continue singly with too few rays: they start where they are, not at the root.
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
            // The first ray gives the node's lower corner: the node contains all rays of the mask.
            let node = tree.node(index);
            let edge = grid.edge(node);
            let low: [u32; 3] = map([0, 1, 2], |k: usize| whole(beam.at[k][first]) & !(edge - 1));
            // Split the beam among the children of an inner node.
            if node.is_inner() {
                counters[first].step_boxes();
                join(counters, mask);
                part(
                    simd,
                    (node, grid.signs),
                    map(low, |x| x + edge / 2),
                    (beam, mask),
                    waiting,
                );
                continue;
            }
            // Intersect all rays with the planes ahead, and test them against the leaf's triangles.
            let next = map(low, |x| x + edge);
            let by_axis = leave(simd, (grid, next), shared, (beam, mask));
            let leaf = node.blocks();
            counters[first].leaf(leaf.count);
            join(counters, mask);
            if leaf.count != 0 {
                test(
                    simd,
                    triangles,
                    leaf,
                    shared,
                    (beam, mask),
                    RaySlice { frame, rays },
                    counters,
                );
            }
            // Send the rays that go on to the neighbours behind their exit faces.
            let open = advance(simd, (grid, next), shared, (beam, mask), by_axis);
            for (axis, by) in by_axis.into_iter().enumerate() {
                if by & open != 0 && next[axis] != grid.size {
                    let side = usize::from(grid.signs >> axis & 1 == 0);
                    let neighbour = tree.links(node.leaf_index())[2 * axis + side];
                    if neighbour != OUTSIDE {
                        waiting.push((neighbour, by & open));
                    }
                }
            }
        }
    }
}

/// Converts an integral float to an integer.
#[inline(always)]
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a whole number below 2^20"
)]
fn whole(x: f32) -> u32 {
    x as u32
}

/// Splits a beam in an inner node by the octants of its rays, and pushes the parts. `mid` holds the mid planes.
#[inline(always)]
fn part<S: Simd>(
    simd: S,
    (node, signs): (Node, u32),
    mid: [u32; 3],
    (beam, mask): (&Beam, u64),
    waiting: &mut Vec<(u32, u64)>,
) {
    // Find the rays beyond each mid plane.
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
    // Combine the three masks for each octant.
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

/// Computes when each ray leaves the cell that ends at planes `next`; returns the masks of rays by exit axis.
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
        // Choose the first plane; of equally near ones the lowest axis, as single rays do.
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

/// Moves each ray to the smallest cell behind its exit face; returns the mask of rays that do not end before.
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
        // Leave the lanes of other beams as they are.
        let own = mask32x8::from_bitmask(simd, bits);
        let enter = load(simd, &beam.rows.enter, row);
        let enter: f32x8<S> = own.select(leave, enter);
        enter.store_slice(&mut beam.rows.enter[row..row + LANES]);
        let o = shared.origins(simd, &beam.rows.rays, row);
        let d = shared.directions(simd, &beam.rows.rays, row);
        for k in 0..3 {
            // Across the exit axis take the next cell; along the others compute the cell, clamped to the face.
            let at = load(simd, &beam.at[k], row);
            // No fused multiply-add: products and sums must round as for single rays.
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
    Job { scene, blocks }: Job<'_>,
    leaf: Leaf,
    shared: &B,
    (beam, mask): (&mut Beam, u64),
    RaySlice { frame, rays }: RaySlice<'_>,
    counters: &mut [C],
) {
    for i in lanes(mask) {
        counters[i].visit(leaf.first, leaf.count);
        counters[i].tests(leaf.count);
    }
    blocks.each(leaf, |id, corners| {
        let seen = shared.see(corners);
        for row in (0..RAYS).step_by(LANES) {
            let bits = mask >> row & 0xff;
            if bits == 0 {
                continue;
            }
            // Pass each candidate ray to the exact test; hits beyond the cell are found in another leaf.
            let reach = load(simd, &beam.leave, row).min(load(simd, &beam.rows.reach, row));
            for lane in lanes(shared.candidates(simd, &seen, (&beam.rows.rays, row), reach) & bits)
            {
                let i = row + lane;
                // The exact test needs only the scale of distances in the frame.
                let framed = frame.limits_of(&rays[i]);
                let ray = RayRef {
                    ray: &rays[i],
                    frame: &framed,
                };
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
