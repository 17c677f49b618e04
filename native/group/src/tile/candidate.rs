// SPDX-License-Identifier: GPL-3.0-or-later
//! Candidates: triangles that the f32 tests of a leaf could not rule out for some rays of a row.

use fearless_simd::{Simd, f32x16};
use halfspace_geom::vec3::map;
use halfspace_leaf::Job;
use halfspace_leaf::blocks::{Blocks, SPAN};

/// A triangle in the blocks of the leaves.
#[derive(Debug, Clone, Copy)]
pub struct StoredTriangle {
    /// Its number in the scene.
    pub id: u32,
    /// Position of its first word.
    pub at: usize,
    /// Distance between its words; 0 for a triangle stored as indices.
    pub stride: usize,
}

impl StoredTriangle {
    /// The triangle in `lane` of a block of `n` at word offset `at`.
    #[inline(always)]
    pub fn new(blocks: &Blocks, block: &[f32; SPAN], at: u32, n: usize, lane: usize) -> Self {
        let id = block[1 + 9 * n + lane].to_bits();
        let at = at as usize;
        if blocks.has_indices() {
            return Self {
                id,
                at: at + 4 * lane,
                stride: 0,
            };
        }
        Self {
            id,
            at: at + 1 + lane,
            stride: n,
        }
    }

    /// The three vertices in the frame, which must be unscaled. They are exact, so that the verdict on a ray with an
    /// exact origin in the frame is that on the ray in the scene.
    #[inline(always)]
    pub fn corners(self, job: Job<'_>) -> [[f32; 3]; 3] {
        if self.stride == 0 {
            let to_frame = job.blocks.to_frame();
            map(job.scene.corners(self.id), |p| to_frame.point(p))
        } else {
            job.blocks.corners_at(self.at, self.stride)
        }
    }

    /// The three vertices in the scene, of an unscaled frame.
    #[inline(always)]
    pub fn scene_corners(self, job: Job<'_>) -> [[f32; 3]; 3] {
        if self.stride == 0 {
            job.scene.corners(self.id)
        } else {
            let to_frame = job.blocks.to_frame();
            map(job.blocks.corners_at(self.at, self.stride), |p| {
                to_frame.vertex_to_scene(p)
            })
        }
    }
}

/// Distances in the frame of sixteen rays to a triangle's plane, as quotients `t / det` with the error bounds
/// of both.
#[derive(Clone, Copy)]
pub struct Quotient<S: Simd> {
    /// Numerators.
    pub t: f32x16<S>,
    /// Their error bounds.
    pub t_error: f32x16<S>,
    /// Denominators.
    pub det: f32x16<S>,
    /// Their error bounds.
    pub det_error: f32x16<S>,
}

/// Limits on the distances of proven hits, in the frame, rounded inwards.
#[derive(Clone, Copy)]
pub struct Limits<S: Simd> {
    /// Lower limits, rounded up.
    pub soonest: f32x16<S>,
    /// Upper limits, rounded down.
    pub latest: f32x16<S>,
    /// Error bound of subnormal distances.
    pub last_place: f32x16<S>,
}

/// The rays of a row that may hit a triangle.
#[derive(Clone, Copy)]
pub struct Candidate<S: Simd> {
    /// The row.
    pub row: usize,
    /// Mask of these rays.
    pub open: u16,
    /// Mask of those whose lines certainly pass through the triangle.
    pub sure: u16,
    /// Their distances. Undefined if no ray is in `sure`.
    pub distance: Quotient<S>,
    /// The triangle.
    pub triangle: StoredTriangle,
}
