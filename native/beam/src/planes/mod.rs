// SPDX-License-Identifier: GPL-3.0-or-later
//! Beam tracing through plane trees, after Heckbert and Hanrahan 1984 (Beam tracing polygonal objects): a beam
//! is traced front to back, and each polygon it hits cuts its own part out of the beam.
//!
//! A beam is a convex polygon in the plane of view and a set of at most 64 pixels. At a node, one comparison of
//! intervals over the polygon's corners finds the children that the beam meets, the one on the eye's side
//! first. In a leaf the pixels' rays are tested against the triangles, and the beam is split along the outline
//! of each triangle hit, as Weiler and Atherton split polygons: at most three pieces outside the triangle, and
//! one on it, which ends where everything beyond is hidden.
//!
//! The cuts need no exactness. Each pixel belongs to one piece, chosen by the sign of one function per edge,
//! and its ray ends only when its best hit certainly lies before the next plane. Every hit is therefore that of
//! the single ray, however the cuts are rounded. Reflected and refracted beams, the second half of the paper,
//! are left to single rays.

mod leaf;
mod plane;

use crate::bundle::{self, RAYS, lanes};
use crate::frame_rows::FrameRows;
use fearless_simd::Simd;
use halfspace_geom::view::{Polygon, View};
use halfspace_leaf::{Job, Leaf};
use halfspace_nodes::plane_tree::{Node, PlaneTree};
use halfspace_ray::query::{Best, Closest, Counters, join};
use halfspace_ray::{Hit, Ray, RayRef, RaySlice};
use halfspace_single::planes::dir::PlaneTraversal;
use halfspace_trace::batch::{SingleTraversal as _, TileTraversal};
use plane::{Depths, Seen};

/// Names of this traversal's entries in [`halfspace_ray::ray::RayCounters::cases`], in order: nodes and leaves visited
/// by beams, splits of a beam along a triangle, and rays traced singly.
pub const NAMES: [&str; 3] = ["beam_visits", "beam_cuts", "beam_singles"];

const VISIT: usize = 0;
const CUT: usize = 1;
const SINGLE: usize = 2;

/// Largest average number of nodes that the beams of a tile visit per ray; beyond it the remaining rays are traced
/// singly. Not measured: it has the order of a single ray's visits, some tens.
const VISITS: usize = 16;

/// Smallest speed along the tile's axis for a ray to join the beam. Derived: the largest component of a direction in
/// the frame is at least 1; rays of half that are steep enough.
const STEEP: f32 = 0.5;

/// The beam traversal of one tree.
pub struct PlaneBeams<'a> {
    /// The tree.
    pub tree: &'a PlaneTree,
    /// Fewer rays than this, or fewer without a hit, are traced singly.
    pub least: u32,
}

/// A beam, or a piece of one.
#[derive(Clone, Copy)]
struct Beam {
    polygon: Polygon,
    /// Mask of the pixels.
    pixels: u64,
}

/// State shared by the beams of a tile.
struct Tile<'a> {
    tree: &'a PlaneTree,
    /// The rays without a hit of a beam are traced singly if they are fewer than this.
    least: u32,
    job: Job<'a>,
    slice: RaySlice<'a>,
    view: View,
    eye: [f32; 3],
    /// Error bounds of the eye's distance to planes across each axis.
    axis_pads: [f32; 3],
    /// The same for oblique planes.
    oblique_pad: f32,
    /// Position of each ray in the plane of view.
    at: [[f64; 2]; RAYS],
    /// Depth per unit of distance along each ray.
    depth: [f64; RAYS],
    rows: &'a mut FrameRows,
    best: &'a mut [Best],
    /// Mask of the rays to trace singly.
    singles: u64,
    /// Nodes visited by the tile's beams so far.
    visits: usize,
}

/// Memory that tiles use one after another.
pub struct Scratch {
    rows: FrameRows,
    best: Vec<Best>,
}

impl TileTraversal for PlaneBeams<'_> {
    const RAYS: usize = RAYS;
    type Scratch = Scratch;

    fn scratch(&self) -> Self::Scratch {
        Scratch {
            rows: FrameRows::blank(),
            best: Vec::with_capacity(RAYS),
        }
    }

    #[inline(always)]
    fn cast_tile<S: Simd, C: Counters>(
        &self,
        simd: S,
        job: Job<'_>,
        slice: RaySlice<'_>,
        scratch: &mut Self::Scratch,
        write: &mut impl FnMut(usize, Hit),
        counters: &mut [C],
    ) {
        let Scratch { rows, best } = scratch;
        let RaySlice { frame, rays } = slice;
        rows.fill(simd, frame, rays);
        best.clear();
        best.resize_with(rays.len(), Best::blank);
        // Trace as a beam the rays that share an origin and a dominant direction.
        let (parallel, alike) = bundle::alike(rays);
        let (live, alike) = (rows.live, alike & !rows.blurred);
        let forward = mask_of(lanes(live & alike).filter(|&i| rays[i].t_min >= 0.0));
        let together = if parallel { 0 } else { forward };
        let mut singles = live;
        if let Some((axis, group)) = steepest(rows, together)
            && group.count_ones() >= self.least
        {
            // Set up the tile, and trace its beam through the tree.
            let negative = rows.negative[axis] & group != 0;
            let first = group.trailing_zeros() as usize;
            let eye = [0, 1, 2].map(|k: usize| rows.rays.o[k][first]);
            let (axis_pads, oblique_pad) = frame.pads(eye);
            let mut tile = Tile {
                tree: self.tree,
                least: self.least,
                job,
                slice,
                view: View::new(axis, negative),
                eye,
                axis_pads,
                oblique_pad,
                at: [[0.0; 2]; RAYS],
                depth: [0.0; RAYS],
                rows,
                best,
                singles: live & !group,
                visits: 0,
            };
            tile.trace(simd, axis, group, counters);
            singles = tile.singles;
        }
        self.trace_singly(simd, job, slice, singles, best, counters);
        for (i, best) in best.iter().enumerate() {
            write(i, best.hit());
        }
    }
}

impl PlaneBeams<'_> {
    /// Traces some rays one by one, each up to its best hit so far.
    #[inline(always)]
    fn trace_singly<S: Simd, C: Counters>(
        &self,
        simd: S,
        job: Job<'_>,
        RaySlice { frame, rays }: RaySlice<'_>,
        singles: u64,
        best: &mut [Best],
        counters: &mut [C],
    ) {
        let single = PlaneTraversal(self.tree);
        let mut scratch = single.scratch();
        for i in lanes(singles) {
            counters[i].case(|| SINGLE);
            // End at the known hit: it is found again, or a better one.
            let found = best[i].hit();
            let t_max = if found.is_hit() {
                found.t
            } else {
                rays[i].t_max
            };
            let ray = &Ray { t_max, ..rays[i] };
            if let Some(frame) = &frame.ray(ray) {
                let (ray, count) = (RayRef { ray, frame }, &mut counters[i]);
                let mut own = single.cast::<S, Closest, C>(simd, job, ray, &mut scratch, count);
                best[i] = Best::known(own.answer(ray));
            }
        }
    }
}

/// The mask with these bits set.
#[inline(always)]
fn mask_of(bits: impl Iterator<Item = usize>) -> u64 {
    bits.fold(0, |mask, i| mask | 1 << i)
}

/// The axis of the largest direction component of the first of `some`, and the mask of those rays of `some`
/// that are steep along this axis in the same direction.
#[inline(always)]
fn steepest(rows: &FrameRows, some: u64) -> Option<(usize, u64)> {
    let first = lanes(some).next()?;
    let speed = |k: usize, i: usize| rows.rays.d[k][i];
    let axis = (1..3).fold(0, |a, b| {
        if speed(b, first).abs() > speed(a, first).abs() {
            b
        } else {
            a
        }
    });
    let negative = rows.negative[axis] >> first & 1 == 1;
    let same = if negative {
        rows.negative[axis]
    } else {
        !rows.negative[axis]
    };
    let steep = lanes(some & same).filter(|&i| speed(axis, i).abs() >= STEEP);
    Some((axis, mask_of(steep)))
}

impl Tile<'_> {
    /// Traces the beam of all pixels of a group through the whole tree.
    #[inline(always)]
    fn trace<S: Simd, C: Counters>(
        &mut self,
        simd: S,
        axis: usize,
        group: u64,
        counters: &mut [C],
    ) {
        // Bound the pixels by a rectangle, and the rays' intervals by depths along the axis.
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let mut depths = Depths {
            enter: f64::INFINITY,
            leave: f64::NEG_INFINITY,
        };
        for i in lanes(group) {
            let d = [0, 1, 2].map(|k: usize| self.rows.rays.d[k][i]);
            self.at[i] = self.view.pixel(d);
            self.depth[i] = f64::from(d[axis].abs());
            for k in 0..2 {
                low[k] = low[k].min(self.at[i][k]);
                high[k] = high[k].max(self.at[i][k]);
            }
            let enter = f64::from(self.rows.enter[i]) * self.depth[i];
            let leave = f64::from(self.rows.reach[i]) * self.depth[i];
            depths.enter = depths.enter.min(enter);
            depths.leave = depths.leave.max(leave);
        }
        let beam = Beam {
            polygon: Polygon::rectangle(low, high),
            pixels: group,
        };
        let root = self.tree.root();
        self.follow(simd, root, beam, depths, &mut Vec::new(), counters);
    }

    /// Traces a beam through a subtree between two depths, and appends to `left` the pieces into which it was split,
    /// without the rays to trace singly. Recursive: at most [`halfspace_nodes::plane_tree::MAX_DEPTH`] levels.
    fn follow<S: Simd, C: Counters>(
        &mut self,
        simd: S,
        node: u32,
        beam: Beam,
        depths: Depths,
        left: &mut Vec<Beam>,
        counters: &mut [C],
    ) {
        let Some(beam) = self.worth(beam) else {
            return;
        };
        // Count the visit for the beam's first ray.
        let first = beam.pixels.trailing_zeros() as usize;
        counters[first].case(|| VISIT);
        join(counters, beam.pixels);
        self.visits += 1;
        let plane = match self.tree.node(node) {
            Node::Leaf {
                first: block,
                count,
            } => {
                counters[first].leaf(count);
                if count == 0 {
                    left.push(beam);
                } else {
                    let leaf = Leaf {
                        first: block,
                        count,
                    };
                    // Recursion leaves the instruction set of the caller: enter it again.
                    simd.vectorize(
                        #[inline(always)]
                        || self.leaf(simd, leaf, beam, left, counters),
                    );
                }
                return;
            }
            Node::Axis {
                axis,
                split,
                children,
                empty,
                ..
            } => {
                counters[first].step_axis();
                self.see_axis(axis, split, children, empty)
            }
            Node::Oblique {
                normal,
                offset,
                children,
                empty,
            } => {
                counters[first].step_oblique();
                self.see_oblique(normal, offset, children, empty)
            }
        };
        self.visit_children(simd, &plane, beam, depths, left, counters);
    }

    /// Traces a beam through the children of a node with this plane, the near one first.
    #[inline(always)]
    fn visit_children<S: Simd, C: Counters>(
        &mut self,
        simd: S,
        plane: &Seen,
        beam: Beam,
        depths: Depths,
        left: &mut Vec<Beam>,
        counters: &mut [C],
    ) {
        // Compare the depths where the beam crosses the plane with its interval, and visit the near child.
        let crossing = plane.crossing(&beam.polygon);
        let far = plane.near ^ 1;
        let mut pieces = Vec::new();
        if crossing.leave < depths.enter || plane.is_empty(plane.near) {
            pieces.push(beam);
        } else {
            let before = Depths {
                enter: depths.enter,
                leave: depths.leave.min(crossing.leave),
            };
            self.follow(simd, plane.near, beam, before, &mut pieces, counters);
        }
        if crossing.enter > depths.leave || plane.is_empty(far) {
            left.append(&mut pieces);
            return;
        }
        // Visit the far child with each piece that is left of the beam.
        for mut piece in pieces {
            let crossing = plane.crossing(&piece.polygon);
            if crossing.enter > depths.leave {
                left.push(piece);
                continue;
            }
            // Pixels finished before this plane remain in play for the planes of the node's ancestors, which
            // their rays may cross sooner.
            let open = self.open(plane, piece.pixels);
            if open != piece.pixels {
                left.push(Beam {
                    pixels: piece.pixels & !open,
                    ..piece
                });
            }
            if open == 0 {
                continue;
            }
            piece.pixels = open;
            let behind = Depths {
                enter: depths.enter.max(crossing.enter),
                leave: depths.leave,
            };
            self.follow(simd, far, piece, behind, left, counters);
        }
    }

    /// Removes from a beam the rays to trace singly: all of them once the tile's visits are used up, and those
    /// without a hit if they are too few. `None` if no ray is left.
    fn worth(&mut self, mut beam: Beam) -> Option<Beam> {
        beam.pixels &= !self.singles;
        // Find the rays without a hit.
        let blind = mask_of(lanes(beam.pixels).filter(|&i| !self.best[i].hit().is_hit()));
        if self.visits > VISITS * RAYS {
            self.singles |= beam.pixels;
            return None;
        }
        if blind != 0 && blind.count_ones() < self.least {
            self.singles |= blind;
            beam.pixels &= !blind;
        }
        (beam.pixels != 0).then_some(beam)
    }
}
