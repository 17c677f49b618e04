// SPDX-License-Identifier: GPL-3.0-or-later
//! Rays in numpy arrays.

use crate::args::arrays::{self, PerRay, Points};
use halfspace_base::error::{Error, Result};
use halfspace_ray::{Order, Rays};
use pyo3::prelude::*;

/// The arguments of `closest` and `occluded`; borrows the arrays, or owns converted copies.
pub struct RayArrays<'py> {
    origins: Points<'py>,
    directions: Points<'py>,
    t_min: PerRay<'py>,
    t_max: PerRay<'py>,
    order: Order,
}

impl<'py> RayArrays<'py> {
    /// Checks types, shapes, distances and order. That coordinates are finite is checked when the rays are traced, see
    /// [`halfspace_ray::rays::Finite`].
    ///
    /// # Errors
    /// [`Error::Shape`], [`Error::NonFinite`] for distances and [`Error::Spec`] for `order`; each names the argument.
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
        // Check the order, which for tiles needs whole tiles.
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
                "order: tile8 needs a multiple of 64 rays, got {}",
                origins.len()
            )));
        }
        // Read the distances, which are 0 and infinity by default.
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

    /// Returns the rays, independent of Python.
    pub fn rays(&self) -> Rays<'_> {
        Rays {
            origins: self.origins.rows(),
            directions: self.directions.rows(),
            t_min: self.t_min.limits(),
            t_max: self.t_max.limits(),
            order: self.order,
            monitor: None,
        }
    }
}
