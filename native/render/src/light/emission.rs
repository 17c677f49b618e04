// SPDX-License-Identifier: GPL-3.0-or-later
//! Bounds of the directions into which lights shine, for a tree over lights: cones of axes, and the angle from an axis
//! that light reaches. After Conty Estevez and Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree
//! Splitting", §4.1.

use std::f32::consts::{FRAC_PI_2, PI};

use crate::math::vector::{Frame, Vec3, angle, vec3};

/// Angle in radians that is added to bounds, more than their rounding errors.
const SLACK: f32 = 2e-3;

/// A bound of the directions into which lights shine.
#[derive(Debug, Clone, Copy)]
pub struct Emission {
    /// Middle of the axes of the lights.
    axis: Vec3,
    /// Largest angle between it and the axis of a light, in radians.
    spread: f32,
    /// Largest angle between the axis of a light and its rays, in radians.
    reach: f32,
    /// Sine and cosine of the spread.
    turned: [f32; 2],
    /// Cosine of the reach.
    edge: f32,
    /// Measure of the directions, weighted by their cosines to the nearest axis (§4.4 there).
    measure: f32,
}

impl Emission {
    /// All directions.
    pub const ALL: Self = Self {
        axis: vec3(0.0, 0.0, 1.0),
        spread: PI,
        reach: FRAC_PI_2,
        turned: [0.0, -1.0],
        edge: 0.0,
        measure: 4.0 * PI,
    };

    /// Directions around a unit vector, within an angle of at most a right one.
    pub fn around(axis: Vec3, reach: f32) -> Self {
        Self::new(axis, 0.0, (reach + SLACK).min(FRAC_PI_2))
    }

    fn new(axis: Vec3, spread: f32, reach: f32) -> Self {
        let (sine, cosine) = spread.sin_cos();
        // At a right angle light arrives from points next to the middle; rounding must not make the bound tighter.
        let edge = if reach < FRAC_PI_2 { reach.cos() } else { 0.0 };
        let wide = (spread + reach).min(PI);
        let core = 2.0 * PI * (1.0 - cosine);
        let rim = 2.0 * wide * sine - (spread - 2.0 * wide).cos() - 2.0 * spread * sine + cosine;
        Self {
            axis,
            spread,
            reach,
            turned: [sine, cosine],
            edge,
            measure: core + FRAC_PI_2 * rim,
        }
    }

    /// Whether light may leave in every direction.
    #[inline(always)]
    pub fn is_all(&self) -> bool {
        self.spread >= PI
    }

    /// Returns the bound of both.
    pub fn union(&self, other: &Self) -> Self {
        let [a, b] = if self.spread >= other.spread {
            [self, other]
        } else {
            [other, self]
        };
        let reach = a.reach.max(b.reach);
        if a.is_all() {
            return Self { reach, ..Self::ALL };
        }
        let between = angle(a.axis, b.axis);
        if between + b.spread <= a.spread {
            return Self::new(a.axis, a.spread, reach);
        }
        let spread = 0.5 * (a.spread + between + b.spread) + 0.5 * SLACK;
        if spread >= PI - SLACK {
            return Self { reach, ..Self::ALL };
        }
        // Turn the wider cone's axis towards the other; opposite axes have no plane, so any will do.
        let across = b.axis - a.axis * a.axis.dot(b.axis);
        let across = across.normalized_or(Frame::around(a.axis).x);
        let (sine, cosine) = (spread - a.spread).sin_cos();
        let axis = (a.axis * cosine + across * sine).normalized_or(a.axis);
        Self::new(axis, spread, reach)
    }

    /// Returns the largest cosine between an axis and a direction to the receiver, from a sphere that the receiver sees
    /// under an angle with this sine and cosine; 0 only where no light arrives. `direction`: unit vector from the centre
    /// of the sphere to the receiver.
    #[inline]
    pub fn towards(&self, direction: Vec3, [sine, cosine]: [f32; 2]) -> f32 {
        if self.is_all() {
            return 1.0;
        }
        let beside = less(self.axis.dot(direction), self.turned);
        let least = less(beside, [sine, cosine]);
        if least > self.edge { least } else { 0.0 }
    }

    /// Returns the part of a line that light reaches from a sphere around the origin: the first and the last distance,
    /// which may be infinite; `None` where it reaches none. `from`: a point of the line; `direction`: unit vector;
    /// `flat`: whether the lights in the sphere lie in the plane across the axis.
    pub fn lit_part(
        &self,
        from: Vec3,
        direction: Vec3,
        radius: f32,
        flat: bool,
    ) -> Option<[f32; 2]> {
        const WHOLE: [f32; 2] = [f32::NEG_INFINITY, f32::INFINITY];
        let reach = self.spread + self.reach;
        if self.is_all() || reach > FRAC_PI_2 {
            return Some(WHOLE);
        }
        // All light leaves as from the tip of a cone behind the sphere. In f64, since far from the light the terms of
        // the quadratic equation nearly cancel each other.
        let (sine, cosine) = f64::from(reach).sin_cos();
        let back = f64::from(radius) * if flat { cosine.max(0.0) } else { 1.0 } / sine;
        let dot = |a: Vec3, b: Vec3| -> f64 {
            let products = (a.array().into_iter()).zip(b.array());
            products.map(|(a, b)| f64::from(a) * f64::from(b)).sum()
        };
        let (height, climb) = (dot(from, self.axis) + back, dot(direction, self.axis));
        // Squared lengths and product of the vectors from the tip.
        let square = dot(from, from) + 2.0 * back * dot(from, self.axis) + back * back;
        let product = dot(from, direction) + back * climb;
        // Points within the cone and its mirror image: a t² + 2 b t + c >= 0.
        let narrow = if reach < FRAC_PI_2 {
            cosine * cosine
        } else {
            0.0
        };
        let a = climb * climb - narrow;
        let b = climb * height - narrow * product;
        let c = height * height - narrow * square;
        let root = (b * b - a * c).max(0.0).sqrt();
        let q = -(b + root.copysign(b));
        let (one, other) = (q / a, if q == 0.0 { 0.0 } else { c / q });
        if !(one.is_finite() && other.is_finite()) {
            // A line along the side of the cone, or along the plane of a half space.
            return Some(WHOLE);
        }
        let [first, last] = [one.min(other), one.max(other)];
        let [first, last] = if a > 0.0 {
            // The line crosses both cones, and stays in one of them.
            if climb > 0.0 {
                [last, f64::INFINITY]
            } else {
                [f64::NEG_INFINITY, first]
            }
        } else if b * b - a * c < 0.0 || height + 0.5 * (first + last) * climb < 0.0 {
            return None;
        } else {
            [first, last]
        };
        Some([first, last].map(|t| t as f32))
    }

    /// Returns the measure of the directions, weighted by their cosines to the nearest axis.
    pub fn measure(&self) -> f32 {
        self.measure
    }
}

/// Returns the cosine of an angle, given by its cosine, less another one, given by its sine and cosine; 1 if the other is
/// larger.
#[inline(always)]
fn less(angle: f32, [sine, cosine]: [f32; 2]) -> f32 {
    if angle >= cosine {
        return 1.0;
    }
    angle * cosine + (1.0 - angle * angle).max(0.0).sqrt() * sine
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::PixelSampler;

    /// Unit vectors in all directions.
    fn directions(seed: u32) -> impl Iterator<Item = Vec3> {
        let sampler = PixelSampler::new(1, 2, seed);
        (0..).map(move |i| {
            let [u, v] = sampler.pair(i, 0);
            let (z, turn) = (2.0 * u - 1.0, 2.0 * PI * v);
            let r = (1.0 - z * z).sqrt();
            vec3(r * turn.cos(), r * turn.sin(), z)
        })
    }

    #[test]
    fn unions_contain_all_axes_and_reach_as_far_as_any() {
        for seed in 0..300 {
            let reaches = [0.1, 0.4, 1.5];
            let all: Vec<_> = (directions(seed).take(2 + seed as usize % 6))
                .map(|d| {
                    (d * 0.3 + vec3(0.0, 0.0, if seed < 200 { 1.0 } else { 0.0 })).normalized()
                })
                .zip(reaches.into_iter().cycle())
                .collect();
            let each = all
                .iter()
                .map(|&(axis, reach)| Emission::around(axis, reach));
            let both = each.reduce(|a, b| a.union(&b)).unwrap();
            for (axis, reach) in all {
                assert!(
                    both.is_all() || angle(axis, both.axis) <= both.spread + 1e-5,
                    "{seed}"
                );
                assert!(both.reach >= reach);
            }
        }
    }

    #[test]
    fn light_that_arrives_is_never_bounded_by_zero() {
        let spots: Vec<_> = directions(5).take(40).collect();
        let mut arrived = 0;
        for (k, pair) in spots.chunks_exact(2).enumerate() {
            let reach = 0.2 + 0.06 * k as f32;
            let [a, b] = [pair[0], (pair[0] + pair[1] * 0.4).normalized()];
            let both = Emission::around(a, reach).union(&Emission::around(b, reach));
            // Receivers around a sphere with both spots in it.
            for (receiver, from) in directions(7).zip(directions(8)).take(500) {
                let (receiver, from) = (receiver * 3.0, from * 0.999);
                let distance = receiver.length();
                let bound = both.towards(receiver * (1.0 / distance), {
                    let sine = 1.0 / distance;
                    [sine, (1.0 - sine * sine).sqrt()]
                });
                let to = (receiver - from).normalized();
                for axis in [a, b] {
                    if angle(axis, to) < reach {
                        arrived += 1;
                        assert!(bound > 0.0 && bound >= axis.dot(to) - 1e-3, "{k}");
                    }
                }
            }
        }
        assert!(arrived > 1000, "{arrived}");
    }

    #[test]
    fn lit_parts_of_lines_hold_all_lit_points_and_few_others() {
        for (k, (axis, direction)) in directions(11).zip(directions(12)).take(200).enumerate() {
            let reach = [0.02, 0.3, 0.8, 1.4, FRAC_PI_2][k % 5];
            let (radius, flat) = ([0.0, 0.2][k / 5 % 2], k % 3 == 0);
            let emission = Emission::around(axis, reach);
            let across = Frame::around(axis);
            for (start, point) in directions(k as u32).zip(directions(13)).take(20) {
                let from = start * (0.5 + 3.0 * (k % 7) as f32);
                let part = emission.lit_part(from, direction, radius, flat);
                // The light's points: all of the sphere, or of the disc across the axis.
                let points = if flat {
                    (across.x * point.x + across.y * point.y) * radius
                } else {
                    point * radius
                };
                let (mut near, mut found) = (0, 0);
                for i in -400..400 {
                    let t = 0.05 * i as f32;
                    let to = from + direction * t - points;
                    let inside = part.is_some_and(|[first, last]| (first..=last).contains(&t));
                    found += u32::from(inside);
                    let cosine = to.normalized().dot(axis);
                    near += u32::from(cosine > (reach + 2.0 * SLACK).cos());
                    if cosine > reach.cos() {
                        assert!(inside, "{k} {reach} {radius}: {t} {part:?}");
                    }
                }
                // Without a size the bound is tight, but for the slack.
                assert!(
                    radius > 0.0 || found <= near + 1,
                    "{k} {reach}: {found} of {near}"
                );
            }
        }
    }

    #[test]
    fn light_that_cannot_arrive_is_bounded_by_zero() {
        let down = Emission::around(vec3(0.0, 0.0, -1.0), 0.5);
        assert_eq!(down.towards(vec3(0.0, 0.0, 1.0), [0.1, 0.995]), 0.0);
        assert_eq!(
            Emission::ALL.towards(vec3(0.0, 0.0, 1.0), [0.1, 0.995]),
            1.0
        );
        // 0.5 + asin(0.1) = 0.6002 from the axis.
        let at = |angle: f32| vec3(angle.sin(), 0.0, -angle.cos());
        assert!(down.towards(at(0.59), [0.1, 0.995]) > 0.0);
        assert_eq!(down.towards(at(0.61), [0.1, 0.995]), 0.0);
    }

    #[test]
    fn the_measure_is_that_of_known_sets() {
        let flat = Emission::around(vec3(0.0, 1.0, 0.0), FRAC_PI_2);
        assert!((flat.measure() - PI).abs() < 1e-3, "{}", flat.measure());
        assert!((Emission::ALL.measure() - 4.0 * PI).abs() < 1e-3);
        let narrow = Emission::around(vec3(0.0, 1.0, 0.0), 0.1);
        assert!(narrow.measure() < 0.04);
    }
}
