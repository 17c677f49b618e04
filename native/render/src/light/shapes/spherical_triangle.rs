// SPDX-License-Identifier: GPL-3.0-or-later
//! The directions in which a triangle is seen from a point, sampled uniformly: Arvo 1995, "Stratified Sampling of
//! Spherical Triangles". In f64, because differences of angles lose digits.

use crate::math::vector::Vec3;

/// Least solid angle that is sampled as such (chosen: smaller ones lose digits, and their density varies little).
const LEAST_ANGLE: f64 = 1e-3;

/// Least volume of the parallelepiped of the directions to the corners: that of points in the triangle's plane, but for
/// the rounding of f32.
const LEAST_VOLUME: f64 = 1e-6;

type Vector = [f64; 3];

/// A triangle seen from a point.
pub(super) struct Spherical {
    /// Vectors from the point to the corners.
    to: [Vector; 3],
    /// Their directions.
    corners: [Vector; 3],
    /// Cosine and sine of the angle at the first corner.
    alpha: [f64; 2],
    /// Solid angle.
    angle: f64,
}

impl Spherical {
    /// The triangle with these corners, seen from a point; `None` if the solid angle is too small.
    pub(super) fn new(corners: [Vec3; 3], from: Vec3) -> Option<Self> {
        let from = from.array().map(f64::from);
        let to = corners.map(|corner| plus(corner.array().map(f64::from), from, -1.0));
        let [a, b, c] = to.map(unit);
        // Van Oosterom and Strackee 1983, "The Solid Angle of a Plane Triangle".
        let volume = dot(a, cross(b, c)).abs();
        let angle = 2.0 * volume.atan2(1.0 + dot(a, b) + dot(b, c) + dot(c, a));
        // A point of the triangle itself sees no direction of it.
        if angle.is_nan() || angle < LEAST_ANGLE || volume < LEAST_VOLUME {
            return None;
        }
        // The angle between the planes of two sides is that at their corner.
        let (ab, ac) = (unit(cross(a, b)), unit(cross(a, c)));
        let normal = cross(ab, ac);
        let alpha = [dot(ab, ac), dot(normal, normal).sqrt()];
        Some(Self {
            to,
            corners: [a, b, c],
            alpha,
            angle,
        })
    }

    /// Returns the density per solid angle.
    #[expect(clippy::cast_possible_truncation, reason = "shading is in f32")]
    pub(super) fn density(&self) -> f32 {
        (1.0 / self.angle) as f32
    }

    /// Samples a direction. Returns it, and the distance of the triangle with the weights of its second and third corner;
    /// `None` if it misses the triangle by rounding.
    #[expect(clippy::cast_possible_truncation, reason = "shading is in f32")]
    pub(super) fn sample(&self, u: [f32; 2]) -> Option<(Vec3, f32, [f32; 2])> {
        let [a, b, c] = self.corners;
        let [cos_alpha, sin_alpha] = self.alpha;
        // Choose the area of a part that has the side from a to b, and find its third corner on the side from a to c.
        let (sin, cos) = (self.angle * f64::from(u[0])).sin_cos();
        let (s, t) = (
            sin * cos_alpha - cos * sin_alpha,
            cos * cos_alpha + sin * sin_alpha,
        );
        let (p, q) = (t - cos_alpha, s + sin_alpha * dot(a, b));
        let along = ((q * t - p * s) * cos_alpha - q) / ((q * s + p * t) * sin_alpha);
        let along = if along.is_nan() {
            1.0
        } else {
            along.clamp(-1.0, 1.0)
        };
        let third = between(a, c, along);
        // Choose a point on the arc from b to that corner.
        let direction = between(b, third, 1.0 - f64::from(u[1]) * (1.0 - dot(third, b)));
        // Find it in the triangle.
        let [side_b, side_c] = [1, 2].map(|k| plus(self.to[k], self.to[0], -1.0));
        let normal = cross(side_b, side_c);
        let distance = dot(normal, self.to[0]) / dot(normal, direction);
        let at = plus(direction.map(|x| x * distance), self.to[0], -1.0);
        let scale = 1.0 / dot(normal, normal);
        let v = dot(cross(at, side_c), normal) * scale;
        let w = dot(cross(side_b, at), normal) * scale;
        if !(distance > 0.0 && distance.is_finite() && v.is_finite() && w.is_finite()) {
            return None;
        }
        let v = v.clamp(0.0, 1.0);
        let weights = [v, w.clamp(0.0, 1.0 - v)].map(|x| x as f32);
        let found = Vec3::from(direction.map(|x| x as f32));
        Some((found, distance as f32, weights))
    }
}

/// Returns the unit vector on the arc from `a` towards `b` whose cosine to `a` is this.
fn between(a: Vector, b: Vector, cosine: f64) -> Vector {
    let across = plus(b, a, -dot(a, b));
    let length = dot(across, across).sqrt();
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
    let scale = if length > 0.0 { sine / length } else { 0.0 };
    plus(a.map(|x| x * cosine), across, scale)
}

/// Scalar product.
fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Vector product.
fn cross(a: Vector, b: Vector) -> Vector {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// Returns `a` + `b` × `scale`.
fn plus(a: Vector, b: Vector, scale: f64) -> Vector {
    [0, 1, 2].map(|k| a[k] + b[k] * scale)
}

/// Divides by the length.
fn unit(a: Vector) -> Vector {
    let scale = 1.0 / dot(a, a).sqrt();
    a.map(|x| x * scale)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampler::PixelSampler;

    const CORNERS: [[f32; 3]; 3] = [[-0.3, 0.2, 1.0], [1.1, -0.4, 0.9], [0.2, 0.9, 1.4]];

    #[test]
    fn directions_are_uniform_over_the_triangle() {
        let corners = CORNERS.map(Vec3::from);
        let seen = Spherical::new(corners, Vec3::ZERO).unwrap();
        // The area is the integral of distance² / cosine over the directions.
        let [a, b, c] = corners;
        let cross = (b - a).cross(c - a);
        let (area, normal) = (0.5 * cross.length(), cross.normalized());
        let sampler = PixelSampler::new(3, 1, 4);
        let (n, mut sum, mut centre) = (1 << 14, 0.0_f64, Vec3::ZERO);
        for i in 0..n {
            let (d, distance, [v, w]) = seen.sample(sampler.pair(i, 0)).unwrap();
            let point = a * (1.0 - v - w) + b * v + c * w;
            assert!((d * distance - point).length() < 1e-5 * distance);
            assert!((d.length() - 1.0).abs() < 1e-5);
            let weight = distance * distance / normal.dot(d).abs() / seen.density();
            sum += f64::from(weight);
            centre += point * (weight / n as f32);
        }
        let ratio = sum / f64::from(n) / f64::from(area);
        assert!((ratio - 1.0).abs() < 1e-3, "{ratio}");
        // Weighted by area, the points have the centroid of the triangle.
        let expected = (a + b + c) * (area / 3.0);
        assert!((centre - expected).length() < 2e-3 * expected.length());
    }

    #[test]
    fn small_and_degenerate_triangles_are_left_to_sampling_by_area() {
        let far = vec3_far();
        let [a, b, c] = CORNERS.map(Vec3::from);
        for (corners, from) in [
            ([a, b, c], far),
            ([a, a, c], Vec3::ZERO),
            ([a, b, c], a),
            // In the plane of the triangle, next to it and on it.
            ([a, b, c], b + (b - a)),
            ([a, b, c], (a + b + c) * (1.0 / 3.0)),
        ] {
            assert!(Spherical::new(corners, from).is_none());
        }
        let near = Spherical::new(
            [a, b, c],
            (a + b + c) * (1.0 / 3.0) + Vec3::from([0.0, 0.0, 1e-4]),
        );
        assert!((near.unwrap().density() * std::f32::consts::TAU - 1.0).abs() < 0.01);
    }

    fn vec3_far() -> Vec3 {
        Vec3::from([100.0, 0.0, 0.0])
    }
}
