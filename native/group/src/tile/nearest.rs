// SPDX-License-Identifier: GPL-3.0-or-later
//! Nearest hits of the rays of a tile. A hit that f32 has proven and that is nearer than all others is
//! deferred, since nearer ones may follow; a candidate that f32 can neither prove nor rule out gets the exact
//! verdict at once. The deferred hits are decided at the end.

use crate::tile::leaf::Resolver;
use crate::tile::verdict::{each, shared};
use crate::tile::{Candidate, Deferred, LANES, Tile, ray_index};
use fearless_simd::Simd;
use halfspace_geom::verdict::FromOrigin;
use halfspace_ray::query::Counters;
use halfspace_trace::input::Input;

/// Largest number of rays of a row whose verdicts are computed one by one, not in f64 lanes.
const FEW: u32 = 2;

/// Finds the nearest hits.
#[derive(Default)]
pub struct Nearest {
    /// The triangle of the last shared verdict, and its position in the blocks.
    last: Option<(usize, FromOrigin)>,
}

impl<const R: usize> Resolver<R> for Nearest {
    const BUDGET: usize = 6;
    const MIN_FINISHED: u32 = 9;

    #[inline(always)]
    fn resolve<S: Simd, C: Counters>(
        &mut self,
        simd: S,
        input: Input<'_>,
        tile: &mut Tile<R>,
        candidate: &Candidate<S>,
        counters: &mut [C],
    ) {
        let (row, triangle) = (candidate.row, candidate.triangle);
        // A triangle in several leaves is a candidate in each.
        let open = candidate.open & !tile.has_hit(simd, row, triangle.id);
        if open == 0 {
            return;
        }
        let sure = candidate.sure & open;
        let open = open & !tile.defer(simd, row, sure, &candidate.distance, triangle);
        if open == 0 {
            return;
        }
        // Decide the other candidates: several rays in f64 lanes as far as certain, the rest exactly.
        let mut doubtful = open;
        // Several rays share the triangle's quantities, which are kept for the next row.
        if open.count_ones() > FEW {
            let known = self.last.filter(|(at, _)| *at == triangle.at);
            let (_, from) = known.unwrap_or_else(|| {
                let corners = triangle.corners(input.job());
                (triangle.at, FromOrigin::new(tile.o, corners))
            });
            self.last = Some((triangle.at, from));
            doubtful = shared(simd, tile, row, open, triangle.id, &from);
        }
        while doubtful != 0 {
            let lane = doubtful.trailing_zeros() as usize % LANES;
            doubtful &= doubtful - 1;
            let ray = &input.rays[ray_index(row, lane)];
            tile.offer(ray, row, lane, triangle, input.job());
        }
        count(open, row, counters);
    }

    #[inline(always)]
    fn change_blocks<S: Simd, C: Counters>(
        &mut self,
        simd: S,
        input: Input<'_>,
        tile: &mut Tile<R>,
        counters: &mut [C],
    ) {
        self.last = None;
        if tile.deferred.lanes != [0; R] {
            decide_deferred(simd, input, tile, counters);
            tile.deferred = Deferred::none();
        }
    }
}

/// Decides the deferred hits at the end, when no nearer ones can come. Compiled once for all trees.
#[inline(never)]
pub fn decide_deferred<S: Simd, C: Counters, const R: usize>(
    simd: S,
    input: Input<'_>,
    tile: &mut Tile<R>,
    counters: &mut [C],
) {
    simd.vectorize(
        #[inline(always)]
        || decide_rows(simd, input, tile, counters),
    );
}

/// [`decide_deferred`] in the instruction set of the caller.
#[inline(always)]
fn decide_rows<S: Simd, C: Counters, const R: usize>(
    simd: S,
    input: Input<'_>,
    tile: &mut Tile<R>,
    counters: &mut [C],
) {
    let mut last = None;
    for row in 0..R {
        let lanes = tile.deferred.lanes[row];
        if lanes == 0 {
            continue;
        }
        // Decide a row in f64 lanes as far as certain, the rest exactly.
        let mut doubtful = each(simd, input.job(), tile, row, &mut last);
        while doubtful != 0 {
            let lane = doubtful.trailing_zeros() as usize % LANES;
            doubtful &= doubtful - 1;
            let triangle = tile.deferred.triangle(row, lane);
            let ray = &input.rays[ray_index(row, lane)];
            tile.offer(ray, row, lane, triangle, input.job());
        }
        count(lanes, row, counters);
    }
}

/// Counts a visit of the tile for each of its active rays but the first, for which the step or leaf is counted.
#[inline(always)]
pub fn join<C: Counters, const R: usize>(tile: &Tile<R>, counters: &mut [C]) {
    if !C::COUNTS {
        return;
    }
    for (row, &active) in tile.active.iter().enumerate() {
        let mut left = active;
        while left != 0 {
            let ray = ray_index(row, left.trailing_zeros() as usize);
            left &= left - 1;
            if ray != 0 {
                counters[ray].joined();
            }
        }
    }
}

/// Counts one verdict for each of these rays.
#[inline(always)]
pub fn count<C: Counters>(lanes: u16, row: usize, counters: &mut [C]) {
    for lane in 0..LANES {
        if lanes >> lane & 1 == 1 {
            counters[ray_index(row, lane)].verdict();
        }
    }
}
