// SPDX-License-Identifier: GPL-3.0-or-later
//! Trees of boxes walked by tiles of rays with a common origin: a box is passed by when intervals over
//! the whole tile show that no ray meets it. The nearest box comes first, as for single rays.

use super::batch::TileWalk;
use super::blocks::Blocks;
use super::box_tree::{self, BoxTree, INNER, Pending, Wide};
use super::frame::Frame;
use super::query::Counters;
use super::ray::{Hit, Ray};
use super::shadow_tile;
use super::tile::{self, LANES, Patience, Tile};
use super::tile_leaf::{self, Judge};
use super::tile_nearest::{self, Nearest};
use crate::build::plane_tree::MAX_DEPTH;
use crate::scene::Triangles;
use fearless_simd::Simd;

/// The walk over one tree by tiles of `16 R` rays.
pub struct Walk<'a, const W: usize, const R: usize>(pub &'a BoxTree<W>);

impl<const W: usize, const R: usize> TileWalk for Walk<'_, W, R> {
    const RAYS: usize = R * LANES;
    type Scratch = Patience;

    fn scratch(&self) -> Patience {
        Patience::default()
    }

    #[inline(always)]
    fn cast_tile<S: Simd, C: Counters>(
        &self,
        simd: S,
        triangles: (&Triangles, &Blocks),
        (frame, rays): (&Frame, &[Ray]),
        patience: &mut Patience,
        write: &mut impl FnMut(usize, Hit),
        counters: &mut [C],
    ) {
        let mut tile = Tile::<R>::new(simd, frame, rays);
        if !tile.is_inside() {
            // Nothing to hit.
        } else if patience.tries() {
            let mut nearest = Nearest::default();
            let job = (&mut tile, rays, &mut nearest);
            let finished = self.follow(simd, triangles.1, job, counters);
            tile_nearest::settle(simd, triangles.1, (&mut tile, rays), counters);
            patience.learn(finished);
            if !finished {
                tile.give_up();
            }
        } else {
            tile.give_up();
        }
        let single = box_tree::Walk(self.0);
        tile::finish(
            simd,
            &tile,
            (&single, triangles),
            (frame, rays),
            write,
            counters,
        );
    }
}

/// The same walk for shadow rays, in tiles turned round.
pub struct Shadow<'a, const W: usize, const R: usize>(pub &'a BoxTree<W>);

impl<const W: usize, const R: usize> TileWalk for Shadow<'_, W, R> {
    const RAYS: usize = R * LANES;
    type Scratch = Patience;

    fn scratch(&self) -> Patience {
        Patience::default()
    }

    #[inline(always)]
    fn cast_tile<S: Simd, C: Counters>(
        &self,
        simd: S,
        triangles: (&Triangles, &Blocks),
        (frame, rays): (&Frame, &[Ray]),
        patience: &mut Patience,
        write: &mut impl FnMut(usize, Hit),
        counters: &mut [C],
    ) {
        let single = box_tree::Walk(self.0);
        shadow_tile::cast::<_, _, _, R>(
            simd,
            (&single, triangles),
            (frame, rays, patience),
            #[inline(always)]
            |tile, shadows, counters| {
                Walk(self.0).follow(simd, triangles.1, (tile, rays, shadows), counters)
            },
            write,
            counters,
        );
    }
}

impl<const W: usize, const R: usize> Walk<'_, W, R> {
    /// Walks the tile to its end; says whether it came there within its budget.
    #[inline(always)]
    fn follow<S: Simd, C: Counters, J: Judge<R>>(
        &self,
        simd: S,
        blocks: &Blocks,
        (tile, rays, judge): (&mut Tile<R>, &[Ray], &mut J),
        counters: &mut [C],
    ) -> bool {
        let mut stack = [Pending::default(); (MAX_DEPTH + 3) * 8];
        let mut leaves = [0.0; (MAX_DEPTH + 3) * 8];
        let mut waiting = 0;
        let mut budget = J::BUDGET * R * LANES;
        let mut node = &self.0.nodes[0];
        loop {
            counters[0].step_axis();
            let mut enter = [0.0; W];
            let mut leave = [0.0; W];
            look(tile, node, (&mut enter, &mut leave));
            let base = waiting;
            for lane in 0..W {
                if enter[lane] > leave[lane] {
                    continue;
                }
                let mut at = waiting;
                while at > base && stack[at - 1].enter < enter[lane] {
                    stack[at] = stack[at - 1];
                    leaves[at] = leaves[at - 1];
                    at -= 1;
                }
                stack[at] = Pending {
                    enter: enter[lane],
                    link: node.link[lane],
                    count: node.count[lane],
                };
                leaves[at] = leave[lane];
                waiting += 1;
            }
            node = loop {
                if waiting == 0 {
                    return true;
                }
                waiting -= 1;
                let next = stack[waiting];
                if next.enter > tile.far {
                    continue;
                }
                if next.count == INNER {
                    break &self.0.nodes[next.link as usize];
                }
                let count = next.count as usize;
                counters[0].leaf(count);
                let kept = tile_leaf::test(
                    simd,
                    blocks,
                    (next.link, count),
                    (next.enter, leaves[waiting]),
                    (&mut *tile, rays, &mut *judge),
                    counters,
                );
                match budget.checked_sub(4 + kept) {
                    Some(left) => budget = left,
                    None => return false,
                }
            };
        }
    }
}

/// Between which distances rays of the tile are inside each box of a node.
#[inline(always)]
fn look<const W: usize, const R: usize>(
    tile: &Tile<R>,
    node: &Wide<W>,
    (enter, leave): (&mut [f32; W], &mut [f32; W]),
) {
    *enter = [tile.inside.0; W];
    *leave = [tile.far; W];
    for k in 0..3 {
        let (low, high) = (&node.bounds[k], &node.bounds[3 + k]);
        let [down, up] = tile.pace[k];
        let (o, pad) = (tile.o[k], tile.pad[k]);
        for lane in 0..W {
            let floor = low[lane] - o - pad;
            let ceiling = o - high[lane] - pad;
            enter[lane] = enter[lane]
                .max(floor.max(0.0) * up.least)
                .max(ceiling.max(0.0) * down.least);
        }
        // Rays that go neither up nor down, or both ways, may stay for ever.
        if up.most < f32::INFINITY {
            for lane in 0..W {
                leave[lane] = leave[lane].min((high[lane] - o + pad) * up.most);
            }
        } else if down.most < f32::INFINITY {
            for lane in 0..W {
                leave[lane] = leave[lane].min((o - low[lane] + pad) * down.most);
            }
        }
    }
}
