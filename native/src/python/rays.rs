// SPDX-License-Identifier: GPL-3.0-or-later
//! Rays from arrays.

use super::arrays::{self, Limits, PerRay, Points};
use crate::error::{Error, Result};
use crate::traverse::{Order, Ray};
use prefetch_index::prefetch_index;
use pyo3::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

/// So many rays ahead, those that lie anywhere are asked for.
const FAR: usize = 16;

/// The arguments of `closest` and `occluded`, which own or hold on to the arrays.
pub struct RayArrays<'py> {
    origins: Points<'py>,
    directions: Points<'py>,
    t_min: PerRay<'py>,
    t_max: PerRay<'py>,
    order: Order,
}

/// Rays of one call, of right shapes.
#[derive(Clone, Copy)]
pub struct Rays<'a> {
    /// Where they begin.
    pub origins: &'a [[f32; 3]],
    /// Where they go.
    pub directions: &'a [[f32; 3]],
    t_min: Limits<'a>,
    t_max: Limits<'a>,
    /// What is known of how they follow each other.
    pub order: Order,
}

/// Whether all rays are finite, as far as threads have looked. Each part is looked at right before it is traced, when the
/// caches are about to hold it anyway: to read all rays twice takes longer than some need for tracing.
#[derive(Default)]
pub struct Finite(AtomicBool);

impl Finite {
    /// Whether those in a range of places are to be traced: not once there is one that is not finite.
    pub fn allows(&self, rays: &Rays<'_>, range: Range<usize>) -> bool {
        if !rays.are_finite(range) {
            self.0.store(true, Ordering::Relaxed);
        }
        !self.0.load(Ordering::Relaxed)
    }

    /// Passes when all rays were traced.
    ///
    /// # Errors
    /// [`Error::NonFinite`] naming the first that is not finite.
    pub fn end(self, rays: &Rays<'_>) -> Result<()> {
        if !self.0.into_inner() {
            return Ok(());
        }
        rays.check()?;
        // Somebody has written into the arrays meanwhile.
        Err(Error::NonFinite(
            "origins, directions: some were not finite".into(),
        ))
    }
}

impl<'py> RayArrays<'py> {
    /// Checks types, shapes and distances. Whether rays are finite is looked at as they are traced, see [`Finite`].
    pub fn new(
        origins: &Bound<'py, PyAny>,
        directions: &Bound<'py, PyAny>,
        t_min: Option<&Bound<'py, PyAny>>,
        t_max: Option<&Bound<'py, PyAny>>,
        order: &str,
    ) -> Result<Self> {
        let origin_points = Points::new("origins", origins)?;
        let direction_points = Points::new("directions", directions)?;
        let (origins, directions) = (origin_points.rows(), direction_points.rows());
        if origins.len() != directions.len() {
            return Err(Error::Shape(format!(
                "directions: expected one per origin, {}, got {}",
                origins.len(),
                directions.len()
            )));
        }
        let order = match order {
            "none" => Order::None,
            "tile8" => Order::Tiles,
            other => {
                return Err(Error::Spec(format!(
                    "order: expected none or tile8, got {other}"
                )));
            }
        };
        if order == Order::Tiles && origins.len() % 64 != 0 {
            return Err(Error::Shape(format!(
                "order: tile8 wants a multiple of 64 rays, got {}",
                origins.len()
            )));
        }
        let limit = |name, value: Option<&Bound<'py, PyAny>>, default| match value {
            None => Ok(PerRay::Same(default)),
            Some(value) => arrays::per_ray(name, value, origins.len()),
        };
        let t_min = limit("t_min", t_min, 0.0)?;
        let t_max = limit("t_max", t_max, f32::INFINITY)?;
        Ok(Self {
            origins: origin_points,
            directions: direction_points,
            t_min,
            t_max,
            order,
        })
    }

    /// The rays, free of Python.
    pub fn rays(&self) -> Rays<'_> {
        Rays {
            origins: self.origins.rows(),
            directions: self.directions.rows(),
            t_min: self.t_min.limits(),
            t_max: self.t_max.limits(),
            order: self.order,
        }
    }
}

impl<'a> Rays<'a> {
    /// All of them.
    ///
    /// # Errors
    /// [`Error::NonFinite`] naming the first that is not finite.
    pub fn all(&self) -> Result<Vec<Ray>> {
        self.check()?;
        let mut rays = vec![BLANK; self.origins.len()];
        self.put(0, &mut rays);
        Ok(rays)
    }

    /// Passes when all are finite.
    ///
    /// # Errors
    /// [`Error::NonFinite`] naming the first that is not.
    pub fn check(&self) -> Result<()> {
        arrays::check_finite("origins", self.origins)?;
        arrays::check_finite("directions", self.directions)
    }

    /// Whether those in a range of places are finite.
    fn are_finite(&self, range: Range<usize>) -> bool {
        arrays::are_finite(&self.origins[range.clone()])
            && arrays::are_finite(&self.directions[range])
    }

    /// Those in a range of places.
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

    /// Overwrites `rays` with those at these places.
    pub fn put_those(&self, places: &[u32], rays: &mut [Ray]) {
        let at = |limits: Limits<'_>, i: usize| match limits {
            Limits::Same(t) => t,
            Limits::Each(t) => t[i],
        };
        for (k, (ray, &place)) in rays.iter_mut().zip(places).enumerate() {
            // They lie in no order, and the processor does not look that far ahead by itself.
            if let Some(&later) = places.get(k + FAR) {
                let i = later as usize;
                prefetch_index(self.origins, i);
                prefetch_index(self.directions, i);
                for limits in [self.t_min, self.t_max] {
                    if let Limits::Each(t) = limits {
                        prefetch_index(t, i);
                    }
                }
            }
            let i = place as usize;
            *ray = Ray {
                o: self.origins[i],
                d: self.directions[i],
                t_min: at(self.t_min, i),
                t_max: at(self.t_max, i),
            };
        }
    }

    /// Overwrites `rays` with those from the `first` on.
    // Field by field, and with the kinds of limits told apart outside the loops: rays that are put together
    // first and copied then take longer to bring in than to trace in tiles.
    pub fn put(&self, first: usize, rays: &mut [Ray]) {
        let range = first..first + rays.len();
        let ends = self.origins[range.clone()]
            .iter()
            .zip(&self.directions[range.clone()]);
        for (ray, (o, d)) in rays.iter_mut().zip(ends) {
            ray.o = *o;
            ray.d = *d;
        }
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

/// What buffers of rays hold before they are filled.
pub const BLANK: Ray = Ray {
    o: [0.0; 3],
    d: [0.0; 3],
    t_min: 0.0,
    t_max: 0.0,
};
