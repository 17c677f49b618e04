// SPDX-License-Identifier: GPL-3.0-or-later
//! Tiles of shadow rays: rays that end near one point, the light, are walked from there, as a beam of which
//! most often nothing is in the way, and then one walk answers them all.
//!
//! Nobody says where the light is. The point where two of the rays pass each other is taken for it, and how far the
//! lines of the others pass that point is their blur: every plane and every triangle is compared with rays that
//! thick. What may block a ray is decided by the verdict on the ray itself, so the
//! answer does not depend on any of this. Rays that are not of one light, or spread too far, go in
//! packets.

use super::blocks::Blocks;
use super::frame::Frame;
use super::query::Counters;
use super::ray::Ray;
use super::tile::{Backoff, LANES, Numbers, ORDINARY, Row, Tile, bits, load, place, seat, splat};
use super::tile_leaf::{Candidate, Judge};
use super::tile_nearest::count;
use super::tile_verdict::any;
use crate::geom::vec3::{add_scaled, dot as dot64, sub as sub64, widen};
use crate::geom::verdict::verdict_within;
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask, f32x16, mask32x16};

/// The rays of a shadow tile as they are.
pub struct Shadows<const R: usize> {
    o: [[Row; 3]; R],
    /// Directions over the power of two below.
    d: [[Row; 3]; R],
    to_scene: f64,
    t_min: [Row; R],
    t_max: [Row; R],
    /// The rays that are blocked.
    pub blocked: [u16; R],
}

/// Directions of a tile may differ by so much, in parts of the longest.
const SPREAD: f32 = 0.25;

/// Lines may pass the light at most at this distance, in parts of the longest.
const BLUR: f32 = 1e-3;

impl<const R: usize> Shadows<R> {
    /// Turns shadow rays round; `None` for rays that are better walked in packets. One function for all trees.
    #[inline(never)]
    pub fn new<S: Simd>(simd: S, frame: &Frame, rays: &[Ray]) -> Option<(Tile<R>, Self)> {
        simd.vectorize(
            #[inline(always)]
            || Self::of(simd, frame, rays),
        )
    }

    #[inline(always)]
    fn of<S: Simd>(simd: S, frame: &Frame, rays: &[Ray]) -> Option<(Tile<R>, Self)> {
        let first = &rays[0];
        let longest = first.d[0].abs().max(first.d[1].abs()).max(first.d[2].abs());
        let unit = f32::from_bits(longest.to_bits() & 0x7f80_0000);
        // What is not finite is in no range.
        if rays.len() < LANES || !ORDINARY.contains(&unit) || !ORDINARY.contains(&first.t_max) {
            return None;
        }
        let mut shadows = Self {
            o: [[[0.0; LANES]; 3]; R],
            d: [[[0.0; LANES]; 3]; R],
            to_scene: 1.0 / f64::from(unit),
            t_min: [[0.0; LANES]; R],
            t_max: [[f32::NEG_INFINITY; LANES]; R],
            blocked: [0; R],
        };
        let mut there = [0; R];
        if rays.len() == R * LANES {
            for (row, there) in there.iter_mut().enumerate() {
                let own = Numbers::of_row(simd, rays, row);
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
                let (row, lane) = seat(i);
                for k in 0..3 {
                    shadows.o[row][k][lane] = ray.o[k];
                    shadows.d[row][k][lane] = ray.d[k];
                }
                shadows.t_min[row][lane] = ray.t_min;
                shadows.t_max[row][lane] = ray.t_max;
                there[row] |= 1 << lane;
            }
        }
        shadows.scale(simd, unit);
        let light = light(rays);
        let (mut tile, blur) = shadows.towards(simd, (light, unit), there)?;
        if !tile.is_worth_it(rays.len()) {
            return None;
        }
        let size = tile.to_frame;
        tile.blur = [blur, blur / size];
        let spread = tile.settle_in(simd, frame)?;
        (spread < SPREAD && blur < BLUR * size).then_some((tile, shadows))
    }

    /// Brings directions to size.
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

    /// The tile of the same lines seen from the light, and the blur of their lines.
    #[inline(always)]
    fn towards<S: Simd>(
        &self,
        simd: S,
        (light, unit): ([f32; 3], f32),
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
            // At this distance along the ray it passes the light, at this place.
            let at = -dot(way, d) / dot(d, d);
            let off = largest([
                d[0].mul_add(at, way[0]),
                d[1].mul_add(at, way[1]),
                d[2].mul_add(at, way[2]),
            ]);
            let (t_min, t_max) = (load(simd, &self.t_min[row]), load(simd, &self.t_max[row]));
            // Every point of the ray lies between its origin and the light, but for the share of its way at which it
            // passes the light, and for what lies behind.
            let share = t_max * splat(simd, unit) / at;
            let behind = (share - splat(simd, 1.0)).max(splat(simd, 0.0)) * size;
            let own = (off * share.max(splat(simd, 1.0)) + behind) * splat(simd, 1.01)
                + size * splat(simd, 2e-6);
            let fine = at.simd_gt(splat(simd, 0.0))
                & own.simd_lt(size * splat(simd, BLUR))
                & t_min.simd_ge(splat(simd, 0.0))
                & largest(d).simd_lt(splat(simd, 2.0));
            active[row] = bits(fine) & there[row];
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
            Tile::turned(light, longest, rows, (active, there)),
            blur.reduce_max(),
        ))
    }
}

/// Where the first ray and the one that differs most from it, of some, pass each other; the end of the first
/// where all are parallel.
#[inline(always)]
fn light(rays: &[Ray]) -> [f32; 3] {
    let first = &rays[0];
    let (o, d) = (widen(first.o), widen(first.d));
    let square = dot64(d, d);
    let mut best = (1e-12 * square * square, f64::from(first.t_max));
    for i in [7, 15, rays.len() - 8, rays.len() - 1] {
        let other = &rays[i];
        let (p, e) = (widen(other.o), widen(other.d));
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

/// Walks the rays of a shadow tile that go together: `follow` does it, and says whether it came to its end. Returns
/// the rays that are blocked, and those that are to be walked in another way.
#[inline(always)]
pub fn cast<S: Simd, C: Counters, const R: usize>(
    simd: S,
    (frame, rays, backoff): (&Frame, &[Ray], &mut Backoff<'_>),
    follow: impl FnOnce(&mut Tile<R>, &mut Shadows<R>, &mut [C]) -> bool,
    counters: &mut [C],
) -> [[u16; R]; 2] {
    let (mut blocked, mut rest) = ([0; R], [u16::MAX; R]);
    // Of rays that do not go together nothing is learned: to find that out costs little, and the next ones may.
    if backoff.tries()
        && let Some((mut tile, mut shadows)) = Shadows::new(simd, frame, rays)
    {
        if tile.is_inside() {
            let finished = follow(&mut tile, &mut shadows, counters);
            backoff.learn(finished);
            if !finished {
                tile.give_up();
            }
        }
        (blocked, rest) = (shadows.blocked, tile.rest);
    }
    for (rest, blocked) in rest.iter_mut().zip(blocked) {
        *rest &= !blocked;
    }
    [blocked, rest]
}

// No closures: they do not have the instruction set of the function around them unless they are inlined.

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

impl<const R: usize> Judge<R> for Shadows<R> {
    // Most beams are empty; those that are not are dearer than packets, whose rays stop at the first hit.
    const BUDGET: usize = 1;
    const WORTH: u32 = 13;

    #[inline(always)]
    fn judge<S: Simd, C: Counters>(
        &mut self,
        simd: S,
        blocks: &Blocks,
        (tile, rays): (&mut Tile<R>, &[Ray]),
        candidate: &Candidate<S>,
        counters: &mut [C],
    ) {
        let &Candidate {
            row,
            open,
            words: (from, n),
            ..
        } = candidate;
        let corners = blocks.corners_at(from, n);
        let lines = (&self.o[row], &self.d[row], self.to_scene);
        let limits = (&self.t_min[row], &self.t_max[row]);
        let (mut blocked, mut doubtful) = any(simd, lines, limits, corners, open);
        while doubtful != 0 {
            let lane = doubtful.trailing_zeros() as usize % LANES;
            doubtful &= doubtful - 1;
            let ray = &rays[place(row, lane)];
            let found = verdict_within(ray.o, ray.d, corners, [ray.t_min, ray.t_max]);
            let hit = found.is_some_and(|at| ray.reaches(at.t));
            blocked |= u16::from(hit) << lane;
        }
        count(open, row, counters);
        self.blocked[row] |= blocked;
        tile.stop(simd, row, blocked);
    }
}

#[cfg(test)]
mod tests;
