// SPDX-License-Identifier: GPL-3.0-or-later
//! Rays of a tile that go on one by one: those that it left out.

use super::super::batch::{AHEAD, Walk};
use super::super::blocks::Blocks;
use super::super::frame::Frame;
use super::super::query::{Closest, Counters, Query};
use super::super::ray::{Hit, Ray};
use super::{Tile, seat};
use crate::scene::Triangles;
use fearless_simd::Simd;

/// Hands on the hits of a tile that has been walked; the rays that it left out are walked singly, by
/// `single`.
#[inline(always)]
pub fn finish<S: Simd, W: Walk, C: Counters, const R: usize>(
    simd: S,
    tile: &Tile<R>,
    (single, triangles): (&W, (&Triangles, &Blocks)),
    (frame, rays): (&Frame, &[Ray]),
    write: &mut impl FnMut(usize, Hit),
    counters: &mut [C],
) {
    for i in 0..rays.len() {
        let (row, lane) = seat(i);
        write(i, tile.hit(row, lane));
    }
    if tile.rest == [0; R] {
        return;
    }
    let rest = rays.iter().enumerate().filter_map(|(i, ray)| {
        let (row, lane) = seat(i);
        // The same hit again, or a better one.
        let found = tile.hit(row, lane);
        let t_max = if found.is_hit() { found.t } else { ray.t_max };
        (tile.rest[row] >> lane & 1 == 1).then_some((i, Ray { t_max, ..*ray }))
    });
    singly::<S, W, Closest, C>(simd, (single, triangles), (frame, rest), write, counters);
}

/// Walks rays of a tile, each with its place, one by one.
#[inline(always)]
pub fn singly<S: Simd, W: Walk, Q: Query, C: Counters>(
    simd: S,
    (single, triangles): (&W, (&Triangles, &Blocks)),
    (frame, mut rays): (&Frame, impl Iterator<Item = (usize, Ray)>),
    write: &mut impl FnMut(usize, Hit),
    counters: &mut [C],
) {
    let mut scratch = single.scratch();
    loop {
        let mut ahead = [None; AHEAD];
        for seat in &mut ahead {
            if let Some((i, ray)) = rays.next() {
                *seat = Some((i, ray, frame.ray(&ray)));
            }
        }
        for (i, ray, framed) in ahead.iter().flatten() {
            let hit = match framed {
                Some(framed) => single.cast::<S, Q, C>(
                    simd,
                    triangles,
                    (ray, framed),
                    &mut scratch,
                    &mut counters[*i],
                ),
                None => Hit::MISS,
            };
            write(*i, hit);
        }
        if ahead[AHEAD - 1].is_none() {
            return;
        }
    }
}
