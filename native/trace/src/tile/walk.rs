// SPDX-License-Identifier: GPL-3.0-or-later
//! Traversal of a tree by tiles of rays: camera rays from their origin, shadow rays from their light. Rays that
//! do not fit a tile, and those of tiles that exceed their budget, are traced in packets.

use crate::batch::TileWalk;
use crate::packet::walk::{PacketTree, Rest};
use crate::tile::leaf::Judge;
use crate::tile::nearest::Nearest;
use crate::tile::shadow::Shadows;
use crate::tile::{
    Backoff, LANES, Lately, Tile, nearest as tile_nearest, place, seat, shadow as shadow_tile,
};
use fearless_simd::Simd;
use halfspace_leaf::Job;
use halfspace_ray::query::{Any, Closest, Counters};
use halfspace_ray::{Hit, Ray, RaySlice};

/// A tree with a tile traversal.
pub trait TileTree: PacketTree {
    /// The traversal's stack.
    type Room;

    /// A stack with room for the deepest path.
    fn room(&self) -> Self::Room;

    /// Traces a tile; returns whether it finished within its budget.
    fn follow<S: Simd, C: Counters, J: Judge<R>, const R: usize>(
        &self,
        simd: S,
        triangles: Job<'_>,
        tile: (&mut Tile<R>, &[Ray], &mut J),
        room: &mut Self::Room,
        counters: &mut [C],
    ) -> bool;
}

/// Working memory of consecutive tiles.
pub struct Scratch<'a, T: TileTree + 'a> {
    backoff: Backoff<'a>,
    room: T::Room,
    rest: Rest<'a, T>,
}

impl<'a, T: TileTree> Scratch<'a, T> {
    fn new(tree: &'a T, worth: u32, lately: Option<&'a Lately>) -> Self {
        Self {
            backoff: Backoff::new(worth, lately),
            room: tree.room(),
            rest: Rest::new(tree),
        }
    }
}

/// The nearest-hit traversal by tiles of `16 R` rays, with the success rate of earlier batches.
pub struct Tiles<'a, T, const R: usize>(pub &'a T, pub Option<&'a Lately>);

impl<'a, T: TileTree, const R: usize> TileWalk for Tiles<'a, T, R> {
    const RAYS: usize = R * LANES;
    type Scratch = (Scratch<'a, T>, Tile<R>);

    fn scratch(&self) -> Self::Scratch {
        let shared = Scratch::new(self.0, <Nearest as Judge<R>>::WORTH, self.1);
        (shared, Tile::none())
    }

    #[inline(always)]
    fn cast_tile<S: Simd, C: Counters>(
        &self,
        simd: S,
        triangles: Job<'_>,
        RaySlice { frame, rays }: RaySlice<'_>,
        (scratch, tile): &mut Self::Scratch,
        write: &mut impl FnMut(usize, Hit),
        counters: &mut [C],
    ) {
        let Scratch {
            backoff,
            room,
            rest,
        } = scratch;
        // Trace all rays in packets while tiles do not pay.
        if !backoff.tries() {
            let all = Seats::new(rays.len(), [u16::MAX; R]).map(|(i, _)| (i, Hit::MISS));
            rest.walk::<S, Closest, C>(
                simd,
                triangles,
                RaySlice { frame, rays },
                all,
                (write, counters),
            );
            return;
        }
        // Trace the tile, decide its deferred hits, and record whether it finished.
        tile.fill(simd, frame, rays);
        if tile.is_inside() {
            let mut nearest = Nearest::default();
            let job = (&mut *tile, rays, &mut nearest);
            let finished = TileTree::follow(self.0, simd, triangles, job, room, counters);
            tile_nearest::settle(simd, triangles.blocks, (&mut *tile, rays), counters);
            backoff.learn(finished);
            if !finished {
                tile.give_up();
            }
        } else if tile.rest != [0; R] {
            backoff.learn(false);
        }
        // Write the tile's hits, then continue the rays that are left in packets.
        for i in 0..rays.len() {
            let (row, lane) = seat(i);
            write(i, tile.hit(row, lane));
        }
        if tile.rest != [0; R] {
            let left =
                Seats::new(rays.len(), tile.rest).map(|(i, (row, lane))| (i, tile.hit(row, lane)));
            rest.walk::<S, Closest, C>(
                simd,
                triangles,
                RaySlice { frame, rays },
                left,
                (write, counters),
            );
        }
    }
}

/// Iterator over some rays of a tile: index, and row and lane, of the rays of `lanes` with an index below
/// `rays`. It goes row by row, so that the rays of a packet form a square of pixels.
struct Seats<const R: usize> {
    rays: usize,
    lanes: [u16; R],
    row: usize,
}

impl<const R: usize> Seats<R> {
    #[inline(always)]
    fn new(rays: usize, lanes: [u16; R]) -> Self {
        Self {
            rays,
            lanes,
            row: 0,
        }
    }
}

impl<const R: usize> Iterator for Seats<R> {
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
            let place = place(self.row, lane);
            if place < self.rays {
                return Some((place, (self.row, lane)));
            }
        }
        None
    }
}

/// The any-hit traversal by tiles of `16 R` reversed shadow rays, with the success rate of earlier batches.
pub struct ShadowTiles<'a, T, const R: usize>(pub &'a T, pub Option<&'a Lately>);

impl<'a, T: TileTree, const R: usize> TileWalk for ShadowTiles<'a, T, R> {
    const RAYS: usize = R * LANES;
    type Scratch = Scratch<'a, T>;

    fn scratch(&self) -> Self::Scratch {
        Scratch::new(self.0, <Shadows<R> as Judge<R>>::WORTH, self.1)
    }

    #[inline(always)]
    fn cast_tile<S: Simd, C: Counters>(
        &self,
        simd: S,
        triangles: Job<'_>,
        RaySlice { frame, rays }: RaySlice<'_>,
        Scratch {
            backoff,
            room,
            rest,
        }: &mut Self::Scratch,
        write: &mut impl FnMut(usize, Hit),
        counters: &mut [C],
    ) {
        let [blocked, left] = shadow_tile::cast::<S, C, R>(
            simd,
            (frame, rays, backoff),
            #[inline(always)]
            |tile, shadows, counters| {
                let job = (tile, rays, shadows);
                TileTree::follow(self.0, simd, triangles, job, room, counters)
            },
            counters,
        );
        // Write the decided rays, then trace the others in packets.
        for (i, (row, lane)) in Seats::new(rays.len(), left.map(|left| !left)) {
            // An any-hit query returns existence only; number and weights are placeholders.
            let hit = Hit {
                t: rays[i].t_max,
                triangle: 0,
                u: 0.0,
                v: 0.0,
            };
            let is_blocked = blocked[row] >> lane & 1 == 1;
            write(i, if is_blocked { hit } else { Hit::MISS });
        }
        if left != [0; R] {
            let left = Seats::new(rays.len(), left).map(|(i, _)| (i, Hit::MISS));
            rest.walk::<S, Any, C>(
                simd,
                triangles,
                RaySlice { frame, rays },
                left,
                (write, counters),
            );
        }
    }
}
