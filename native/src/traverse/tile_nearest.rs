// SPDX-License-Identifier: GPL-3.0-or-later
//! Nearest hits of the rays of a tile. Hits of which f32 is certain, and which are nearer than all others, are held
//! back, for nearer ones may come; of what f32 can neither rule out nor be certain of the verdict decides at once.
//! In the end it decides on the hits that were held back.

use super::blocks::Blocks;
use super::query::Counters;
use super::ray::Ray;
use super::tile::{Held, LANES, Tile, place};
use super::tile_leaf::{Candidate, Judge};
use super::tile_verdict::{each, shared};
use crate::geom::verdict::FromOrigin;
use fearless_simd::Simd;

/// So many rays of a row are put to the verdict one by one.
const FEW: u32 = 2;

/// Looks for the nearest hits.
#[derive(Default)]
pub struct Nearest {
    /// The triangle that was looked at last, by the place of its words.
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
        // A triangle that reaches into several leaves is met again in each.
        let open = open & !tile.met(simd, row, id);
        if open == 0 {
            return;
        }
        let held = tile.hold(simd, (row, sure & open), candidate.distance, (id, from, n));
        let open = open & !held;
        if open == 0 {
            return;
        }
        let corners = blocks.corners_at(from, n);
        let mut doubtful = open;
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

/// Works out the hits that are held back, once no nearer ones can come. One function for all trees.
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

/// Counts a verdict of each of these rays.
#[inline(always)]
pub(super) fn count<C: Counters>(lanes: u16, row: usize, counters: &mut [C]) {
    for lane in 0..LANES {
        if lanes >> lane & 1 == 1 {
            counters[place(row, lane)].verdict();
        }
    }
}
