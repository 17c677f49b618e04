// SPDX-License-Identifier: GPL-3.0-or-later
//! Tiles through the boxes that intervals leave: interval arithmetic over the whole tile culls a node whose box no ray
//! of the tile can meet. The box of a node is derived from the parent's on the way down, once for all rays.

use crate::tile::boxes::{Along, intersect};
use crate::tile::leaf::{self, Resolver};
use crate::tile::nearest::join;
use crate::tile::traversal::TileTree;
use crate::tile::{LANES, Tile};
use fearless_simd::Simd;
use halfspace_geom::Aabb;
use halfspace_nodes::plane_tree::MAX_DEPTH;
use halfspace_nodes::slab_boxes::{BoxedNode, SlabBoxes};
use halfspace_ray::Interval;
use halfspace_ray::query::Counters;
use halfspace_trace::input::Input;

impl TileTree for SlabBoxes {
    type Room = Vec<BoxedNode>;

    fn room(&self) -> Vec<BoxedNode> {
        // Each level leaves one child on the stack, and the lowest level both.
        vec![self.root(); MAX_DEPTH + 3]
    }

    #[inline(always)]
    fn trace_tile<S: Simd, C: Counters, J: Resolver<R>, const R: usize>(
        &self,
        simd: S,
        input: Input<'_>,
        tile: &mut Tile<R>,
        resolver: &mut J,
        stack: &mut Vec<BoxedNode>,
        counters: &mut [C],
    ) -> bool {
        let stack = stack.as_mut_slice();
        let mut budget = J::BUDGET * R * LANES;
        // The near child is that of most rays.
        let octant = (0..3).fold(0, |octant, k| octant | usize::from(!tile.up[k]) << k);
        stack[0] = self.root();
        let mut size = 1;
        while size != 0 {
            // Pop the nearest node, and skip it if no ray meets its box before its best hit.
            size -= 1;
            let own = stack[size];
            let inside = between(tile, &own.region);
            if inside.enter > inside.leave {
                continue;
            }
            join(tile, counters);
            let Some(leaf) = own.leaf() else {
                counters[0].step_boxes();
                for child in self.children(&own, octant).into_iter().flatten() {
                    stack[size] = child;
                    size += 1;
                }
                continue;
            };
            input.blocks.fetch_ahead(leaf.first);
            counters[0].leaf(leaf.count);
            let kept = leaf::test(simd, input, leaf, inside, tile, resolver, counters);
            // Give up tiles whose rays diverge: a leaf costs four units of the budget, each kept candidate one.
            match budget.checked_sub(4 + kept) {
                Some(left) => budget = left,
                None => return false,
            }
        }
        true
    }
}

/// The interval of distances in which rays of the tile may be inside a box.
#[inline(always)]
fn between<const R: usize>(tile: &Tile<R>, region: &Aabb) -> Interval {
    let Aabb { min, max } = region;
    let bounds = [[min[0]], [min[1]], [min[2]], [max[0]], [max[1]], [max[2]]];
    let (mut enter, mut leave) = ([0.0], [0.0]);
    let axes = [0, 1, 2].map(|k: usize| Along::axis(tile, k));
    intersect(tile, &axes, &bounds, &mut enter, &mut leave);
    Interval::new(enter[0], leave[0])
}
