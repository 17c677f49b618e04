// SPDX-License-Identifier: GPL-3.0-or-later
//! Nearest hits of the rays of a tile. A hit that f32 has proven and that is nearer than all others is
//! deferred, since nearer ones may follow; a candidate that f32 can neither prove nor rule out gets the exact
//! verdict at once. The deferred hits are decided at the end.

use crate::tile::leaf::{Candidate, Judge};
use crate::tile::verdict::{each, shared};
use crate::tile::{Held, LANES, Tile, place};
use fearless_simd::Simd;
use halfspace_geom::verdict::FromOrigin;
use halfspace_leaf::blocks::Blocks;
use halfspace_ray::Ray;
use halfspace_ray::query::Counters;

/// Largest number of rays of a row whose verdicts are computed one by one, not in f64 lanes.
const FEW: u32 = 2;

/// Finds the nearest hits.
#[derive(Default)]
pub struct Nearest {
    /// The triangle of the last shared verdict, and its position in the blocks.
    last: Option<(usize, FromOrigin)>,
}

impl<const R: usize> Judge<R> for Nearest {
    const BUDGET: usize = 6;
    const WORTH: u32 = 9;

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
            sure,
            id,
            words: (from, n),
            ..
        } = candidate;
        // A triangle in several leaves is a candidate in each.
        let open = open & !tile.met(simd, row, id);
        if open == 0 {
            return;
        }
        let held = tile.hold(simd, (row, sure & open), candidate.distance, (id, from, n));
        let open = open & !held;
        if open == 0 {
            return;
        }
        // Decide the other candidates: several rays in f64 lanes as far as certain, the rest exactly.
        let corners = blocks.corners_at(from, n);
        let mut doubtful = open;
        // Several rays share the triangle's quantities, which are kept for the next row.
        if open.count_ones() > FEW {
            let known = self.last.filter(|(place, _)| *place == from);
            let (_, triangle) = known.unwrap_or_else(|| (from, FromOrigin::new(tile.o, corners)));
            self.last = Some((from, triangle));
            doubtful = shared(simd, tile, (row, open), (id, &triangle));
        }
        while doubtful != 0 {
            let lane = doubtful.trailing_zeros() as usize % LANES;
            doubtful &= doubtful - 1;
            let ray = &rays[place(row, lane)];
            tile.offer(ray, (row, lane), (id, corners));
        }
        count(open, row, counters);
    }

    #[inline(always)]
    fn leave<S: Simd, C: Counters>(
        &mut self,
        simd: S,
        blocks: &Blocks,
        (tile, rays): (&mut Tile<R>, &[Ray]),
        counters: &mut [C],
    ) {
        self.last = None;
        if tile.held.lanes != [0; R] {
            settle(simd, blocks, (&mut *tile, rays), counters);
            tile.held = Held::none();
        }
    }
}

/// Decides the deferred hits at the end, when no nearer ones can come. Compiled once for all trees.
#[inline(never)]
pub fn settle<S: Simd, C: Counters, const R: usize>(
    simd: S,
    blocks: &Blocks,
    tile: (&mut Tile<R>, &[Ray]),
    counters: &mut [C],
) {
    simd.vectorize(
        #[inline(always)]
        || settled(simd, blocks, tile, counters),
    );
}

#[inline(always)]
fn settled<S: Simd, C: Counters, const R: usize>(
    simd: S,
    blocks: &Blocks,
    (tile, rays): (&mut Tile<R>, &[Ray]),
    counters: &mut [C],
) {
    let mut last = None;
    for row in 0..R {
        let held = tile.held.lanes[row];
        if held == 0 {
            continue;
        }
        // Decide a row in f64 lanes as far as certain, the rest exactly.
        let mut doubtful = each(simd, blocks, (&mut *tile, row), &mut last);
        while doubtful != 0 {
            let lane = doubtful.trailing_zeros() as usize % LANES;
            doubtful &= doubtful - 1;
            let (from, n) = tile.held.words(row, lane);
            let triangle = (tile.held.id[row][lane], blocks.corners_at(from, n));
            tile.offer(&rays[place(row, lane)], (row, lane), triangle);
        }
        count(held, row, counters);
    }
}

/// Counts one verdict for each of these rays.
#[inline(always)]
pub fn count<C: Counters>(lanes: u16, row: usize, counters: &mut [C]) {
    for lane in 0..LANES {
        if lanes >> lane & 1 == 1 {
            counters[place(row, lane)].verdict();
        }
    }
}
