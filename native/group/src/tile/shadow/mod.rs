// SPDX-License-Identifier: GPL-3.0-or-later
//! Tiles of shadow rays: rays that end near one point, the light, are traced from there as a tile. Mostly nothing
//! blocks any of them, and one traversal decides them all.
//!
//! The light is not given. It is estimated as the point where two of the rays pass each other; the distance at
//! which the other rays' lines pass that point is their blur, and every plane and triangle is compared with
//! rays of that thickness. Blockers are decided by the exact verdict on the ray itself, so the result does not
//! depend on the estimate. Rays that belong to no common light, or spread too far, are traced in packets.

use crate::tile::leaf::{self, Resolver};
use crate::tile::nearest::{count, join};
use crate::tile::verdict::{Segments, any};
use crate::tile::{
    Backoff, Candidate, LANES, Numbers, Row, Tile, bits, load, ray_index, row_and_lane, splat,
};
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask, f32x16, mask32x16};
use halfspace_geom::vec3::{add_scaled, dot as dot64, sub as sub64, widen};
use halfspace_geom::verdict::verdict_within;
use halfspace_leaf::Leaf;
use halfspace_ray::columns::ORDINARY;
use halfspace_ray::frame::{Frame, ToFrame};
use halfspace_ray::query::Counters;
use halfspace_ray::{Interval, Ray, RaySlice};
use halfspace_trace::blocker::Blocker;
use halfspace_trace::input::Input;

/// The shadow rays of a tile.
pub struct Shadows<const R: usize> {
    /// Origins in the frame; the frame does not round those of the tile.
    o: [[Row; 3]; R],
    /// Directions divided by a power of two, the reciprocal of `to_scene`.
    d: [[Row; 3]; R],
    to_scene: f64,
    t_min: [Row; R],
    t_max: [Row; R],
    /// Masks of the rays whose origins the frame does not round; the others are traced outside the tile.
    exact: [u16; R],
    /// Masks of the occluded rays.
    pub blocked: [u16; R],
    /// The leaf that blocks most rays.
    pub blocker: Blocker,
}

/// Largest difference of a tile's directions, relative to the longest.
const SPREAD: f32 = 0.25;

/// Largest blur, relative to the longest distance to the light.
const BLUR: f32 = 1e-3;

impl<const R: usize> Shadows<R> {
    /// Forms the tile of reversed rays; `None` for rays that are better traced in packets. Compiled once for
    /// all trees.
    #[inline(never)]
    pub fn new<S: Simd>(simd: S, frame: &Frame, rays: &[Ray]) -> Option<(Tile<R>, Self)> {
        simd.vectorize(
            #[inline(always)]
            || Self::form(simd, frame, rays),
        )
    }

    /// [`Self::new`] in the instruction set of the caller.
    #[inline(always)]
    fn form<S: Simd>(simd: S, frame: &Frame, rays: &[Ray]) -> Option<(Tile<R>, Self)> {
        let first = &rays[0];
        let longest = first.d[0].abs().max(first.d[1].abs()).max(first.d[2].abs());
        let unit = f32::from_bits(longest.to_bits() & 0x7f80_0000);
        // NaN and infinity lie in no range.
        if rays.len() < LANES || !ORDINARY.contains(&unit) || !ORDINARY.contains(&first.t_max) {
            return None;
        }
        let to_frame = frame.map();
        let mut shadows = Self {
            o: [[[0.0; LANES]; 3]; R],
            d: [[[0.0; LANES]; 3]; R],
            to_scene: 1.0 / f64::from(unit),
            t_min: [[0.0; LANES]; R],
            t_max: [[f32::NEG_INFINITY; LANES]; R],
            exact: [0; R],
            blocked: [0; R],
            blocker: Blocker::default(),
        };
        // Load the rays: rows of a full tile as vectors, others ray by ray.
        let mut there = [0; R];
        if rays.len() == R * LANES {
            for (row, there) in there.iter_mut().enumerate() {
                let mut own = Numbers::of_row(simd, rays, row);
                shadows.exact[row] = bits(own.translate(simd, to_frame));
                for k in 0..3 {
                    own.o[k].store_slice(&mut shadows.o[row][k]);
                    own.d[k].store_slice(&mut shadows.d[row][k]);
                }
                own.t_min.store_slice(&mut shadows.t_min[row]);
                own.t_max.store_slice(&mut shadows.t_max[row]);
                *there = u16::MAX;
            }
        } else {
            for (i, ray) in rays.iter().enumerate() {
                let (row, lane) = row_and_lane(i);
                let o = to_frame.point(ray.o);
                shadows.exact[row] |= u16::from(to_frame.is_exact(o)) << lane;
                for (k, o) in o.into_iter().enumerate() {
                    shadows.o[row][k][lane] = o;
                    shadows.d[row][k][lane] = ray.d[k];
                }
                shadows.t_min[row][lane] = ray.t_min;
                shadows.t_max[row][lane] = ray.t_max;
                there[row] |= 1 << lane;
            }
        }
        shadows.scale(simd, unit);
        // Estimate the light and reverse the rays; give up if they do not meet there closely enough.
        let light = light(to_frame, rays);
        let (mut tile, blur) = shadows.seen_from(simd, light, unit, there)?;
        if !tile.is_half_active(rays.len()) {
            return None;
        }
        let size = tile.to_frame;
        tile.blur = [blur, blur / size];
        let spread = tile.scale_into(simd, frame)?;
        (spread < SPREAD && blur < BLUR * size).then_some((tile, shadows))
    }

    /// Divides the directions by `unit`.
    #[inline(always)]
    fn scale<S: Simd>(&mut self, simd: S, unit: f32) {
        let inverse = splat(simd, 1.0 / unit);
        for row in 0..R {
            let way = vectors(simd, &self.d[row]);
            for (row, way) in self.d[row].iter_mut().zip(way) {
                (way * inverse).store_slice(row);
            }
        }
    }

    /// The tile of the same lines with the light as origin, and their blur. Rays that pass too far from the
    /// light are left out; `None` if no ray is left.
    #[inline(always)]
    fn seen_from<S: Simd>(
        &self,
        simd: S,
        light: [f32; 3],
        unit: f32,
        there: [u16; R],
    ) -> Option<(Tile<R>, f32)> {
        let to = [
            splat(simd, light[0]),
            splat(simd, light[1]),
            splat(simd, light[2]),
        ];
        let mut rows = [[[0.0; LANES]; 3]; R];
        let mut active = [0; R];
        let (mut blur, mut longest) = (splat(simd, 0.0), splat(simd, 0.0));
        for row in 0..R {
            let o = vectors(simd, &self.o[row]);
            let d = vectors(simd, &self.d[row]);
            let way = [o[0] - to[0], o[1] - to[1], o[2] - to[2]];
            let size = largest(way);
            // Distance along the ray at which it passes the light, and its offset there.
            let at = -dot(way, d) / dot(d, d);
            let off = largest([
                d[0].mul_add(at, way[0]),
                d[1].mul_add(at, way[1]),
                d[2].mul_add(at, way[2]),
            ]);
            let (t_min, t_max) = (load(simd, &self.t_min[row]), load(simd, &self.t_max[row]));
            // Bound the blur over the whole ray. Between the ray's origin and the light it is at most `off`;
            // beyond the light it grows with the ray's share, and that part lies behind the new origin.
            let share = t_max * splat(simd, unit) / at;
            let behind = (share - splat(simd, 1.0)).max(splat(simd, 0.0)) * size;
            let own = (off * share.max(splat(simd, 1.0)) + behind) * splat(simd, 1.01)
                + size * splat(simd, 2e-6);
            // Keep rays that lead to the light with little blur; the others are traced in packets.
            let fine = at.simd_gt(splat(simd, 0.0))
                & own.simd_lt(size * splat(simd, BLUR))
                & t_min.simd_ge(splat(simd, 0.0))
                & largest(d).simd_lt(splat(simd, 2.0));
            active[row] = bits(fine) & there[row] & self.exact[row];
            let fine = mask32x16::from_bitmask(simd, u64::from(active[row]));
            let own: f32x16<S> = fine.select(own, splat(simd, 0.0));
            let size: f32x16<S> = fine.select(size, splat(simd, 0.0));
            (blur, longest) = (blur.max(own), longest.max(size));
            for k in 0..3 {
                way[k].store_slice(&mut rows[row][k]);
            }
        }
        let longest = longest.reduce_max();
        if longest <= 0.0 || longest.is_nan() {
            return None;
        }
        Some((
            Tile::to_points(light, longest, rows, active, there),
            blur.reduce_max(),
        ))
    }
}

/// Estimate of the light in the frame. Of four sample rays, the one whose direction differs most from the first ray's
/// is chosen; the light is the point of the first ray nearest to it, or the first ray's end if all are parallel.
#[inline(always)]
fn light(to_frame: &ToFrame, rays: &[Ray]) -> [f32; 3] {
    let first = &rays[0];
    let (o, d) = (widen(to_frame.point(first.o)), widen(first.d));
    let square = dot64(d, d);
    let mut best = (1e-12 * square * square, f64::from(first.t_max));
    // Intersect with the sample ray of the largest angle, by the closest points of two lines.
    for i in [7, 15, rays.len() - 8, rays.len() - 1] {
        let other = &rays[i];
        let (p, e) = (widen(to_frame.point(other.o)), widen(other.d));
        let (both, own) = (dot64(d, e), dot64(e, e));
        let sine = square * own - both * both;
        if sine > best.0 {
            let way = sub64(p, o);
            best = (sine, (own * dot64(way, d) - both * dot64(way, e)) / sine);
        }
    }
    let at = add_scaled(o, best.1, d);
    #[expect(clippy::cast_possible_truncation, reason = "what that changes is blur")]
    [at[0] as f32, at[1] as f32, at[2] as f32]
}

/// The rays that a shadow tile has decided, and the others.
pub struct Decided<const R: usize> {
    /// Masks of the occluded rays.
    pub blocked: [u16; R],
    /// Masks of the rays that are not decided.
    pub left: [u16; R],
}

/// Traces the rays of a slice that form a shadow tile. `trace` is the traversal and returns whether it finished.
#[inline(always)]
pub fn cast<S: Simd, C: Counters, const R: usize>(
    simd: S,
    RaySlice { frame, rays }: RaySlice<'_>,
    backoff: &mut Backoff<'_>,
    trace: impl FnOnce(&mut Tile<R>, &mut Shadows<R>, &mut [C]) -> bool,
    counters: &mut [C],
) -> Decided<R> {
    let (mut blocked, mut left) = ([0; R], [u16::MAX; R]);
    // A tile that cannot be formed is not reported as a failure: the attempt is cheap, and the next may
    // succeed.
    if backoff.should_try()
        && let Some((mut tile, mut shadows)) = Shadows::new(simd, frame, rays)
    {
        if tile.is_inside() {
            let finished = trace(&mut tile, &mut shadows, counters);
            backoff.record(finished);
            if !finished {
                tile.give_up();
            }
        }
        (blocked, left) = (shadows.blocked, tile.rest);
    }
    for (left, blocked) in left.iter_mut().zip(blocked) {
        *left &= !blocked;
    }
    Decided { blocked, left }
}

/// Tests the blocker of the last tile against a tile. Returns whether it blocks all rays of it.
#[inline(always)]
pub fn try_first<S: Simd, C: Counters, const R: usize>(
    simd: S,
    input: Input<'_>,
    blocker: Leaf,
    tile: &mut Tile<R>,
    shadows: &mut Shadows<R>,
    counters: &mut [C],
) -> bool {
    counters[0].leaf(blocker.count);
    join(tile, counters);
    let inside = Interval::new(tile.inside.enter, tile.far);
    leaf::test(simd, input, blocker, inside, tile, shadows, counters);
    if C::COUNTS {
        for (row, blocked) in shadows.blocked.iter().enumerate() {
            for lane in (0..LANES).filter(|lane| blocked >> lane & 1 == 1) {
                counters[ray_index(row, lane)].spared();
            }
        }
    }
    tile.active == [0; R]
}

// No closures in these functions: unless inlined, a closure is not compiled for the caller's instruction set.

#[inline(always)]
fn vectors<S: Simd>(simd: S, rows: &[Row; 3]) -> [f32x16<S>; 3] {
    [
        load(simd, &rows[0]),
        load(simd, &rows[1]),
        load(simd, &rows[2]),
    ]
}

#[inline(always)]
fn largest<S: Simd>(v: [f32x16<S>; 3]) -> f32x16<S> {
    v[0].abs().max(v[1].abs()).max(v[2].abs())
}

#[inline(always)]
fn dot<S: Simd>(a: [f32x16<S>; 3], b: [f32x16<S>; 3]) -> f32x16<S> {
    a[0].mul_add(b[0], a[1].mul_add(b[1], a[2] * b[2]))
}

impl<const R: usize> Resolver<R> for Shadows<R> {
    // Most tiles find no blocker. The others cost more than packets, whose rays stop at their first hit.
    const BUDGET: usize = 1;
    const MIN_FINISHED: u32 = 13;

    #[inline(always)]
    fn resolve<S: Simd, C: Counters>(
        &mut self,
        simd: S,
        input: Input<'_>,
        tile: &mut Tile<R>,
        candidate: &Candidate<S>,
        counters: &mut [C],
    ) {
        let (row, open) = (candidate.row, candidate.open);
        let corners = candidate.triangle.corners(input.job());
        let segments = Segments {
            o: &self.o[row],
            d: &self.d[row],
            to_scene: self.to_scene,
            t_min: &self.t_min[row],
            t_max: &self.t_max[row],
        };
        // Decide in f64 lanes as far as certain, the rest exactly.
        let (mut blocked, mut doubtful) = any(simd, &segments, corners, open);
        while doubtful != 0 {
            let lane = doubtful.trailing_zeros() as usize % LANES;
            doubtful &= doubtful - 1;
            let ray = &input.rays[ray_index(row, lane)];
            let corners = candidate.triangle.scene_corners(input.job());
            let found = verdict_within(ray.o, ray.d, corners, [ray.t_min, ray.t_max]);
            let hit = found.is_some_and(|at| ray.reaches(at.t));
            blocked |= u16::from(hit) << lane;
        }
        count(open, row, counters);
        self.blocked[row] |= blocked;
        self.blocker.blocks(blocked.count_ones());
        tile.deactivate(simd, row, blocked);
    }

    #[inline(always)]
    fn tested(&mut self, leaf: Leaf) {
        self.blocker.tested(leaf);
    }
}
