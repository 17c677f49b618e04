// SPDX-License-Identifier: GPL-3.0-or-later
//! The triangles of a leaf against a tile of rays, in three steps: eight triangles at a time against the
//! pyramid that contains the rays, each remaining triangle against the parts of the pyramid that contain its
//! rows, then against the sixteen rays of each remaining row, in f32. Candidates that f32 cannot rule out are
//! handed to a [`Judge`].
//!
//! The f32 test and its bounds are those of [`halfspace_leaf::lanes`]: with a common origin each quantity is a dot
//! product of the direction with a vector that depends on the triangle alone. If such a product is negative for
//! four directions, it is negative for all directions between them. Only hits ahead of the origin count, so the
//! side of the triangle on which the origin lies gives the common sign of all weights of a hit; both signs are
//! tried only if that side is uncertain. The part of a side that is lost below the normal numbers is nowhere
//! multiplied by the offset, since a weight is one product of both.
//!
//! Errors beyond those of the single test, where products and sums round one by one: the third weight, whose
//! vector is the sum of the other two and the determinant's, is off by `22 u S E + 12 u E^2` per component,
//! which times a direction makes `132 u S E + 72 u E^2`, and the dot product adds `64 u S E + 32 u E^2`; its
//! bound is `208 u S E + 288 u E^2`. A product in a row's part of the pyramid is combined from those with three
//! corners, with factors of 3 in all, which makes `588 u S E + 312 u E^2`, and the roundings of two sides and
//! of eight products and sums add `744 u S E + 372 u E^2`. Eight times the bound of the single test covers
//! that.
//!
//! If the lines of the rays pass the common origin at a distance of up to a blur `B`, which turns their
//! directions by up to `b` in the frame, offsets are off by `B` and directions by `b` per component:
//! determinants by `6 b E^2`, weights by `6 b S E + 12 B E`, the third by twice that and `6 b E^2`, and the
//! product that gives the distance by `6 B E^2`. The bounds are a little larger, to cover the product of both.

use crate::tile::{Tile, bits, load, splat};
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask, f32x4, f32x8, f32x16, mask32x4};
use halfspace_leaf::Leaf;
use halfspace_leaf::blocks::{Blocks, LANES as WIDE, SPAN};
use halfspace_leaf::candidates::{DET_ERROR, T_ERROR, UNDERFLOW, UV_ERROR};
use halfspace_leaf::eight::{corner_and_sides, cross, dot, largest, same, sub};
use halfspace_ray::Ray;
use halfspace_ray::query::Counters;

/// A dot product at the corners of the pyramid, one triangle per lane: at the first corner, and its differences
/// along the two sides that begin there.
#[derive(Clone, Copy)]
struct Corners {
    first: [f32; WIDE],
    sides: [[f32; WIDE]; 2],
}

/// Eight triangles relative to the origin of a tile, one per lane.
struct Seen {
    /// Vectors whose dot product with a direction is the determinant.
    det: [[f32; WIDE]; 3],
    /// Vectors whose dot products with a direction are the weights of the three vertices.
    weights: [[[f32; WIDE]; 3]; 3],
    /// Numerators of the distances, positive, and the error bounds of the single test.
    t: [f32; WIDE],
    det_error: [f32; WIDE],
    uv_error: [f32; WIDE],
    t_error: [f32; WIDE],
    /// Error bounds for products over a row's part of the pyramid.
    det_row_error: [f32; WIDE],
    uv_row_error: [f32; WIDE],
    /// The weights and the determinant at the corners of the pyramid.
    at: [Corners; 4],
    /// Mask of the triangles that some ray of the tile may hit.
    kept: u64,
    /// Mask of the triangles of which the origin's side is uncertain.
    edgewise: u64,
}

/// The rays of a row that may hit a triangle.
pub struct Candidate<S: Simd> {
    /// The row.
    pub row: usize,
    /// Mask of these rays.
    pub open: u16,
    /// Mask of those whose lines certainly pass through the triangle.
    pub sure: u16,
    /// The distance in the frame: numerator, its error bound, denominator, its error bound. Undefined if no ray
    /// is in `sure`.
    pub distance: [f32x16<S>; 4],
    /// The triangle's number.
    pub id: u32,
    /// Position of its first word in the blocks, and the distance between its words.
    pub words: (usize, usize),
}

/// Decides candidates, depending on the query.
pub trait Judge<const R: usize> {
    /// Work per ray after which a tile is continued in packets: one unit per triangle kept, four per leaf.
    const BUDGET: usize;

    /// Number of tiles out of 16 that must finish for tiles to be worth trying.
    const WORTH: u32;

    /// Decides a candidate and updates the tile's hits and `tile.reach`.
    fn judge<S: Simd, C: Counters>(
        &mut self,
        simd: S,
        blocks: &Blocks,
        tile: (&mut Tile<R>, &[Ray]),
        candidate: &Candidate<S>,
        counters: &mut [C],
    );

    /// Called before the traversal changes to other blocks: decides all that refers to positions in these.
    #[inline(always)]
    fn leave<S: Simd, C: Counters>(
        &mut self,
        simd: S,
        blocks: &Blocks,
        tile: (&mut Tile<R>, &[Ray]),
        counters: &mut [C],
    ) {
        let _ = (simd, blocks, tile, counters);
    }
}

/// Factor between the error bound of the single test and that for rows; derived above.
const ROW_ERROR: f32 = 8.0;

/// Tests the tile against the leaf of `count` triangles from block `first` on, in whose cell the rays are
/// between `enter` and `leave`. Returns the number of triangles that the pyramid test kept; tests are counted
/// for the tile's first ray. Compiled once for all trees.
#[inline(never)]
pub fn test<S: Simd, C: Counters, J: Judge<R>, const R: usize>(
    simd: S,
    blocks: &Blocks,
    leaf: Leaf,
    ends: (f32, f32),
    tile: (&mut Tile<R>, &[Ray], &mut J),
    counters: &mut [C],
) -> usize {
    simd.vectorize(
        #[inline(always)]
        || each(simd, blocks, leaf, ends, tile, counters),
    )
}

// No closures with vectors in these functions: unless inlined, a closure is not compiled for the caller's
// instruction set and is slow.
#[inline(always)]
fn each<S: Simd, C: Counters, const R: usize>(
    simd: S,
    blocks: &Blocks,
    Leaf { first, count }: Leaf,
    ends: (f32, f32),
    (tile, rays, judge): (&mut Tile<R>, &[Ray], &mut impl Judge<R>),
    counters: &mut [C],
) -> usize {
    counters[0].tests(count);
    let mut kept = 0;
    let mut at = first;
    let mut left = count;
    while left > 0 {
        let n = left.min(WIDE);
        let (block, next) = blocks.block(at, n);
        // Test eight triangles against the pyramid, then each remaining one against the rows.
        let seen = look(simd, tile, ends.1, (block, n));
        let mut open = seen.kept;
        kept += open.count_ones() as usize;
        while open != 0 {
            let lane = open.trailing_zeros() as usize % WIDE;
            open &= open - 1;
            one(
                simd,
                (&seen, lane),
                (blocks, at as usize + 1, n),
                ends,
                (&mut *tile, rays, &mut *judge),
                counters,
            );
        }
        at = next;
        left -= n;
    }
    // Update the farthest reach of the tile.
    tile.far = tile.row_reach[0];
    for reach in &tile.row_reach[1..] {
        tile.far = tile.far.max(*reach);
    }
    kept
}

type Vector16<S> = [f32x16<S>; 3];

#[inline(always)]
fn splat8<S: Simd>(simd: S, x: f32) -> f32x8<S> {
    f32x8::splat(simd, x)
}

#[inline(always)]
fn dot16<S: Simd>(a: Vector16<S>, d: Vector16<S>) -> f32x16<S> {
    d[0].mul_add(a[0], d[1].mul_add(a[1], d[2] * a[2]))
}

/// Tests eight triangles against the pyramid, and computes what the tests of rows and rays need of them.
#[inline(always)]
fn look<S: Simd, const R: usize>(
    simd: S,
    tile: &Tile<R>,
    leave: f32,
    (block, n): (&[f32; SPAN], usize),
) -> Seen {
    let [a, e1, e2] = corner_and_sides(simd, block, n);
    let s = sub(same(simd, tile.o), a);
    let size = largest(e1).max(largest(e2));
    let span = largest(s);
    // A term of zero unless some product may have overflowed, then NaN: NaN bounds reject nothing.
    let product = splat8(simd, 64.0) * span * size * size.max(splat8(simd, 1.0));
    let floor = product.mul_add(splat8(simd, 0.0), splat8(simd, UNDERFLOW));
    let [blur, turn] = tile.blur;
    // The part of the bounds due to the blur, which does not grow when products are combined.
    let det_blur = size * size * splat8(simd, 7.0 * turn);
    let uv_blur = size * span.mul_add(splat8(simd, 14.0 * turn), splat8(simd, 30.0 * blur))
        + det_blur * splat8(simd, 3.0);
    // The bounds of the single test, with the terms of the blur.
    let det_error = size.mul_add(
        size * splat8(simd, 7.0f32.mul_add(turn, DET_ERROR)),
        splat8(simd, UNDERFLOW),
    );
    let uv_error = size.mul_add(
        span.mul_add(
            splat8(simd, 14.0f32.mul_add(turn, 2.0 * UV_ERROR)),
            splat8(simd, 30.0 * blur),
        ),
        det_error.mul_add(splat8(simd, 3.0), floor),
    );
    let t_error = (size * size).mul_add(
        span.mul_add(splat8(simd, T_ERROR), splat8(simd, 7.0 * blur)),
        floor,
    );
    let (det, u, v) = (cross(e2, e1), cross(e2, s), cross(s, e1));
    let t = dot(e2, v);
    // Orient all vectors so that the determinant of a hit is positive.
    let side = splat8(simd, 1.0).copysign(t);
    let t = t * side;
    let edgewise = !t.simd_gt(t_error).to_bitmask();
    let det = [det[0] * side, det[1] * side, det[2] * side];
    let u = [u[0] * side, u[1] * side, u[2] * side];
    let v = [v[0] * side, v[1] * side, v[2] * side];
    let w = sub(sub(det, u), v);
    let blank = Corners {
        first: [0.0; WIDE],
        sides: [[0.0; WIDE]; 2],
    };
    let mut seen = Seen {
        det: [[0.0; WIDE]; 3],
        weights: [[[0.0; WIDE]; 3]; 3],
        t: [0.0; WIDE],
        det_error: [0.0; WIDE],
        uv_error: [0.0; WIDE],
        t_error: [0.0; WIDE],
        det_row_error: [0.0; WIDE],
        uv_row_error: [0.0; WIDE],
        at: [blank; 4],
        kept: (1_u64 << n) - 1,
        edgewise,
    };
    let rows_of = splat8(simd, ROW_ERROR);
    let det_row_error = det_blur + (det_error - det_blur) * rows_of;
    let uv_row_error = uv_blur + (uv_error - uv_blur) * rows_of;
    // Reject triangles with a weight that is negative at all corners, or that lie beyond the farthest ray.
    if let Some(pyramid) = &tile.pyramid {
        let below = -uv_error;
        let mut outside = 0;
        for (i, of) in [u, v, w, det].into_iter().enumerate() {
            let [a, b, c, d] = &pyramid.corners;
            let a = dot(of, same(simd, *a));
            let b = dot(of, same(simd, *b));
            let c = dot(of, same(simd, *c));
            let d = dot(of, same(simd, *d));
            let most = a.max(b).max(c.max(d));
            if i < 3 {
                outside |= most.simd_lt(below).to_bitmask();
            } else {
                let far = splat8(simd, tile.stretched(pyramid, leave));
                let doubt = far.abs() * det_row_error + t_error;
                outside |= t.simd_gt(most.mul_add(far, doubt)).to_bitmask();
            }
            a.store_slice(&mut seen.at[i].first);
            (b - a).store_slice(&mut seen.at[i].sides[0]);
            (c - a).store_slice(&mut seen.at[i].sides[1]);
        }
        seen.kept &= !(outside & !edgewise);
    }
    // Store the eight triangles as rows, to be read one lane at a time.
    if seen.kept != 0 {
        for k in 0..3 {
            det[k].store_slice(&mut seen.det[k]);
            u[k].store_slice(&mut seen.weights[0][k]);
            v[k].store_slice(&mut seen.weights[1][k]);
            w[k].store_slice(&mut seen.weights[2][k]);
        }
        t.store_slice(&mut seen.t);
        det_error.store_slice(&mut seen.det_error);
        uv_error.store_slice(&mut seen.uv_error);
        det_row_error.store_slice(&mut seen.det_row_error);
        uv_row_error.store_slice(&mut seen.uv_row_error);
        t_error.store_slice(&mut seen.t_error);
    }
    seen
}

/// Loads a vector of one triangle into all lanes.
#[inline(always)]
fn pick<S: Simd>(simd: S, rows: &[[f32; WIDE]; 3], lane: usize) -> Vector16<S> {
    [
        splat(simd, rows[0][lane]),
        splat(simd, rows[1][lane]),
        splat(simd, rows[2][lane]),
    ]
}

/// Mask of the rows that may hit this triangle, four rows at a time.
#[inline(always)]
fn rows<S: Simd, const R: usize>(
    simd: S,
    (seen, lane): (&Seen, usize),
    (enter, leave): (f32, f32),
    tile: &Tile<R>,
) -> u32 {
    let mut open = 0;
    let all = |x: f32| f32x4::splat(simd, x);
    let below = all(-seen.uv_row_error[lane]);
    let det_error = all(seen.det_row_error[lane]);
    let (t, t_error) = (all(seen.t[lane]), all(seen.t_error[lane]));
    for first in (0..R).step_by(4) {
        let reach = f32x4::from_slice(simd, &tile.row_reach[first..first + 4]);
        // Skip rows whose rays all end before the leaf.
        let mut out = reach.simd_lt(all(enter));
        if let Some(pyramid) = &tile.pyramid
            && seen.edgewise >> lane & 1 == 0
        {
            // Reject by the largest weights and determinant over each row's part of the pyramid.
            let [a, b] = &pyramid.middle;
            let a = f32x4::from_slice(simd, &a[first..first + 4]);
            let b = f32x4::from_slice(simd, &b[first..first + 4]);
            let [c, d] = &pyramid.half;
            let c = f32x4::from_slice(simd, &c[first..first + 4]);
            let d = f32x4::from_slice(simd, &d[first..first + 4]);
            let u = most(simd, &seen.at[0], lane, [a, b, c, d]);
            let v = most(simd, &seen.at[1], lane, [a, b, c, d]);
            let w = most(simd, &seen.at[2], lane, [a, b, c, d]);
            out |= u.min(v).min(w).simd_lt(below);
            let det = most(simd, &seen.at[3], lane, [a, b, c, d]);
            let depth =
                reach.min(all(leave)) * f32x4::from_slice(simd, &pyramid.stretch[first..first + 4]);
            out |= t.simd_gt(det.mul_add(depth, depth.abs().mul_add(det_error, t_error)));
        }
        #[expect(clippy::cast_possible_truncation, reason = "four lanes")]
        let inside = !out.to_bitmask() as u32 & 0xf;
        open |= inside << first;
    }
    open
}

/// Largest value of a product over the parts of the pyramid with these centres and half extents.
#[inline(always)]
fn most<S: Simd>(simd: S, at: &Corners, lane: usize, [a, b, c, d]: [f32x4<S>; 4]) -> f32x4<S> {
    let [g, h] = [at.sides[0][lane], at.sides[1][lane]];
    let first = f32x4::splat(simd, at.first[lane]);
    let middle = a.mul_add(
        f32x4::splat(simd, g),
        b.mul_add(f32x4::splat(simd, h), first),
    );
    let (g, h) = (f32x4::splat(simd, g.abs()), f32x4::splat(simd, h.abs()));
    c.mul_add(g, d.mul_add(h, middle))
}

/// Tests one triangle against all rays; its words begin at `from + lane` and are `n` apart.
#[inline(always)]
fn one<S: Simd, C: Counters, const R: usize>(
    simd: S,
    (seen, lane): (&Seen, usize),
    (blocks, from, n): (&Blocks, usize, usize),
    (enter, leave): (f32, f32),
    (tile, rays, judge): (&mut Tile<R>, &[Ray], &mut impl Judge<R>),
    counters: &mut [C],
) {
    let mut left = rows(simd, (seen, lane), (enter, leave), tile);
    if left == 0 {
        return;
    }
    let [of_u, of_v, of_w] = [
        pick(simd, &seen.weights[0], lane),
        pick(simd, &seen.weights[1], lane),
        pick(simd, &seen.weights[2], lane),
    ];
    let of_det = pick(simd, &seen.det, lane);
    let t = splat(simd, seen.t[lane]);
    let error = splat(simd, seen.uv_error[lane]);
    let det_error = splat(simd, seen.det_error[lane]);
    let t_error = splat(simd, seen.t_error[lane]);
    let id = blocks.id_at(from + lane, n);
    let edgewise = seen.edgewise >> lane & 1 == 1;
    while left != 0 {
        let row = left.trailing_zeros() as usize % R;
        left &= left - 1;
        let [x, y, z] = &tile.d[row];
        let d = [load(simd, x), load(simd, y), load(simd, z)];
        // Compare the rays' weights and distances with their bounds; try both signs if the side is uncertain.
        let (u, v, w) = (dot16(of_u, d), dot16(of_v, d), dot16(of_w, d));
        let least = u.min(v).min(w);
        let mut rejected = bits(least.simd_lt(-error));
        let det = dot16(of_det, d);
        if edgewise {
            rejected &= bits(u.max(v).max(w).simd_gt(error));
        } else {
            let reach = load(simd, &tile.reach[row]).min(splat(simd, leave));
            let doubt = reach.abs().mul_add(det_error * splat(simd, 3.0), t_error);
            rejected |= bits(t.simd_gt(det.mul_add(reach, doubt)));
        }
        let open = !rejected & tile.active[row];
        if open == 0 {
            continue;
        }
        // Hand the candidates over, and continue with the shorter reaches.
        let candidate = Candidate {
            row,
            open,
            sure: if edgewise {
                0
            } else {
                open & bits(least.simd_gt(error))
            },
            distance: [t, t_error, det, det_error],
            id,
            words: (from + lane, n),
        };
        judge.judge(simd, blocks, (&mut *tile, rays), &candidate, counters);
        keep_reach(simd, tile, row);
    }
}

/// Updates a row's `row_reach`. Four rows are written as one vector because they are soon read as one: a load
/// that covers a part just stored would stall.
#[inline(always)]
fn keep_reach<S: Simd, const R: usize>(simd: S, tile: &mut Tile<R>, row: usize) {
    let most = load(simd, &tile.reach[row]).reduce_max();
    let four = &mut tile.row_reach[row / 4 * 4..][..4];
    let own = mask32x4::from_bitmask(simd, 1 << (row % 4));
    let kept: f32x4<S> = own.select(f32x4::splat(simd, most), f32x4::from_slice(simd, four));
    kept.store_slice(four);
}
