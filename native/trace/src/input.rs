// SPDX-License-Identifier: GPL-3.0-or-later
//! The input of a group of rays: the triangles, and the rays as the caller gave them.

use halfspace_leaf::Job;
use halfspace_leaf::blocks::Blocks;
use halfspace_ray::{Ray, RaySlice};
use halfspace_scene::Triangles;

/// The triangles and rays of one group, in the caller's coordinates, as the exact verdict needs them.
#[derive(Clone, Copy)]
pub struct Input<'a> {
    /// The triangles of the scene.
    pub scene: &'a Triangles,
    /// The blocks of the leaves.
    pub blocks: &'a Blocks,
    /// The rays.
    pub rays: &'a [Ray],
}

impl<'a> Input<'a> {
    /// The triangles of a job and the rays of a slice.
    #[inline(always)]
    pub fn new(job: Job<'a>, rays: RaySlice<'a>) -> Self {
        Self {
            scene: job.scene,
            blocks: job.blocks,
            rays: rays.rays,
        }
    }

    /// The triangles alone.
    #[inline(always)]
    pub fn job(self) -> Job<'a> {
        Job {
            scene: self.scene,
            blocks: self.blocks,
        }
    }

    /// The same with the leaves of another part of the tree.
    #[inline(always)]
    pub fn with(self, blocks: &'a Blocks) -> Self {
        Self { blocks, ..self }
    }
}
