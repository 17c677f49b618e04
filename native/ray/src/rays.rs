// SPDX-License-Identifier: GPL-3.0-or-later
//! Rays in arrays of the caller, checked and gathered into [`Ray`]s a chunk at a time.

use crate::ray::{Order, Ray};
use halfspace_base::Monitor;
use halfspace_base::error::{Error, Result};
use prefetch_index::prefetch_index;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

/// Distance of prefetches, in rays, where rays are gathered in random order (chosen).
const FAR: usize = 16;

/// A distance for each ray, in units of its direction.
#[derive(Clone, Copy)]
pub enum Limits<'a> {
    /// The same for all rays.
    Same(f32),
    /// One per ray.
    Each(&'a [f32]),
}

/// Rays in arrays, one entry per ray in each.
#[derive(Clone, Copy)]
pub struct Rays<'a> {
    /// Origins, shape (n, 3), in the scene's space.
    pub origins: &'a [[f32; 3]],
    /// Directions, shape (n, 3), of any length.
    pub directions: &'a [[f32; 3]],
    /// Smallest distances of hits, in units of the directions.
    pub t_min: Limits<'a>,
    /// Largest distances of hits, in units of the directions.
    pub t_max: Limits<'a>,
    /// Order of the rays.
    pub order: Order,
    /// Once it is cancelled, no further chunk is traced.
    pub monitor: Option<&'a Monitor>,
}

/// The check, shared between threads, that all rays are finite. Each part is checked right before it is traced, which
/// also loads it into the caches: a separate pass over all rays takes longer than some batches need for tracing.
#[derive(Default)]
pub struct Finite {
    /// Whether some ray was not finite.
    failed: AtomicBool,
}

impl Finite {
    /// Checks the rays of a range; returns whether all rays checked so far, on any thread, are finite, so that the
    /// range should be traced. No range should be once the rays are cancelled.
    pub fn allows(&self, rays: &Rays<'_>, range: Range<usize>) -> bool {
        if rays.is_cancelled() {
            return false;
        }
        if !rays.are_finite(range) {
            self.failed.store(true, Ordering::Relaxed);
        }
        !self.failed.load(Ordering::Relaxed)
    }

    /// Returns an error if some ray was not finite, or if some were not traced.
    ///
    /// # Errors
    /// [`Error::NonFinite`], which names the first ray that is not finite, and [`Error::Cancelled`].
    pub fn end(self, rays: &Rays<'_>) -> Result<()> {
        if rays.is_cancelled() {
            return Err(Error::Cancelled);
        }
        if !self.failed.into_inner() {
            return Ok(());
        }
        rays.check()?;
        // The caller has made all rays finite since.
        Err(Error::NonFinite(
            "origins, directions: some were not finite".into(),
        ))
    }
}

impl<'a> Rays<'a> {
    /// Returns all rays.
    ///
    /// # Errors
    /// [`Error::NonFinite`], which names the first ray that is not finite.
    pub fn all(&self) -> Result<Vec<Ray>> {
        self.check()?;
        let mut rays = vec![BLANK; self.origins.len()];
        self.put(0, &mut rays);
        Ok(rays)
    }

    /// The same rays, traced until `monitor` is cancelled.
    pub fn watched(self, monitor: Option<&'a Monitor>) -> Self {
        Self { monitor, ..self }
    }

    /// Returns whether no further chunk should be traced.
    pub fn is_cancelled(&self) -> bool {
        self.monitor.is_some_and(Monitor::is_cancelled)
    }

    /// Checks that all rays are finite.
    ///
    /// # Errors
    /// [`Error::NonFinite`], which names the first ray that is not.
    pub fn check(&self) -> Result<()> {
        check_finite("origins", self.origins)?;
        check_finite("directions", self.directions)
    }

    /// Returns whether the rays of a range are finite.
    fn are_finite(&self, range: Range<usize>) -> bool {
        are_finite(&self.origins[range.clone()]) && are_finite(&self.directions[range])
    }

    /// Returns the rays of a range.
    pub fn part(&self, range: Range<usize>) -> Self {
        let limits = |limits: Limits<'a>| match limits {
            Limits::Same(t) => Limits::Same(t),
            Limits::Each(t) => Limits::Each(&t[range.clone()]),
        };
        Self {
            origins: &self.origins[range.clone()],
            directions: &self.directions[range.clone()],
            t_min: limits(self.t_min),
            t_max: limits(self.t_max),
            ..*self
        }
    }

    /// Overwrites `rays` with those of the given indices.
    pub fn gather(&self, indices: &[u32], rays: &mut [Ray]) {
        let at = |limits: Limits<'_>, i: usize| match limits {
            Limits::Same(t) => t,
            Limits::Each(t) => t[i],
        };
        for (k, (ray, &index)) in rays.iter_mut().zip(indices).enumerate() {
            // Prefetch a later ray: the processor cannot predict the addresses of rays in random order.
            if let Some(&later) = indices.get(k + FAR) {
                let i = later as usize;
                prefetch_index(self.origins, i);
                prefetch_index(self.directions, i);
                for limits in [self.t_min, self.t_max] {
                    if let Limits::Each(t) = limits {
                        prefetch_index(t, i);
                    }
                }
            }
            // Copy the ray.
            let i = index as usize;
            *ray = Ray {
                o: self.origins[i],
                d: self.directions[i],
                t_min: at(self.t_min, i),
                t_max: at(self.t_max, i),
            };
        }
    }

    /// Overwrites `rays` with those from index `first` on.
    // Loops over single fields: assembling whole rays and copying them takes longer than tracing them in tiles.
    pub fn put(&self, first: usize, rays: &mut [Ray]) {
        let range = first..first + rays.len();
        let points = self.origins[range.clone()]
            .iter()
            .zip(&self.directions[range.clone()]);
        for (ray, (o, d)) in rays.iter_mut().zip(points) {
            ray.o = *o;
            ray.d = *d;
        }
        // Write the intervals; the match outside each loop keeps branches out of it.
        match self.t_min {
            Limits::Same(t_min) => rays.iter_mut().for_each(|ray| ray.t_min = t_min),
            Limits::Each(t_min) => {
                for (ray, t_min) in rays.iter_mut().zip(&t_min[range.clone()]) {
                    ray.t_min = *t_min;
                }
            }
        }
        match self.t_max {
            Limits::Same(t_max) => rays.iter_mut().for_each(|ray| ray.t_max = t_max),
            Limits::Each(t_max) => {
                for (ray, t_max) in rays.iter_mut().zip(&t_max[range]) {
                    ray.t_max = *t_max;
                }
            }
        }
    }
}

/// Content of buffers of rays before they are filled.
pub const BLANK: Ray = Ray {
    o: [0.0; 3],
    d: [0.0; 3],
    t_min: 0.0,
    t_max: 0.0,
};

/// Returns the index of the first number for which `is` holds. Tests whole groups without branches first, because
/// almost always no number has the property.
#[inline(always)]
pub fn first(numbers: &[f32], is: impl Fn(f32) -> bool) -> Option<usize> {
    // A group is long enough to be tested with SIMD, and short enough to be searched again.
    const GROUP: usize = 256;
    numbers
        .chunks(GROUP)
        .position(|group| group.iter().fold(false, |any, &x| any | is(x)))
        .and_then(|group| {
            let before = group * GROUP;
            let found = numbers[before..].iter().position(|&x| is(x))?;
            Some(before + found)
        })
}

/// Returns whether all coordinates are finite.
pub fn are_finite(points: &[[f32; 3]]) -> bool {
    first(points.as_flattened(), |x| !x.is_finite()).is_none()
}

/// Checks that all coordinates are finite.
///
/// # Errors
/// [`Error::NonFinite`], which names the array and the first row that is not finite.
pub fn check_finite(name: &str, points: &[[f32; 3]]) -> Result<()> {
    match first(points.as_flattened(), |x| !x.is_finite()).map(|i| i / 3) {
        None => Ok(()),
        Some(i) => Err(Error::NonFinite(format!(
            "{name}[{i}]: {:?} is not finite",
            points[i]
        ))),
    }
}
