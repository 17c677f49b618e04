// SPDX-License-Identifier: GPL-3.0-or-later
//! Two-level scenes as tracers.

use crate::instances::Instances;
use crate::instances::tracing::Run;
use fearless_simd::Level;
use halfspace_base::{Monitor, simd};
use halfspace_ray::counters::Log;
use halfspace_ray::query::{Any, Closest};
use halfspace_ray::selection::{HitFilter, Sieve};
use halfspace_ray::{Hit, Ray, RayCounters, SelectiveTracer, Tracer};

impl Instances {
    /// Returns the same scene with its traversals on the given instruction set instead of the best one.
    pub fn at_level(&self, level: Level) -> AtLevel<'_> {
        AtLevel {
            instances: self,
            level,
            monitor: None,
        }
    }

    /// Returns the same scene, which leaves rays without an answer once the monitor is cancelled.
    pub fn watched<'a>(&'a self, monitor: Option<&'a Monitor>) -> AtLevel<'a> {
        AtLevel {
            monitor,
            ..self.at_level(simd::level())
        }
    }
}

/// Two-level scene with traversals on a given instruction set.
pub struct AtLevel<'a> {
    instances: &'a Instances,
    level: Level,
    monitor: Option<&'a Monitor>,
}

impl AtLevel<'_> {
    /// How rays are traced.
    fn run(&self) -> Run<'_> {
        Run {
            level: self.level,
            monitor: self.monitor,
        }
    }
}

impl Tracer for AtLevel<'_> {
    fn count(&self) -> usize {
        self.instances.count()
    }

    fn corners(&self, id: u32) -> [[f32; 3]; 3] {
        self.instances.corners(id)
    }

    fn closest(&self, rays: &[Ray], hits: &mut [Hit], counters: Option<&mut [RayCounters]>) {
        assert_eq!(rays.len(), hits.len(), "one answer per ray");
        let write = &mut |i: usize, hit: Hit| hits[i] = hit;
        let log = &mut |_| Log::Nothing;
        self.instances
            .trace::<Closest>(self.run(), rays, write, log, counters);
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool], counters: Option<&mut [RayCounters]>) {
        assert_eq!(rays.len(), occluded.len(), "one answer per ray");
        let write = &mut |i: usize, hit: Hit| occluded[i] = hit.is_hit();
        let log = &mut |_| Log::Nothing;
        self.instances
            .trace::<Any>(self.run(), rays, write, log, counters);
    }
}

impl Tracer for Instances {
    fn count(&self) -> usize {
        *self.firsts.last().expect("one more than instances") as usize
    }

    fn corners(&self, id: u32) -> [[f32; 3]; 3] {
        let (instance, local) = self.locate(id);
        let corners = self.meshes[self.mesh_of[instance] as usize]
            .scene()
            .corners(local);
        let placed = self
            .place(instance)
            .and_then(|place| place.to_scene.corners(corners));
        placed.unwrap_or([[f32::NAN; 3]; 3])
    }

    fn closest(&self, rays: &[Ray], hits: &mut [Hit], counters: Option<&mut [RayCounters]>) {
        self.at_level(simd::level()).closest(rays, hits, counters);
    }

    fn sift(&self, rays: &[Ray], hits: &mut [Hit], filter: HitFilter<'_>) {
        let write = &mut |i: usize, hit: Hit| hits[i] = hit;
        let log = &mut |ray| Log::Filtered(Sieve { filter, ray });
        let run = self.watched(None);
        self.trace::<Closest>(run.run(), rays, write, log, None);
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool], counters: Option<&mut [RayCounters]>) {
        self.at_level(simd::level())
            .occluded(rays, occluded, counters);
    }
}

impl SelectiveTracer for Instances {
    fn observe<'l>(
        &self,
        rays: &[Ray],
        any: bool,
        write: &mut dyn FnMut(usize, Hit),
        log: &mut dyn FnMut(usize) -> Log<'l>,
    ) {
        let run = self.watched(None);
        if any {
            self.trace::<Any>(run.run(), rays, write, log, None);
        } else {
            self.trace::<Closest>(run.run(), rays, write, log, None);
        }
    }
}
