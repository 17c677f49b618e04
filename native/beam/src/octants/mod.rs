// SPDX-License-Identifier: GPL-3.0-or-later
//! Beam traversal of octrees: up to 64 rays of a common origin or direction go from leaf to leaf together
//! (González López and Gisbert Cantó, Trazado de haces, section 2).
//!
//! As in the paper, a beam in an empty leaf continues to the neighbours behind the faces through which its rays leave,
//! split if there are several. In a leaf with triangles its rays are tested one by one, those that are decided end, and
//! the others continue as a beam, or singly if fewer than a threshold are left. In the paper a beam is a pyramid, and
//! scan conversion finds the pixels inside; here it is the set of its rays.
//!
//! Each ray keeps its own cell: it belongs to a leaf if and only if its own traversal
//! ([`halfspace_single::octants::step`]) visits that leaf, with the same floats. So no ray is lost or doubled at the
//! edge of a cell, whatever the camera. The planes of a cell are common to the beam and are compared with eight rays at
//! a time.

mod steps;

use crate::bundle::{self, Bundle, Common, LANES, Parallel, RAYS, Row, lanes, load};
use crate::frame_rows::{Candidate, FrameRows};
use fearless_simd::{Simd, SimdBase};
use halfspace_geom::bound::keep_min;
use halfspace_geom::vec3::map;
use halfspace_leaf::{Job, Leaf};
use halfspace_nodes::octree_nodes::{OUTSIDE, Octree};
use halfspace_ray::query::{Best, Closest, Counters, join};
use halfspace_ray::{FrameRay, Hit, RayRef, RaySlice};
use halfspace_single::octants::net::Links;
use halfspace_single::octants::step::{Grid, NeighbourTraversal, Position, Steps};
use halfspace_trace::batch::{SingleTraversal as _, TileTraversal};
use steps::{advance, leave, of_octant, split, start};

/// The beam traversal of one tree.
pub struct OctantBeams<'a> {
    /// The tree.
    pub tree: &'a Octree,
    /// Rays continue singly when fewer than this are left together.
    pub least: u32,
}

/// The rays of a tile, one row per quantity.
struct Beam {
    rows: FrameRows,
    /// Per axis the number of the smallest cell that each ray is in, counted along its direction.
    at: [Row; 3],
    /// Distance at which each ray leaves its leaf.
    leave: Row,
    best: Vec<Best>,
}

/// A part of a beam: a node still to visit, and the mask of the rays in it.
#[derive(Clone, Copy)]
struct Part {
    node: u32,
    rays: u64,
}

/// Memory that tiles use one after another.
pub struct Scratch {
    beam: Beam,
    stack: Vec<Part>,
}

/// Rays of a tile that have a common half and count cells in the same directions.
struct Group<B> {
    grid: Grid,
    shared: B,
    /// Mask of the rays.
    rays: u64,
}

/// Arguments that all beams of a tile share.
struct Tile<'a> {
    tree: &'a Octree,
    /// Rays continue singly when fewer than this are left together.
    least: u32,
    job: Job<'a>,
    rays: RaySlice<'a>,
}

impl TileTraversal for OctantBeams<'_> {
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
            stack: Vec::with_capacity(64),
        }
    }

    #[inline(always)]
    fn cast_tile<S: Simd, C: Counters>(
        &self,
        simd: S,
        job: Job<'_>,
        slice: RaySlice<'_>,
        scratch: &mut Scratch,
        write: &mut impl FnMut(usize, Hit),
        counters: &mut [C],
    ) {
        let Scratch { beam, stack } = scratch;
        let RaySlice { frame, rays } = slice;
        beam.rows.fill(simd, frame, rays);
        beam.best.clear();
        beam.best.resize_with(rays.len(), Best::blank);
        // Trace singly the rays without the common half, and all rays if an origin is far away.
        let (parallel, mut alike) = bundle::alike(rays);
        alike &= !beam.rows.blurred;
        for i in lanes(if parallel { alike } else { 1 }) {
            if !self.tree.is_near(frame.point(rays[i].o)) {
                alike = 0;
            }
        }
        let tile = Tile {
            tree: self.tree,
            least: self.least,
            job,
            rays: slice,
        };
        let mut rest = beam.rows.live & !alike;
        // Trace a beam for each octant of directions with enough rays.
        for signs in 0..8_u32 {
            let own = beam.rows.live & alike & of_octant(signs, |k| beam.rows.negative[k]);
            if own.count_ones() < self.least.max(1) {
                rest |= own;
                continue;
            }
            // Take the common half from the octant's first ray.
            let grid = Grid::new(self.tree, signs);
            let first = own.trailing_zeros() as usize;
            let of = |rows: &[Row; 3]| [rows[0][first], rows[1][first], rows[2][first]];
            if parallel {
                let shared = Parallel(of(&beam.rows.rays.d));
                let rays = own;
                let group = Group { grid, shared, rays };
                tile.follow(simd, &group, beam, stack, counters);
            } else {
                let shared = Common(of(&beam.rows.rays.o));
                let rays = own;
                let group = Group { grid, shared, rays };
                tile.follow(simd, &group, beam, stack, counters);
            }
        }
        tile.trace_singly(simd, rest, &mut beam.best, counters);
        for (i, best) in beam.best.iter().enumerate() {
            write(i, best.hit());
        }
    }
}

impl Tile<'_> {
    /// Traces some rays singly from the root, and stores their hits in `best`.
    #[inline(always)]
    fn trace_singly<S: Simd, C: Counters>(
        &self,
        simd: S,
        mask: u64,
        best: &mut [Best],
        counters: &mut [C],
    ) {
        if mask == 0 {
            return;
        }
        let single = NeighbourTraversal(self.tree, Links);
        let mut scratch = single.scratch();
        for i in lanes(mask) {
            // A ray that misses the scene has an empty interval.
            let ray = &self.rays.rays[i];
            let frame = &self.rays.frame.ray(ray).unwrap_or(FrameRay::NOTHING);
            let (ray, count) = (RayRef { ray, frame }, &mut counters[i]);
            let mut own = single.cast::<S, Closest, C>(simd, self.job, ray, &mut scratch, count);
            best[i] = Best::known(own.answer(ray));
        }
    }

    /// Traces a group as a beam until no ray is left. Steps are counted for the first ray of a beam.
    #[inline(always)]
    fn follow<S: Simd, C: Counters, B: Bundle>(
        &self,
        simd: S,
        group: &Group<B>,
        beam: &mut Beam,
        stack: &mut Vec<Part>,
        counters: &mut [C],
    ) {
        let (tree, grid) = (self.tree, &group.grid);
        start(simd, group, beam);
        stack.clear();
        stack.push(Part {
            node: 0,
            rays: group.rays,
        });
        while let Some(part) = stack.pop() {
            let mask = part.rays;
            let first = mask.trailing_zeros() as usize;
            if mask.count_ones() < self.least {
                self.continue_singly(simd, grid, part, beam, counters);
                continue;
            }
            // The first ray gives the node's lower corner: the node contains all rays of the mask.
            let node = tree.node(part.node);
            let edge = grid.edge(node);
            let low: [u32; 3] = map([0, 1, 2], |k: usize| whole(beam.at[k][first]) & !(edge - 1));
            // Split the beam among the children of an inner node.
            if node.is_inner() {
                counters[first].step_boxes();
                join(counters, mask);
                let mid = map(low, |x| x + edge / 2);
                split(simd, grid, node, mid, beam, mask, stack);
                continue;
            }
            // Intersect all rays with the planes ahead, and test them against the leaf's triangles.
            let next = map(low, |x| x + edge);
            let by_axis = leave(simd, group, next, beam, mask);
            let leaf = node.blocks();
            counters[first].leaf(leaf.count);
            join(counters, mask);
            if leaf.count != 0 {
                self.test(simd, leaf, &group.shared, beam, mask, counters);
            }
            // Send the rays that go on to the neighbours behind their exit faces.
            let open = advance(simd, group, next, beam, mask, by_axis);
            for (axis, by) in by_axis.into_iter().enumerate() {
                if by & open != 0 && next[axis] != grid.size {
                    let side = usize::from(grid.signs >> axis & 1 == 0);
                    let neighbour = tree.links(node.leaf_index())[2 * axis + side];
                    if neighbour != OUTSIDE {
                        stack.push(Part {
                            node: neighbour,
                            rays: by & open,
                        });
                    }
                }
            }
        }
    }

    /// Continues the rays of a part one by one. They start where they are, not at the root.
    #[inline(always)]
    fn continue_singly<S: Simd, C: Counters>(
        &self,
        simd: S,
        grid: &Grid,
        part: Part,
        beam: &mut Beam,
        counters: &mut [C],
    ) {
        let tree = self.tree;
        let steps = Steps { tree, grid };
        for i in lanes(part.rays) {
            let ray = &self.rays.rays[i];
            let Some(frame) = &self.rays.frame.ray(ray) else {
                continue;
            };
            let best = &mut beam.best[i];
            best.reach = keep_min(best.reach, beam.rows.reach[i]);
            let at = map([0, 1, 2], |k: usize| whole(beam.at[k][i]));
            let from = Position {
                leaf: grid.descend(tree, part.node, at, &mut counters[i]),
                at,
                enter: beam.rows.enter[i],
            };
            let (ray, count) = (RayRef { ray, frame }, &mut counters[i]);
            steps.follow::<S, Closest, C, Links>(simd, self.job, ray, from, best, count);
        }
    }

    /// Tests the rays of a beam against the triangles of its leaf.
    #[inline(always)]
    fn test<S: Simd, C: Counters, B: Bundle>(
        &self,
        simd: S,
        leaf: Leaf,
        shared: &B,
        beam: &mut Beam,
        mask: u64,
        counters: &mut [C],
    ) {
        for i in lanes(mask) {
            counters[i].visit(leaf.first, leaf.count);
            counters[i].tests(leaf.count);
        }
        self.job.blocks.each(leaf, |id, corners| {
            let seen = shared.see(corners);
            for row in (0..RAYS).step_by(LANES) {
                let bits = mask >> row & 0xff;
                if bits == 0 {
                    continue;
                }
                // Pass each candidate ray to the exact test; hits beyond the cell are found in another leaf.
                let reach = load(simd, &beam.leave, row).min(load(simd, &beam.rows.reach, row));
                let found = shared.candidates(simd, &seen, &beam.rows.rays, row, reach) & bits;
                for lane in lanes(found) {
                    let i = row + lane;
                    let (best, count) = (&mut beam.best[i], &mut counters[i]);
                    let candidate = Candidate { id, corners };
                    (beam.rows).offer(i, self.rays, self.job, candidate, best, count);
                }
            }
        });
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
