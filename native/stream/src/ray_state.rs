// SPDX-License-Identifier: GPL-3.0-or-later
//! The state of each ray in a stream.

use fearless_simd::{Simd, SimdBase, SimdFloat, SimdMask, f32x8};
use halfspace_geom::bound::{keep_max, keep_max_each, keep_min_each};
use halfspace_group::visits::{FAR, INV, NEAR, REACH};
use halfspace_leaf::Block;
use halfspace_leaf::candidates::{Candidates, Edges};
use halfspace_ray::query::{Best, Counters, Query};
use halfspace_ray::{BoundedRay, FrameRay, Ray, RayRef};
use prefetch_index::prefetch_index;

/// Constants of a ray for tests of axis planes: per axis one row of four numbers, so that one load gets all that
/// a plane needs, and the start of its interval.
#[derive(Clone, Copy)]
pub struct Line {
    /// Per axis the coefficients, and a copy of the best hit's `reach`.
    pub axes: [[f32; 4]; 3],
    /// Where the ray enters the scene.
    pub start: f32,
}

impl Line {
    #[inline(always)]
    pub fn new(ray: &FrameRay, inv: [f32; 3], near: [f32; 3], far: [f32; 3]) -> Self {
        let axis = |k: usize| [inv[k], near[k], far[k], ray.t_max];
        Self {
            axes: [axis(0), axis(1), axis(2)],
            start: ray.t_min,
        }
    }

    /// Distance beyond which no hit is needed.
    #[inline(always)]
    pub fn reach(&self) -> f32 {
        self.axes[0][REACH]
    }

    /// Sets [`Self::reach`].
    #[inline(always)]
    pub fn set_reach(&mut self, reach: f32) {
        for axis in &mut self.axes {
            axis[REACH] = reach;
        }
    }

    /// Mask of the boxes that the ray meets before its best hit. `near` and `far` are the sides of entry and
    /// exit.
    #[inline(always)]
    pub fn meets<S: Simd>(&self, simd: S, near: &[f32x8<S>; 3], far: &[f32x8<S>; 3]) -> u64 {
        let mut enter = f32x8::splat(simd, self.start);
        let mut leave = f32x8::splat(simd, self.reach());
        for (axis, (near, far)) in self.axes.iter().zip(near.iter().zip(far)) {
            let inv = f32x8::splat(simd, axis[INV]);
            let soon = near.mul_add(inv, f32x8::splat(simd, axis[NEAR]));
            let late = far.mul_add(inv, f32x8::splat(simd, axis[FAR]));
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
        for (axis, near) in self.axes.iter().zip(near) {
            enter = keep_max(near * axis[INV] + axis[NEAR], enter);
        }
        enter <= self.reach()
    }
}

/// Up to eight triangles of a leaf with their edges.
#[derive(Clone, Copy)]
pub struct EdgedBlock<'a, S: Simd> {
    pub block: Block<'a>,
    pub edges: &'a Edges<S>,
}

/// The state of one ray: the part of a [`FrameRay`] that the traversal needs, which is smaller, since thousands
/// of rays are in use at once. A visit to a node of axis planes or boxes reads one cache line of it.
#[repr(C, align(64))]
pub struct RayState {
    pub line: Line,
    span: f32,
    last_place: f32,
    still_x: f32,
    /// Origin, and the error bound of heights over oblique planes ([`FrameRay::oblique_pad`]).
    pub origin: [f32; 4],
    /// Direction, and nothing.
    pub direction: [f32; 4],
    still_yz: [f32; 2],
    /// [`FrameRay::certain`].
    certain: [f32; 2],
    to_frame: f64,
    pub best: Best,
}

impl RayState {
    /// The state of a ray of the scene. `certain` is [`FrameRay::certain`]; `still` must be computed from the
    /// caller's direction, since the frame may round it to 0.
    #[inline(always)]
    pub fn new(ray: &FrameRay, line: Line, certain: [f32; 2], still: [f32; 3]) -> Self {
        Self {
            line,
            // The test of triangles rejects nothing at an infinite span: it does not allow for blur here.
            span: if ray.is_blurred() {
                f32::INFINITY
            } else {
                ray.span
            },
            last_place: ray.last_place,
            still_x: still[0],
            origin: [ray.o[0], ray.o[1], ray.o[2], ray.oblique_pad],
            direction: [ray.d[0], ray.d[1], ray.d[2], 0.0],
            still_yz: [still[1], still[2]],
            certain,
            to_frame: ray.to_frame,
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
        let first = |row: &[f32; 4]| [row[0], row[1], row[2]];
        FrameRay {
            o: first(&self.origin),
            d: first(&self.direction),
            still: [self.still_x, self.still_yz[0], self.still_yz[1]],
            t_min: self.line.start,
            t_max: self.line.reach(),
            span: self.span,
            to_frame: self.to_frame,
            last_place: self.last_place,
            ..FrameRay::NOTHING
        }
    }

    /// Tests the ray, `own` in the space of the scene, against a block of triangles up to the distance `reach`.
    /// An any-hit ray that hits one ends: its reach becomes negative infinity, and the result is `true`.
    #[inline(always)]
    pub fn test<S: Simd, Q: Query, C: Counters>(
        &mut self,
        simd: S,
        block: EdgedBlock<'_, S>,
        own: &Ray,
        reach: f32,
        counters: &mut C,
    ) -> bool {
        let EdgedBlock { block, edges } = block;
        counters.tests(block.count);
        let ray = self.ray();
        let mut open = Candidates::new(simd, edges, &ray, reach);
        // Refine the candidates and update the best hit.
        if open.any() {
            let surely = open.refine::<Q, C>(simd, edges, &ray);
            let bounded = BoundedRay {
                ray: RayRef {
                    ray: own,
                    frame: &ray,
                },
                certain: self.certain,
            };
            let best = &mut self.best;
            let ends = block.settle::<S, Q, C>(simd, open, &surely, bounded, best, counters);
            let reach = if Q::ANY && ends {
                f32::NEG_INFINITY
            } else {
                self.best.reach
            };
            self.line.set_reach(reach);
            return Q::ANY && ends;
        }
        false
    }

    /// Prefetches all cache lines of the state.
    #[inline(always)]
    pub fn fetch_ahead(&self) {
        prefetch_index(std::slice::from_ref(&self.line), 0);
        prefetch_index(self.origin.as_slice(), 0);
        // The best hit lies sixteen numbers, one cache line, behind.
        prefetch_index(self.origin.as_slice(), 16);
    }

    /// Prefetches what a visit to a node reads.
    #[inline(always)]
    pub fn fetch_line(&self) {
        prefetch_index(std::slice::from_ref(&self.line), 0);
    }
}
