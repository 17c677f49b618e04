// SPDX-License-Identifier: GPL-3.0-or-later
//! Traversal of box trees by tiles of rays with a common origin: interval arithmetic over the whole tile culls
//! a box that no ray of the tile can hit. Boxes are visited nearest first, as for single rays. At a turned node the
//! slowest and the fastest ray along each row of its rotation are found first.

use crate::tile::leaf::{self, Resolver};
use crate::tile::nearest::join;
use crate::tile::planes::speeds;
use crate::tile::traversal::TileTree;
use crate::tile::{LANES, Pace, Tile};
use fearless_simd::Simd;
use halfspace_leaf::Leaf;
use halfspace_nodes::box_tree::{BoxTree, Wide};
use halfspace_nodes::obb_tree::{Boxes, Inner, ObbTree, WIDTH};
use halfspace_nodes::plane_tree::MAX_DEPTH;
use halfspace_ray::Interval;
use halfspace_ray::frame::U;
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

/// Implements tiles for trees of `$width` boxes per node.
macro_rules! tiles {
    ([$($of:tt)*] $tree:ty, $width:expr) => {
        impl<$($of)*> TileTree for $tree {
            type Room = Vec<BoxEntry>;

            fn room(&self) -> Vec<BoxEntry> {
                vec![BoxEntry::default(); (MAX_DEPTH + 3) * $width]
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
                trace::<S, _, C, J, R, { $width }>(simd, self, input, tile, resolver, stack, counters)
            }
        }
    };
}

tiles!([const W: usize] BoxTree<W>, W);
tiles!([] ObbTree, WIDTH);

/// Traverses a tree with a tile; returns whether it finished within its budget. Steps and leaves are counted for the
/// tile's first ray, visits for each active ray.
#[inline(always)]
fn trace<S: Simd, T: Boxes<W>, C: Counters, J: Resolver<R>, const R: usize, const W: usize>(
    simd: S,
    tree: &T,
    input: Input<'_>,
    tile: &mut Tile<R>,
    resolver: &mut J,
    stack: &mut [BoxEntry],
    counters: &mut [C],
) -> bool {
    let axes = [0, 1, 2].map(|k: usize| Along::axis(tile, k));
    let mut size = 0;
    let mut budget = J::BUDGET * R * LANES;
    let Some(mut inner) = tree.inner(0, tree.root()) else {
        return true;
    };
    loop {
        join(tile, counters);
        let Inner { node, rotation } = inner;
        if let Some(rotation) = rotation {
            counters[0].step_oblique();
            let along = [0, 1, 2].map(
                #[inline(always)]
                |k: usize| Along::row(simd, tile, rotation.row(k)),
            );
            push_children(tile, &along, node, stack, &mut size);
        } else {
            counters[0].step_boxes();
            push_children(tile, &axes, node, stack, &mut size);
        }
        // Pop the nearest box, and test leaves until an inner node comes up.
        inner = loop {
            if size == 0 {
                return true;
            }
            size -= 1;
            let next = stack[size];
            // Skip boxes behind the best hits of all rays.
            if next.inside.enter > tile.far {
                continue;
            }
            if let Some(inner) = tree.inner(next.link, next.count) {
                break inner;
            }
            let own = Leaf {
                first: next.link,
                count: next.count as usize,
            };
            // Prefetch the leaf, and the entry that follows it.
            input.blocks.fetch_ahead(own.first);
            if let Some(further) = stack[..size].last() {
                tree.fetch_ahead(further.link, further.count, input.blocks);
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

/// Bounds on the rays of a tile along a direction.
#[derive(Clone, Copy)]
pub struct Along {
    /// Height of the common origin.
    o: f32,
    /// Error bound of the distance between that and the height of a plane.
    pad: f32,
    /// Distance per unit of height, downwards and upwards.
    pace: [Pace; 2],
}

impl Along {
    /// The bounds along an axis.
    #[inline(always)]
    pub fn axis<const R: usize>(tile: &Tile<R>, k: usize) -> Self {
        Self {
            o: tile.o[k],
            pad: tile.pad[k],
            pace: tile.pace[k],
        }
    }

    /// The bounds along a row of a rotation. The factors cover five roundings: those of a pace, of a distance to a
    /// plane and of their product.
    #[inline(always)]
    fn row<S: Simd, const R: usize>(simd: S, tile: &Tile<R>, row: [f32; 3]) -> Self {
        let [low, high] = speeds(simd, tile, row);
        let pace = |slow: f32, fast: f32| Pace {
            least: if fast > 0.0 {
                (1.0 - 8.0 * U) / fast
            } else {
                f32::MAX
            },
            most: if slow > 0.0 {
                (1.0 + 8.0 * U) / slow
            } else {
                f32::INFINITY
            },
        };
        Self {
            o: row[0] * tile.o[0] + row[1] * tile.o[1] + row[2] * tile.o[2],
            pad: tile.oblique_pad,
            pace: [pace(-high, -low), pace(low, high)],
        }
    }
}

/// Intersects the tile with the boxes of all children and pushes those that are hit, the nearest on top.
#[inline(always)]
fn push_children<const W: usize, const R: usize>(
    tile: &Tile<R>,
    along: &[Along; 3],
    node: &Wide<W>,
    stack: &mut [BoxEntry],
    size: &mut usize,
) {
    let (mut enter, mut leave) = ([0.0; W], [0.0; W]);
    intersect(tile, along, &node.bounds, &mut enter, &mut leave);
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

/// Computes the interval of distances in which rays of the tile may be inside each of several boxes along three
/// directions.
#[inline(always)]
pub fn intersect<const W: usize, const R: usize>(
    tile: &Tile<R>,
    along: &[Along; 3],
    bounds: &[[f32; W]; 6],
    enter: &mut [f32; W],
    leave: &mut [f32; W],
) {
    *enter = [tile.inside.enter; W];
    *leave = [tile.far; W];
    for (k, &Along { o, pad, pace }) in along.iter().enumerate() {
        let (low, high) = (&bounds[k], &bounds[3 + k]);
        let [down, up] = pace;
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
