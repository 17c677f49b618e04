// SPDX-License-Identifier: GPL-3.0-or-later
//! Tracing that a monitor can cancel.

use halfspace_base::Monitor;
use halfspace_geom::Aabb;
use halfspace_ray::counters::Log;
use halfspace_ray::selection::HitFilter;
use halfspace_ray::{Hit, Order, Ray, RayCounters, SelectiveTracer, Tracer};
use halfspace_scene::Triangles;
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Number of rays of a tile, which slices do not divide.
const TILE: usize = 64;

/// Largest number of rays between two reads of the monitor: 0.1 s for rays of 100 µs.
const MOST: usize = 1024;

/// Slices that take less time become longer, those that take more than four times as long become shorter.
const SHORT: Duration = Duration::from_millis(5);

/// A tracer that reads a monitor, if there is one, between slices of its rays, and leaves rays without an answer once it
/// is cancelled. Answers do not depend on the slices, but what is counted may: the kernels of counted rays read the monitor
/// themselves ([`crate::trace::Cancellable`]).
pub struct Watched<'a, T: ?Sized> {
    tracer: &'a T,
    monitor: Option<&'a Monitor>,
    /// Number of rays of the next slice.
    slice: AtomicUsize,
}

impl<'a, T: ?Sized> Watched<'a, T> {
    /// A tracer that reads `monitor`.
    pub fn new(tracer: &'a T, monitor: Option<&'a Monitor>) -> Self {
        Self {
            tracer,
            monitor,
            slice: AtomicUsize::new(1),
        }
    }

    /// Runs `work` on slices of `count` rays, of a multiple of `unit` each, until the monitor is cancelled.
    fn sliced(&self, count: usize, unit: usize, mut work: impl FnMut(Range<usize>)) {
        let Some(monitor) = self.monitor else {
            return work(0..count);
        };
        let mut first = 0;
        while first < count && !monitor.is_cancelled() {
            let slice = self.slice.load(Ordering::Relaxed);
            let end = count.min(first + slice.next_multiple_of(unit));
            let start = Instant::now();
            work(first..end);
            let time = start.elapsed();
            if time < SHORT {
                self.slice.store((2 * slice).min(MOST), Ordering::Relaxed);
            } else if time > 4 * SHORT {
                self.slice.store((slice / 2).max(1), Ordering::Relaxed);
            }
            first = end;
        }
    }
}

impl<T: Tracer + ?Sized> Tracer for Watched<'_, T> {
    fn triangles(&self) -> Option<&Triangles> {
        self.tracer.triangles()
    }

    fn count(&self) -> usize {
        self.tracer.count()
    }

    fn corners(&self, id: u32) -> [[f32; 3]; 3] {
        self.tracer.corners(id)
    }

    fn closest(&self, rays: &[Ray], hits: &mut [Hit], counters: Option<&mut [RayCounters]>) {
        self.closest_ordered(rays, hits, counters, Order::None);
    }

    fn takes_tiles(&self) -> bool {
        self.tracer.takes_tiles()
    }

    fn closest_ordered(
        &self,
        rays: &[Ray],
        hits: &mut [Hit],
        counters: Option<&mut [RayCounters]>,
        order: Order,
    ) {
        if counters.is_some() {
            return self.tracer.closest_ordered(rays, hits, counters, order);
        }
        let unit = if order == Order::Tiles { TILE } else { 1 };
        self.sliced(rays.len(), unit, |part| {
            let (rays, hits) = (&rays[part.clone()], &mut hits[part]);
            self.tracer.closest_ordered(rays, hits, None, order);
        });
    }

    fn near_rays(&self, any: bool) -> Option<Aabb> {
        self.tracer.near_rays(any)
    }

    fn batch(&self, order: Order, any: bool) -> Option<usize> {
        self.tracer.batch(order, any)
    }

    fn leaf_depths(&self, rays: &[Ray], depths: &mut [u32]) {
        self.tracer.leaf_depths(rays, depths);
    }

    fn sift(&self, rays: &[Ray], hits: &mut [Hit], filter: HitFilter<'_>) {
        self.tracer.sift(rays, hits, filter);
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool], counters: Option<&mut [RayCounters]>) {
        if counters.is_some() {
            return self.tracer.occluded(rays, occluded, counters);
        }
        self.sliced(rays.len(), 1, |part| {
            let (rays, occluded) = (&rays[part.clone()], &mut occluded[part]);
            self.tracer.occluded(rays, occluded, None);
        });
    }
}

impl<T: SelectiveTracer + ?Sized> SelectiveTracer for Watched<'_, T> {
    fn observe<'l>(
        &self,
        rays: &[Ray],
        any: bool,
        write: &mut dyn FnMut(usize, Hit),
        log: &mut dyn FnMut(usize) -> Log<'l>,
    ) {
        self.sliced(rays.len(), 1, |part| {
            let first = part.start;
            let mut write = |i: usize, hit: Hit| write(first + i, hit);
            (self.tracer).observe(&rays[part], any, &mut write, &mut |i| log(first + i));
        });
    }
}
