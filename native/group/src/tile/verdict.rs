// SPDX-License-Identifier: GPL-3.0-or-later
//! The exact verdict for sixteen rays of a tile at a time, in f64 as far as f64 is certain: on one triangle for
//! all rays, or on one for each. It repeats the arithmetic of [`halfspace_geom::verdict`] operation by operation,
//! with error bounds at least as large.

use crate::tile::{self, Deferred, LANES, Row, Tile, load, splat};
use fearless_simd::{Select, Simd, SimdBase, SimdMask, f32x16, mask32x16, u32x16};
use halfspace_geom::vec3::widen;
use halfspace_geom::verdict::FromOrigin;
use halfspace_leaf::Job;
use halfspace_ray::Hit;
use halfspace_ray::frame::PRUNE;
use halfspace_trace::verdicts::{HALF, Triangles8, all, half, shares, vectors, wide};

/// Applies the verdict on one triangle to some rays of a row; returns the mask of those that f64 cannot decide.
#[inline(always)]
pub fn shared<S: Simd, const R: usize>(
    simd: S,
    tile: &mut Tile<R>,
    row: usize,
    open: u16,
    id: u32,
    triangle: &FromOrigin,
) -> u16 {
    // Copy the triangle's quantities to all lanes.
    let [a, b, c] = triangle.normals;
    let errors = triangle.errors;
    let from = Triangles8 {
        normals: [vectors(simd, a), vectors(simd, b), vectors(simd, c)],
        normal: vectors(simd, triangle.normal),
        distance: all(simd, triangle.distance),
        weight_error: all(simd, errors.weight),
        sum_error: all(simd, errors.sum),
        distance_error: all(simd, errors.distance),
    };
    let ids = u32x16::splat(simd, id);
    take(simd, tile, row, open, [from, from], ids)
}

/// Applies to each ray of a row the verdict on its deferred triangle; returns the mask of those that f64 cannot decide.
/// `last` caches the last triangle that all rays of a row shared, by its position in the blocks.
#[inline(always)]
pub fn each<S: Simd, const R: usize>(
    simd: S,
    job: Job<'_>,
    tile: &mut Tile<R>,
    row: usize,
    last: &mut Option<(usize, FromOrigin)>,
) -> u16 {
    let lanes = tile.deferred.lanes[row];
    let ids = u32x16::from_slice(simd, &tile.deferred.id[row]);
    let first = lanes.trailing_zeros() as usize % LANES;
    let id = tile.deferred.id[row][first];
    // Use the verdict on one triangle if all rays share it.
    if lanes & !tile::bits(ids.simd_eq(u32x16::splat(simd, id))) == 0 {
        let stored = tile.deferred.triangle(row, first);
        let known = last.filter(|(at, _)| *at == stored.at);
        let (_, triangle) =
            known.unwrap_or_else(|| (stored.at, FromOrigin::new(tile.o, stored.corners(job))));
        *last = Some((stored.at, triangle));
        return shared(simd, tile, row, lanes, id, &triangle);
    }
    // Otherwise gather one triangle per lane.
    let [a, b, c] = gathered(job, &tile.deferred, row);
    let (a, b, c) = (wide(simd, &a), wide(simd, &b), wide(simd, &c));
    let o = vectors(simd, widen(tile.o));
    let low = Triangles8::from_origins(simd, o, [a[0], b[0], c[0]]);
    let high = Triangles8::from_origins(simd, o, [a[1], b[1], c[1]]);
    take(simd, tile, row, lanes, [low, high], ids)
}

/// Vertices of the deferred triangles of a row's rays, per vertex and axis; zeros for other rays.
#[inline(always)]
#[expect(
    clippy::needless_range_loop,
    reason = "by iterators over arrays it takes five times as long"
)]
pub fn gathered<const R: usize>(job: Job<'_>, deferred: &Deferred<R>, row: usize) -> [[Row; 3]; 3] {
    let mut rows = [[[0.0; LANES]; 3]; 3];
    for lane in 0..LANES {
        if deferred.lanes[row] >> lane & 1 == 0 {
            continue;
        }
        let corners = deferred.triangle(row, lane).corners(job);
        for corner in 0..3 {
            for k in 0..3 {
                rows[corner][k][lane] = corners[corner][k];
            }
        }
    }
    rows
}

/// A row of rays with origins of their own.
pub struct Segments<'a> {
    /// Origins.
    pub o: &'a [Row; 3],
    /// Directions with components below 2.
    pub d: &'a [Row; 3],
    /// Factor from distances along `d` to distances in the scene.
    pub to_scene: f64,
    /// Smallest distances of hits in the scene.
    pub t_min: &'a Row,
    /// Largest distances of hits in the scene.
    pub t_max: &'a Row,
}

/// Masks of the rays of a row that hit a triangle inside their limits, and of those that f64 cannot decide.
#[inline(always)]
pub fn any<S: Simd>(simd: S, rays: &Segments<'_>, corners: [[f32; 3]; 3], open: u16) -> (u16, u16) {
    let [a, b, c] = corners;
    let corners = [
        vectors(simd, widen(a)),
        vectors(simd, widen(b)),
        vectors(simd, widen(c)),
    ];
    let (o, d, to_scene) = (
        wide(simd, rays.o),
        wide(simd, rays.d),
        all(simd, rays.to_scene),
    );
    let low = half(
        simd,
        &Triangles8::from_origins(simd, o[0], corners),
        d[0],
        to_scene,
    );
    let high = half(
        simd,
        &Triangles8::from_origins(simd, o[1], corners),
        d[1],
        to_scene,
    );
    let join = |low: u16, high: u16| low | high << HALF;
    let (miss, hit, well) = (
        join(low.miss, high.miss),
        join(low.hit, high.hit),
        join(low.well, high.well),
    );
    // Compare bounds on the distance, rounded to f32, with the limits.
    let early = simd.narrow_f64x8(low.early, high.early);
    let late = simd.narrow_f64x8(low.late, high.late);
    let (t_min, t_max) = (load(simd, rays.t_min), load(simd, rays.t_max));
    let outside = tile::bits(late.simd_lt(t_min) | early.simd_gt(t_max)) & well;
    let inside = tile::bits(early.simd_ge(t_min) & late.simd_le(t_max)) & well & hit;
    let open = open & !(miss | outside);
    (open & inside, open & !inside)
}

/// Writes new values to some lanes of a row.
#[inline(always)]
fn keep<S: Simd>(simd: S, lanes: mask32x16<S>, new: f32x16<S>, row: &mut Row) {
    let kept: f32x16<S> = lanes.select(new, load(simd, row));
    kept.store_slice(row);
}

/// Takes the hits of the `open` rays of a row that f64 proves nearer than the best ones; returns the mask of the rays
/// that it cannot decide.
#[inline(always)]
fn take<S: Simd, const R: usize>(
    simd: S,
    tile: &mut Tile<R>,
    row: usize,
    open: u16,
    triangles: [Triangles8<S>; 2],
    ids: u32x16<S>,
) -> u16 {
    let d = wide(simd, &tile.d[row]);
    let to_scene = all(simd, 1.0 / f64::from(tile.to_frame));
    let low = half(simd, &triangles[0], d[0], to_scene);
    let high = half(simd, &triangles[1], d[1], to_scene);
    let open = open & !(low.miss | high.miss << HALF);
    if open == 0 {
        return 0;
    }
    let (hit, well) = (low.hit | high.hit << HALF, low.well | high.well << HALF);
    let early = simd.narrow_f64x8(low.early, high.early);
    let late = simd.narrow_f64x8(low.late, high.late);
    let t_min = load(simd, &tile.t_min[row]);
    let best = load(simd, &tile.t[row]);
    // Drop hits that are certainly outside the interval, whatever their last bit.
    let open = open & !(tile::bits(late.simd_lt(t_min) | early.simd_gt(best)) & well);
    let (sure, [u, v]) = shares(simd, &low, &high);
    let certain = hit & well & sure & tile::bits(early.simd_eq(late));
    let nearer = tile::bits(early.simd_lt(best) & early.simd_ge(t_min));
    let taken = open & certain & nearer;
    if taken != 0 {
        // Adding zero turns -0.0 into 0.0.
        let t = early + splat(simd, 0.0);
        let reach = t * splat(simd, tile.to_frame * PRUNE) + splat(simd, tile.last_place);
        let reach = reach.min(load(simd, &tile.reach[row]));
        let lanes = mask32x16::from_bitmask(simd, u64::from(taken));
        keep(simd, lanes, reach, &mut tile.reach[row]);
        keep(simd, lanes, t, &mut tile.t[row]);
        keep(simd, lanes, u, &mut tile.u[row]);
        keep(simd, lanes, v, &mut tile.v[row]);
        let known = u32x16::from_slice(simd, &tile.id[row]);
        let ids: u32x16<S> = lanes.select(ids, known);
        ids.store_slice(&mut tile.id[row]);
    }
    // Uncertain hits, and ties.
    open & !taken
}

const _: () = assert!(Hit::NONE == u32::MAX, "no triangle has a larger number");
