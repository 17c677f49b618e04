// SPDX-License-Identifier: GPL-3.0-or-later
//! What the rays of a beam share: their origin (a pinhole, a point light), or their direction (an
//! orthographic camera, a sun). What the shared half says about a triangle is worked out once per
//! beam, and each ray is left with three dot products, eight rays at a time.

use super::lanes::{Along, Seen};
use super::ray::Ray;
use fearless_simd::{Simd, SimdBase, f32x8};

/// Rays in a beam at most.
pub const RAYS: usize = 64;

/// Rays that are handled at once.
pub const LANES: usize = 8;

/// One number per ray.
pub type Row = [f32; RAYS];

/// Origins and directions in the frame.
pub struct Rows {
    /// Origins.
    pub o: [Row; 3],
    /// Directions.
    pub d: [Row; 3],
}

impl Rows {
    /// All zero.
    #[inline(always)]
    pub fn blank() -> Self {
        Self {
            o: [[0.0; RAYS]; 3],
            d: [[0.0; RAYS]; 3],
        }
    }
}

/// Eight places of a row.
#[inline(always)]
pub fn load<S: Simd>(simd: S, from: &Row, row: usize) -> f32x8<S> {
    f32x8::from_slice(simd, &from[row..row + LANES])
}

/// Eight places of three rows. Written out, because a closure would leave the instruction set.
#[inline(always)]
pub fn all<S: Simd>(simd: S, from: &[Row; 3], row: usize) -> [f32x8<S>; 3] {
    [
        load(simd, &from[0], row),
        load(simd, &from[1], row),
        load(simd, &from[2], row),
    ]
}

/// One vector for eight rays.
#[inline(always)]
fn spread<S: Simd>(simd: S, v: [f32; 3]) -> [f32x8<S>; 3] {
    [
        f32x8::splat(simd, v[0]),
        f32x8::splat(simd, v[1]),
        f32x8::splat(simd, v[2]),
    ]
}

/// The places of the bits of a mask.
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

/// Whether the rays differ in their origins, and which share the first one's direction then, or else its
/// origin.
#[inline(always)]
pub fn alike(rays: &[Ray]) -> (bool, u64) {
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

/// Rays that share something.
pub trait Bundle {
    /// A triangle, as the shared half sees it.
    type Seen;

    /// A triangle, as the shared half sees it.
    fn see(&self, corners: [[f32; 3]; 3]) -> Self::Seen;

    /// Eight rays' origins.
    fn origins<S: Simd>(&self, simd: S, rays: &Rows, row: usize) -> [f32x8<S>; 3];

    /// Eight rays' directions.
    fn directions<S: Simd>(&self, simd: S, rays: &Rows, row: usize) -> [f32x8<S>; 3];

    /// Which of eight rays may hit the triangle no farther away than `reach`.
    fn candidates<S: Simd>(
        &self,
        simd: S,
        seen: &Self::Seen,
        rays: (&Rows, usize),
        reach: f32x8<S>,
    ) -> u64;
}

/// Rays of this origin.
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
        (rays, row): (&Rows, usize),
        reach: f32x8<S>,
    ) -> u64 {
        seen.candidates(simd, all(simd, &rays.d, row), reach)
    }
}

/// Rays of this direction.
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
        (rays, row): (&Rows, usize),
        reach: f32x8<S>,
    ) -> u64 {
        seen.candidates(simd, all(simd, &rays.o, row), reach)
    }
}
