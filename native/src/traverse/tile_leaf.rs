// SPDX-License-Identifier: GPL-3.0-or-later
//! The triangles of a leaf against a tile of rays: first eight triangles at a time against the pyramid
//! that holds the rays, then each that is left against sixteen rays at a time, in f32; what f32
//! cannot rule out goes to the verdict, in f64 for sixteen rays at a time where that is certain.
//!
//! The f32 test and its bounds are those of [`super::lanes`]: with a common origin each quantity is a
//! dot product of the direction with a vector that depends on the triangle alone. If such a product is
//! negative for four directions, it is for all directions between them.

use super::blocks::{Blocks, DET_ERROR, LANES as WIDE, SPAN, T_ERROR, UNDERFLOW, UV_ERROR};
use super::frame::PRUNE;
use super::query::Counters;
use super::ray::{Hit, Ray};
use super::tile::{LANES, Row, Tile, bits, load, splat};
use crate::geom::verdict::FromOrigin;
use fearless_simd::{
    Select, Simd, SimdBase, SimdFloat, SimdMask, f32x8, f32x16, f64x8, mask32x16, mask64x8,
};

/// Eight triangles as seen from the origin of a tile, one number a lane.
struct Seen {
    det: [[f32; WIDE]; 3],
    u: [[f32; WIDE]; 3],
    v: [[f32; WIDE]; 3],
    t: [f32; WIDE],
    det_error: [f32; WIDE],
    uv_error: [f32; WIDE],
    t_error: [f32; WIDE],
    /// Those that some ray of the tile may hit.
    kept: u64,
}

/// Tests the tile against the leaf of `count` triangles that begins at `first`, in whose cell the rays
/// are between `enter` and `leave`. Returns how many triangles the pyramid let through. What is tested
/// is charged to the tile's first ray.
// Vectors in closures are slow: a closure does not have the instruction set of the function around it
// unless the compiler happens to inline it. So there are none here.
#[inline(always)]
pub fn test<S: Simd, C: Counters, const R: usize>(
    simd: S,
    blocks: &Blocks,
    (first, count): (u32, usize),
    ends: (f32, f32),
    (tile, rays): (&mut Tile<R>, &[Ray]),
    counters: &mut [C],
) -> usize {
    counters[0].tests(count);
    let mut kept = 0;
    let mut at = first;
    let mut left = count;
    while left > 0 {
        let n = left.min(WIDE);
        let (block, next) = blocks.block(at, n);
        let seen = look(simd, tile, block, n);
        let mut open = seen.kept;
        kept += open.count_ones() as usize;
        while open != 0 {
            let lane = open.trailing_zeros() as usize % WIDE;
            open &= open - 1;
            one(
                simd,
                (&seen, lane),
                (block, n),
                ends,
                (tile, rays),
                counters,
            );
        }
        at = next;
        left -= n;
    }
    tile.far = tile.row_reach[0];
    for reach in &tile.row_reach[1..] {
        tile.far = tile.far.max(*reach);
    }
    kept
}

type Vector8<S> = [f32x8<S>; 3];
type Vector16<S> = [f32x16<S>; 3];

#[inline(always)]
fn splat8<S: Simd>(simd: S, x: f32) -> f32x8<S> {
    f32x8::splat(simd, x)
}

#[inline(always)]
fn load8<S: Simd>(simd: S, block: &[f32; SPAN], n: usize, row: usize) -> f32x8<S> {
    f32x8::from_slice(simd, &block[1 + row * n..1 + row * n + WIDE])
}

#[inline(always)]
fn point8<S: Simd>(simd: S, block: &[f32; SPAN], n: usize, row: usize) -> Vector8<S> {
    [
        load8(simd, block, n, row),
        load8(simd, block, n, row + 1),
        load8(simd, block, n, row + 2),
    ]
}

#[inline(always)]
fn sub8<S: Simd>(a: Vector8<S>, b: Vector8<S>) -> Vector8<S> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn largest8<S: Simd>(v: Vector8<S>) -> f32x8<S> {
    v[0].abs().max(v[1].abs()).max(v[2].abs())
}

#[inline(always)]
fn cross8<S: Simd>(a: Vector8<S>, b: Vector8<S>) -> Vector8<S> {
    [
        a[1].mul_sub(b[2], a[2] * b[1]),
        a[2].mul_sub(b[0], a[0] * b[2]),
        a[0].mul_sub(b[1], a[1] * b[0]),
    ]
}

#[inline(always)]
fn dot8<S: Simd>(a: Vector8<S>, d: Vector8<S>) -> f32x8<S> {
    d[0].mul_add(a[0], d[1].mul_add(a[1], d[2] * a[2]))
}

#[inline(always)]
fn dot16<S: Simd>(a: Vector16<S>, d: Vector16<S>) -> f32x16<S> {
    d[0].mul_add(a[0], d[1].mul_add(a[1], d[2] * a[2]))
}

/// Eight triangles against the pyramid.
#[inline(always)]
fn look<S: Simd, const R: usize>(simd: S, tile: &Tile<R>, block: &[f32; SPAN], n: usize) -> Seen {
    let a = point8(simd, block, n, 0);
    let e1 = sub8(point8(simd, block, n, 3), a);
    let e2 = sub8(point8(simd, block, n, 6), a);
    let [x, y, z] = tile.o;
    let s = sub8([splat8(simd, x), splat8(simd, y), splat8(simd, z)], a);
    let size = largest8(e1).max(largest8(e2));
    let span = largest8(s);
    // Zero, or NaN where some product may have overflowed: NaN bounds reject nothing.
    let product = splat8(simd, 64.0) * span * size * size.max(splat8(simd, 1.0));
    let floor = product.mul_add(splat8(simd, 0.0), splat8(simd, UNDERFLOW));
    let det_error = size.mul_add(size * splat8(simd, DET_ERROR), splat8(simd, UNDERFLOW));
    let uv_error = size.mul_add(
        span * splat8(simd, 2.0 * UV_ERROR),
        det_error.mul_add(splat8(simd, 3.0), floor),
    );
    let t_error = (size * size).mul_add(span * splat8(simd, T_ERROR), floor);
    let (det, u, v) = (cross8(e2, e1), cross8(e2, s), cross8(s, e1));
    let t = dot8(e2, v);
    let mut kept = (1_u64 << n) - 1;
    if let Some(corners) = &tile.corners {
        let (most, least) = (splat8(simd, f32::INFINITY), splat8(simd, f32::NEG_INFINITY));
        let (mut u_low, mut v_low, mut w_low) = (most, most, most);
        let (mut u_high, mut v_high, mut w_high) = (least, least, least);
        for &[x, y, z] in corners {
            let d = [splat8(simd, x), splat8(simd, y), splat8(simd, z)];
            let (u, v) = (dot8(u, d), dot8(v, d));
            let w = dot8(det, d) - u - v;
            (u_low, v_low, w_low) = (u_low.min(u), v_low.min(v), w_low.min(w));
            (u_high, v_high, w_high) = (u_high.max(u), v_high.max(v), w_high.max(w));
        }
        // No ray has three weights above zero, and none has three below.
        let outside = u_high.min(v_high).min(w_high).simd_lt(-uv_error)
            & u_low.max(v_low).max(w_low).simd_gt(uv_error);
        kept &= !outside.to_bitmask();
    }
    let mut seen = Seen {
        det: [[0.0; WIDE]; 3],
        u: [[0.0; WIDE]; 3],
        v: [[0.0; WIDE]; 3],
        t: [0.0; WIDE],
        det_error: [0.0; WIDE],
        uv_error: [0.0; WIDE],
        t_error: [0.0; WIDE],
        kept,
    };
    if kept != 0 {
        for k in 0..3 {
            det[k].store_slice(&mut seen.det[k]);
            u[k].store_slice(&mut seen.u[k]);
            v[k].store_slice(&mut seen.v[k]);
        }
        t.store_slice(&mut seen.t);
        det_error.store_slice(&mut seen.det_error);
        uv_error.store_slice(&mut seen.uv_error);
        t_error.store_slice(&mut seen.t_error);
    }
    seen
}

#[inline(always)]
fn pick<S: Simd>(simd: S, rows: &[[f32; WIDE]; 3], lane: usize) -> Vector16<S> {
    [
        splat(simd, rows[0][lane]),
        splat(simd, rows[1][lane]),
        splat(simd, rows[2][lane]),
    ]
}

/// One triangle against all rows.
#[inline(always)]
fn one<S: Simd, C: Counters, const R: usize>(
    simd: S,
    (seen, lane): (&Seen, usize),
    (block, n): (&[f32; SPAN], usize),
    (enter, leave): (f32, f32),
    (tile, rays): (&mut Tile<R>, &[Ray]),
    counters: &mut [C],
) {
    let of_det = pick(simd, &seen.det, lane);
    let of_u = pick(simd, &seen.u, lane);
    let of_v = pick(simd, &seen.v, lane);
    let t = splat(simd, seen.t[lane]);
    let below = splat(simd, -seen.uv_error[lane]);
    let det_error = splat(simd, 3.0 * seen.det_error[lane]);
    let t_error = splat(simd, seen.t_error[lane]);
    let mut exact: Option<FromOrigin> = None;
    for row in 0..R {
        // Rays that have hit something nearer, or have ended.
        if tile.row_reach[row] < enter {
            continue;
        }
        let [x, y, z] = &tile.d[row];
        let d = [load(simd, x), load(simd, y), load(simd, z)];
        let (det, u, v) = (dot16(of_det, d), dot16(of_u, d), dot16(of_v, d));
        let sign = splat(simd, 1.0).copysign(det);
        let (det, u, v, t) = (det * sign, u * sign, v * sign, t * sign);
        let least = u.min(v).min(det - u - v);
        let reach = load(simd, &tile.reach[row]).min(splat(simd, leave));
        let doubt = reach.abs().mul_add(det_error, t_error);
        let rejected = least.simd_lt(below) | t.simd_gt(det.mul_add(reach, doubt));
        let mut open = !bits(rejected) & tile.active[row];
        if open == 0 {
            continue;
        }
        // A triangle that reaches into several leaves is met again in each.
        let id = block[1 + 9 * n + lane].to_bits();
        for lane in 0..LANES {
            open &= !(u16::from(tile.id[row][lane] == id) << lane);
        }
        if open == 0 {
            continue;
        }
        let corner = |r: usize| {
            let at = 1 + r * n + lane;
            [block[at], block[at + n], block[at + 2 * n]]
        };
        let corners = [corner(0), corner(3), corner(6)];
        if exact.is_none() {
            exact = Some(FromOrigin::new(tile.o, corners));
        }
        let mut doubtful = match &exact {
            Some(exact) => verdicts(simd, exact, (id, row, open), tile),
            None => open,
        };
        while doubtful != 0 {
            let lane = doubtful.trailing_zeros() as usize % LANES;
            doubtful &= doubtful - 1;
            tile.offer(&rays[row * LANES + lane], (row, lane), (id, corners));
        }
        for i in 0..LANES {
            if open >> i & 1 == 1 {
                counters[row * LANES + i].verdict();
            }
        }
        tile.row_reach[row] = load(simd, &tile.reach[row]).reduce_max();
    }
}

/// The new values of some lanes.
#[inline(always)]
fn keep<S: Simd>(simd: S, lanes: u16, new: f32x16<S>, row: &mut Row) {
    let lanes = mask32x16::from_bitmask(simd, u64::from(lanes));
    let kept: f32x16<S> = lanes.select(new, load(simd, row));
    kept.store_slice(row);
}

/// The verdicts of the `open` rays of a row, as far as f64 is certain of them; returns the others.
#[inline(always)]
fn verdicts<S: Simd, const R: usize>(
    simd: S,
    triangle: &FromOrigin,
    (id, row, open): (u32, usize, u16),
    tile: &mut Tile<R>,
) -> u16 {
    let [x, y, z] = &tile.d[row];
    let (x, y, z) = (
        simd.widen_f32x16(load(simd, x)),
        simd.widen_f32x16(load(simd, y)),
        simd.widen_f32x16(load(simd, z)),
    );
    let to_scene = 1.0 / f64::from(tile.to_frame);
    let low = half(simd, triangle, [x.0, y.0, z.0], to_scene);
    let high = half(simd, triangle, [x.1, y.1, z.1], to_scene);
    let open = open & !(low.miss | high.miss << 8);
    if open == 0 {
        return 0;
    }
    let (hit, well) = (low.hit | high.hit << 8, low.well | high.well << 8);
    let early = simd.narrow_f64x8(low.early, high.early);
    let late = simd.narrow_f64x8(low.late, high.late);
    let t_min = load(simd, &tile.t_min[row]);
    let best = load(simd, &tile.t[row]);
    // Certainly too near or too far, whatever the last bit is.
    let open = open & !(bits(late.simd_lt(t_min) | early.simd_gt(best)) & well);
    let certain = hit & well & bits(early.simd_eq(late));
    let nearer = bits(early.simd_lt(best) & early.simd_ge(t_min));
    let taken = open & certain & nearer;
    if taken != 0 {
        // -0.0 becomes 0.0.
        let t = early + splat(simd, 0.0);
        let reach = t * splat(simd, tile.to_frame * PRUNE) + splat(simd, tile.last_place);
        let reach = reach.min(load(simd, &tile.reach[row]));
        keep(simd, taken, reach, &mut tile.reach[row]);
        keep(simd, taken, t, &mut tile.t[row]);
        keep(
            simd,
            taken,
            simd.narrow_f64x8(low.u, high.u),
            &mut tile.u[row],
        );
        keep(
            simd,
            taken,
            simd.narrow_f64x8(low.v, high.v),
            &mut tile.v[row],
        );
        for lane in 0..LANES {
            if taken >> lane & 1 == 1 {
                tile.id[row][lane] = id;
            }
        }
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

#[inline(always)]
fn splat64<S: Simd>(simd: S, x: f64) -> f64x8<S> {
    f64x8::splat(simd, x)
}

#[inline(always)]
fn weight<S: Simd>(simd: S, normal: [f64; 3], d: [f64x8<S>; 3]) -> f64x8<S> {
    d[0] * splat64(simd, normal[0])
        + d[1] * splat64(simd, normal[1])
        + d[2] * splat64(simd, normal[2])
}

/// The verdict's own arithmetic, operation by operation, with error bounds at least as large.
#[inline(always)]
fn half<S: Simd>(simd: S, triangle: &FromOrigin, d: [f64x8<S>; 3], to_scene: f64) -> Half<S> {
    let [a, b, c] = triangle.normals;
    let w = [weight(simd, a, d), weight(simd, b, d), weight(simd, c, d)];
    let [a, b, c] = triangle.errors;
    let sums = a + b + c;
    let (above_a, below_a) = (
        w[0].simd_gt(splat64(simd, a)),
        w[0].simd_lt(splat64(simd, -a)),
    );
    let (above_b, below_b) = (
        w[1].simd_gt(splat64(simd, b)),
        w[1].simd_lt(splat64(simd, -b)),
    );
    let (above_c, below_c) = (
        w[2].simd_gt(splat64(simd, c)),
        w[2].simd_lt(splat64(simd, -c)),
    );
    let miss = (above_a | above_b | above_c) & (below_a | below_b | below_c);
    let hit = (above_a & above_b & above_c) | (below_a & below_b & below_c);
    let sum = w[0] + w[1] + w[2];
    let epsilon = splat64(simd, 2.0 * f64::EPSILON);
    let sum_error = sum.abs() * epsilon + splat64(simd, sums);
    let well = sum
        .abs()
        .simd_gt(sum_error * splat64(simd, FromOrigin::WELL_CONDITIONED));
    let inverse = splat64(simd, 1.0) / sum;
    let t = splat64(simd, triangle.distance.0) * inverse;
    let error = splat64(simd, triangle.distance.1) + t.abs() * sum_error;
    let slack = error * inverse.abs() * splat64(simd, 1.0 + 2e-6) + t.abs() * epsilon;
    Half {
        miss: bits8(miss),
        hit: bits8(hit),
        well: bits8(well),
        early: (t - slack) * splat64(simd, to_scene),
        late: (t + slack) * splat64(simd, to_scene),
        u: w[1] * inverse,
        v: w[2] * inverse,
    }
}

#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "eight lanes")]
fn bits8<S: Simd>(mask: mask64x8<S>) -> u16 {
    mask.to_bitmask() as u16 & 0xff
}

const _: () = assert!(Hit::NONE == u32::MAX, "no triangle has a larger number");
