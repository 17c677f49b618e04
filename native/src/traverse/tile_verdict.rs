// SPDX-License-Identifier: GPL-3.0-or-later
//! The verdict for sixteen rays of a tile at a time, in f64, as far as f64 is certain: of one triangle
//! that all of them may hit, or of another one for each. It is the arithmetic of [`crate::geom::verdict`],
//! operation by operation, with error bounds at least as large.

use super::blocks::Blocks;
use super::frame::PRUNE;
use super::ray::Hit;
use super::tile::{self, Held, LANES, Row, Tile, load, splat};
use crate::geom::vec3::widen;
use crate::geom::verdict::{DETERMINANT_ERROR, FromOrigin};
use fearless_simd::{Select, Simd, SimdBase, SimdMask, f32x16, f64x8, mask32x16, mask64x8, u32x16};

/// Half of a row.
const HALF: usize = 8;

type Vector<S> = [f64x8<S>; 3];

/// Puts some rays of a row to the verdict on one triangle; returns those of which f64 is not certain.
#[inline(always)]
pub fn shared<S: Simd, const R: usize>(
    simd: S,
    tile: &mut Tile<R>,
    (row, open): (usize, u16),
    (id, triangle): (u32, &FromOrigin),
) -> u16 {
    let [a, b, c] = triangle.normals;
    let errors = triangle.errors;
    let from = From {
        normals: [vectors(simd, a), vectors(simd, b), vectors(simd, c)],
        normal: vectors(simd, triangle.normal),
        distance: all(simd, triangle.distance),
        weight_error: all(simd, errors.weight),
        sum_error: all(simd, errors.sum),
        distance_error: all(simd, errors.distance),
    };
    let ids = u32x16::splat(simd, id);
    take(simd, tile, (row, open), [from, from], ids)
}

/// Puts the rays of a row to the verdict on the triangles whose hits are held back; returns those of which f64
/// is not certain. `last`: the triangle that a whole row held last, by the place of its words; the next may hold it, too.
#[inline(always)]
pub fn each<S: Simd, const R: usize>(
    simd: S,
    blocks: &Blocks,
    (tile, row): (&mut Tile<R>, usize),
    last: &mut Option<(usize, FromOrigin)>,
) -> u16 {
    let held = tile.held.lanes[row];
    let ids = u32x16::from_slice(simd, &tile.held.id[row]);
    let first = held.trailing_zeros() as usize % LANES;
    let id = tile.held.id[row][first];
    if held & !tile::bits(ids.simd_eq(u32x16::splat(simd, id))) == 0 {
        let (from, n) = tile.held.words(row, first);
        let known = last.filter(|(place, _)| *place == from);
        let (_, triangle) =
            known.unwrap_or_else(|| (from, FromOrigin::new(tile.o, blocks.corners_at(from, n))));
        *last = Some((from, triangle));
        return shared(simd, tile, (row, held), (id, &triangle));
    }
    let [a, b, c] = gathered(blocks, &tile.held, row);
    let (a, b, c) = (wide(simd, &a), wide(simd, &b), wide(simd, &c));
    let o = vectors(simd, widen(tile.o));
    let low = From::seen(simd, o, [a[0], b[0], c[0]]);
    let high = From::seen(simd, o, [a[1], b[1], c[1]]);
    take(simd, tile, (row, held), [low, high], ids)
}

/// The corners of the triangles whose hits the rays of a row hold back, per corner the axes; of other rays zeros.
#[inline(always)]
#[expect(
    clippy::needless_range_loop,
    reason = "by iterators over arrays it takes five times as long"
)]
pub(super) fn gathered<const R: usize>(
    blocks: &Blocks,
    held: &Held<R>,
    row: usize,
) -> [[Row; 3]; 3] {
    let mut rows = [[[0.0; LANES]; 3]; 3];
    for lane in 0..LANES {
        if held.lanes[row] >> lane & 1 == 0 {
            continue;
        }
        let (from, n) = held.words(row, lane);
        let corners = blocks.corners_at(from, n);
        for corner in 0..3 {
            for k in 0..3 {
                rows[corner][k][lane] = corners[corner][k];
            }
        }
    }
    rows
}

/// Tells which rays of a row hit a triangle inside their limits, and of which f64 is not certain. The rays start
/// from points `o` of their own in directions `d`, whose components are below 2; a distance in the scene is one along
/// them times `to_scene`.
#[inline(always)]
pub fn any<S: Simd>(
    simd: S,
    (o, d, to_scene): (&[Row; 3], &[Row; 3], f64),
    (t_min, t_max): (&Row, &Row),
    corners: [[f32; 3]; 3],
    open: u16,
) -> (u16, u16) {
    let [a, b, c] = corners;
    let corners = [
        vectors(simd, widen(a)),
        vectors(simd, widen(b)),
        vectors(simd, widen(c)),
    ];
    let (o, d, to_scene) = (wide(simd, o), wide(simd, d), all(simd, to_scene));
    let low = half(simd, &From::seen(simd, o[0], corners), d[0], to_scene);
    let high = half(simd, &From::seen(simd, o[1], corners), d[1], to_scene);
    let join = |low: u16, high: u16| low | high << HALF;
    let (miss, hit, well) = (
        join(low.miss, high.miss),
        join(low.hit, high.hit),
        join(low.well, high.well),
    );
    let early = simd.narrow_f64x8(low.early, high.early);
    let late = simd.narrow_f64x8(low.late, high.late);
    let (t_min, t_max) = (load(simd, t_min), load(simd, t_max));
    let outside = tile::bits(late.simd_lt(t_min) | early.simd_gt(t_max)) & well;
    let inside = tile::bits(early.simd_ge(t_min) & late.simd_le(t_max)) & well & hit;
    let open = open & !(miss | outside);
    (open & inside, open & !inside)
}

/// The verdict on sixteen rays as in [`any`], and a triangle for each that it certainly hits: which of them f64 is
/// certain of to the last bit, and their `t` and the weights of the second and the third corner.
#[inline(always)]
pub fn apart<S: Simd>(
    simd: S,
    (o, d, to_scene): (&[Row; 3], &[Row; 3], &[f64; LANES]),
    corners: &[[Row; 3]; 3],
) -> (u16, [Row; 3]) {
    let (o, d) = (wide(simd, o), wide(simd, d));
    let [a, b, c] = corners;
    let (a, b, c) = (wide(simd, a), wide(simd, b), wide(simd, c));
    let (below, above) = to_scene.split_at(HALF);
    let low = From::seen(simd, o[0], [a[0], b[0], c[0]]);
    let low = half(simd, &low, d[0], f64x8::from_slice(simd, below));
    let high = From::seen(simd, o[1], [a[1], b[1], c[1]]);
    let high = half(simd, &high, d[1], f64x8::from_slice(simd, above));
    let early = simd.narrow_f64x8(low.early, high.early);
    let late = simd.narrow_f64x8(low.late, high.late);
    let certain = (low.hit & low.well) | (high.hit & high.well) << HALF;
    let mut out = [[0.0; LANES]; 3];
    // -0.0 becomes 0.0.
    (early + splat(simd, 0.0)).store_slice(&mut out[0]);
    simd.narrow_f64x8(low.u, high.u).store_slice(&mut out[1]);
    simd.narrow_f64x8(low.v, high.v).store_slice(&mut out[2]);
    (certain & tile::bits(early.simd_eq(late)), out)
}

/// What the verdict knows of eight triangles, each as seen from an origin, for directions whose components are below 2.
#[derive(Clone, Copy)]
struct From<S: Simd> {
    normals: [Vector<S>; 3],
    normal: Vector<S>,
    distance: f64x8<S>,
    weight_error: f64x8<S>,
    sum_error: f64x8<S>,
    distance_error: f64x8<S>,
}

impl<S: Simd> From<S> {
    /// Of eight origins and the corners of eight triangles.
    #[inline(always)]
    fn seen(simd: S, o: Vector<S>, [a, b, c]: [Vector<S>; 3]) -> Self {
        let [of_a, of_b, of_c] = [sub(c, b), sub(a, c), sub(b, a)];
        let [a, b, c] = [sub(a, o), sub(b, o), sub(c, o)];
        let normal = cross(of_b, of_c);
        let (first, size) = (largest(a), largest(of_b).max(largest(of_c)));
        let error = all(simd, DETERMINANT_ERROR);
        let (twice, four) = (all(simd, 2.0), all(simd, 4.0));
        Self {
            normals: [cross(b, of_a), cross(c, of_b), cross(a, of_c)],
            normal,
            distance: dot(a, normal),
            weight_error: error * (four * ((first + size) * size)),
            sum_error: error * (twice * (size * size)),
            distance_error: error * (first * (size * size)),
        }
    }
}

/// Both halves of rows, widened.
#[inline(always)]
fn wide<S: Simd>(simd: S, rows: &[Row; 3]) -> [Vector<S>; 2] {
    let [x, y, z] = rows;
    let (x, y, z) = (
        simd.widen_f32x16(load(simd, x)),
        simd.widen_f32x16(load(simd, y)),
        simd.widen_f32x16(load(simd, z)),
    );
    [[x.0, y.0, z.0], [x.1, y.1, z.1]]
}

#[inline(always)]
fn all<S: Simd>(simd: S, x: f64) -> f64x8<S> {
    f64x8::splat(simd, x)
}

#[inline(always)]
fn vectors<S: Simd>(simd: S, v: [f64; 3]) -> Vector<S> {
    [all(simd, v[0]), all(simd, v[1]), all(simd, v[2])]
}

#[inline(always)]
fn sub<S: Simd>(a: Vector<S>, b: Vector<S>) -> Vector<S> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn largest<S: Simd>(v: Vector<S>) -> f64x8<S> {
    v[0].abs().max(v[1].abs()).max(v[2].abs())
}

#[inline(always)]
fn dot<S: Simd>(a: Vector<S>, b: Vector<S>) -> f64x8<S> {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn cross<S: Simd>(a: Vector<S>, b: Vector<S>) -> Vector<S> {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// The new values of some lanes.
#[inline(always)]
fn keep<S: Simd>(simd: S, lanes: mask32x16<S>, new: f32x16<S>, row: &mut Row) {
    let kept: f32x16<S> = lanes.select(new, load(simd, row));
    kept.store_slice(row);
}

/// Takes the hits of the `open` rays of a row of which f64 is certain that they are nearer than what was
/// known; returns the rays of which it is not certain.
#[inline(always)]
fn take<S: Simd, const R: usize>(
    simd: S,
    tile: &mut Tile<R>,
    (row, open): (usize, u16),
    triangles: [From<S>; 2],
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
    // Certainly too near or too far, whatever the last bit is.
    let open = open & !(tile::bits(late.simd_lt(t_min) | early.simd_gt(best)) & well);
    let certain = hit & well & tile::bits(early.simd_eq(late));
    let nearer = tile::bits(early.simd_lt(best) & early.simd_ge(t_min));
    let taken = open & certain & nearer;
    if taken != 0 {
        // -0.0 becomes 0.0.
        let t = early + splat(simd, 0.0);
        let reach = t * splat(simd, tile.to_frame * PRUNE) + splat(simd, tile.last_place);
        let reach = reach.min(load(simd, &tile.reach[row]));
        let lanes = mask32x16::from_bitmask(simd, u64::from(taken));
        keep(simd, lanes, reach, &mut tile.reach[row]);
        keep(simd, lanes, t, &mut tile.t[row]);
        let u = simd.narrow_f64x8(low.u, high.u);
        keep(simd, lanes, u, &mut tile.u[row]);
        let v = simd.narrow_f64x8(low.v, high.v);
        keep(simd, lanes, v, &mut tile.v[row]);
        let known = u32x16::from_slice(simd, &tile.id[row]);
        let ids: u32x16<S> = lanes.select(ids, known);
        ids.store_slice(&mut tile.id[row]);
    }
    // Uncertain ones, and ties.
    open & !taken
}

/// What f64 knows of eight rays.
struct Half<S: Simd> {
    /// Certainly missed.
    miss: u16,
    /// Certainly hit.
    hit: u16,
    /// The distance certainly lies between the two below.
    well: u16,
    early: f64x8<S>,
    late: f64x8<S>,
    u: f64x8<S>,
    v: f64x8<S>,
}

/// The verdict on eight rays.
#[inline(always)]
fn half<S: Simd>(simd: S, triangle: &From<S>, d: Vector<S>, to_scene: f64x8<S>) -> Half<S> {
    let [a, b, c] = triangle.normals;
    let w = [dot(d, a), dot(d, b), dot(d, c)];
    let (most, least) = (w[0].max(w[1]).max(w[2]), w[0].min(w[1]).min(w[2]));
    let (above, below) = (triangle.weight_error, -triangle.weight_error);
    let miss = most.simd_gt(above) & least.simd_lt(below);
    let hit = least.simd_gt(above) | most.simd_lt(below);
    let sum = dot(d, triangle.normal);
    let epsilon = all(simd, 2.0 * f64::EPSILON);
    let sum_error = triangle.sum_error;
    let well = sum
        .abs()
        .simd_gt((sum_error + triangle.weight_error) * all(simd, FromOrigin::WELL_CONDITIONED));
    let inverse = all(simd, 1.0) / sum;
    let t = triangle.distance * inverse;
    let error = triangle.distance_error + t.abs() * sum_error;
    let slack = error * inverse.abs() * all(simd, 1.0 + 2e-6) + t.abs() * epsilon;
    Half {
        miss: bits(miss),
        hit: bits(hit),
        well: bits(well),
        early: (t - slack) * to_scene,
        late: (t + slack) * to_scene,
        u: w[1] * inverse,
        v: w[2] * inverse,
    }
}

#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "eight lanes")]
fn bits<S: Simd>(mask: mask64x8<S>) -> u16 {
    mask.to_bitmask() as u16 & 0xff
}

const _: () = assert!(Hit::NONE == u32::MAX, "no triangle has a larger number");
