// SPDX-License-Identifier: GPL-3.0-or-later
//! The public types of ray tracing: rays, hits, counters and the trait of everything that traces them.

use crate::cases::CASES;
use crate::counters::Log;
use crate::selection::{Filtered, HitFilter};
use halfspace_geom::Aabb;
use halfspace_scene::Triangles;

/// A ray `o + t d` with `t` in the closed interval `[t_min, t_max]`.
// Field order matters: tiles load the first and the last four numbers of a ray as one vector each.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C)]
pub struct Ray {
    /// Origin, in the scene's space.
    pub o: [f32; 3],
    /// Direction, of any length; a ray with a zero direction hits nothing.
    pub d: [f32; 3],
    /// Smallest distance of a hit, in units of `d`.
    pub t_min: f32,
    /// Largest distance of a hit, in units of `d`; may be infinite.
    pub t_max: f32,
}

impl Ray {
    /// Returns whether `t` lies in the ray's interval and is finite: a distance beyond the range of f32, on either side
    /// of the origin, is no hit, because an infinite distance stands for a miss.
    #[inline(always)]
    pub fn reaches(&self, t: f32) -> bool {
        self.t_min <= t && t <= self.t_max && t.abs() < f32::INFINITY
    }
}

/// The nearest hit of a ray; among hits at equal `t`, the one with the smallest triangle number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Distance in units of the direction, correctly rounded; infinite for a miss.
    pub t: f32,
    /// Number of the triangle; [`Hit::NONE`] for a miss.
    pub triangle: u32,
    /// Barycentric weight of the second vertex.
    pub u: f32,
    /// Barycentric weight of the third vertex.
    pub v: f32,
}

impl Hit {
    /// The triangle number of a miss.
    pub const NONE: u32 = u32::MAX;
    /// The hit of a ray that hits nothing.
    pub const MISS: Self = Self {
        t: f32::INFINITY,
        triangle: Self::NONE,
        u: 0.0,
        v: 0.0,
    };

    /// Returns whether this is a hit.
    pub fn is_hit(&self) -> bool {
        self.triangle != Self::NONE
    }
}

/// The key by which hits are ordered: distance, then triangle number.
#[derive(Debug, Clone, Copy)]
pub struct HitKey {
    /// Distance of the hit.
    pub t: f32,
    /// Number of the triangle; [`Hit::NONE`] is larger than all numbers.
    pub triangle: u32,
}

impl HitKey {
    /// Makes the key of a hit.
    #[inline(always)]
    pub fn new(t: f32, triangle: u32) -> Self {
        Self { t, triangle }
    }

    /// Returns whether this hit is nearer than the other, or as near with a smaller triangle number.
    #[inline(always)]
    pub fn precedes(self, other: Self) -> bool {
        self.t < other.t || (self.t == other.t && self.triangle < other.triangle)
    }

    /// Returns the largest distance at which a triangle would precede this hit: its own, or, if the triangle has a larger
    /// number, the one below.
    #[inline(always)]
    pub fn last_before(self, triangle: u32) -> f32 {
        if triangle > self.triangle {
            self.t.next_down()
        } else {
            self.t
        }
    }

    /// Returns the order of two hits, whose distances are not NaN.
    pub fn order(self, other: Self) -> std::cmp::Ordering {
        let distances = self.t.partial_cmp(&other.t);
        distances
            .expect("no distance is NaN")
            .then(self.triangle.cmp(&other.triangle))
    }
}

/// Work counters of one ray. When a group of rays (packet, tile, beam or stream) visits a node, the first ray of the
/// group counts a step or a leaf, and the others count [`Self::joined`]: sums over all rays are the work of the kernel.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct RayCounters {
    /// Inner nodes with an axis-aligned split plane.
    pub steps_axis: u32,
    /// Inner nodes with an oblique split plane or with oriented boxes.
    pub steps_oblique: u32,
    /// Inner nodes with boxes, intervals or octants, and steps from cell to cell of a grid.
    pub steps_boxes: u32,
    /// Visits of leaves with triangles.
    pub leaves: u32,
    /// Visits of leaves without triangles.
    pub leaves_empty: u32,
    /// Visits of nodes and leaves with a group, counted as steps and leaves of another ray of the group.
    pub joined: u32,
    /// Triangles tested in f32.
    pub tests: u32,
    /// Tests in visits of leaves, or of a remembered blocker, that did not improve the ray's answer: they found no
    /// nearer hit, or for an any-hit ray no hit.
    pub tests_wasted: u32,
    /// Exact verdicts on candidates. Traversals without counters need fewer: none for shadow rays whose hit f32
    /// has proven, and mostly one for rays in streams or in flight.
    pub verdicts: u32,
    /// Counters of particular traversals: cases of ray and plane ([`crate::cases::NAMES`]), or events of beams
    /// (`halfspace_beam::planes::NAMES`).
    pub cases: [u32; CASES],
    /// 1 if the ray needed no traversal of its own: the shadow cache held its blocker, or its shadow beam was
    /// empty.
    pub spared: u32,
}

impl RayCounters {
    /// Returns the number of inner nodes of all kinds.
    pub fn steps(&self) -> u32 {
        self.steps_axis + self.steps_oblique + self.steps_boxes
    }

    /// Returns the number of nodes and leaves that the ray visited, singly or with a group.
    pub fn visits(&self) -> u32 {
        self.steps() + self.leaves + self.leaves_empty + self.joined
    }

    /// Adds the counters of another traversal.
    pub fn add(&mut self, other: &Self) {
        self.steps_axis += other.steps_axis;
        self.steps_oblique += other.steps_oblique;
        self.steps_boxes += other.steps_boxes;
        self.leaves += other.leaves;
        self.leaves_empty += other.leaves_empty;
        self.joined += other.joined;
        self.tests += other.tests;
        self.tests_wasted += other.tests_wasted;
        self.verdicts += other.verdicts;
        for (case, more) in self.cases.iter_mut().zip(other.cases) {
            *case += more;
        }
        self.spared += other.spared;
    }
}

/// The order of a batch's rays: a hint that changes no result.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Order {
    /// In no particular order.
    #[default]
    None,
    /// Each 64 consecutive rays are those of a tile of 8 x 8 pixels, row by row, mostly with a common origin.
    Tiles,
}

/// Traces batches of rays against a scene.
pub trait Tracer: Sync {
    /// Returns the triangles as one array, if they are stored as one.
    fn triangles(&self) -> Option<&Triangles> {
        None
    }
    /// Returns the number of triangles, including those that can never be hit; triangle numbers of hits are less.
    fn count(&self) -> usize;
    /// Returns the vertices of a triangle in the scene.
    fn corners(&self, id: u32) -> [[f32; 3]; 3];
    /// Writes the nearest hit of each ray, on the calling thread. All slices have the length of `rays`.
    fn closest(&self, rays: &[Ray], hits: &mut [Hit], counters: Option<&mut [RayCounters]>);
    /// Whether [`Self::closest_ordered`] traces rays in tiles where they come in tiles.
    fn takes_tiles(&self) -> bool {
        false
    }
    /// Like [`Self::closest`], with a hint on the order of the rays. The hits are the same, the speed may differ.
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
    /// Returns the bounding box of the scene if batches, for any hits or for nearest hits, are faster when rays with
    /// nearby origins are consecutive, else `None`.
    fn near_rays(&self, any: bool) -> Option<Aabb> {
        let _ = any;
        None
    }
    /// Returns the largest number of rays in this order that are worth tracing at once on one thread, for any hits or
    /// for nearest hits; `None` if batches beyond the usual size gain nothing.
    fn batch(&self, order: Order, any: bool) -> Option<usize> {
        let _ = (order, any);
        None
    }
    /// Writes for each ray the depth of the last leaf whose triangles were tested for its nearest hit, for display; 0
    /// if there is none or if depths are unknown.
    fn leaf_depths(&self, rays: &[Ray], depths: &mut [u32]) {
        let _ = rays;
        depths.fill(0);
    }
    /// Writes for each ray the nearest of the hits that a filter keeps, on the calling thread; the answer of a ray that it
    /// ends means nothing. By default rays begin again behind each hit that they pass, so that of several hits at one
    /// distance the filter is asked about the first alone.
    fn sift(&self, rays: &[Ray], hits: &mut [Hit], filter: HitFilter<'_>) {
        for (i, (ray, hit)) in rays.iter().zip(hits).enumerate() {
            let mut rest = *ray;
            loop {
                let mut next = [Hit::MISS];
                self.closest(&[rest], &mut next, None);
                let verdict = next[0].is_hit().then(|| filter(i, &next[0]));
                *hit = match verdict {
                    Some(Filtered::Ended) => Hit::MISS,
                    Some(Filtered::Passed) => {
                        rest.t_min = next[0].t.next_up();
                        continue;
                    }
                    _ => next[0],
                };
                break;
            }
        }
    }
    /// Writes whether each ray hits any triangle, on the calling thread. All slices have the length of `rays`.
    fn occluded(&self, rays: &[Ray], occluded: &mut [bool], counters: Option<&mut [RayCounters]>);
}

/// A tracer whose rays may ask for other hits than the nearest of all triangles.
pub trait SelectiveTracer: Tracer {
    /// Traces rays one by one on the calling thread, for the nearest hits or for any hits, and passes each answer to
    /// `write`. `log` returns what is recorded or hidden for the ray with this index; it is called once per ray, in
    /// their order.
    fn observe<'l>(
        &self,
        rays: &[Ray],
        any: bool,
        write: &mut dyn FnMut(usize, Hit),
        log: &mut dyn FnMut(usize) -> Log<'l>,
    );
}
