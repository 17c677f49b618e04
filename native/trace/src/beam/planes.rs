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

use crate::batch::{TileWalk, Walk as _};
use crate::beam::bundle::{self, Bundle as _, Common, LANES, RAYS, lanes, load};
use crate::beam::frame_rows::FrameRows;
use crate::single::planes::dir as plane_dir;
use fearless_simd::Simd;
use halfspace_geom::bound::keep_min;
use halfspace_geom::vec3::{Vec3, dot, sub, widen};
use halfspace_geom::view::{Line, Polygon, View};
use halfspace_leaf::{Job, Leaf};
use halfspace_nodes::plane_tree::{Node, PlaneTree};
use halfspace_ray::frame::Frame;
use halfspace_ray::query::{Best, Closest, Counters, join};
use halfspace_ray::{Hit, Ray, RayRef, RaySlice};

/// Names of this traversal's entries in [`halfspace_ray::ray::RayCounters::cases`], in order: nodes and leaves visited
/// by beams, splits of a beam along a triangle, and rays traced singly.
pub const NAMES: [&str; 3] = ["beam_visits", "beam_cuts", "beam_singles"];

const VISIT: usize = 0;
const CUT: usize = 1;
const SINGLE: usize = 2;

/// Largest average number of nodes that the beams of a tile visit per ray; beyond it the remaining rays are
/// traced singly. Chosen at the order of a single ray's visits, which are some tens.
const VISITS: usize = 16;

/// Smallest speed along the tile's axis for a ray to join the beam: half the largest component's lower bound of
/// 1.
const STEEP: f32 = 0.5;

/// The beam traversal of one tree, and the number of rays below which a beam is given up for single rays.
pub struct Walk<'a>(pub &'a PlaneTree, pub u32);

/// A beam, or a piece of one.
#[derive(Clone, Copy)]
struct Beam {
    polygon: Polygon,
    /// Mask of the pixels.
    pixels: u64,
}

/// A split plane relative to the eye.
struct Seen {
    /// The child on the eye's side.
    near: u32,
    /// Speed of the directions towards the plane, an affine function of the pixel.
    speed: Line,
    /// Distance from the eye along the plane's normal, and its error bound; `None` if the eye may lie in the
    /// plane.
    distance: Option<(f64, f64)>,
}

/// State shared by the beams of a tile.
struct Tile<'a> {
    tree: &'a PlaneTree,
    /// Beams with fewer rays without a hit trace those singly.
    least: u32,
    triangles: Job<'a>,
    frame: &'a Frame,
    rays: &'a [Ray],
    view: View,
    eye: [f32; 3],
    /// Error bounds of the eye's distance to planes across each axis, and to oblique planes.
    pads: ([f32; 3], f32),
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

impl TileWalk for Walk<'_> {
    const RAYS: usize = RAYS;
    type Scratch = (FrameRows, Vec<Best>);

    fn scratch(&self) -> Self::Scratch {
        (FrameRows::blank(), Vec::with_capacity(RAYS))
    }

    #[inline(always)]
    fn cast_tile<S: Simd, C: Counters>(
        &self,
        simd: S,
        triangles: Job<'_>,
        RaySlice { frame, rays }: RaySlice<'_>,
        (rows, best): &mut Self::Scratch,
        write: &mut impl FnMut(usize, Hit),
        counters: &mut [C],
    ) {
        rows.fill(simd, frame, rays);
        best.clear();
        best.resize_with(rays.len(), Best::blank);
        // Trace as a beam the rays that share an origin and a dominant direction.
        let (parallel, alike) = bundle::alike(rays);
        let live = rows.live;
        let forward = lanes(live & alike)
            .filter(|&i| rays[i].t_min >= 0.0)
            .fold(0_u64, |forward, i| forward | 1 << i);
        let together = if parallel { 0 } else { forward };
        let mut singles = live;
        if let Some((axis, group)) = steepest(rows, together)
            && group.count_ones() >= self.1
        {
            // Set up the tile, and trace its beam through the tree.
            let negative = rows.negative[axis] & group != 0;
            let mut tile = Tile {
                tree: self.0,
                least: self.1,
                triangles,
                frame,
                rays,
                view: View::new(axis, negative),
                eye: [0, 1, 2].map(|k: usize| rows.rays.o[k][group.trailing_zeros() as usize]),
                pads: ([0.0; 3], 0.0),
                at: [[0.0; 2]; RAYS],
                depth: [0.0; RAYS],
                rows,
                best,
                singles: live & !group,
                visits: 0,
            };
            tile.pads = frame.pads(tile.eye);
            tile.trace(simd, (axis, group), counters);
            singles = tile.singles;
        }
        // Trace the other rays one by one.
        let single = plane_dir::Walk(self.0);
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
            let ray = Ray { t_max, ..rays[i] };
            if let Some(framed) = frame.ray(&ray) {
                let (ray, count) = (
                    RayRef {
                        ray: &ray,
                        frame: &framed,
                    },
                    &mut counters[i],
                );
                let hit = single.cast::<S, Closest, C>(simd, triangles, ray, &mut scratch, count);
                best[i] = Best::known(hit);
            }
        }
        for (i, best) in best.iter().enumerate() {
            write(i, best.hit());
        }
    }
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
    Some((axis, steep.fold(0, |group, i| group | 1 << i)))
}

impl Tile<'_> {
    /// Traces the beam of all pixels of a group through the whole tree.
    #[inline(always)]
    fn trace<S: Simd, C: Counters>(
        &mut self,
        simd: S,
        (axis, group): (usize, u64),
        counters: &mut [C],
    ) {
        // Bound the pixels by a rectangle, and the rays' intervals by depths along the axis.
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let (mut enter, mut leave) = (f64::INFINITY, f64::NEG_INFINITY);
        for i in lanes(group) {
            let d = [0, 1, 2].map(|k: usize| self.rows.rays.d[k][i]);
            self.at[i] = self.view.pixel(d);
            self.depth[i] = f64::from(d[axis].abs());
            for k in 0..2 {
                low[k] = low[k].min(self.at[i][k]);
                high[k] = high[k].max(self.at[i][k]);
            }
            enter = enter.min(f64::from(self.rows.enter[i]) * self.depth[i]);
            leave = leave.max(f64::from(self.rows.reach[i]) * self.depth[i]);
        }
        let beam = Beam {
            polygon: Polygon::rectangle(low, high),
            pixels: group,
        };
        let root = self.tree.root();
        self.follow(
            simd,
            root,
            (beam, (enter, leave)),
            &mut Vec::new(),
            counters,
        );
    }

    /// Traces a beam through a subtree between two depths, and appends to `left` the pieces with pixels that
    /// are not finished. Recursive: at most [`halfspace_nodes::plane_tree::MAX_DEPTH`] levels.
    fn follow<S: Simd, C: Counters>(
        &mut self,
        simd: S,
        node: u32,
        (beam, (enter, leave)): (Beam, (f64, f64)),
        left: &mut Vec<Beam>,
        counters: &mut [C],
    ) {
        let Some(beam) = self.worth(beam) else {
            return;
        };
        // Count the visit for the beam's first ray.
        let charged = &mut counters[beam.pixels.trailing_zeros() as usize];
        charged.case(|| VISIT);
        join(counters, beam.pixels);
        let charged = &mut counters[beam.pixels.trailing_zeros() as usize];
        self.visits += 1;
        let (plane, empty) = match self.tree.node(node) {
            Node::Leaf { first, count } => {
                charged.leaf(count);
                if count == 0 {
                    left.push(beam);
                } else {
                    let leaf = Leaf { first, count };
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
                charged.step_axis();
                let mut normal = [0.0; 3];
                normal[axis] = 1.0;
                (
                    self.see((normal, split), self.pads.0[axis], children),
                    empty,
                )
            }
            Node::Oblique {
                normal,
                offset,
                children,
                empty,
            } => {
                charged.step_oblique();
                let plane = (widen(normal), offset);
                (self.see(plane, self.pads.1, children), empty)
            }
        };
        // Compare the depths where the beam crosses the plane with its interval, and visit the near child.
        let (first, last) = crossing(&plane, &beam.polygon);
        let is_empty = |child: u32| empty >> (child & 1) & 1 == 1;
        let far = plane.near ^ 1;
        let mut pieces = Vec::new();
        if last < enter || is_empty(plane.near) {
            pieces.push(beam);
        } else {
            let ends = (enter, leave.min(last));
            self.follow(simd, plane.near, (beam, ends), &mut pieces, counters);
        }
        if first > leave || is_empty(far) {
            left.append(&mut pieces);
            return;
        }
        // Visit the far child with each piece that is left of the beam.
        for mut piece in pieces {
            let (first, _) = crossing(&plane, &piece.polygon);
            if first > leave {
                left.push(piece);
                continue;
            }
            // Pixels finished before this plane remain in play for the planes of the node's ancestors, which
            // their rays may cross sooner.
            let open = self.open(&plane, piece.pixels);
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
            self.follow(
                simd,
                far,
                (piece, (enter.max(first), leave)),
                left,
                counters,
            );
        }
    }

    /// Removes from a beam the rays to trace singly: all of them once the tile's visits are used up, and those
    /// without a hit if they are too few. `None` if no ray is left.
    fn worth(&mut self, mut beam: Beam) -> Option<Beam> {
        beam.pixels &= !self.singles;
        // Find the rays without a hit.
        let blind = lanes(beam.pixels)
            .filter(|&i| !self.best[i].hit().is_hit())
            .fold(0_u64, |blind, i| blind | 1 << i);
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

    /// A plane relative to the eye.
    #[inline(always)]
    fn see(&self, (normal, offset): (Vec3, f32), pad: f32, children: u32) -> Seen {
        let gap = f64::from(offset) - dot(normal, widen(self.eye));
        let up = gap > 0.0;
        let turned = if up { normal } else { normal.map(|x| -x) };
        let pad = f64::from(pad);
        Seen {
            near: children + u32::from(!up),
            speed: self.view.speed(turned),
            distance: (gap.abs() > pad).then_some((gap.abs(), pad)),
        }
    }

    /// Mask of those `pixels` whose best hit does not certainly lie before the plane.
    #[inline(always)]
    fn open(&self, plane: &Seen, pixels: u64) -> u64 {
        let Some((distance, pad)) = plane.distance else {
            return pixels;
        };
        let behind = lanes(pixels).filter(|&i| {
            let reach = f64::from(keep_min(self.best[i].reach, self.rows.reach[i])) * self.depth[i];
            let speed = plane.speed.at(self.at[i]);
            // A ray that moves away from the plane, or along it, never crosses it.
            (distance - pad) * (1.0 - 1e-9) > reach * speed.max(0.0) * (1.0 + 1e-9) + reach * 1e-11
        });
        behind.fold(pixels, |pixels, i| pixels & !(1 << i))
    }

    /// Tests the rays of a beam against the triangles of a leaf, and splits the beam along those that are hit.
    #[inline(always)]
    fn leaf<S: Simd, C: Counters>(
        &mut self,
        simd: S,
        leaf: Leaf,
        beam: Beam,
        left: &mut Vec<Beam>,
        counters: &mut [C],
    ) {
        let Job { scene, blocks } = self.triangles;
        for i in lanes(beam.pixels) {
            counters[i].visit(leaf.first, leaf.count);
            counters[i].tests(leaf.count);
        }
        let shared = Common(self.eye);
        let mut pieces = vec![beam];
        blocks.each(leaf, |id, corners| {
            // Test eight rays at a time in f32, then put the candidates to the exact verdict.
            let seen = shared.see(corners);
            let mut found = 0;
            for row in (0..RAYS).step_by(LANES) {
                let bits = beam.pixels >> row & 0xff;
                if bits == 0 {
                    continue;
                }
                let reach = load(simd, &self.rows.reach, row);
                let rays = (&self.rows.rays, row);
                for lane in lanes(shared.candidates(simd, &seen, rays, reach) & bits) {
                    let i = row + lane;
                    // The verdict takes the caller's ray; only the scale of its distances is needed.
                    let framed = self.frame.limits_of(&self.rays[i]);
                    let (ray, best) = (
                        RayRef {
                            ray: &self.rays[i],
                            frame: &framed,
                        },
                        &mut self.best[i],
                    );
                    best.offer::<Closest, C>(
                        ray,
                        id,
                        #[inline(always)]
                        || blocks.scene_corners(scene, id, corners),
                        &mut counters[i],
                    );
                    self.rows.reach[i] = keep_min(best.reach, self.rows.reach[i]);
                    found |= u64::from(best.hit().triangle == id) << i;
                }
            }
            if found != 0 {
                self.cut(corners, found, &mut pieces, counters);
            }
        });
        left.append(&mut pieces);
    }

    /// Splits the beams of `pieces` along the outline of a triangle that hides some, but not all, of their
    /// pixels. `found` is the mask of pixels whose best hit is this triangle.
    fn cut<C: Counters>(
        &self,
        corners: [[f32; 3]; 3],
        found: u64,
        pieces: &mut Vec<Beam>,
        counters: &mut [C],
    ) {
        let whole = |beam: &Beam| beam.pixels & found == 0 || beam.pixels & !found == 0;
        if pieces.iter().all(whole) {
            return;
        }
        let eye = widen(self.eye);
        let Some(edges) = self.view.edges(corners.map(|p| sub(widen(p), eye))) else {
            return;
        };
        for _ in 0..pieces.len() {
            let mut beam = pieces.remove(0);
            if whole(&beam) {
                pieces.push(beam);
                continue;
            }
            counters[beam.pixels.trailing_zeros() as usize].case(|| CUT);
            // Cut off the part beyond each edge as a piece of its own.
            for edge in &edges {
                let outside = lanes(beam.pixels)
                    .filter(|&i| edge.at(self.at[i]) < 0.0)
                    .fold(0_u64, |outside, i| outside | 1 << i);
                if outside == 0 {
                    continue;
                }
                let beyond = Line(edge.0.map(|x| -x));
                pieces.push(Beam {
                    polygon: beam.polygon.part(&beyond).unwrap_or(beam.polygon),
                    pixels: outside,
                });
                beam.pixels &= !outside;
                if beam.pixels == 0 {
                    break;
                }
                beam.polygon = beam.polygon.part(edge).unwrap_or(beam.polygon);
            }
            if beam.pixels != 0 {
                pieces.push(beam);
            }
        }
    }
}

/// The interval of depths in which the directions of a polygon cross a plane, rounded outwards.
#[inline(always)]
fn crossing(plane: &Seen, polygon: &Polygon) -> (f64, f64) {
    let Some((distance, pad)) = plane.distance else {
        return (f64::NEG_INFINITY, f64::INFINITY);
    };
    let (slowest, quickest) = polygon.range(&plane.speed);
    let at = |distance: f64, speed: f64| {
        if speed > 0.0 {
            distance / speed
        } else {
            f64::INFINITY
        }
    };
    (
        at(distance - pad, quickest) * (1.0 - 1e-9),
        at(distance + pad, slowest) * (1.0 + 1e-9),
    )
}
