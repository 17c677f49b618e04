// SPDX-License-Identifier: GPL-3.0-or-later
//! The shadow cache (Wilt 1994, "Object-Oriented Ray Tracing in C++"): the triangle that blocked the last
//! shadow ray often blocks the next one, so it is tested first.
//!
//! Wilt keeps one blocker per light and recursion level. Rays here carry no light, but they end at it, so the
//! end point of a ray selects the entry. A batch contains the rays of one thread, image tile and bounce, and
//! starts with an empty cache. An unblocked ray clears its entry, which avoids useless tests in lit regions.
//! Any blocker proves occlusion, so no result changes.

use halfspace_ray::frame::Frame;
use halfspace_ray::{Hit, Ray};

/// Number of entries. Lights that share an entry replace each other's blocker.
const ENTRIES: usize = 64;

/// Number of cells along the scene's largest extent; end points in different cells belong to different lights.
const CELLS: f32 = 16.0;

/// The last blocker of each light.
pub struct ShadowCache {
    blockers: [u32; ENTRIES],
    /// Point of the scene at the frame's origin.
    origin: [f32; 3],
    per_cell: f32,
}

impl ShadowCache {
    /// An empty cache for the scene of a frame.
    pub fn new(frame: &Frame) -> Self {
        let bounds = frame.bounds();
        let size = (0..3)
            .map(|k| bounds.max[k] - bounds.min[k])
            .fold(f32::MIN_POSITIVE, f32::max);
        Self {
            blockers: [Hit::NONE; ENTRIES],
            origin: frame.map().origin(),
            per_cell: CELLS / size * frame.scale(),
        }
    }

    /// The entry of a ray's light: a hash of the cell of its end point, or of its direction if the ray is
    /// infinite.
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
                (ray.o[k] - self.origin[k] + ray.t_max * ray.d[k]) * self.per_cell
            } else {
                ray.d[k] * CELLS
            };
            hash = (hash ^ place.round() as i32 as u32).wrapping_mul(0x9e37_79b1);
        }
        // The upper six bits name one of the 64 entries.
        (hash >> 26) as usize
    }

    /// The blocker of this entry's last ray; [`Hit::NONE`] if there was none.
    #[inline(always)]
    pub fn blocker(&self, entry: usize) -> u32 {
        self.blockers[entry]
    }

    /// Stores the blocker of a ray, or that there is none.
    #[inline(always)]
    pub fn remember(&mut self, entry: usize, hit: &Hit) {
        self.blockers[entry] = hit.triangle;
    }
}
