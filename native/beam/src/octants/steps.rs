// SPDX-License-Identifier: GPL-3.0-or-later
//! Steps of the rays of a beam from cell to cell, for eight rays at a time.

use crate::bundle::{Bundle, LANES, RAYS, all, load};
use crate::octants::{Beam, Group, Part};
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask, f32x8, mask32x8};
use halfspace_geom::bound::keep_max_each;
use halfspace_nodes::octree_nodes::Node;
use halfspace_single::octants::step::Grid;

/// Mask of the rays in an octant: bit `k` of its number selects the rays of mask `upper(k)`, or else all others.
#[inline(always)]
pub(super) fn of_octant(octant: u32, upper: impl Fn(usize) -> u64) -> u64 {
    let mut own = u64::MAX;
    for k in 0..3 {
        own &= if octant >> k & 1 == 1 {
            upper(k)
        } else {
            !upper(k)
        };
    }
    own
}

/// Initializes the cell of each ray of a group: the smallest cell where it enters the scene.
#[inline(always)]
pub(super) fn start<S: Simd, B: Bundle>(simd: S, group: &Group<B>, beam: &mut Beam) {
    let Group {
        grid,
        shared,
        rays: mask,
    } = group;
    for row in (0..RAYS).step_by(LANES) {
        if mask >> row & 0xff == 0 {
            continue;
        }
        let o = shared.origins(simd, &beam.rows.rays, row);
        let d = shared.directions(simd, &beam.rows.rays, row);
        let enter = load(simd, &beam.rows.enter, row);
        for k in 0..3 {
            // Compute the cell with the operations of [`Grid::cell`], and leave the lanes of other beams as
            // they are.
            let moved = enter * d[k];
            let number = grid.numbers(simd, k, o[k] + moved);
            let inside = number
                .max(f32x8::splat(simd, 0.0))
                .min(f32x8::splat(simd, (grid.size - 1) as f32))
                .floor();
            let own = mask32x8::from_bitmask(simd, mask >> row & 0xff);
            let at: f32x8<S> = own.select(inside, load(simd, &beam.at[k], row));
            at.store_slice(&mut beam.at[k][row..row + LANES]);
        }
    }
}

/// Splits a beam in an inner node by the octants of its rays, and pushes the parts. `mid` holds the mid planes.
#[inline(always)]
pub(super) fn split<S: Simd>(
    simd: S,
    grid: &Grid,
    node: Node,
    mid: [u32; 3],
    beam: &Beam,
    mask: u64,
    stack: &mut Vec<Part>,
) {
    // Find the rays beyond each mid plane.
    let mut beyond = [0_u64; 3];
    for row in (0..RAYS).step_by(LANES) {
        if mask >> row & 0xff == 0 {
            continue;
        }
        for k in 0..3 {
            let at = load(simd, &beam.at[k], row);
            let bits = at.simd_ge(f32x8::splat(simd, mid[k] as f32)).to_bitmask();
            beyond[k] |= (bits & 0xff) << row;
        }
    }
    // Combine the three masks for each octant.
    for octant in 0..8_u32 {
        let rays = mask & of_octant(octant, |k| beyond[k]);
        if rays != 0 {
            stack.push(Part {
                node: node.children() + (octant ^ grid.signs),
                rays,
            });
        }
    }
}

/// Computes when each ray leaves the cell that ends at planes `next`; returns the masks of rays by exit axis.
#[inline(always)]
pub(super) fn leave<S: Simd, B: Bundle>(
    simd: S,
    group: &Group<B>,
    next: [u32; 3],
    beam: &mut Beam,
    mask: u64,
) -> [u64; 3] {
    let Group { grid, shared, .. } = group;
    let mut by_axis = [0_u64; 3];
    for row in (0..RAYS).step_by(LANES) {
        let bits = mask >> row & 0xff;
        if bits == 0 {
            continue;
        }
        let o = shared.origins(simd, &beam.rows.rays, row);
        let inv = all(simd, &beam.rows.inv, row);
        let times = [
            grid.all_ahead(simd, 0, next[0], o[0]) * inv[0],
            grid.all_ahead(simd, 1, next[1], o[1]) * inv[1],
            grid.all_ahead(simd, 2, next[2], o[2]) * inv[2],
        ];
        // Choose the first plane; of equally near ones the lowest axis, as single rays do.
        let second = times[1].simd_lt(times[0]);
        let nearer = second.select(times[1], times[0]);
        let third = times[2].simd_lt(nearer);
        let leave = keep_max_each(
            third.select(times[2], nearer),
            load(simd, &beam.rows.enter, row),
        );
        leave.store_slice(&mut beam.leave[row..row + LANES]);
        let third = third.to_bitmask() & bits;
        let second = second.to_bitmask() & bits & !third;
        by_axis[0] |= (bits & !second & !third) << row;
        by_axis[1] |= second << row;
        by_axis[2] |= third << row;
    }
    by_axis
}

/// Moves each ray to the smallest cell behind its exit face; returns the mask of rays that do not end before that face.
#[inline(always)]
pub(super) fn advance<S: Simd, B: Bundle>(
    simd: S,
    group: &Group<B>,
    next: [u32; 3],
    beam: &mut Beam,
    mask: u64,
    by_axis: [u64; 3],
) -> u64 {
    let Group { grid, shared, .. } = group;
    let mut open = 0;
    for row in (0..RAYS).step_by(LANES) {
        let bits = mask >> row & 0xff;
        if bits == 0 {
            continue;
        }
        let leave = load(simd, &beam.leave, row);
        let reach = load(simd, &beam.rows.reach, row);
        let done = leave.simd_gt(reach).to_bitmask();
        open |= (bits & !done) << row;
        // Leave the lanes of other beams as they are.
        let own = mask32x8::from_bitmask(simd, bits);
        let enter = load(simd, &beam.rows.enter, row);
        let enter: f32x8<S> = own.select(leave, enter);
        enter.store_slice(&mut beam.rows.enter[row..row + LANES]);
        let o = shared.origins(simd, &beam.rows.rays, row);
        let d = shared.directions(simd, &beam.rows.rays, row);
        for k in 0..3 {
            // Across the exit axis take the next cell; along the others compute the cell, clamped to the face.
            let at = load(simd, &beam.at[k], row);
            // No fused multiply-add: products and sums must round as for single rays.
            let moved = leave * d[k];
            let x = o[k] + moved;
            let number = grid.numbers(simd, k, x);
            let inside = keep_max_each(number, at)
                .min(f32x8::splat(simd, (next[k] - 1) as f32))
                .floor();
            let across = mask32x8::from_bitmask(simd, by_axis[k] >> row & 0xff);
            let moved: f32x8<S> = across.select(f32x8::splat(simd, next[k] as f32), inside);
            let at: f32x8<S> = own.select(moved, at);
            at.store_slice(&mut beam.at[k][row..row + LANES]);
        }
    }
    open
}
