// SPDX-License-Identifier: GPL-3.0-or-later
//! The termination rule of traversals as published: they end at the first leaf with a hit inside its cell. That
//! hit is the nearest, unless rounding visits leaves out of order.

use fearless_simd::Simd;
use halfspace_leaf::blocks::Blocks;
use halfspace_ray::query::{Best, Counters, Query};
use halfspace_ray::{FrameRay, Ray};
use halfspace_scene::Triangles;

/// Tests a leaf as [`Blocks::test`] does, and returns whether the traversal ends there: at the first hit if
/// `PUBLISHED`, otherwise only if no later leaf can improve the answer.
#[inline(always)]
pub fn test<const PUBLISHED: bool, S: Simd, Q: Query, C: Counters>(
    simd: S,
    leaf: (u32, usize),
    (scene, blocks): (&Triangles, &Blocks),
    ray: (&Ray, &FrameRay, f32),
    best: &mut Best,
    counters: &mut C,
) -> bool {
    let ends = blocks.test::<S, Q, C>(simd, leaf, scene, ray, best, counters);
    ends || (PUBLISHED && best.hit().is_hit())
}
