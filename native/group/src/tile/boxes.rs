// SPDX-License-Identifier: GPL-3.0-or-later
//! Traversal of box trees by tiles of rays with a common origin: interval arithmetic over the whole tile culls
//! a box that no ray of the tile can hit. Boxes are visited nearest first, as for single rays.

use crate::tile::leaf::{self, Resolver};
use crate::tile::nearest::join;
use crate::tile::traversal::TileTree;
use crate::tile::{LANES, Tile};
use fearless_simd::Simd;
use halfspace_leaf::Leaf;
use halfspace_nodes::box_tree::{BoxTree, INNER, Wide};
use halfspace_nodes::plane_tree::MAX_DEPTH;
use halfspace_ray::Interval;
use halfspace_ray::query::Counters;
use halfspace_trace::input::Input;
use halfspace_trace::stack::{Entry, make_room};

/// A stack entry: a box still to visit, the interval of distances in which rays of the tile may be inside it,
/// and the box's link and count.
#[derive(Debug, Clone, Copy, Default)]
pub struct BoxEntry {
    inside: Interval,
    link: u32,
    count: u32,
}

impl Entry for BoxEntry {
    #[inline(always)]
    fn enter(&self) -> f32 {
        self.inside.enter
    }
}

impl<const W: usize> TileTree for BoxTree<W> {
    type Room = Vec<BoxEntry>;

    fn room(&self) -> Vec<BoxEntry> {
        vec![BoxEntry::default(); (MAX_DEPTH + 3) * W]
    }

    #[inline(always)]
    fn trace_tile<S: Simd, C: Counters, J: Resolver<R>, const R: usize>(
        &self,
        simd: S,
        input: Input<'_>,
        tile: &mut Tile<R>,
        resolver: &mut J,
        stack: &mut Vec<BoxEntry>,
        counters: &mut [C],
    ) -> bool {
        let stack = stack.as_mut_slice();
        let mut size = 0;
        let mut budget = J::BUDGET * R * LANES;
        let mut node = &self.nodes[0];
        loop {
            counters[0].step_boxes();
            join(tile, counters);
            push_children(tile, node, stack, &mut size);
            // Pop the nearest box, and test leaves until an inner node comes up.
            node = loop {
                if size == 0 {
                    return true;
                }
                size -= 1;
                let next = stack[size];
                // Skip boxes behind the best hits of all rays.
                if next.inside.enter > tile.far {
                    continue;
                }
                if next.count == INNER {
                    break &self.nodes[next.link as usize];
                }
                let own = Leaf {
                    first: next.link,
                    count: next.count as usize,
                };
                // Prefetch the leaf, and the entry that follows it.
                input.blocks.fetch_ahead(own.first);
                if let Some(further) = stack[..size].last() {
                    self.fetch_ahead(further.link, further.count, input.blocks);
                }
                counters[0].leaf(own.count);
                join(tile, counters);
                let kept = leaf::test(simd, input, own, next.inside, tile, resolver, counters);
                // Give up tiles whose rays diverge: a leaf costs four units of the budget, each kept candidate
                // one.
                match budget.checked_sub(4 + kept) {
                    Some(left) => budget = left,
                    None => return false,
                }
            };
        }
    }
}

/// Intersects the tile with the boxes of all children and pushes those that are hit, the nearest on top.
#[inline(always)]
fn push_children<const W: usize, const R: usize>(
    tile: &Tile<R>,
    node: &Wide<W>,
    stack: &mut [BoxEntry],
    size: &mut usize,
) {
    let (mut enter, mut leave) = ([0.0; W], [0.0; W]);
    intersect(tile, &node.bounds, &mut enter, &mut leave);
    // Find the boxes that the tile hits, then insert them by their entry distances.
    let base = *size;
    let mut met = 0_u32;
    for lane in 0..W {
        // The inverted bounds of an empty slot do not cull a tile without a finite exit distance, so check the
        // count.
        let outside = node.count[lane] == 0 || enter[lane] > leave[lane];
        met |= u32::from(!outside) << lane;
    }
    while met != 0 {
        let lane = met.trailing_zeros() as usize % W;
        met &= met - 1;
        let at = make_room(stack, base, size, enter[lane]);
        stack[at] = BoxEntry {
            inside: Interval::new(enter[lane], leave[lane]),
            link: node.link[lane],
            count: node.count[lane],
        };
    }
}

/// Computes the interval of distances in which rays of the tile may be inside each of several boxes.
#[inline(always)]
pub fn intersect<const W: usize, const R: usize>(
    tile: &Tile<R>,
    bounds: &[[f32; W]; 6],
    enter: &mut [f32; W],
    leave: &mut [f32; W],
) {
    // `pace` holds the least and the largest distance per unit of travel along an axis, downwards and upwards;
    // `pad` bounds the error of a coordinate.
    *enter = [tile.inside.enter; W];
    *leave = [tile.far; W];
    for k in 0..3 {
        let (low, high) = (&bounds[k], &bounds[3 + k]);
        let [down, up] = tile.pace[k];
        let (o, pad) = (tile.o[k], tile.pad[k]);
        for lane in 0..W {
            let floor = low[lane] - o - pad;
            let ceiling = o - high[lane] - pad;
            enter[lane] = enter[lane]
                .max(floor.max(0.0) * up.least)
                .max(ceiling.max(0.0) * down.least);
        }
        // The exit distance is bounded only if all rays move along the axis in the same direction.
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
