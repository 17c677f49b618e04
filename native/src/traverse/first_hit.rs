// SPDX-License-Identifier: GPL-3.0-or-later
//! Where walks as published end: at the first leaf with a hit inside, which has the nearest one, if
//! rounding has not led the ray into leaves out of their order.

use super::blocks::Blocks;
use super::frame::FrameRay;
use super::query::{Best, Counters, Query};
use super::ray::Ray;
use crate::scene::Triangles;
use fearless_simd::Simd;

/// Tests a leaf as [`Blocks::test`] does; whether the walk ends there, as published or with allowance
/// for rounding.
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
