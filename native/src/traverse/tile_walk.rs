// SPDX-License-Identifier: GPL-3.0-or-later
//! Walks of a tree by tiles of rays: camera rays from their origin, shadow rays from their light. Rays that do not
//! go together, and those of tiles that outgrow their budget, go singly.

use super::batch::{TileWalk, Walk};
use super::blocks::Blocks;
use super::frame::Frame;
use super::query::Counters;
use super::ray::{Hit, Ray};
use super::shadow_tile;
use super::tile::{self, Backoff, LANES, Tile};
use super::tile_leaf::Judge;
use super::tile_nearest::{self, Nearest};
use crate::scene::Triangles;
use fearless_simd::Simd;

/// A tree that tiles can be walked through.
pub trait TileTree: Sync {
    /// The walk of its single rays.
    type Single<'a>: Walk
    where
        Self: 'a;

    /// That walk.
    fn single(&self) -> Self::Single<'_>;

    /// Walks a tile to its end; says whether it came there within its budget.
    fn follow<S: Simd, C: Counters, J: Judge<R>, const R: usize>(
        &self,
        simd: S,
        triangles: (&Triangles, &Blocks),
        tile: (&mut Tile<R>, &[Ray], &mut J),
        counters: &mut [C],
    ) -> bool;
}

/// Nearest hits by tiles of `16 R` rays.
pub struct Tiles<'a, T, const R: usize>(pub &'a T);

impl<T: TileTree, const R: usize> TileWalk for Tiles<'_, T, R> {
    const RAYS: usize = R * LANES;
    type Scratch = Backoff;

    fn scratch(&self) -> Backoff {
        Backoff::default()
    }

    #[inline(always)]
    fn cast_tile<S: Simd, C: Counters>(
        &self,
        simd: S,
        triangles: (&Triangles, &Blocks),
        (frame, rays): (&Frame, &[Ray]),
        backoff: &mut Backoff,
        write: &mut impl FnMut(usize, Hit),
        counters: &mut [C],
    ) {
        let mut tile = Tile::<R>::new(simd, frame, rays);
        if tile.is_inside() {
            let finished = backoff.tries() && {
                let mut nearest = Nearest::default();
                let job = (&mut tile, rays, &mut nearest);
                let finished = self.0.follow(simd, triangles, job, counters);
                tile_nearest::settle(simd, triangles.1, (&mut tile, rays), counters);
                backoff.learn(finished);
                finished
            };
            if !finished {
                tile.give_up();
            }
        }
        tile::finish(
            simd,
            &tile,
            (&self.0.single(), triangles),
            (frame, rays),
            write,
            counters,
        );
    }
}

/// Any hits of shadow rays, by tiles of `16 R` that are turned round.
pub struct ShadowTiles<'a, T, const R: usize>(pub &'a T);

impl<T: TileTree, const R: usize> TileWalk for ShadowTiles<'_, T, R> {
    const RAYS: usize = R * LANES;
    type Scratch = Backoff;

    fn scratch(&self) -> Backoff {
        Backoff::default()
    }

    #[inline(always)]
    fn cast_tile<S: Simd, C: Counters>(
        &self,
        simd: S,
        triangles: (&Triangles, &Blocks),
        (frame, rays): (&Frame, &[Ray]),
        backoff: &mut Backoff,
        write: &mut impl FnMut(usize, Hit),
        counters: &mut [C],
    ) {
        shadow_tile::cast::<_, _, _, R>(
            simd,
            (&self.0.single(), triangles),
            (frame, rays, backoff),
            #[inline(always)]
            |tile, shadows, counters| {
                self.0
                    .follow(simd, triangles, (tile, rays, shadows), counters)
            },
            write,
            counters,
        );
    }
}
