// SPDX-License-Identifier: GPL-3.0-or-later
//! Rays and their answers, as callers see them.

use super::cases::CASES;
use crate::geom::Aabb;
use crate::scene::Triangles;

/// A ray `o + t d` with `t` in the closed interval `[t_min, t_max]`.
// Laid out as written: tiles take the first and the last four numbers of a ray as a vector each.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C)]
pub struct Ray {
    /// Origin, scene frame.
    pub o: [f32; 3],
    /// Direction, of any length; a zero direction meets nothing.
    pub d: [f32; 3],
    /// Smallest distance that counts, in units of `d`.
    pub t_min: f32,
    /// Largest distance that counts, in units of `d`; may be infinite.
    pub t_max: f32,
}

impl Ray {
    /// Whether a hit at this distance counts. An infinite distance stands for a miss, so it cannot be a hit; neither can
    /// one too large for a float, before or behind the origin.
    #[inline(always)]
    pub fn reaches(&self, t: f32) -> bool {
        self.t_min <= t && t <= self.t_max && t.abs() < f32::INFINITY
    }
}

/// The nearest triangle a ray meets. Of several at the same `t` the one with the smallest number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Distance in units of the direction, correctly rounded; infinite for a miss.
    pub t: f32,
    /// Number of the triangle; [`Hit::NONE`] for a miss.
    pub triangle: u32,
    /// Barycentric weight of the second corner.
    pub u: f32,
    /// Barycentric weight of the third corner.
    pub v: f32,
}

impl Hit {
    /// The triangle number of a miss.
    pub const NONE: u32 = u32::MAX;
    /// The answer of a ray that meets nothing.
    pub const MISS: Self = Self {
        t: f32::INFINITY,
        triangle: Self::NONE,
        u: 0.0,
        v: 0.0,
    };

    /// Whether some triangle was met.
    pub fn is_hit(&self) -> bool {
        self.triangle != Self::NONE
    }

    /// Whether a hit at the first distance, with the first triangle, is nearer than the second one, or as near and of a
    /// smaller number. That of no triangle is larger than all others.
    #[inline(always)]
    pub fn precedes((t, id): (f32, u32), (best_t, best_id): (f32, u32)) -> bool {
        t < best_t || (t == best_t && id < best_id)
    }
}

/// What one ray cost.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct RayCounters {
    /// Inner nodes with an axis-aligned plane (or a box, a slab pair, an octant).
    pub steps_axis: u32,
    /// Inner nodes with an oblique plane.
    pub steps_oblique: u32,
    /// Leaves with triangles.
    pub leaves: u32,
    /// Leaves without.
    pub leaves_empty: u32,
    /// Triangles tested in f32.
    pub tests: u32,
    /// Candidates put to the exact verdict. Walks that do not count put fewer to it: shadow rays none of which
    /// f32 is sure, rays in streams or in flight most often only the nearest.
    pub verdicts: u32,
    /// What only some walks tell apart: cases of ray and plane ([`super::cases::NAMES`]), or what beams do
    /// ([`super::plane_beam::NAMES`]).
    pub cases: [u32; CASES],
    /// 1 where the tree was not walked for this ray: the shadow cache knew a blocker, or its shadow
    /// beam was empty.
    pub spared: u32,
}

impl RayCounters {
    /// Adds what another walk cost.
    pub fn add(&mut self, other: &Self) {
        self.steps_axis += other.steps_axis;
        self.steps_oblique += other.steps_oblique;
        self.leaves += other.leaves;
        self.leaves_empty += other.leaves_empty;
        self.tests += other.tests;
        self.verdicts += other.verdicts;
        for (case, more) in self.cases.iter_mut().zip(other.cases) {
            *case += more;
        }
        self.spared += other.spared;
    }
}

/// How the rays of a batch follow one another: a hint, which changes no answer.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Order {
    /// Anyhow.
    #[default]
    None,
    /// Every 64 are the rays of a tile of 8 x 8 pixels, row by row, mostly of one origin.
    Tiles,
}

/// What a renderer sees of a structure: batches of rays in, answers out.
pub trait Tracer: Sync {
    /// The triangles as one array, where they are at hand as that.
    fn triangles(&self) -> Option<&Triangles> {
        None
    }
    /// How many triangles hits may refer to, those included that can never be hit.
    fn count(&self) -> usize;
    /// The corners of a triangle in the scene.
    fn corners(&self, id: u32) -> [[f32; 3]; 3];
    /// The nearest hit of each ray, on the calling thread. All slices have the same length.
    fn closest(&self, rays: &[Ray], hits: &mut [Hit], counters: Option<&mut [RayCounters]>);
    /// The same, told how the rays follow one another; it may be quicker, and the answers are the
    /// same.
    fn closest_ordered(
        &self,
        rays: &[Ray],
        hits: &mut [Hit],
        counters: Option<&mut [RayCounters]>,
        order: Order,
    ) {
        let _ = order;
        self.closest(rays, hits, counters);
    }
    /// The box of the scene, where rays that start near each other had better follow one another; `None` where they go
    /// singly, or where that is no quicker.
    fn near_rays(&self) -> Option<Aabb> {
        None
    }
    /// The depth of the last leaf that the walk of each ray to its nearest hit tests, for showing; 0
    /// where there is none, or where depths are not known.
    fn leaf_depths(&self, rays: &[Ray], depths: &mut [u32]) {
        let _ = rays;
        depths.fill(0);
    }
    /// Whether each ray meets anything at all, on the calling thread.
    fn occluded(&self, rays: &[Ray], occluded: &mut [bool], counters: Option<&mut [RayCounters]>);
}
