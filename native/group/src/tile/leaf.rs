// SPDX-License-Identifier: GPL-3.0-or-later
//! The triangles of a leaf against a tile of rays, in three steps: eight triangles at a time against the
//! pyramid that contains the rays, each remaining triangle against the parts of the pyramid that contain its
//! rows, then against the sixteen rays of each remaining row, in f32. Candidates that f32 cannot rule out are
//! handed to a [`Resolver`].
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

use crate::tile::prepare::{Corners, Prepared, prepare};
use crate::tile::{Candidate, Quotient, StoredTriangle, Tile, bits, load, splat};
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask, f32x4, f32x16, mask32x4};
use halfspace_leaf::Leaf;
use halfspace_leaf::blocks::{Blocks, LANES as WIDE};
use halfspace_ray::Interval;
use halfspace_ray::query::Counters;
use halfspace_trace::input::Input;

/// Decides candidates, depending on the query.
pub trait Resolver<const R: usize> {
    /// Work per ray after which a tile is continued in packets: one unit per triangle kept, four per leaf.
    const BUDGET: usize;

    /// Number of tiles out of 16 that must finish for tiles to be worth trying.
    const MIN_FINISHED: u32;

    /// Decides a candidate and updates the tile's hits and `tile.reach`.
    fn resolve<S: Simd, C: Counters>(
        &mut self,
        simd: S,
        input: Input<'_>,
        tile: &mut Tile<R>,
        candidate: &Candidate<S>,
        counters: &mut [C],
    );

    /// Notes that a leaf has been tested, all its candidates decided.
    #[inline(always)]
    fn tested(&mut self, leaf: Leaf) {
        let _ = leaf;
    }

    /// Decides everything that refers to positions in the current blocks, before the traversal changes to others.
    #[inline(always)]
    fn change_blocks<S: Simd, C: Counters>(
        &mut self,
        simd: S,
        input: Input<'_>,
        tile: &mut Tile<R>,
        counters: &mut [C],
    ) {
        let _ = (simd, input, tile, counters);
    }
}

/// Tests the tile against the triangles of a leaf, in whose cell the rays are in the interval `inside`. Returns
/// the number of triangles that the pyramid test kept; tests are counted for the tile's first ray. Compiled
/// once for all trees.
#[inline(never)]
pub fn test<S: Simd, C: Counters, J: Resolver<R>, const R: usize>(
    simd: S,
    input: Input<'_>,
    leaf: Leaf,
    inside: Interval,
    tile: &mut Tile<R>,
    resolver: &mut J,
    counters: &mut [C],
) -> usize {
    simd.vectorize(
        #[inline(always)]
        || each(simd, input, leaf, inside, tile, resolver, counters),
    )
}

/// One of eight prepared triangles.
struct One<'a> {
    /// The eight triangles.
    eight: &'a Prepared,
    /// The lane of this one.
    lane: usize,
    /// Where it is stored.
    stored: StoredTriangle,
}

// No closures with vectors in these functions: unless inlined, a closure is not compiled for the caller's
// instruction set and is slow.

/// [`test()`] in the instruction set of the caller.
#[inline(always)]
fn each<S: Simd, C: Counters, const R: usize>(
    simd: S,
    input: Input<'_>,
    leaf: Leaf,
    inside: Interval,
    tile: &mut Tile<R>,
    resolver: &mut impl Resolver<R>,
    counters: &mut [C],
) -> usize {
    counters[0].tests(leaf.count);
    let mut kept = 0;
    let (mut at, mut left) = (leaf.first, leaf.count);
    while left > 0 {
        let n = left.min(WIDE);
        let gathered;
        let (block, next) = if input.blocks.has_indices() {
            gathered = input.blocks.gathered(input.scene, at, n);
            (&gathered, Blocks::after_indices(at, n))
        } else {
            input.blocks.block(at, n)
        };
        // Test eight triangles against the pyramid, then each remaining one against the rows.
        let eight = prepare(simd, tile, inside.leave, block, n);
        let mut open = eight.kept;
        kept += open.count_ones() as usize;
        while open != 0 {
            let lane = open.trailing_zeros() as usize % WIDE;
            open &= open - 1;
            let one = One {
                eight: &eight,
                lane,
                stored: StoredTriangle::new(input.blocks, block, at, n, lane),
            };
            test_rays(simd, input, &one, inside, tile, resolver, counters);
        }
        at = next;
        left -= n;
    }
    // Update the farthest reach of the tile.
    tile.far = tile.row_reach[0];
    for reach in &tile.row_reach[1..] {
        tile.far = tile.far.max(*reach);
    }
    resolver.tested(leaf);
    kept
}

type Vector16<S> = [f32x16<S>; 3];

#[inline(always)]
fn dot16<S: Simd>(a: Vector16<S>, d: Vector16<S>) -> f32x16<S> {
    d[0].mul_add(a[0], d[1].mul_add(a[1], d[2] * a[2]))
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
    &One { eight, lane, .. }: &One<'_>,
    Interval { enter, leave }: Interval,
    tile: &Tile<R>,
) -> u32 {
    let mut open = 0;
    let all = |x: f32| f32x4::splat(simd, x);
    let below = all(-eight.uv_row_error[lane]);
    let det_error = all(eight.det_row_error[lane]);
    let (t, t_error) = (all(eight.t[lane]), all(eight.t_error[lane]));
    for first in (0..R).step_by(4) {
        let reach = f32x4::from_slice(simd, &tile.row_reach[first..first + 4]);
        // Skip rows whose rays all end before the leaf.
        let mut out = reach.simd_lt(all(enter));
        if let Some(pyramid) = &tile.pyramid
            && eight.edgewise >> lane & 1 == 0
        {
            // Reject by the largest weights and determinant over each row's part of the pyramid.
            let [a, b] = &pyramid.middle;
            let a = f32x4::from_slice(simd, &a[first..first + 4]);
            let b = f32x4::from_slice(simd, &b[first..first + 4]);
            let [c, d] = &pyramid.half;
            let c = f32x4::from_slice(simd, &c[first..first + 4]);
            let d = f32x4::from_slice(simd, &d[first..first + 4]);
            let u = most(simd, &eight.at[0], lane, [a, b, c, d]);
            let v = most(simd, &eight.at[1], lane, [a, b, c, d]);
            let w = most(simd, &eight.at[2], lane, [a, b, c, d]);
            out |= u.min(v).min(w).simd_lt(below);
            let det = most(simd, &eight.at[3], lane, [a, b, c, d]);
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

/// Tests one triangle against all rays.
#[inline(always)]
fn test_rays<S: Simd, C: Counters, const R: usize>(
    simd: S,
    input: Input<'_>,
    one: &One<'_>,
    inside: Interval,
    tile: &mut Tile<R>,
    resolver: &mut impl Resolver<R>,
    counters: &mut [C],
) {
    let mut left = rows(simd, one, inside, tile);
    if left == 0 {
        return;
    }
    // Copy the triangle's quantities to all lanes.
    let &One {
        eight,
        lane,
        stored: triangle,
    } = one;
    let [of_u, of_v, of_w] = [
        pick(simd, &eight.weights[0], lane),
        pick(simd, &eight.weights[1], lane),
        pick(simd, &eight.weights[2], lane),
    ];
    let of_det = pick(simd, &eight.det, lane);
    let t = splat(simd, eight.t[lane]);
    let error = splat(simd, eight.uv_error[lane]);
    let det_error = splat(simd, eight.det_error[lane]);
    let t_error = splat(simd, eight.t_error[lane]);
    let edgewise = eight.edgewise >> lane & 1 == 1;
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
            let reach = load(simd, &tile.reach[row]).min(splat(simd, inside.leave));
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
            distance: Quotient {
                t,
                t_error,
                det,
                det_error,
            },
            triangle,
        };
        resolver.resolve(simd, input, tile, &candidate, counters);
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
