// SPDX-License-Identifier: GPL-3.0-or-later
//! The shadow cache of tiles: the leaf that blocked most rays of the last tile often blocks the next one, so it is
//! tested first, against all its rays at once. Wilt 1994 keeps one triangle per light; the rays of a tile have one light.
//! Any blocker proves occlusion, so no result changes. A tile in which nothing is blocked clears the cache.

use crate::input::Input;
use crate::tile::leaf;
use crate::tile::nearest::join;
use crate::tile::shadow::Shadows;
use crate::tile::{LANES, Tile, ray_index};
use fearless_simd::Simd;
use halfspace_leaf::Leaf;
use halfspace_ray::Interval;
use halfspace_ray::query::Counters;

/// The leaf that blocks most rays of a tile.
#[derive(Debug, Clone, Copy, Default)]
pub struct Blocker {
    leaf: Option<Leaf>,
    /// Number of rays that it blocks, and that the leaf under test has blocked so far.
    most: u32,
    now: u32,
}

impl Blocker {
    /// Notes that the leaf under test blocks further rays.
    #[inline(always)]
    pub fn blocks(&mut self, rays: u32) {
        self.now += rays;
    }

    /// Notes which leaf was tested.
    #[inline(always)]
    pub fn tested(&mut self, leaf: Leaf) {
        if self.now > self.most {
            (self.leaf, self.most) = (Some(leaf), self.now);
        }
        self.now = 0;
    }

    /// The leaf, if any ray is blocked.
    #[inline(always)]
    pub fn leaf(&self) -> Option<Leaf> {
        self.leaf
    }
}

/// Tests the blocker of the last tile against a tile. Returns whether it blocks all rays of it.
#[inline(always)]
pub fn try_first<S: Simd, C: Counters, const R: usize>(
    simd: S,
    input: Input<'_>,
    blocker: Leaf,
    tile: &mut Tile<R>,
    shadows: &mut Shadows<R>,
    counters: &mut [C],
) -> bool {
    counters[0].leaf(blocker.count);
    join(tile, counters);
    let inside = Interval::new(tile.inside.enter, tile.far);
    leaf::test(simd, input, blocker, inside, tile, shadows, counters);
    if C::COUNTS {
        for (row, blocked) in shadows.blocked.iter().enumerate() {
            for lane in (0..LANES).filter(|lane| blocked >> lane & 1 == 1) {
                counters[ray_index(row, lane)].spared();
            }
        }
    }
    tile.active == [0; R]
}
