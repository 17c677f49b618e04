// SPDX-License-Identifier: GPL-3.0-or-later
//! The way of beams of polygons through an octree.

use halfspace_base::Monitor;
use halfspace_base::error::{Error, Result};
use halfspace_ray::beam_path::BeamPath;
use halfspace_ray::{Hit, Ray, RayCounters};
use halfspace_structure::Structure;

/// Largest number of rays: those of one batch of beams. A record has a few dozen bytes of each.
pub const MOST: usize = 1 << 19;

/// What beams find, and their way in the scene's space.
#[derive(Debug)]
pub struct Beams {
    /// Nearest hit of each ray, or the hit that ended it.
    pub hits: Vec<Hit>,
    /// Counters of each ray.
    pub counters: Vec<RayCounters>,
    /// The steps of the beams.
    pub path: BeamPath,
}

/// Traces rays together, for nearest hits or any hits, and records the way of their beams.
///
/// # Errors
/// [`Error::Spec`] unless the structure traces these rays as polygons; [`Error::Shape`] for more than [`MOST`] rays;
/// [`Error::Cancelled`] once the monitor is cancelled.
pub fn beams(structure: &Structure, rays: &[Ray], any: bool, monitor: &Monitor) -> Result<Beams> {
    if rays.len() > MOST {
        return Err(Error::Shape(format!(
            "origins: {} rays, and at most {MOST} are recorded",
            rays.len()
        )));
    }
    let (hits, counters, mut path) =
        structure.beams(rays, any, Some(monitor)).ok_or_else(|| {
            let shadow = if any { " and shadow=beam" } else { "" };
            let spec = structure.config().canonical();
            Error::Spec(format!(
                "{spec}: has no polygons; octree-beam with traversal=polygon{shadow} has"
            ))
        })?;
    monitor.check()?;
    // Convert the points from the frame to the scene.
    let map = *structure.built().frame.map();
    let (origin, scale) = (map.origin(), f64::from(map.scale()));
    let place = |point: &mut [f64; 3]| {
        *point = std::array::from_fn(|k| point[k] / scale + f64::from(origin[k]));
    };
    path.vertices.iter_mut().for_each(place);
    for step in &mut path.steps {
        step.corners.iter_mut().for_each(place);
    }
    Ok(Beams {
        hits,
        counters,
        path,
    })
}
