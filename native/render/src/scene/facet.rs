// SPDX-License-Identifier: GPL-3.0-or-later
//! Where rays begin: on the triangle that they leave, without an epsilon.
//!
//! A ray is the exact line of f32 numbers, and every structure answers it exactly. So a ray that leaves a triangle
//! starts at an f32 point on the triangle's plane or less than one step behind it, and its interval begins behind the
//! line's crossing of the triangle, by the error of f64: the triangle itself is excluded, and a sheet one representable
//! step further is not, because distances near 0 have their full relative precision. The crossing
//! lies strictly within the triangle, so that no ray begins beyond the edge of a wall.

use halfspace_geom::vec3::{Vec3, add_scaled, cross, dot, length, map, sub, widen};
use halfspace_geom::verdict::{DETERMINANT_ERROR, verdict_within};
use halfspace_ray::Ray;

/// Error of a height above the plane, relative to the distance from a corner, if the square of the edges is twice the
/// area: more than twice the bound of the verdict, which so excludes the triangle in f64. A ray skips less than 2⁻⁴² of
/// the triangle's size.
const HEIGHT_ERROR: f64 = 2.5 * DETERMINANT_ERROR;

/// Largest distance of an f32 point from the one that it rounds, relative to the largest coordinate, in the plane of a
/// triangle: half a unit in the last place in two coordinates, and as much again along the third.
const ROUNDING: f64 = 3.0 * f32::EPSILON as f64;

/// Smallest barycentric weight of the beginning of a ray near an edge.
const LEAST_WEIGHT: f32 = 1e-6;

/// Steps from the edge of a triangle to its middle, each eight times as long as the one before.
const STEPS: u32 = 14;

/// Sine of the angle between a line and a plane below which their crossing is not computed from the line.
const GRAZING: f64 = 1e-4;

/// A triangle with its plane, in f64, and a point on it.
#[derive(Debug, Clone, Copy)]
pub struct Facet {
    corners: [[f32; 3]; 3],
    /// Unit normal, on the front.
    pub normal: Vec3,
    /// Error bound of the height of a point above the plane, relative to its distance from the first corner.
    error: f64,
    /// A point of the triangle.
    pub point: Vec3,
    /// Lower bound of the distance of the point from the edges.
    room: f64,
}

/// Where a ray begins.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Start {
    o: [f32; 3],
    d: [f32; 3],
    t_min: f32,
}

impl Facet {
    /// The triangle and its point of these weights, or if the ray of a hit is given, the point where its line crosses the plane.
    #[inline]
    pub fn new(corners: [[f32; 3]; 3], weights: [f32; 3], line: Option<&Ray>) -> Self {
        let [a, b, c] = map(corners, widen);
        let (ab, ac) = (sub(b, a), sub(c, a));
        let (normal, twice) = unit(cross(ab, ac));
        let longest = largest(ab) + largest(ac);
        // The weights place the point up to their rounding.
        let [_, u, v] = weights.map(f64::from);
        let mut point = add_scaled(add_scaled(a, u, ab), v, ac);
        let least = weights[0].min(weights[1]).min(weights[2]);
        if let Some(ray) = line {
            // The line is more accurate, unless it grazes the plane.
            let (o, d) = (widen(ray.o), widen(ray.d));
            let along = dot(normal, d);
            if along.abs() > GRAZING * (d[0].abs() + d[1].abs() + d[2].abs()) {
                point = add_scaled(o, dot(normal, sub(a, o)) / along, d);
            }
        }
        let share = (f64::from(least) - f64::from(f32::EPSILON)).max(0.0);
        Self {
            corners,
            normal,
            error: HEIGHT_ERROR * (longest * longest / twice),
            point,
            // The longest edge is at most √3 times as long as the sum of the largest components of two.
            room: share * twice / (1.75 * longest),
        }
    }

    /// Returns the distance along a line at which it crosses the plane, with its error bound.
    #[inline(always)]
    pub fn crossing(&self, o: [f32; 3], d: [f32; 3]) -> [f64; 2] {
        let from = sub(widen(self.corners[0]), widen(o));
        let along = dot(self.normal, widen(d));
        let t = dot(self.normal, from) / along;
        let bound = self.error * (largest(from) + t.abs() * largest(widen(d)));
        [t, bound / along.abs()]
    }

    /// Returns an f32 point near `point`, the nearest along the normal's largest component of those on the plane or
    /// on one side of it, and its height above the plane. `side`: 1 for the front, -1 for the back.
    #[inline]
    fn rounded(&self, point: Vec3, side: f64) -> ([f32; 3], f64) {
        let n = self.normal;
        let a = widen(self.corners[0]);
        let size = n.map(f64::abs);
        let (k, i, j) = if size[0] > size[1] && size[0] > size[2] {
            (0, 1, 2)
        } else if size[1] > size[2] {
            (1, 2, 0)
        } else {
            (2, 0, 1)
        };
        // Round two coordinates, and find the third on the plane; differences of f32 are exact.
        let mut o = point.map(|x| x as f32);
        let across = n[i] * (f64::from(o[i]) - a[i]) + n[j] * (f64::from(o[j]) - a[j]);
        let rise = -across / n[k];
        let mut nearest = (a[k] + rise) as f32;
        let height = |x: f32| ((f64::from(x) - a[k]) - rise) * n[k];
        if height(nearest) * side < 0.0 {
            nearest = if n[k] * side > 0.0 {
                nearest.next_up()
            } else {
                nearest.next_down()
            };
        }
        o[k] = nearest;
        (o, height(nearest))
    }

    /// Returns the ray that leaves the point to a side (1 for the front, -1 for the back). `direction`: returns its
    /// direction for its origin. A direction that rounding has turned to the other side meets the triangle itself.
    #[inline(always)]
    pub fn ray(&self, side: f64, direction: impl Fn([f32; 3]) -> [f32; 3], t_max: f32) -> Ray {
        self.ray_from(self.start(side), side, direction, t_max)
    }

    /// Returns where rays to a side begin: a point on the plane or behind it, and its height above the plane.
    #[inline(always)]
    pub fn start(&self, side: f64) -> ([f32; 3], f64) {
        self.rounded(self.point, -side)
    }

    /// As [`Self::ray`], with [`Self::start`] of the side known.
    #[inline(always)]
    pub fn ray_from(
        &self,
        (o, height): ([f32; 3], f64),
        side: f64,
        direction: impl Fn([f32; 3]) -> [f32; 3],
        t_max: f32,
    ) -> Ray {
        let d = direction(o);
        let start = self
            .behind(o, d, [height, side])
            .unwrap_or_else(|| self.near_an_edge(side, &direction));
        let Start { o, d, t_min } = start;
        Ray { o, d, t_min, t_max }
    }

    /// Returns where a ray from a point behind the plane by `height` begins, or `None` if that may be beyond an edge.
    #[inline]
    fn behind(&self, o: [f32; 3], d: [f32; 3], [height, side]: [f64; 2]) -> Option<Start> {
        let along = side * dot(self.normal, widen(d));
        let t = height.abs() / along;
        let moved = ROUNDING * largest(self.point) + 2.0 * t * largest(widen(d));
        let from = largest(sub(widen(o), widen(self.corners[0])));
        (along > 0.0 && moved < self.room).then(|| Start {
            o,
            d,
            t_min: after(t + self.error * from / along),
        })
    }

    /// The same near an edge of the triangle, or for directions along its plane: moves the point towards the middle
    /// until the line crosses the triangle, by the exact verdict.
    #[cold]
    #[inline(never)]
    fn near_an_edge(&self, side: f64, direction: impl Fn([f32; 3]) -> [f32; 3]) -> Start {
        let [a, b, c] = map(self.corners, widen);
        let middle = add_scaled(add_scaled(a, 1.0 / 3.0, sub(b, a)), 1.0 / 3.0, sub(c, a));
        let inwards = sub(middle, self.point);
        let step = 2.0 * ROUNDING * largest(self.point) / largest(inwards);
        let first = step.max(1e-9);
        let mut share = 0.0;
        for _ in 0..STEPS {
            let (o, _) = self.rounded(add_scaled(self.point, share, inwards), -side);
            let d = direction(o);
            if side * dot(self.normal, widen(d)) > 0.0
                && let Some(found) =
                    verdict_within(o, d, self.corners, [f32::NEG_INFINITY, f32::INFINITY])
                && found.u.min(found.v).min(1.0 - found.u - found.v) > LEAST_WEIGHT
                && found.t >= 0.0
            {
                let t_min = found.t.next_up();
                return Start { o, d, t_min };
            }
            if share >= 1.0 {
                break;
            }
            share = (8.0_f64 * share).max(first).min(1.0);
        }
        // A direction along the plane, or a triangle narrower than a step: start in front, so that the triangle stops
        // rays to its other side.
        let (o, _) = self.rounded(add_scaled(self.point, first.min(1.0), inwards), side);
        self.in_front(o, direction(o), side)
    }

    /// Returns where a ray from a point in front of the plane, or on it, begins. One that leaves to this side does not
    /// meet the triangle at its origin.
    fn in_front(&self, o: [f32; 3], d: [f32; 3], side: f64) -> Start {
        let leaves = side * dot(self.normal, widen(d)) > 0.0;
        let t_min = if leaves { after(0.0) } else { 0.0 };
        Start { o, d, t_min }
    }

    /// Returns the ray with the origin `eye`, at any distance, and a unit direction that leaves the point to a side;
    /// `None` if rounding moves it to the other side or near an edge.
    pub fn ray_through(&self, eye: [f32; 3], side: f64) -> Option<Ray> {
        let (way, distance) = unit(sub(self.point, widen(eye)));
        let d = way.map(|x| x as f32);
        let along = side * dot(self.normal, widen(d));
        // The direction rounds in the last place of the distance.
        let [t, bound] = self.crossing(eye, d);
        let moved = ROUNDING * distance / along;
        (along > 0.0 && t > 0.0 && moved < self.room).then(|| Ray {
            o: eye,
            d,
            t_min: after(t + bound),
            t_max: f32::INFINITY,
        })
    }

    /// Returns the ray from a point lifted off the triangle to a side; the triangle may stop it.
    pub fn lifted(
        &self,
        lift: Vec3,
        side: f64,
        direction: &dyn Fn([f32; 3]) -> [f32; 3],
        t_max: f32,
    ) -> Ray {
        let lifted = add_scaled(self.point, 1.0, lift);
        let rounded = lifted.map(|x| x as f32);
        let a = widen(self.corners[0]);
        let o = if side * dot(self.normal, sub(widen(rounded), a)) > 0.0 {
            rounded
        } else {
            self.rounded(lifted, side).0
        };
        let Start { o, d, t_min } = self.in_front(o, direction(o), side);
        Ray { o, d, t_min, t_max }
    }
}

/// Returns the first f32 behind that to which `t` rounds, as distances of hits do.
#[inline(always)]
fn after(t: f64) -> f32 {
    (t as f32).next_up()
}

/// Returns the largest component by absolute value.
#[inline(always)]
fn largest(v: Vec3) -> f64 {
    let larger = |a: f64, b: f64| if a > b { a } else { b };
    larger(larger(v[0].abs(), v[1].abs()), v[2].abs())
}

/// Returns the unit vector of the same direction, and the length; of a zero vector the z axis.
#[inline(always)]
fn unit(v: Vec3) -> (Vec3, f64) {
    let size = length(v);
    if size > 0.0 && size.is_finite() {
        let scale = 1.0 / size;
        (v.map(|x| x * scale), size)
    } else {
        ([0.0, 0.0, 1.0], f64::MIN_POSITIVE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::Stream;

    const ALL: [f32; 2] = [f32::NEG_INFINITY, f32::INFINITY];

    fn point(random: &mut Stream) -> [f32; 3] {
        [0, 1, 2].map(|_| 2.0 * random.number() - 1.0)
    }

    /// Moves the corners by one representable step to a side, along the largest component of the normal.
    fn step(corners: [[f32; 3]; 3], side: f64) -> [[f32; 3]; 3] {
        let n = Facet::new(corners, [0.0; 3], None).normal;
        let size = n.map(f64::abs);
        let k = (0..3).max_by(|&a, &b| size[a].total_cmp(&size[b])).unwrap();
        corners.map(|mut v| {
            v[k] = if n[k] * side > 0.0 {
                v[k].next_up()
            } else {
                v[k].next_down()
            };
            v
        })
    }

    #[test]
    fn rays_leave_their_triangle_and_meet_the_sheet_one_step_away() {
        let mut random = Stream::new(3);
        let (mut begun, mut met) = (0, 0);
        for (scale, offset) in [
            (1.0, 0.0),
            (1.0, 100.0),
            (1.0, 1e4),
            (1e-30, 0.0),
            (1e-30, 100.0),
            (1e30, 0.0),
            (1e30, 1e4),
            (1e-4, 0.0),
        ] {
            for _ in 0..4000 {
                let at = |p: [f32; 3]| p.map(|x| (x + offset) * scale);
                let corners = [0; 3].map(|_| at(point(&mut random)));
                let [u, v] = [0, 1].map(|_| 0.1 + 0.3 * random.number());
                let facet = Facet::new(corners, [1.0 - u - v, u, v], None);
                let d = point(&mut random);
                let side = if dot(facet.normal, widen(d)) > 0.0 {
                    1.0
                } else {
                    -1.0
                };
                let ray = facet.ray(side, |_| d, f32::INFINITY);
                assert!(ray.t_min > 0.0, "an ordinary ray: {corners:?} {d:?}");
                // The line crosses the triangle, and the interval begins behind it.
                let own = verdict_within(ray.o, ray.d, corners, ALL).filter(|own| own.t >= 0.0);
                let Some(own) = own else {
                    // Directions along the plane begin in front of it, and so do narrow triangles.
                    let along = dot(facet.normal, widen(d)).abs();
                    let narrow = facet.room < 50.0 * ROUNDING * largest(facet.point);
                    assert!(along < 0.02 || narrow, "{corners:?} {d:?}");
                    continue;
                };
                assert!(own.t < ray.t_min, "{own:?} {}", ray.t_min);
                begun += 1;
                let sheet = step(corners, side);
                if let Some(next) = verdict_within(ray.o, ray.d, sheet, ALL) {
                    assert!(next.t >= ray.t_min, "{corners:?} {d:?}: {next:?}");
                    met += 1;
                }
            }
        }
        assert!(begun > 31_900 && met > 30_500, "{begun} {met}");
    }

    #[test]
    fn rays_near_edges_and_corners_begin_within_the_triangle() {
        let mut random = Stream::new(5);
        for offset in [0.0, 30.0, 1e5] {
            for i in 0..3000 {
                let corners = [0; 3].map(|_| point(&mut random).map(|x| x + offset));
                // Points on an edge, or at a corner.
                let x = random.number();
                let weights = match i % 3 {
                    0 => [1.0 - x, x, 0.0],
                    1 => [0.0, x, 1.0 - x],
                    _ => [0.0, 0.0, 1.0],
                };
                let facet = Facet::new(corners, weights, None);
                let d = point(&mut random);
                let along = dot(facet.normal, widen(d));
                let ray = facet.ray(along.signum(), |_| d, f32::INFINITY);
                // Narrow triangles and directions along the plane begin in front.
                let found = verdict_within(ray.o, ray.d, corners, ALL);
                if let Some(own) = found.filter(|own| own.t >= 0.0 && own.t < ray.t_min) {
                    assert!(own.u.min(own.v) > 0.0 && own.u + own.v < 1.0);
                } else {
                    assert!(along.abs() < 0.05 || offset > 1e4, "{corners:?} {d:?}");
                }
            }
        }
    }

    #[test]
    fn points_follow_the_line_of_their_ray() {
        // Weights of f32 place points on a plane of 10,000 km only to half a metre.
        let corners = [[-1e7, -1e7, 0.0], [1e7, -1e7, 0.0], [0.0, 2e7, 0.0]];
        let ray = Ray {
            o: [1.0, 2.0, 3.0],
            d: [0.6, 0.0, -0.8],
            t_min: 0.0,
            t_max: f32::INFINITY,
        };
        let found = verdict_within(ray.o, ray.d, corners, ALL).unwrap();
        let weights = [1.0 - found.u - found.v, found.u, found.v];
        let point = Facet::new(corners, weights, Some(&ray)).point;
        let want = [
            1.0 + 3.0 * f64::from(0.6_f32) / f64::from(0.8_f32),
            2.0,
            0.0,
        ];
        assert!(largest(sub(point, want)) < 1e-9, "{point:?}");
    }
}
