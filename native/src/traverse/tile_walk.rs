// SPDX-License-Identifier: GPL-3.0-or-later
//! Walks of a tree by tiles of rays: camera rays from their origin, shadow rays from their light. Rays that do not
//! go together, and those of tiles that outgrow their budget, go in packets.

use super::batch::TileWalk;
use super::blocks::Blocks;
use super::frame::Frame;
use super::packet_walk::{PacketTree, Rest};
use super::query::{Any, Closest, Counters};
use super::ray::{Hit, Ray};
use super::shadow_tile::{self, Shadows};
use super::tile::{Backoff, LANES, Lately, Tile, place, seat};
use super::tile_leaf::Judge;
use super::tile_nearest::{self, Nearest};
use crate::scene::Triangles;
use fearless_simd::Simd;

/// A tree that tiles can be walked through.
pub trait TileTree: PacketTree {
    /// Room for what waits.
    type Room;

    /// As much as may wait.
    fn room(&self) -> Self::Room;

    /// Walks a tile to its end; says whether it came there within its budget.
    fn follow<S: Simd, C: Counters, J: Judge<R>, const R: usize>(
        &self,
        simd: S,
        triangles: (&Triangles, &Blocks),
        tile: (&mut Tile<R>, &[Ray], &mut J),
        room: &mut Self::Room,
        counters: &mut [C],
    ) -> bool;
}

/// What tiles share, one after another.
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

/// Nearest hits by tiles of `16 R` rays through a tree, with what earlier batches have learned.
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
        triangles: (&Triangles, &Blocks),
        (frame, rays): (&Frame, &[Ray]),
        (scratch, tile): &mut Self::Scratch,
        write: &mut impl FnMut(usize, Hit),
        counters: &mut [C],
    ) {
        let Scratch {
            backoff,
            room,
            rest,
        } = scratch;
        if !backoff.tries() {
            let all = Seats::new(rays.len(), [u16::MAX; R]).map(|(i, _)| (i, Hit::MISS));
            rest.walk::<S, Closest, C>(simd, triangles, (frame, rays), all, (write, counters));
            return;
        }
        tile.fill(simd, frame, rays);
        if tile.is_inside() {
            let mut nearest = Nearest::default();
            let job = (&mut *tile, rays, &mut nearest);
            let finished = TileTree::follow(self.0, simd, triangles, job, room, counters);
            tile_nearest::settle(simd, triangles.1, (&mut *tile, rays), counters);
            backoff.learn(finished);
            if !finished {
                tile.give_up();
            }
        } else if tile.rest != [0; R] {
            backoff.learn(false);
        }
        for i in 0..rays.len() {
            let (row, lane) = seat(i);
            write(i, tile.hit(row, lane));
        }
        if tile.rest != [0; R] {
            let left =
                Seats::new(rays.len(), tile.rest).map(|(i, (row, lane))| (i, tile.hit(row, lane)));
            rest.walk::<S, Closest, C>(simd, triangles, (frame, rays), left, (write, counters));
        }
    }
}

/// Some of the first so many rays of a tile, row by row, so that the rays of a packet are those of a square: their
/// places and their seats.
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

/// Any hits of shadow rays, by tiles of `16 R` that are turned round, with what earlier batches have learned.
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
        triangles: (&Triangles, &Blocks),
        (frame, rays): (&Frame, &[Ray]),
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
        for (i, (row, lane)) in Seats::new(rays.len(), left.map(|left| !left)) {
            // Of any hit only that there is one is asked.
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
            rest.walk::<S, Any, C>(simd, triangles, (frame, rays), left, (write, counters));
        }
    }
}
