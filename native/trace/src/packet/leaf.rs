// SPDX-License-Identifier: GPL-3.0-or-later
//! The triangles of a leaf against a packet, in f32. Quantities of a triangle alone are computed for eight
//! triangles at once; then each triangle is tested against all rays, one per lane.
//!
//! The test is that of [`halfspace_leaf::candidates`] with its triple products permuted, so that the last factor depends
//! on the triangle only: `n = e2 x e1` gives determinant and distance, `q = s x d` the weights. With `|d| < 2`
//! per component, `|e| <= E`, `|s| <= S`: `n` is off by `8 u E^2` per component, the determinant by `84 u E^2`
//! and the distance by `48 u S E^2`, as in [`halfspace_leaf::lanes`]; `q` by `12 u S`, and the weights, like those from
//! `d x e2` there, by `84 u S E`. The part of a side that is lost below the normal numbers is multiplied by the
//! offset `s` in the distance only, and is less there than the part due to the determinant's error: no hit of a
//! packet lies behind its origin.
//!
//! For rays of a common origin, triangles that the whole fan misses are rejected first, by their products with
//! the box of the directions. Centre and half extent add up to hardly more than 2 per component, so the errors
//! of both parts together are at most twice that for one direction (for the third weight that of
//! [`crate::tile::leaf`]): less than twice the bound of the single test.

use crate::packet::{MOST, Packet, Width, load, store};
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask, f32x8, f32x16, mask32x16};
use halfspace_leaf::Leaf;
use halfspace_leaf::blocks::{Blocks, LANES as WIDE, SPAN};
use halfspace_leaf::candidates::{DET_ERROR, T_ERROR, UNDERFLOW, UV_ERROR};
use halfspace_leaf::eight::{Vector8, abs, corner_and_sides, cross, dot, largest, same, sub};
use halfspace_ray::Ray;
use halfspace_ray::query::{Counters, Query};

/// Eight triangles, one per lane.
struct Seen {
    corner: [[f32; WIDE]; 3],
    e1: [[f32; WIDE]; 3],
    e2: [[f32; WIDE]; 3],
    normal: [[f32; WIDE]; 3],
    det_error: [f32; WIDE],
    /// Three times `det_error`.
    doubt: [f32; WIDE],
    uv_error: [f32; WIDE],
    t_error: [f32; WIDE],
    /// Mask of the triangles that some ray may hit.
    kept: u64,
}

impl Seen {
    const NOTHING: Self = Self {
        corner: [[0.0; WIDE]; 3],
        e1: [[0.0; WIDE]; 3],
        e2: [[0.0; WIDE]; 3],
        normal: [[0.0; WIDE]; 3],
        det_error: [0.0; WIDE],
        doubt: [0.0; WIDE],
        uv_error: [0.0; WIDE],
        t_error: [0.0; WIDE],
        kept: 0,
    };
}

/// Tests `count` triangles of a leaf from block `first` on against the rays of `lanes`, which leave the leaf's
/// cell at `leave`, and offers the candidates to the packet. Compiled once for all trees.
#[inline(never)]
pub fn test<S: Simd, Q: Query, C: Counters, L: Width>(
    simd: S,
    blocks: (&Blocks, &[Ray]),
    leaf: Leaf,
    packet: &mut Packet,
    cell: (u64, &L::Vector<S>),
    counters: &mut [C],
) {
    simd.vectorize(
        #[inline(always)]
        || each::<S, Q, C, L>(simd, blocks, leaf, packet, cell, counters),
    );
}

/// Starts within this distance of the origin are moved to this distance before it. Most rays start at their
/// origin but for rounding; their products with a determinant would be subnormal, which costs some processors a
/// hundred cycles. Derived: the product with any determinant above 1.2e-20 is a normal number.
const BEFORE: f32 = 1e-18;

#[inline(always)]
fn each<S: Simd, Q: Query, C: Counters, L: Width>(
    simd: S,
    (blocks, rays): (&Blocks, &[Ray]),
    Leaf { first, count }: Leaf,
    packet: &mut Packet,
    (mut lanes, leave): (u64, &L::Vector<S>),
    counters: &mut [C],
) {
    let leave = *leave;
    // Count one test per ray and triangle.
    if !C::QUICK {
        let mut left = lanes;
        while left != 0 {
            counters[packet.places[left.trailing_zeros() as usize % MOST]].tests(count);
            left &= left - 1;
        }
    }
    // Load the rays; they stay in registers for the whole leaf.
    let o = [
        load::<S, L>(simd, &packet.o[0]),
        load::<S, L>(simd, &packet.o[1]),
        load::<S, L>(simd, &packet.o[2]),
    ];
    let d = [
        load::<S, L>(simd, &packet.d[0]),
        load::<S, L>(simd, &packet.d[1]),
        load::<S, L>(simd, &packet.d[2]),
    ];
    let start = load::<S, L>(simd, &packet.start);
    let splat = |x: f32| L::Vector::splat(simd, x);
    // Move starts near the origin before it, see [`BEFORE`].
    let start = (start.abs())
        .simd_lt(splat(BEFORE))
        .select(splat(-BEFORE), start);
    let mut reach = load::<S, L>(simd, &packet.reach).min(leave);
    let farthest = match packet.fan {
        Some(_) => farthest::<S, L>(simd, reach, lanes),
        None => f32::INFINITY,
    };
    let mut at = first;
    let mut left = count;
    while left > 0 {
        let n = left.min(WIDE);
        let (block, next) = blocks.block(at, n);
        // Test eight triangles against the box of the fan, if there is one.
        let seen = look(simd, packet, farthest, (block, n));
        let mut kept = seen.kept;
        // Test each remaining triangle against all rays.
        while kept != 0 {
            let lane = kept.trailing_zeros() as usize % WIDE;
            kept &= kept - 1;
            let splat = |x: f32| L::Vector::splat(simd, x);
            // Compute the determinant, the distance's numerator and the two weights.
            let s = [
                o[0] - splat(seen.corner[0][lane]),
                o[1] - splat(seen.corner[1][lane]),
                o[2] - splat(seen.corner[2][lane]),
            ];
            let q = [
                s[1].mul_sub(d[2], s[2] * d[1]),
                s[2].mul_sub(d[0], s[0] * d[2]),
                s[0].mul_sub(d[1], s[1] * d[0]),
            ];
            let [nx, ny, nz] = [
                splat(seen.normal[0][lane]),
                splat(seen.normal[1][lane]),
                splat(seen.normal[2][lane]),
            ];
            let det = d[0].mul_add(nx, d[1].mul_add(ny, d[2] * nz));
            let t = -s[0].mul_add(nx, s[1].mul_add(ny, s[2] * nz));
            let u = q[0].mul_add(
                splat(seen.e2[0][lane]),
                q[1].mul_add(splat(seen.e2[1][lane]), q[2] * splat(seen.e2[2][lane])),
            );
            let v = -q[0].mul_add(
                splat(seen.e1[0][lane]),
                q[1].mul_add(splat(seen.e1[1][lane]), q[2] * splat(seen.e1[2][lane])),
            );
            // Make the determinant positive, then compare without a division.
            let sign = splat(1.0).copysign(det);
            let (det, u, v, t) = (det * sign, u * sign, v * sign, t * sign);
            let least = u.min(v).min(det - u - v);
            let error = splat(seen.uv_error[lane]);
            let doubt = reach
                .abs()
                .mul_add(splat(seen.doubt[lane]), splat(seen.t_error[lane]));
            // Reject hits before the start only if the sign of the determinant is certain.
            let det_error = splat(seen.det_error[lane]);
            let soonest = det.mul_sub(start, splat(seen.t_error[lane]) + start.abs() * det_error);
            let rejected = least.simd_lt(-error)
                | t.simd_gt(det.mul_add(reach, doubt))
                | (t.simd_lt(soonest) & det.simd_gt(det_error));
            let open = !rejected.to_bitmask() & lanes;
            if open == 0 {
                continue;
            }
            let sure = if Q::ANY && !C::QUICK {
                0
            } else {
                open & least.simd_gt(error).to_bitmask()
            };
            // Hand the candidates over, and continue with the shorter reaches.
            let mut rows = [[1.0; MOST]; 2];
            store::<S, L>(t, &mut rows[0]);
            store::<S, L>(det, &mut rows[1]);
            let quotient = [
                f32x16::from_slice(simd, &rows[0]),
                f32x16::splat(simd, seen.t_error[lane]),
                f32x16::from_slice(simd, &rows[1]),
                f32x16::splat(simd, seen.det_error[lane]),
            ];
            let from = at as usize + 1 + lane;
            packet.offer::<S, Q, C>(
                simd,
                (blocks, rays),
                (low(open), low(sure)),
                quotient,
                (blocks.id_at(from, n), from, n),
                counters,
            );
            if Q::ANY {
                lanes &= !u64::from(packet.blocked);
                if lanes == 0 {
                    return;
                }
            } else {
                reach = load::<S, L>(simd, &packet.reach).min(leave);
            }
        }
        at = next;
        left -= n;
    }
}

#[expect(clippy::cast_possible_truncation, reason = "at most 16 lanes")]
fn low(lanes: u64) -> u16 {
    lanes as u16
}

/// Largest `reach` of the rays of `lanes`.
#[inline(always)]
fn farthest<S: Simd, L: Width>(simd: S, reach: L::Vector<S>, lanes: u64) -> f32 {
    let mut rows = [f32::NEG_INFINITY; MOST];
    store::<S, L>(reach, &mut rows);
    let open = mask32x16::from_bitmask(simd, lanes);
    let none = f32x16::splat(simd, f32::NEG_INFINITY);
    let reach: f32x16<S> = open.select(f32x16::from_slice(simd, &rows), none);
    reach.reduce_max()
}

/// Computes for `n` triangles of a block the quantities common to all rays: sides, normals, error bounds, and
/// the mask of triangles that the fan may hit.
#[inline(always)]
fn look<S: Simd>(
    simd: S,
    packet: &Packet,
    farthest: f32,
    (block, n): (&[f32; SPAN], usize),
) -> Seen {
    let splat = |x: f32| f32x8::splat(simd, x);
    let [a, e1, e2] = corner_and_sides(simd, block, n);
    let normal = cross(e2, e1);
    let [low, high] = packet.origins;
    let (low, high) = (sub(same(simd, low), a), sub(same(simd, high), a));
    let size = largest(e1).max(largest(e2));
    let span = largest(low).max(largest(high));
    // A term of zero unless some product may have overflowed, then NaN: NaN bounds reject nothing.
    let product = splat(64.0) * span * size * size.max(splat(1.0));
    let floor = product.mul_add(splat(0.0), splat(UNDERFLOW));
    let det_error = size.mul_add(size * splat(DET_ERROR), splat(UNDERFLOW));
    let uv_error = size.mul_add(
        span * splat(2.0 * UV_ERROR),
        det_error.mul_add(splat(3.0), floor),
    );
    let t_error = (size * size).mul_add(span * splat(T_ERROR), floor);

    let mut kept = (1 << n) - 1;
    if let Some(fan) = packet.fan {
        let errors = [det_error, uv_error, t_error];
        kept &= !beside(simd, (low, fan, farthest), [e1, e2, normal], errors);
        if kept == 0 {
            return Seen::NOTHING;
        }
    }
    // Store the eight triangles as rows, to be read one lane at a time.
    let mut seen = Seen {
        kept,
        ..Seen::NOTHING
    };
    for k in 0..3 {
        a[k].store_slice(&mut seen.corner[k]);
        e1[k].store_slice(&mut seen.e1[k]);
        e2[k].store_slice(&mut seen.e2[k]);
        normal[k].store_slice(&mut seen.normal[k]);
    }
    det_error.store_slice(&mut seen.det_error);
    (det_error * splat(3.0)).store_slice(&mut seen.doubt);
    uv_error.store_slice(&mut seen.uv_error);
    t_error.store_slice(&mut seen.t_error);
    seen
}

/// Mask of the triangles that all rays of a fan miss. The rays start at offset `s` from the first corners, have
/// directions in the box `(d, turn)` (centre, half extent) and end at `farthest`.
///
/// A product with any direction of the box lies within its product with `turn` of that with `d`; if all rays
/// see the triangle from one side, the sign of the determinant is known.
#[inline(always)]
fn beside<S: Simd>(
    simd: S,
    (s, [d, turn], farthest): (Vector8<S>, [[f32; 3]; 2], f32),
    [e1, e2, normal]: [Vector8<S>; 3],
    [det_error, uv_error, t_error]: [f32x8<S>; 3],
) -> u64 {
    let two = f32x8::splat(simd, 2.0);
    let (d, turn) = (same(simd, d), same(simd, turn));
    // The range of the determinant over the box: `det` plus or minus `det_half`.
    let det = dot(normal, d);
    let det_half = dot(abs(normal), turn);
    let side = f32x8::splat(simd, 1.0).copysign(det);
    let det = det.abs();
    let one_sided = (det - det_half).simd_gt(det_error * two);
    // Bound the largest value of each weight over the box; reject if one is negative for all rays.
    let (of_u, of_v) = (cross(e2, s), cross(s, e1));
    let of_w = sub(sub(normal, of_u), of_v);
    let u = dot(of_u, d).mul_add(side, dot(abs(of_u), turn));
    let v = dot(of_v, d).mul_add(side, dot(abs(of_v), turn));
    let w = dot(of_w, d).mul_add(side, dot(abs(of_w), turn));
    let outside = u.min(v).min(w).simd_lt(-(uv_error * two));
    // Reject triangles beyond the farthest ray's end, or behind the common origin.
    let height = dot(normal, s) * -side;
    let room = t_error * two;
    let far = f32x8::splat(simd, farthest);
    let doubt = far.abs().mul_add(det_error * f32x8::splat(simd, 3.0), room);
    let beyond = height.simd_gt((det + det_half).mul_add(far, doubt)) | height.simd_lt(-room);
    (one_sided & (outside | beyond)).to_bitmask()
}
