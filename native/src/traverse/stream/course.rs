// SPDX-License-Identifier: GPL-3.0-or-later
//! What a stream keeps of each ray.

use super::super::batch::Batch;
use super::super::blocks::SPAN;
use super::super::bound::{keep_max, keep_max_each, keep_min_each};
use super::super::candidates::{Candidates, Edges};
use super::super::frame::FrameRay;
use super::super::query::{Best, Closest, NoCountLate};
use fearless_simd::{Simd, SimdBase, SimdFloat, SimdMask, f32x8};
use prefetch_index::prefetch_index;

/// What slab tests need of a ray, as [`super::super::box_tree::Slabs`] says it.
pub(super) struct Line {
    inv: [f32; 3],
    near: [f32; 3],
    far: [f32; 3],
    pub(super) start: f32,
    /// That of the ray's best hit: it is asked for with the rest.
    pub(super) reach: f32,
}

impl Line {
    #[inline(always)]
    pub(super) fn new(ray: &FrameRay, inv: [f32; 3], near: [f32; 3], far: [f32; 3]) -> Self {
        Self {
            inv,
            near,
            far,
            start: ray.t_min,
            reach: ray.t_max,
        }
    }

    /// A bit for each box that the ray may hit something in. `near` and `far` are the sides of entry and of leaving.
    #[inline(always)]
    pub(super) fn meets<S: Simd>(&self, simd: S, near: &[f32x8<S>; 3], far: &[f32x8<S>; 3]) -> u64 {
        let mut enter = f32x8::splat(simd, self.start);
        let mut leave = f32x8::splat(simd, self.reach);
        for (k, (near, far)) in near.iter().zip(far).enumerate() {
            let inv = f32x8::splat(simd, self.inv[k]);
            let soon = near.mul_add(inv, f32x8::splat(simd, self.near[k]));
            let late = far.mul_add(inv, f32x8::splat(simd, self.far[k]));
            // What is not a number bounds nothing.
            enter = keep_max_each(soon, enter);
            leave = keep_min_each(late, leave);
        }
        enter.simd_le(leave).to_bitmask()
    }

    /// Whether the ray enters a box, of which it may hit something, before its best hit. `near` are the sides of entry.
    #[inline(always)]
    pub(super) fn enters(&self, near: [f32; 3]) -> bool {
        let mut enter = self.start;
        for (k, near) in near.into_iter().enumerate() {
            enter = keep_max(near * self.inv[k] + self.near[k], enter);
        }
        enter <= self.reach
    }
}

/// A ray on its way, with what its walk needs of a [`FrameRay`], which is larger: thousands of rays are in use at once.
/// A step through a node reads one line of the caches.
#[repr(C, align(64))]
pub(super) struct Course {
    pub(super) line: Line,
    span: f32,
    last_place: f32,
    /// [`FrameRay::certain`].
    certain: [f32; 2],
    to_frame: f64,
    o: [f32; 3],
    d: [f32; 3],
    still: [f32; 3],
    pub(super) best: Best,
}

impl Course {
    /// Of a ray of the scene. `certain` is [`FrameRay::certain`], `still` that of [`FrameRay`]: what a direction is in the
    /// frame may have been rounded to 0.
    #[inline(always)]
    pub(super) fn new(ray: &FrameRay, line: Line, certain: [f32; 2], still: [f32; 3]) -> Self {
        Self {
            certain,
            line,
            span: ray.span,
            last_place: ray.last_place,
            to_frame: ray.to_frame,
            o: ray.o,
            d: ray.d,
            still,
            best: Best::new(ray),
        }
    }

    /// Of a ray that meets nothing, and is on no list.
    #[inline(always)]
    pub(super) fn nothing() -> Self {
        let ray = FrameRay::NOTHING;
        let line = Line::new(&ray, [0.0; 3], [0.0; 3], [0.0; 3]);
        Self::new(&ray, line, [f32::NAN; 2], ray.still)
    }

    /// What leaves need of the ray.
    #[inline(always)]
    pub(super) fn ray(&self) -> FrameRay<'static> {
        FrameRay {
            o: self.o,
            d: self.d,
            still: self.still,
            t_min: self.line.start,
            t_max: self.line.reach,
            span: self.span,
            to_frame: self.to_frame,
            last_place: self.last_place,
            ..FrameRay::NOTHING
        }
    }

    /// Tests a block of `n` triangles.
    #[inline(always)]
    pub(super) fn test<S: Simd>(
        &mut self,
        simd: S,
        (batch, place): (&Batch<'_>, usize),
        (block, n): (&[f32; SPAN], usize),
        edges: &Edges<S>,
    ) {
        let ray = self.ray();
        let mut open = Candidates::new(simd, edges, &ray, self.line.reach);
        if open.any() {
            let surely = open.refine::<Closest, NoCountLate>(simd, edges, &ray);
            batch.blocks.settle::<S, Closest, _>(
                simd,
                (open, &surely),
                (block, n, batch.scene),
                (&batch.rays[place], &ray, self.certain),
                &mut self.best,
                &mut NoCountLate,
            );
            self.line.reach = self.best.reach;
        }
    }

    /// Asks for all of it.
    #[inline(always)]
    pub(super) fn fetch_ahead(&self) {
        prefetch_index(std::slice::from_ref(&self.line), 0);
        prefetch_index(self.o.as_slice(), 0);
        // The best hit lies behind, and a line of the caches is sixteen numbers long.
        prefetch_index(self.o.as_slice(), 16);
    }
}
