// SPDX-License-Identifier: GPL-3.0-or-later
//! Trees of boxes walked by tiles of rays with a common origin: a box is passed by when intervals over
//! the whole tile show that no ray meets it. The nearest box comes first, as for single rays.

use super::blocks::Blocks;
use super::box_tree::{BoxTree, INNER, Wide};
use super::query::Counters;
use super::ray::Ray;
use super::tile::{LANES, Tile};
use super::tile_leaf::{self, Judge};
use super::tile_walk::TileTree;
use crate::build::plane_tree::MAX_DEPTH;
use crate::scene::Triangles;
use fearless_simd::Simd;

/// A box still to visit: between which distances rays are inside it, and what is.
#[derive(Debug, Clone, Copy, Default)]
pub struct Waiting {
    enter: f32,
    leave: f32,
    link: u32,
    count: u32,
}

impl<const W: usize> TileTree for BoxTree<W> {
    type Room = Vec<Waiting>;

    fn room(&self) -> Vec<Waiting> {
        vec![Waiting::default(); (MAX_DEPTH + 3) * W]
    }

    #[inline(always)]
    fn follow<S: Simd, C: Counters, J: Judge<R>, const R: usize>(
        &self,
        simd: S,
        (_, blocks): (&Triangles, &Blocks),
        (tile, rays, judge): (&mut Tile<R>, &[Ray], &mut J),
        stack: &mut Vec<Waiting>,
        counters: &mut [C],
    ) -> bool {
        let stack = stack.as_mut_slice();
        let mut waiting = 0;
        let mut budget = J::BUDGET * R * LANES;
        let mut node = &self.nodes[0];
        loop {
            counters[0].step_axis();
            let mut enter = [0.0; W];
            let mut leave = [0.0; W];
            look(tile, node, (&mut enter, &mut leave));
            let base = waiting;
            let mut met = 0_u32;
            for lane in 0..W {
                // Of rays that may stay for ever the bounds of no box tell nothing, so empty places must.
                let outside = node.count[lane] == 0 || enter[lane] > leave[lane];
                met |= u32::from(!outside) << lane;
            }
            while met != 0 {
                let lane = met.trailing_zeros() as usize % W;
                met &= met - 1;
                let mut at = waiting;
                while at > base && stack[at - 1].enter < enter[lane] {
                    stack[at] = stack[at - 1];
                    at -= 1;
                }
                stack[at] = Waiting {
                    enter: enter[lane],
                    leave: leave[lane],
                    link: node.link[lane],
                    count: node.count[lane],
                };
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
                    break &self.nodes[next.link as usize];
                }
                let count = next.count as usize;
                blocks.fetch_ahead(next.link);
                if let Some(further) = stack[..waiting].last() {
                    self.fetch_ahead((further.link, further.count), blocks);
                }
                counters[0].leaf(count);
                let kept = tile_leaf::test(
                    simd,
                    blocks,
                    (next.link, count),
                    (next.enter, next.leave),
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

#[cfg(test)]
mod tests {
    use crate::oracle::cases::{Random, grid, ray, soup};
    use crate::structure::Structure;
    use crate::traverse::{Hit, Order, RayCounters, Tracer};

    /// A tree of boxes has no empty leaves, and a place of a node without a box is none.
    #[test]
    fn tiles_that_look_all_ways_visit_no_empty_places() {
        let structure = Structure::of(&soup(grid(4, 0.3)), "bvh-sah:traversal=tile8");
        let mut random = Random(3);
        let rays: Vec<_> = (0..64)
            .map(|_| ray([1.2, 1.7, 2.1], random.point(-1.0, 1.0)))
            .collect();
        let mut hits = vec![Hit::MISS; rays.len()];
        let mut counters = vec![RayCounters::default(); rays.len()];
        structure.closest_ordered(&rays, &mut hits, Some(&mut counters), Order::Tiles);
        let leaves: u32 = counters.iter().map(|c| c.leaves).sum();
        let empty: u32 = counters.iter().map(|c| c.leaves_empty).sum();
        assert!(leaves > 0 && empty == 0, "{empty} of {leaves}");
    }
}
