// SPDX-License-Identifier: GPL-3.0-or-later
//! The state of each ray in a stream.

use crate::batch::Launch;
use fearless_simd::{Simd, SimdBase, SimdFloat, SimdMask, f32x8};
use halfspace_geom::bound::{keep_max, keep_max_each, keep_min_each};
use halfspace_leaf::blocks::SPAN;
use halfspace_leaf::candidates::{Candidates, Edges};
use halfspace_ray::FrameRay;
use halfspace_ray::query::{Best, Closest, NoCountLate};
use prefetch_index::prefetch_index;

/// What slab tests need of a ray: the coefficients of [`crate::slabs::Slabs`] and its interval.
pub struct Line {
    inv: [f32; 3],
    near: [f32; 3],
    far: [f32; 3],
    pub start: f32,
    /// Copy of the best hit's `reach`, in the same cache line.
    pub reach: f32,
}

impl Line {
    #[inline(always)]
    pub fn new(ray: &FrameRay, inv: [f32; 3], near: [f32; 3], far: [f32; 3]) -> Self {
        Self {
            inv,
            near,
            far,
            start: ray.t_min,
            reach: ray.t_max,
        }
    }

    /// Mask of the boxes that the ray meets before its best hit. `near` and `far` are the sides of entry and
    /// exit.
    #[inline(always)]
    pub fn meets<S: Simd>(&self, simd: S, near: &[f32x8<S>; 3], far: &[f32x8<S>; 3]) -> u64 {
        let mut enter = f32x8::splat(simd, self.start);
        let mut leave = f32x8::splat(simd, self.reach);
        for (k, (near, far)) in near.iter().zip(far).enumerate() {
            let inv = f32x8::splat(simd, self.inv[k]);
            let soon = near.mul_add(inv, f32x8::splat(simd, self.near[k]));
            let late = far.mul_add(inv, f32x8::splat(simd, self.far[k]));
            // Ignore bounds that are NaN.
            enter = keep_max_each(soon, enter);
            leave = keep_min_each(late, leave);
        }
        enter.simd_le(leave).to_bitmask()
    }

    /// Whether the ray enters a box before its best hit, given the sides of entry of a box it is known to meet.
    #[inline(always)]
    pub fn enters(&self, near: [f32; 3]) -> bool {
        let mut enter = self.start;
        for (k, near) in near.into_iter().enumerate() {
            enter = keep_max(near * self.inv[k] + self.near[k], enter);
        }
        enter <= self.reach
    }
}

/// The state of one ray: the part of a [`FrameRay`] that the traversal needs, which is smaller, since thousands
/// of rays are in use at once. A visit to a node reads one cache line of it.
#[repr(C, align(64))]
pub struct Course {
    pub line: Line,
    span: f32,
    last_place: f32,
    /// [`FrameRay::certain`].
    certain: [f32; 2],
    to_frame: f64,
    o: [f32; 3],
    d: [f32; 3],
    still: [f32; 3],
    pub best: Best,
}

impl Course {
    /// The state of a ray of the scene. `certain` is [`FrameRay::certain`]; `still` must be computed from the
    /// caller's direction, since the frame may round it to 0.
    #[inline(always)]
    pub fn new(ray: &FrameRay, line: Line, certain: [f32; 2], still: [f32; 3]) -> Self {
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

    /// The state of a ray that hits nothing and is on no list.
    #[inline(always)]
    pub fn nothing() -> Self {
        let ray = FrameRay::NOTHING;
        let line = Line::new(&ray, [0.0; 3], [0.0; 3], [0.0; 3]);
        Self::new(&ray, line, [f32::NAN; 2], ray.still)
    }

    /// The ray as the tests in leaves need it.
    #[inline(always)]
    pub fn ray(&self) -> FrameRay<'static> {
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

    /// Tests the ray against a block of `n` triangles.
    #[inline(always)]
    pub fn test<S: Simd>(
        &mut self,
        simd: S,
        (batch, place): (&Launch<'_>, usize),
        (block, n): (&[f32; SPAN], usize),
        edges: &Edges<S>,
    ) {
        let ray = self.ray();
        let mut open = Candidates::new(simd, edges, &ray, self.line.reach);
        // Refine the candidates and update the best hit.
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

    /// Prefetches all cache lines of the state.
    #[inline(always)]
    pub fn fetch_ahead(&self) {
        prefetch_index(std::slice::from_ref(&self.line), 0);
        prefetch_index(self.o.as_slice(), 0);
        // The best hit lies sixteen numbers, one cache line, behind.
        prefetch_index(self.o.as_slice(), 16);
    }
}
