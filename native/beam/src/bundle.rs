// SPDX-License-Identifier: GPL-3.0-or-later
//! The common half of the rays of a beam: their origin (a pinhole, a point light) or their direction (an
//! orthographic camera, a sun). What depends on the common half and a triangle is computed once per beam, which
//! leaves three dot products per ray, for eight rays at a time.

use fearless_simd::{Simd, SimdBase, f32x8};
use halfspace_leaf::lanes::{Along, Seen};
use halfspace_ray::Ray;

/// Largest number of rays in a beam; a ray mask is one 64-bit word.
pub const RAYS: usize = 64;

/// Rays per vector.
pub const LANES: usize = 8;

/// One number per ray.
pub type Row = [f32; RAYS];

/// Origins and directions of up to [`RAYS`] rays in the frame, one row per component.
pub struct Rows {
    /// Origins.
    pub o: [Row; 3],
    /// Directions.
    pub d: [Row; 3],
}

impl Rows {
    /// Rows of zeros.
    #[inline(always)]
    pub fn blank() -> Self {
        Self {
            o: [[0.0; RAYS]; 3],
            d: [[0.0; RAYS]; 3],
        }
    }
}

/// Loads the eight values of a row from index `row` on.
#[inline(always)]
pub fn load<S: Simd>(simd: S, from: &Row, row: usize) -> f32x8<S> {
    f32x8::from_slice(simd, &from[row..row + LANES])
}

/// Loads the eight values of three rows from index `row` on. There is no loop over a closure, because a closure would
/// not inherit the instruction set of its caller.
#[inline(always)]
pub fn all<S: Simd>(simd: S, from: &[Row; 3], row: usize) -> [f32x8<S>; 3] {
    [
        load(simd, &from[0], row),
        load(simd, &from[1], row),
        load(simd, &from[2], row),
    ]
}

/// Broadcasts one vector to eight rays.
#[inline(always)]
fn spread<S: Simd>(simd: S, v: [f32; 3]) -> [f32x8<S>; 3] {
    [
        f32x8::splat(simd, v[0]),
        f32x8::splat(simd, v[1]),
        f32x8::splat(simd, v[2]),
    ]
}

/// Iterates over the indices of the set bits of a mask, lowest first.
#[inline(always)]
pub fn lanes(mut mask: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        if mask == 0 {
            return None;
        }
        let lane = mask.trailing_zeros() as usize;
        mask &= mask - 1;
        Some(lane)
    })
}

/// Returns whether the rays count as parallel, and the mask of the rays that share the first ray's half: its direction
/// if they are parallel, otherwise its origin. They count as parallel if the first two have different origins.
///
/// # Panics
/// If there are no rays.
#[inline(always)]
pub fn alike(rays: &[Ray]) -> (bool, u64) {
    // Compare bit patterns, so that -0 and +0 differ and NaN equals itself.
    let bits = |v: &[f32; 3]| [v[0].to_bits(), v[1].to_bits(), v[2].to_bits()];
    let (origin, direction) = (bits(&rays[0].o), bits(&rays[0].d));
    let parallel = rays.len() > 1 && bits(&rays[1].o) != origin;
    let mut alike = 0;
    for (i, ray) in rays.iter().enumerate() {
        let own = if parallel {
            bits(&ray.d) == direction
        } else {
            bits(&ray.o) == origin
        };
        alike |= u64::from(own) << i;
    }
    (parallel, alike)
}

/// Rays with a common half.
pub trait Bundle {
    /// The part of the triangle test that depends on the common half and the triangle.
    type Seen;

    /// Precomputes what depends on the common half and the triangle's vertices.
    fn see(&self, corners: [[f32; 3]; 3]) -> Self::Seen;

    /// The origins of the eight rays from index `row` on.
    fn origins<S: Simd>(&self, simd: S, rays: &Rows, row: usize) -> [f32x8<S>; 3];

    /// The directions of the eight rays from index `row` on.
    fn directions<S: Simd>(&self, simd: S, rays: &Rows, row: usize) -> [f32x8<S>; 3];

    /// The mask of those of the eight rays from index `row` on that may hit the triangle within `reach`.
    fn candidates<S: Simd>(
        &self,
        simd: S,
        seen: &Self::Seen,
        rays: &Rows,
        row: usize,
        reach: f32x8<S>,
    ) -> u64;
}

/// Rays with this common origin.
pub struct Common(pub [f32; 3]);

impl Bundle for Common {
    type Seen = Seen;

    #[inline(always)]
    fn see(&self, corners: [[f32; 3]; 3]) -> Seen {
        Seen::new(self.0, corners)
    }

    #[inline(always)]
    fn origins<S: Simd>(&self, simd: S, _: &Rows, _: usize) -> [f32x8<S>; 3] {
        spread(simd, self.0)
    }

    #[inline(always)]
    fn directions<S: Simd>(&self, simd: S, rays: &Rows, row: usize) -> [f32x8<S>; 3] {
        all(simd, &rays.d, row)
    }

    #[inline(always)]
    fn candidates<S: Simd>(
        &self,
        simd: S,
        seen: &Seen,
        rays: &Rows,
        row: usize,
        reach: f32x8<S>,
    ) -> u64 {
        seen.candidates(simd, all(simd, &rays.d, row), reach)
    }
}

/// Rays with this common direction.
pub struct Parallel(pub [f32; 3]);

impl Bundle for Parallel {
    type Seen = Along;

    #[inline(always)]
    fn see(&self, corners: [[f32; 3]; 3]) -> Along {
        Along::new(self.0, corners)
    }

    #[inline(always)]
    fn origins<S: Simd>(&self, simd: S, rays: &Rows, row: usize) -> [f32x8<S>; 3] {
        all(simd, &rays.o, row)
    }

    #[inline(always)]
    fn directions<S: Simd>(&self, simd: S, _: &Rows, _: usize) -> [f32x8<S>; 3] {
        spread(simd, self.0)
    }

    #[inline(always)]
    fn candidates<S: Simd>(
        &self,
        simd: S,
        seen: &Along,
        rays: &Rows,
        row: usize,
        reach: f32x8<S>,
    ) -> u64 {
        seen.candidates(simd, all(simd, &rays.o, row), reach)
    }
}
