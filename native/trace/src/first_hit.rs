// SPDX-License-Identifier: GPL-3.0-or-later
//! The termination rule of traversals as published: they end at the first leaf with a hit inside its cell. That
//! hit is the nearest, unless rounding visits leaves out of order.

use fearless_simd::Simd;
use halfspace_leaf::{Job, Leaf};
use halfspace_ray::RayRef;
use halfspace_ray::query::{Best, Counters, Query};

/// Tests a leaf as [`Job::test`] does, and returns whether the traversal ends there: at the first hit inside a cell if
/// `PUBLISHED`, otherwise only if no later leaf can improve the answer. A hit behind the cell ends nothing: a triangle of
/// a later leaf may be nearer. `leave`: distance at which the ray leaves the leaf's cell.
#[inline(always)]
pub fn test<const PUBLISHED: bool, S: Simd, Q: Query, C: Counters>(
    simd: S,
    leaf: Leaf,
    job: Job<'_>,
    ray: RayRef<'_>,
    leave: f32,
    best: &mut Best,
    counters: &mut C,
) -> bool {
    let ends = job.test::<S, Q, C>(simd, leaf, ray, leave, best, counters);
    ends || (PUBLISHED && best.is_found_before(leave))
}
