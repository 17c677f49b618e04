// SPDX-License-Identifier: GPL-3.0-or-later
//! Rays through a structure: each batch goes to the kernel that the plan names.

use crate::division::{Joined, Part};
use crate::leaf_depth::LeafDepths;
use crate::plan::{Plan, RoutedKernel};
use crate::row::Built;
use crate::structure::Structure;
use fearless_simd::Level;
use halfspace_base::error::Result;
use halfspace_base::{Monitor, simd};
use halfspace_geom::Aabb;
use halfspace_ray::beam_path::BeamPath;
use halfspace_ray::counters::Log;
use halfspace_ray::path::Path;
use halfspace_ray::query::{Any, Closest, Count, Query};
use halfspace_ray::replay::{Record, Recording};
use halfspace_ray::selection::HitFilter;
use halfspace_ray::{FrameRay, Hit, Order, Ray, RayCounters, SelectiveTracer, Tracer};
use halfspace_scene::Triangles;
use halfspace_trace::batch::{Batch, Write};
use halfspace_trace::kernel::Kernel;
use std::slice;

/// Trees of at most this many bytes stay in the caches of most processors, whatever the order of the rays.
const IN_CACHE: usize = 4 << 20;

impl Structure {
    /// The same structure on a given instruction set instead of the best one: for tests, which show
    /// that answers do not depend on it.
    pub fn at_level(&self, level: Level) -> AtLevel<'_> {
        AtLevel {
            structure: self,
            level,
            monitor: None,
        }
    }

    /// The same structure, which leaves rays whose work is counted without an answer once the monitor is cancelled.
    pub fn watched<'a>(&'a self, monitor: Option<&'a Monitor>) -> AtLevel<'a> {
        AtLevel {
            monitor,
            ..self.at_level(simd::level())
        }
    }

    /// The nearest hit of one ray, or the hit that ends an any-hit ray, and the leaves on its path.
    /// It means nothing once the monitor is cancelled.
    pub fn path(&self, ray: &Ray, any: bool, monitor: Option<&Monitor>) -> (Hit, Path) {
        let (known, counters, rest) = self.before(ray, any, monitor);
        let built = self.built();
        let batch = Batch {
            monitor,
            ..self.one_by_one(built, slice::from_ref(&rest))
        };
        let (mut hit, mut path) = built.plan.single.path(&batch, any);
        Closest::join(&mut hit, known);
        path.counters.add(&counters);
        (hit, path)
    }

    /// The nearest hits of rays that go together, or the hits that end any-hit rays, with their counters, and the way of
    /// their beams of polygons through the tree; `None` unless the plan has such beams for them. They mean nothing once
    /// the monitor is cancelled.
    pub fn beams(
        &self,
        rays: &[Ray],
        any: bool,
        monitor: Option<&Monitor>,
    ) -> Option<(Vec<Hit>, Vec<RayCounters>, BeamPath)> {
        // Trace each ray through the trees apart, and its rest through the tree.
        let before = rays.iter().map(|ray| self.before(ray, any, monitor));
        let before: Vec<_> = before.collect();
        let rest: Vec<_> = before.iter().map(|(_, _, rest)| *rest).collect();
        let mut counters: Vec<_> = before.iter().map(|(_, counters, _)| *counters).collect();
        let mut hits = vec![Hit::MISS; rays.len()];
        let built = self.built();
        let batch = Batch {
            monitor,
            ..self.batch(built, simd::level(), &rest)
        };
        let path = if any {
            let beams = built.plan.shadow.as_ref()?;
            beams
                .kernel
                .record_beams(&batch, &mut hits, &mut counters)?
        } else {
            let beams = built.plan.tiles.as_ref()?;
            beams
                .kernel
                .record_beams(&batch, &mut hits, &mut counters)?
        };
        for (hit, (known, _, _)) in hits.iter_mut().zip(before) {
            Closest::join(hit, known);
        }
        Some((hits, counters, path))
    }

    /// Traces a ray through the trees apart. Returns the best hit there with its work, and the part of the ray that may
    /// have a better one; it is empty after any hit of an any-hit ray.
    fn before(&self, ray: &Ray, any: bool, monitor: Option<&Monitor>) -> (Hit, RayCounters, Ray) {
        let (mut known, mut counters, mut rest) = (Hit::MISS, RayCounters::default(), *ray);
        for built in &self.apart {
            let batch = Batch {
                monitor,
                ..self.one_by_one(built, slice::from_ref(&rest))
            };
            let (hit, path) = built.plan.single.path(&batch, any);
            counters.add(&path.counters);
            Closest::join(&mut known, hit);
            if any && known.is_hit() {
                (rest.t_min, rest.t_max) = (f32::INFINITY, f32::NEG_INFINITY);
                break;
            }
            rest = Closest::rest(ray, &known);
        }
        (known, counters, rest)
    }

    /// Traces rays one by one and records the answer of each leaf, for [`Self::replay`].
    ///
    /// # Errors
    /// [`halfspace_base::error::Error::Spec`] for brute force, which has no leaves to record;
    /// [`halfspace_base::error::Error::Cancelled`] once the monitor is cancelled.
    pub fn record(
        &self,
        mut rays: Vec<Ray>,
        any: bool,
        monitor: Option<&Monitor>,
    ) -> Result<Recording> {
        let built = self.built();
        // Record the part of each ray that the trees apart leave.
        let check = || monitor.map_or(Ok(()), Monitor::check);
        if !self.apart.is_empty() {
            for ray in &mut rays {
                check()?;
                *ray = self.before(ray, any, monitor).2;
            }
        }
        let mut counters = vec![RayCounters::default(); rays.len()];
        let mut record = Record::default();
        let batch = Batch {
            monitor,
            ..self.one_by_one(built, &rays)
        };
        built
            .plan
            .single
            .record(&batch, any, &mut counters, &mut record)?;
        check()?;
        Ok(Recording {
            rays,
            any,
            counters,
            record,
        })
    }

    /// Traces recorded rays of this structure once more, on the calling thread, through the same nodes but without
    /// triangle tests. Returns the seconds that each chunk of rays took, and the number of rays that visited other
    /// leaves than recorded, which is 0 unless there is a bug.
    pub fn replay(&self, recording: &Recording) -> (Vec<f64>, usize) {
        let built = self.built();
        let batch = self.one_by_one(built, &recording.rays);
        built.plan.single.replay(&batch, recording)
    }

    /// Traces rays that were transformed into the space of an instance of this mesh, one by one. `counters`: one per
    /// ray, or none.
    pub(crate) fn cast_placed<Q: Query>(
        &self,
        level: Level,
        rays: &[Ray],
        placed: &[FrameRay<'_>],
        write: Write<'_>,
        counters: Option<&mut [RayCounters]>,
    ) {
        let batch = Batch {
            scene: self.triangles(&self.built),
            frame: &self.built.frame,
            rays,
            level,
            shadow_cache: false,
            placed: Some(placed),
            monitor: None,
        };
        self.built.plan.single.cast(&batch, Q::ANY, write, counters);
    }

    /// Traces one ray that was transformed into the space of an instance of this mesh, in the frame of one of its trees,
    /// with the counters given.
    pub(crate) fn observe_placed<Q: Query>(
        &self,
        built: &Built,
        ray: &Ray,
        placed: &FrameRay<'_>,
        write: Write<'_>,
        count: Count<'_>,
    ) {
        let batch = Batch {
            scene: self.triangles(built),
            frame: &built.frame,
            rays: slice::from_ref(ray),
            level: simd::level(),
            shadow_cache: false,
            placed: Some(slice::from_ref(placed)),
            monitor: None,
        };
        let mut count = Some(count);
        let single = &built.plan.single;
        single.observe(&batch, Q::ANY, write, &mut |_| {
            count.take().expect("one ray")
        });
    }

    /// As [`SelectiveTracer::observe`], ray by ray through all trees.
    fn observe_parts<'l>(
        &self,
        rays: &[Ray],
        any: bool,
        write: &mut dyn FnMut(usize, Hit),
        log: &mut dyn FnMut(usize) -> Log<'l>,
    ) {
        for (i, ray) in rays.iter().enumerate() {
            let (mut log, mut best) = (log(i), Hit::MISS);
            for built in self.apart.iter().chain([&self.built]) {
                let (rest, mut counters) = (Closest::rest(ray, &best), RayCounters::default());
                let batch = Batch {
                    shadow_cache: false,
                    ..self.batch(built, simd::level(), slice::from_ref(&rest))
                };
                let mut count = Some(Count::with(&mut counters, log.reborrow()));
                let mut join = |_: usize, hit: Hit| Closest::join(&mut best, hit);
                (built.plan.single).observe(&batch, any, &mut join, &mut |_| {
                    count.take().expect("one ray")
                });
                if any && best.is_hit() {
                    break;
                }
            }
            write(i, best);
        }
    }

    fn batch<'a>(&'a self, built: &'a Built, level: Level, rays: &'a [Ray]) -> Batch<'a> {
        Batch {
            scene: self.triangles(built),
            frame: &built.frame,
            rays,
            level,
            shadow_cache: built.plan.shadow_cache,
            placed: None,
            monitor: None,
        }
    }

    /// Rays for the single-ray kernel of the whole tree.
    fn one_by_one<'a>(&'a self, built: &'a Built, rays: &'a [Ray]) -> Batch<'a> {
        Batch {
            shadow_cache: self.built.plan.shadow_cache,
            ..self.batch(built, simd::level(), rays)
        }
    }
}

/// Traces a batch by the kernel of its route, or by single rays where there is none, it cannot count, or there are few rays.
/// `counters`: one per ray, or none.
pub(crate) fn trace<Q: Query>(
    routed: Option<&RoutedKernel<Q>>,
    single: &dyn Kernel<Q>,
    batch: &Batch<'_>,
    answers: &mut [Q::Answer],
    counters: Option<&mut [RayCounters]>,
) {
    assert_eq!(batch.rays.len(), answers.len(), "one answer per ray");
    let routed = routed.filter(|routed| batch.rays.len() >= routed.least);
    let kernel = routed.map(|routed| &*routed.kernel);
    match counters {
        None => kernel.unwrap_or(single).trace(batch, answers),
        Some(counters) => {
            if !kernel.is_some_and(|kernel| kernel.count(batch, answers, counters)) {
                let counted = single.count(batch, answers, counters);
                assert!(counted, "single rays can be counted");
            }
        }
    }
}

/// Traces a batch for the nearest hits: by the kernel of tiles if it comes in tiles and there is one that can count.
fn closest(
    batch: &Batch<'_>,
    plan: &Plan,
    hits: &mut [Hit],
    mut counters: Option<&mut [RayCounters]>,
    order: Order,
) {
    assert_eq!(batch.rays.len(), hits.len(), "one answer per ray");
    if let Some(tiles) = plan.tiles.as_ref().filter(|_| order == Order::Tiles) {
        let answered = match counters.as_deref_mut() {
            None => {
                tiles.kernel.trace(batch, hits);
                true
            }
            Some(counters) => tiles.kernel.count(batch, hits, counters),
        };
        if answered {
            return;
        }
    }
    trace::<Closest>(plan.closest.as_ref(), &*plan.single, batch, hits, counters);
}

/// A structure whose rays run on a given instruction set.
pub struct AtLevel<'a> {
    structure: &'a Structure,
    level: Level,
    monitor: Option<&'a Monitor>,
}

impl<'a> AtLevel<'a> {
    /// Rays for one tree.
    fn batch_of<'b>(&'b self, built: &'b Built, rays: &'b [Ray]) -> Batch<'b> {
        Batch {
            monitor: self.monitor,
            ..self.structure.batch(built, self.level, rays)
        }
    }
}

impl Tracer for AtLevel<'_> {
    fn triangles(&self) -> Option<&Triangles> {
        Some(&self.structure.scene)
    }

    fn count(&self) -> usize {
        self.structure.scene.len()
    }

    fn corners(&self, id: u32) -> [[f32; 3]; 3] {
        self.structure.scene.corners(id)
    }

    fn closest(&self, rays: &[Ray], hits: &mut [Hit], counters: Option<&mut [RayCounters]>) {
        self.closest_ordered(rays, hits, counters, Order::None);
    }

    fn closest_ordered(
        &self,
        rays: &[Ray],
        hits: &mut [Hit],
        counters: Option<&mut [RayCounters]>,
        order: Order,
    ) {
        (self.structure).each_part::<Closest>(
            rays,
            hits,
            counters,
            |part, rays, hits, counters| {
                let built = part.built;
                let ways = |rays: &[Ray], hits: &mut [Hit], counters: Option<&mut _>| {
                    let batch = self.batch_of(built, rays);
                    closest(&batch, &built.plan, hits, counters, order);
                };
                let unseparated = self.batch_of(built, rays);
                self.structure
                    .each_near::<Closest>(part, &unseparated, hits, counters, ways);
            },
        );
    }

    fn batch(&self, order: Order, any: bool) -> Option<usize> {
        self.structure.built.plan.batch(order, any)
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool], counters: Option<&mut [RayCounters]>) {
        let ways =
            |part: Part<'_>, rays: &[Ray], occluded: &mut [bool], counters: Option<&mut _>| {
                let built = part.built;
                let ways = |rays: &[Ray], occluded: &mut [bool], counters: Option<&mut _>| {
                    let batch = self.batch_of(built, rays);
                    let shadow = built.plan.shadow.as_ref();
                    trace::<Any>(shadow, &*built.plan.single, &batch, occluded, counters);
                };
                let unseparated = self.batch_of(built, rays);
                self.structure
                    .each_near::<Any>(part, &unseparated, occluded, counters, ways);
            };
        (self.structure).each_part::<Any>(rays, occluded, counters, ways);
    }
}

impl Structure {
    /// As [`Tracer::sift`], by single rays through one tree after the other.
    fn sift_parts(&self, rays: &[Ray], hits: &mut [Hit], filter: HitFilter<'_>) {
        hits.fill(Hit::MISS);
        let mut rest = rays.to_vec();
        for built in self.apart.iter().chain([&self.built]) {
            let batch = Batch {
                shadow_cache: false,
                ..self.batch(built, simd::level(), &rest)
            };
            let mut join = |i: usize, hit: Hit| Closest::join(&mut hits[i], hit);
            built.plan.single.sift(&batch, &mut join, filter);
            for ((rest, ray), hit) in rest.iter_mut().zip(rays).zip(&*hits) {
                *rest = Closest::rest(ray, hit);
            }
        }
    }
}

impl Tracer for Structure {
    fn triangles(&self) -> Option<&Triangles> {
        Some(&self.scene)
    }

    fn count(&self) -> usize {
        self.scene.len()
    }

    fn corners(&self, id: u32) -> [[f32; 3]; 3] {
        self.scene.corners(id)
    }

    fn closest(&self, rays: &[Ray], hits: &mut [Hit], counters: Option<&mut [RayCounters]>) {
        self.at_level(simd::level()).closest(rays, hits, counters);
    }

    fn closest_ordered(
        &self,
        rays: &[Ray],
        hits: &mut [Hit],
        counters: Option<&mut [RayCounters]>,
        order: Order,
    ) {
        self.at_level(simd::level())
            .closest_ordered(rays, hits, counters, order);
    }

    fn takes_tiles(&self) -> bool {
        self.built.plan.tiles.is_some()
    }

    fn batch(&self, order: Order, any: bool) -> Option<usize> {
        self.built.plan.batch(order, any)
    }

    fn near_rays(&self, any: bool) -> Option<Aabb> {
        let bytes = self.built.plan.working_set(any)?;
        (bytes > IN_CACHE).then(|| self.scene.bounds())
    }

    fn sift(&self, rays: &[Ray], hits: &mut [Hit], filter: HitFilter<'_>) {
        assert_eq!(rays.len(), hits.len(), "one answer per ray");
        if !self.apart.is_empty() {
            return self.sift_parts(rays, hits, filter);
        }
        let batch = Batch {
            // A remembered blocker may be one that the next ray passes.
            shadow_cache: false,
            ..self.batch(&self.built, simd::level(), rays)
        };
        let single = &self.built.plan.single;
        single.sift(&batch, &mut |i, hit| hits[i] = hit, filter);
    }

    fn leaf_depths(&self, rays: &[Ray], depths: &mut [u32]) {
        let known = self.leaf_depths.get_or_init(|| LeafDepths::new(self));
        for (ray, depth) in rays.iter().zip(depths) {
            *depth = known.of(self, ray);
        }
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool], counters: Option<&mut [RayCounters]>) {
        self.at_level(simd::level())
            .occluded(rays, occluded, counters);
    }
}

impl SelectiveTracer for Structure {
    fn observe<'l>(
        &self,
        rays: &[Ray],
        any: bool,
        write: &mut dyn FnMut(usize, Hit),
        log: &mut dyn FnMut(usize) -> Log<'l>,
    ) {
        if !self.apart.is_empty() {
            return self.observe_parts(rays, any, write, log);
        }
        let batch = Batch {
            // A remembered blocker may be one that the next ray does not see.
            shadow_cache: false,
            ..self.batch(&self.built, simd::level(), rays)
        };
        let mut counters = vec![RayCounters::default(); rays.len()];
        let mut counters = counters.iter_mut();
        let single = &self.built.plan.single;
        single.observe(&batch, any, write, &mut |i| {
            Count::with(counters.next().expect("one set per ray"), log(i))
        });
    }
}
