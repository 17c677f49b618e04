// SPDX-License-Identifier: GPL-3.0-or-later
//! Nodes that trace rays from the point to be shaded: Ambient Occlusion, Bevel and Raycast.

use crate::math::trig::sin_cos_turns;
use crate::math::vector::{Frame, Vec3, vec3};
use crate::values::program::Shift;
use crate::values::shading_point::ShadingPoint;

/// The surroundings of a point, as far as rays explore them.
pub trait Surroundings {
    /// Returns the number of rays from the point, in these unit directions and of this length, that meet no surface that
    /// casts shadows. `local`: only the point's own object counts.
    fn free(&self, directions: &[Vec3], length: f32, local: bool) -> usize;

    /// Returns the nearest surface on a part of a ray.
    fn nearest(&self, ray: Search) -> Option<Met>;

    /// Calls `found` with each surface of the point's own object on parts of rays, and the index of the ray.
    fn each_local(&self, rays: &[Search], found: &mut dyn FnMut(usize, Met));

    /// Returns two random numbers in [0, 1): number `index` of `count` for a purpose.
    fn pair(&self, purpose: Purpose, index: u32, count: u32) -> [f32; 2];

    /// Whether the path that arrives at the point has only scattered in narrow lobes.
    fn is_sharp(&self) -> bool;
}

/// Purpose of random numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// Directions of ambient occlusion.
    Occlusion,
    /// Disks around a bevelled point.
    Bevel,
}

/// A part of a ray that is searched for surfaces.
#[derive(Debug, Clone, Copy)]
pub struct Search {
    /// Origin in scene space.
    pub origin: Vec3,
    /// Direction of any length, the unit of `span`.
    pub direction: Vec3,
    /// The interval that counts.
    pub span: [f32; 2],
    /// Whether only the point's own object counts.
    pub local: bool,
}

/// A surface that a ray has met.
#[derive(Debug, Clone, Copy)]
pub struct Met {
    /// Distance in lengths of the ray's direction.
    pub distance: f32,
    /// Position in scene space.
    pub position: Vec3,
    /// Unit normal of the triangle, on its front.
    pub geometric: Vec3,
    /// Shading normal on the same side.
    pub normal: Vec3,
    /// Whether it belongs to the point's own object.
    pub own: bool,
}

/// Settings of the node Ambient Occlusion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Occlusion {
    /// Number of rays.
    pub samples: u8,
    /// Whether the rays go into the object.
    pub inside: bool,
    /// Whether only the point's own object occludes.
    pub local: bool,
}

/// Settings of the node Raycast.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Raycast {
    /// Whether only the point's own object is met.
    pub local: bool,
    /// Where the point is, which heights move.
    pub shift: Shift,
    /// Whether to return the normal instead of distance, hit and hit of the own object.
    pub normal: bool,
}

/// Density of the density per area of the disks at which bevels are blurred away, see
/// [`Surroundings::is_sharp`]: that of Cycles.
pub const SHARP: f32 = 8.0;

/// Share of a shift that rays of shifted points skip, so that they do not meet the point's own surface.
const SKIPPED: f32 = 1.1;

impl ShadingPoint<'_> {
    /// Returns the share of the directions around `normal`, weighted by their cosine, in which nothing is closer than
    /// `distance`; 1 where no rays can be traced.
    pub(super) fn unoccluded(&self, settings: Occlusion, normal: Vec3, distance: f32) -> f32 {
        let Some(around) = self.around.filter(|_| distance > 0.0) else {
            return 1.0;
        };
        let samples = u32::from(settings.samples);
        if samples == 0 {
            return 1.0;
        }
        let normal = normal.normalized_or(self.normal);
        let frame = Frame::around(if settings.inside { -normal } else { normal });
        // Points of the unit disk below directions that are distributed by their cosine.
        let directions: Vec<_> = (0..samples)
            .map(|index| {
                let [u, v] = around.pair(Purpose::Occlusion, index, samples);
                let (sin, cos) = sin_cos_turns(v);
                let r = u.sqrt();
                frame.to_world(vec3(r * cos, r * sin, (1.0 - u).max(0.0).sqrt()))
            })
            .collect();
        around.free(&directions, distance, settings.local) as f32 / samples as f32
    }

    /// Returns the mean of the normals within a radius, on the viewer's side: the point's own normal where no rays can
    /// be traced, or for paths that are too blurry to show it.
    ///
    /// Points of the surface are found by rays through disks along three axes, combined by multiple importance
    /// sampling (King et al. 2013, "BSSRDF Importance Sampling"), and weighted by a cubic function of their distance.
    pub(super) fn bevelled(&self, samples: u8, radius: f32) -> Vec3 {
        let Some(around) = self.around.filter(|_| radius > 0.0 && radius < 1e18) else {
            return self.normal;
        };
        if !around.is_sharp() {
            return self.normal;
        }
        let frame = Frame::around(self.geometric);
        let count = u32::from(samples);
        // Sample disks along the axes.
        let (rays, disks): (Vec<_>, Vec<_>) = (0..count)
            .map(|index| {
                let pair = around.pair(Purpose::Bevel, index, count);
                let disk = Disk::new(&frame, radius, pair);
                (disk.ray(self.position), disk)
            })
            .unzip();
        // Sum the normals of what the rays meet.
        let mut sum = Vec3::ZERO;
        around.each_local(&rays, &mut |index, met| {
            let weight = disks[index].weight(&met, radius, (met.position - self.position).length());
            if weight.is_finite() {
                sum += met.normal * weight;
            }
        });
        let mean = sum.normalized_or(Vec3::ZERO);
        match (mean == Vec3::ZERO, self.inside) {
            (true, _) => self.normal,
            (false, true) => -mean,
            (false, false) => mean,
        }
    }

    /// Returns what the ray of a Raycast node meets. `position`: in world space; `direction`: of any length, the unit
    /// of `length`.
    pub(super) fn cast(
        &self,
        settings: Raycast,
        position: Vec3,
        direction: Vec3,
        length: f32,
    ) -> Vec3 {
        let missed = if settings.normal {
            Vec3::ZERO
        } else {
            vec3(length, 0.0, 0.0)
        };
        let sound = length > 0.0 && direction != Vec3::ZERO;
        let Some(around) = self.around.filter(|_| sound) else {
            return missed;
        };
        let skipped = match settings.shift {
            Shift::None => 0.0,
            Shift::X(width) | Shift::Y(width) => SKIPPED * width * self.footprint,
        };
        let ray = Search {
            origin: position - Vec3::from(self.varying.origin),
            direction,
            span: [skipped, length],
            local: settings.local,
        };
        let Some(met) = around.nearest(ray) else {
            return missed;
        };
        if !settings.normal {
            return vec3(met.distance, 1.0, f32::from(u8::from(met.own)));
        }
        // Normals are on the side that the ray comes from.
        if met.geometric.dot(direction) > 0.0 {
            -met.normal
        } else {
            met.normal
        }
    }
}

/// A line through the sphere around a bevelled point, along one of three axes.
struct Disk {
    /// The axis of the line, and those across it.
    axes: [Vec3; 3],
    /// Shares of the lines along these axes.
    shares: [f32; 3],
    /// Where the line crosses the disk across its axis.
    across: [f32; 2],
    /// Half of the line's length in the sphere.
    height: f32,
    /// Weight of a point of the disk at the line.
    sampled: f32,
}

impl Disk {
    /// Samples a line in the frame of a point.
    fn new(frame: &Frame, radius: f32, [u, v]: [f32; 2]) -> Self {
        // Half of the rays go along the normal, a quarter along each tangent.
        let (axes, shares, turn) = if u < 0.5 {
            ([frame.z, frame.x, frame.y], [0.5, 0.25, 0.25], 2.0 * u)
        } else if u < 0.75 {
            let turn = 4.0 * (u - 0.5);
            ([frame.x, frame.z, frame.y], [0.25, 0.5, 0.25], turn)
        } else {
            let turn = 4.0 * (u - 0.75);
            ([frame.y, frame.x, frame.z], [0.25, 0.25, 0.5], turn)
        };
        let r = radius * falloff_quantile(v);
        let (sin, cos) = sin_cos_turns(turn);
        Self {
            axes,
            shares,
            across: [r * cos, r * sin],
            height: (radius * radius - r * r).max(0.0).sqrt(),
            sampled: falloff(r / radius),
        }
    }

    /// Returns the part of the line within the sphere around `centre`.
    fn ray(&self, centre: Vec3) -> Search {
        let [axis, right, up] = self.axes;
        let [x, y] = self.across;
        Search {
            origin: centre + axis * self.height + right * x + up * y,
            direction: -axis,
            span: [0.0, 2.0 * self.height],
            local: true,
        }
    }

    /// Returns the weight of a point on the line, at this distance from the bevelled one.
    fn weight(&self, met: &Met, radius: f32, distance: f32) -> f32 {
        let densities = [0, 1, 2].map(|k| self.shares[k] * self.axes[k].dot(met.geometric).abs());
        let squares: f32 = densities.iter().map(|d| d * d).sum();
        densities[0] / squares * (falloff(distance / radius) / self.sampled)
    }
}

/// The weight of a point at this share of the radius, up to a factor.
fn falloff(x: f32) -> f32 {
    let rest = (1.0 - x).max(0.0);
    rest * rest * rest
}

/// Returns the share of the radius within which a disk has this share `u` of its integrated falloff: the root of
/// 10x² - 20x³ + 15x⁴ - 4x⁵ = u, by Newton's method kept within a bracket.
fn falloff_quantile(u: f32) -> f32 {
    let (mut low, mut high, mut x) = (0.0_f32, 1.0_f32, 0.25_f32);
    for _ in 0..24 {
        let rest = 1.0 - x;
        let square = x * x;
        let error = square * (10.0 + x * (-20.0 + x * (15.0 - 4.0 * x))) - u;
        if error.abs() < 1e-6 {
            break;
        }
        if error < 0.0 {
            low = x;
        } else {
            high = x;
        }
        // A step that leaves the bracket is replaced by its middle.
        let next = x - error / (20.0 * x * rest * rest * rest);
        x = if next > low && next < high {
            next
        } else {
            0.5 * (low + high)
        };
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_invert_the_integrated_falloff() {
        for k in 0..=100_u8 {
            let u = f32::from(k) / 100.0;
            let x = falloff_quantile(u);
            let integral = x * x * (10.0 + x * (-20.0 + x * (15.0 - 4.0 * x)));
            assert!(
                (0.0..=1.0).contains(&x) && (integral - u).abs() < 2e-6,
                "{u}: {x}"
            );
        }
    }
}
