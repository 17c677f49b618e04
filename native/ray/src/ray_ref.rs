// SPDX-License-Identifier: GPL-3.0-or-later
//! A ray as kernels take it: as the caller gave it, and in the frame of the tree.

use crate::frame::Frame;
use crate::{FrameRay, Ray};
use halfspace_scene::Triangles;

/// One ray in both coordinates. The verdict needs the caller's, the traversal the frame's.
#[derive(Clone, Copy)]
pub struct RayRef<'a> {
    /// The ray of the caller.
    pub ray: &'a Ray,
    /// The ray in the frame of the tree.
    pub frame: &'a FrameRay<'a>,
}

/// A ray whose hits f32 may prove, and the distances between which it may.
#[derive(Clone, Copy)]
pub struct BoundedRay<'a> {
    /// The ray.
    pub ray: RayRef<'a>,
    /// [`FrameRay::certain`] of the ray, computed once per leaf or per ray.
    pub certain: [f32; 2],
}

/// Consecutive rays of a caller, and the frame of the tree that they are traced through.
#[derive(Clone, Copy)]
pub struct RaySlice<'a> {
    /// The frame of the tree.
    pub frame: &'a Frame,
    /// The rays of the caller.
    pub rays: &'a [Ray],
}

/// The triangles of a scene, and the frame of the tree that is built over them.
#[derive(Clone, Copy)]
pub struct FramedScene<'a> {
    /// The triangles, in the coordinates of the caller.
    pub scene: &'a Triangles,
    /// The frame of the tree.
    pub frame: &'a Frame,
}
