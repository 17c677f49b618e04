// SPDX-License-Identifier: GPL-3.0-or-later
//! Traversal of a tree by tiles of rays: camera rays from their origin, shadow rays from their light. Rays that
//! do not fit a tile, and those of tiles that exceed their budget, are traced in packets.

use crate::packet::traversal::{PacketTree, Remainder};
use crate::tile::leaf::Resolver;
use crate::tile::nearest::{self, Nearest};
use crate::tile::shadow::{self, Decided, Shadows, try_first};
use crate::tile::{Backoff, LANES, SuccessRate, Tile, ray_index, row_and_lane};
use fearless_simd::Simd;
use halfspace_leaf::{Job, Leaf};
use halfspace_ray::query::{Any, Closest, Counters};
use halfspace_ray::{Hit, RaySlice};
use halfspace_trace::batch::TileTraversal;
use halfspace_trace::input::Input;

/// A tree with a tile traversal.
pub trait TileTree: PacketTree {
    /// The traversal's stack.
    type Room;

    /// A stack with room for the deepest path.
    fn room(&self) -> Self::Room;

    /// Traces a tile; returns whether it finished within its budget.
    fn trace_tile<S: Simd, C: Counters, J: Resolver<R>, const R: usize>(
        &self,
        simd: S,
        input: Input<'_>,
        tile: &mut Tile<R>,
        resolver: &mut J,
        room: &mut Self::Room,
        counters: &mut [C],
    ) -> bool;
}

/// Working memory of consecutive tiles.
pub struct Scratch<'a, T: TileTree + 'a> {
    backoff: Backoff<'a>,
    room: T::Room,
    remainder: Remainder<'a, T>,
    /// The leaf that blocked most rays of the last tile.
    blocker: Option<Leaf>,
}

impl<'a, T: TileTree> Scratch<'a, T> {
    fn new(tree: &'a T, min_finished: u32, rate: Option<&'a SuccessRate>, cache: bool) -> Self {
        Self {
            backoff: Backoff::new(min_finished, rate),
            room: tree.room(),
            remainder: Remainder::new(tree, cache),
            blocker: None,
        }
    }
}

/// The nearest-hit traversal by tiles of `16 R` rays, with the success rate of earlier batches.
pub struct Tiles<'a, T, const R: usize>(pub &'a T, pub Option<&'a SuccessRate>);

impl<'a, T: TileTree, const R: usize> TileTraversal for Tiles<'a, T, R> {
    const RAYS: usize = R * LANES;
    type Scratch = (Scratch<'a, T>, Tile<R>);

    fn scratch(&self) -> Self::Scratch {
        let shared = Scratch::new(
            self.0,
            <Nearest as Resolver<R>>::MIN_FINISHED,
            self.1,
            false,
        );
        (shared, Tile::none())
    }

    #[inline(always)]
    fn cast_tile<S: Simd, C: Counters>(
        &self,
        simd: S,
        triangles: Job<'_>,
        rays: RaySlice<'_>,
        (scratch, tile): &mut Self::Scratch,
        write: &mut impl FnMut(usize, Hit),
        counters: &mut [C],
    ) {
        let count = rays.rays.len();
        let Scratch {
            backoff,
            room,
            remainder,
            ..
        } = scratch;
        // Trace all rays in packets while tiles do not pay.
        if !backoff.should_try() {
            let all = RaysOf::new(count, [u16::MAX; R]).map(|(i, _)| (i, Hit::MISS));
            remainder.trace::<S, Closest, C>(simd, triangles, rays, all, write, counters);
            return;
        }
        // Trace the tile, decide its deferred hits, and record whether it finished.
        tile.fill(simd, rays.frame, rays.rays);
        if tile.is_inside() {
            let input = Input::new(triangles, rays);
            let mut resolver = Nearest::default();
            let finished = (self.0).trace_tile(simd, input, tile, &mut resolver, room, counters);
            nearest::decide_deferred(simd, input, tile, counters);
            backoff.record(finished);
            if !finished {
                tile.give_up();
            }
        } else if tile.rest != [0; R] {
            backoff.record(false);
        }
        // Write the tile's hits, then continue the rays that are left in packets.
        for i in 0..count {
            let (row, lane) = row_and_lane(i);
            write(i, tile.hit(row, lane));
        }
        if tile.rest != [0; R] {
            let left = RaysOf::new(count, tile.rest);
            let left = left.map(|(i, (row, lane))| (i, tile.hit(row, lane)));
            remainder.trace::<S, Closest, C>(simd, triangles, rays, left, write, counters);
        }
    }
}

/// Iterator over some rays of a tile: index, and row and lane, of the rays of `lanes` with an index below
/// `rays`. It goes row by row, so that the rays of a packet form a square of pixels.
struct RaysOf<const R: usize> {
    rays: usize,
    lanes: [u16; R],
    row: usize,
}

impl<const R: usize> RaysOf<R> {
    #[inline(always)]
    fn new(rays: usize, lanes: [u16; R]) -> Self {
        Self {
            rays,
            lanes,
            row: 0,
        }
    }
}

impl<const R: usize> Iterator for RaysOf<R> {
    type Item = (usize, (usize, usize));

    #[inline(always)]
    fn next(&mut self) -> Option<Self::Item> {
        while self.row < R {
            let lanes = &mut self.lanes[self.row];
            if *lanes == 0 {
                self.row += 1;
                continue;
            }
            let lane = lanes.trailing_zeros() as usize % LANES;
            *lanes &= *lanes - 1;
            let index = ray_index(self.row, lane);
            if index < self.rays {
                return Some((index, (self.row, lane)));
            }
        }
        None
    }
}

/// The any-hit traversal by tiles of `16 R` reversed shadow rays.
pub struct ShadowTiles<'a, T, const R: usize> {
    /// The tree.
    pub tree: &'a T,
    /// The success rate of earlier batches.
    pub rate: Option<&'a SuccessRate>,
    /// Whether the blocker of the last tile is tested first.
    pub cache: bool,
}

impl<'a, T: TileTree, const R: usize> TileTraversal for ShadowTiles<'a, T, R> {
    const RAYS: usize = R * LANES;
    type Scratch = Scratch<'a, T>;

    fn scratch(&self) -> Self::Scratch {
        Scratch::new(
            self.tree,
            <Shadows<R> as Resolver<R>>::MIN_FINISHED,
            self.rate,
            self.cache,
        )
    }

    #[inline(always)]
    fn cast_tile<S: Simd, C: Counters>(
        &self,
        simd: S,
        triangles: Job<'_>,
        rays: RaySlice<'_>,
        scratch: &mut Self::Scratch,
        write: &mut impl FnMut(usize, Hit),
        counters: &mut [C],
    ) {
        let Scratch {
            backoff,
            room,
            remainder,
            blocker,
        } = scratch;
        let cache = self.cache && T::ONE_STORE;
        let Decided { blocked, left } = shadow::cast::<S, C, R>(
            simd,
            rays,
            backoff,
            #[inline(always)]
            |tile, shadows, counters| {
                let input = Input::new(triangles, rays);
                let done = match blocker.filter(|_| cache) {
                    Some(leaf) => try_first(simd, input, leaf, tile, shadows, counters),
                    None => false,
                };
                let finished =
                    done || (self.tree).trace_tile(simd, input, tile, shadows, room, counters);
                *blocker = shadows.blocker.leaf();
                finished
            },
            counters,
        );
        // Write the decided rays, then trace the others in packets.
        let count = rays.rays.len();
        for (i, (row, lane)) in RaysOf::new(count, left.map(|left| !left)) {
            // An any-hit query returns existence only; number and weights are placeholders.
            let hit = Hit {
                t: rays.rays[i].t_max,
                triangle: 0,
                u: 0.0,
                v: 0.0,
            };
            let is_blocked = blocked[row] >> lane & 1 == 1;
            write(i, if is_blocked { hit } else { Hit::MISS });
        }
        if left != [0; R] {
            let left = RaysOf::new(count, left).map(|(i, _)| (i, Hit::MISS));
            remainder.trace::<S, Any, C>(simd, triangles, rays, left, write, counters);
        }
    }
}
