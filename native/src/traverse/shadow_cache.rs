// SPDX-License-Identifier: GPL-3.0-or-later
//! The shadow cache (Wilt 1994, "Object-Oriented Ray Tracing in C++"): what blocked the light for the
//! last shadow ray often blocks it for the next one, so it is tested first.
//!
//! Wilt keeps one blocker per light and level of recursion. Rays here do not name their light, but
//! they end at it, so the end of a ray chooses the entry; a batch holds the rays of one
//! thread, image tile and bounce, and begins with an empty cache. An unblocked ray clears its entry:
//! in the light nothing is tested in vain. Any blocker is as good as another, so no answer changes.

use super::ray::{Hit, Ray};
use crate::geom::Aabb;

/// Entries; lights that share one take turns.
const ENTRIES: usize = 64;

/// Ends of rays this share of the scene apart are those of different lights.
const CELLS: f32 = 16.0;

/// The last blocker of each light.
pub struct ShadowCache {
    blockers: [u32; ENTRIES],
    per_cell: f32,
}

impl ShadowCache {
    /// An empty cache for rays in a scene with these bounds.
    pub fn new(bounds: Aabb) -> Self {
        let size = (0..3)
            .map(|k| bounds.max[k] - bounds.min[k])
            .fold(f32::MIN_POSITIVE, f32::max);
        Self {
            blockers: [Hit::NONE; ENTRIES],
            per_cell: CELLS / size,
        }
    }

    /// The entry of a ray's light: a place, or a direction for rays that do not end.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "saturates, which is as good as any other number"
    )]
    pub fn entry(&self, ray: &Ray) -> usize {
        let mut hash = 0_u32;
        for k in 0..3 {
            let place = if ray.t_max.is_finite() {
                (ray.o[k] + ray.t_max * ray.d[k]) * self.per_cell
            } else {
                ray.d[k] * CELLS
            };
            hash = (hash ^ place.round() as i32 as u32).wrapping_mul(0x9e37_79b1);
        }
        (hash >> 26) as usize
    }

    /// The triangle that blocked the light of this entry last; [`Hit::NONE`] when there was none.
    #[inline(always)]
    pub fn blocker(&self, entry: usize) -> u32 {
        self.blockers[entry]
    }

    /// Remembers what blocked a ray, or that nothing did.
    #[inline(always)]
    pub fn remember(&mut self, entry: usize, hit: &Hit) {
        self.blockers[entry] = hit.triangle;
    }
}
