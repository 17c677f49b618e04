// SPDX-License-Identifier: GPL-3.0-or-later
//! Rays through a structure: each batch goes to the kernel that the plan names.

use crate::leaf_depth::LeafDepths;
use crate::plan::RoutedKernel;
use crate::row::Built;
use crate::structure::Structure;
use fearless_simd::Level;
use halfspace_base::error::Result;
use halfspace_base::simd;
use halfspace_geom::Aabb;
use halfspace_ray::counters::Log;
use halfspace_ray::path::Path;
use halfspace_ray::query::{Any, Closest, Count, Query};
use halfspace_ray::replay::{Record, Recording};
use halfspace_ray::{FrameRay, Hit, Order, Ray, RayCounters, SelectiveTracer, Tracer};
use halfspace_scene::Triangles;
use halfspace_trace::batch::{Batch, Write};
use halfspace_trace::kernel::{Kernel, SingleRays};
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
        }
    }

    /// The nearest hit of one ray, or the hit that ends an any-hit ray, and the leaves on its path.
    pub fn path(&self, ray: &Ray, any: bool) -> (Hit, Path) {
        let built = self.built();
        built
            .plan
            .single
            .path(&self.one_by_one(built, slice::from_ref(ray)), any)
    }

    /// Traces rays one by one and records the answer of each leaf, for [`Self::replay`].
    ///
    /// # Errors
    /// [`halfspace_base::error::Error::Spec`] for brute force, which has no leaves to record.
    pub fn record(&self, rays: Vec<Ray>, any: bool) -> Result<Recording> {
        let built = self.built();
        let mut counters = vec![RayCounters::default(); rays.len()];
        let mut record = Record::default();
        let batch = self.one_by_one(built, &rays);
        built
            .plan
            .single
            .record(&batch, any, &mut counters, &mut record)?;
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
            scene: &self.scene,
            frame: &self.built.frame,
            rays,
            level,
            shadow_cache: false,
            placed: Some(placed),
        };
        self.built.plan.single.cast(&batch, Q::ANY, write, counters);
    }

    /// Traces one ray that was transformed into the space of an instance of this mesh, with the counters given.
    pub(crate) fn observe_placed<Q: Query>(
        &self,
        ray: &Ray,
        placed: &FrameRay<'_>,
        write: Write<'_>,
        count: Count<'_>,
    ) {
        let batch = Batch {
            scene: &self.scene,
            frame: &self.built.frame,
            rays: slice::from_ref(ray),
            level: simd::level(),
            shadow_cache: false,
            placed: Some(slice::from_ref(placed)),
        };
        let mut count = Some(count);
        let single = &self.built.plan.single;
        single.observe(&batch, Q::ANY, write, &mut |_| {
            count.take().expect("one ray")
        });
    }

    fn batch<'a>(&'a self, level: Level, rays: &'a [Ray]) -> Batch<'a> {
        Batch {
            scene: &self.scene,
            frame: &self.built.frame,
            rays,
            level,
            shadow_cache: self.built.plan.shadow_cache,
            placed: None,
        }
    }

    /// Rays for the single-ray kernel of the whole tree.
    fn one_by_one<'a>(&'a self, built: &'a Built, rays: &'a [Ray]) -> Batch<'a> {
        Batch {
            frame: &built.frame,
            ..self.batch(simd::level(), rays)
        }
    }
}

/// Traces a batch by `kernel`, or by single rays where there is none or it cannot count. `counters`: one per ray, or none.
fn trace<Q: Query>(
    routed: Option<&RoutedKernel<Q>>,
    single: &dyn Kernel<Q>,
    batch: &Batch<'_>,
    answers: &mut [Q::Answer],
    counters: Option<&mut [RayCounters]>,
) {
    assert_eq!(batch.rays.len(), answers.len(), "one answer per ray");
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

/// A structure whose rays run on a given instruction set.
pub struct AtLevel<'a> {
    structure: &'a Structure,
    level: Level,
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
        let plan = &self.structure.built.plan;
        let single: &dyn SingleRays = &*plan.single;
        let batch = self.structure.batch(self.level, rays);
        trace::<Closest>(plan.closest.as_ref(), single, &batch, hits, counters);
    }

    fn closest_ordered(
        &self,
        rays: &[Ray],
        hits: &mut [Hit],
        mut counters: Option<&mut [RayCounters]>,
        order: Order,
    ) {
        let plan = &self.structure.built.plan;
        let Some(tiles) = plan.tiles.as_ref().filter(|_| order == Order::Tiles) else {
            return self.closest(rays, hits, counters);
        };
        let batch = self.structure.batch(self.level, rays);
        assert_eq!(rays.len(), hits.len(), "one answer per ray");
        let answered = match counters.as_deref_mut() {
            None => {
                tiles.kernel.trace(&batch, hits);
                true
            }
            Some(counters) => tiles.kernel.count(&batch, hits, counters),
        };
        if !answered {
            self.closest(rays, hits, counters);
        }
    }

    fn batch(&self, order: Order, any: bool) -> Option<usize> {
        self.structure.built.plan.batch(order, any)
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool], counters: Option<&mut [RayCounters]>) {
        let plan = &self.structure.built.plan;
        let single: &dyn SingleRays = &*plan.single;
        let batch = self.structure.batch(self.level, rays);
        trace::<Any>(plan.shadow.as_ref(), single, &batch, occluded, counters);
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
        let batch = Batch {
            // A remembered blocker may be one that the next ray does not see.
            shadow_cache: false,
            ..self.batch(simd::level(), rays)
        };
        let mut counters = vec![RayCounters::default(); rays.len()];
        let mut counters = counters.iter_mut();
        let single = &self.built.plan.single;
        single.observe(&batch, any, write, &mut |i| {
            Count::with(counters.next().expect("one set per ray"), log(i))
        });
    }
}
