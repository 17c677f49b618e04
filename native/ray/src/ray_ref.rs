// SPDX-License-Identifier: GPL-3.0-or-later
//! Rays and scenes as kernels take them: in the caller's coordinates together with the frame of the tree.

use crate::frame::Frame;
use crate::{FrameRay, Ray};
use halfspace_scene::Triangles;

/// One ray in the caller's coordinates, which the verdict needs, and in the frame, which the traversal needs.
#[derive(Clone, Copy)]
pub struct RayRef<'a> {
    /// The ray of the caller.
    pub ray: &'a Ray,
    /// The ray in the frame of the tree.
    pub frame: &'a FrameRay<'a>,
}

/// A ray, and the interval of distances in which the f32 test may prove its hits.
#[derive(Clone, Copy)]
pub struct BoundedRay<'a> {
    /// The ray.
    pub ray: RayRef<'a>,
    /// The interval [`FrameRay::certain`] of the ray, computed once per leaf or per ray.
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
