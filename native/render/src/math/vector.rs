// SPDX-License-Identifier: GPL-3.0-or-later
//! f32 vectors, colours and frames for shading.

use halfspace_geom::vec3::{length, sub, widen};
use std::ops::{Add, AddAssign, Mul, MulAssign, Neg, Sub};

/// Range of squared lengths within which the squares of components neither overflow nor lose digits that count.
const SQUARES: [f32; 2] = [1e-24, 1e30];

/// A point, a direction or a linear RGB colour.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Vec3 {
    /// First component, or red.
    pub x: f32,
    /// Second component, or green.
    pub y: f32,
    /// Third component, or blue.
    pub z: f32,
}

/// Makes a vector.
#[inline(always)]
pub const fn vec3(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3 { x, y, z }
}

impl Vec3 {
    /// All components zero; black.
    pub const ZERO: Self = vec3(0.0, 0.0, 0.0);
    /// All components one; white.
    pub const ONE: Self = vec3(1.0, 1.0, 1.0);

    /// Sets all components to the same value.
    #[inline(always)]
    pub const fn splat(value: f32) -> Self {
        vec3(value, value, value)
    }

    /// Returns the components as an array.
    #[inline(always)]
    pub const fn array(self) -> [f32; 3] {
        [self.x, self.y, self.z]
    }

    /// Scalar product.
    #[inline(always)]
    pub fn dot(self, b: Self) -> f32 {
        self.x * b.x + self.y * b.y + self.z * b.z
    }

    /// Vector product.
    #[inline(always)]
    pub fn cross(self, b: Self) -> Self {
        vec3(
            self.y * b.z - self.z * b.y,
            self.z * b.x - self.x * b.z,
            self.x * b.y - self.y * b.x,
        )
    }

    /// Squared length.
    #[inline(always)]
    pub fn length2(self) -> f32 {
        self.dot(self)
    }

    /// Length.
    #[inline(always)]
    pub fn length(self) -> f32 {
        self.length2().sqrt()
    }

    /// Returns the unit vector of the same direction, or `fallback` if the squared length is not a normal number:
    /// zero, not finite, overflow or underflow.
    #[inline(always)]
    pub fn normalized_or(self, fallback: Self) -> Self {
        // A subnormal square has too few digits for a unit vector.
        let squared = self.length2();
        if squared.is_normal() {
            self * (1.0 / squared.sqrt())
        } else {
            fallback
        }
    }

    /// Returns the unit vector of the same direction, or the z axis for a zero vector. Tiny and huge vectors keep their
    /// direction.
    #[inline]
    pub fn normalized(self) -> Self {
        let squared = self.length2();
        if (SQUARES[0]..SQUARES[1]).contains(&squared) {
            self * (1.0 / squared.sqrt())
        } else {
            self.normalized_from_afar()
        }
    }

    /// Scales by the largest component first.
    #[cold]
    fn normalized_from_afar(self) -> Self {
        let largest = self.x.abs().max(self.y.abs()).max(self.z.abs());
        if largest > 0.0 && largest.is_finite() {
            let scaled = vec3(self.x / largest, self.y / largest, self.z / largest);
            scaled * (1.0 / scaled.length())
        } else {
            vec3(0.0, 0.0, 1.0)
        }
    }

    /// Returns the largest component.
    #[inline(always)]
    pub fn max_component(self) -> f32 {
        self.x.max(self.y).max(self.z)
    }

    /// Returns the largest magnitude of the components.
    #[inline(always)]
    pub fn max_abs(self) -> f32 {
        self.map(f32::abs).max_component()
    }

    /// Returns the mean of the magnitudes of the components.
    #[inline(always)]
    pub fn mean_abs(self) -> f32 {
        self.map(f32::abs).mean()
    }

    /// Returns the mean of the components.
    #[inline(always)]
    pub fn mean(self) -> f32 {
        (self.x + self.y + self.z) * (1.0 / 3.0)
    }

    /// Applies a function to each component.
    #[inline(always)]
    pub fn map(self, f: impl Fn(f32) -> f32) -> Self {
        vec3(f(self.x), f(self.y), f(self.z))
    }

    /// Whether no component is NaN or infinite.
    #[inline(always)]
    pub fn is_finite(self) -> bool {
        self.x.is_finite() && self.y.is_finite() && self.z.is_finite()
    }
}

impl From<[f32; 3]> for Vec3 {
    #[inline(always)]
    fn from(a: [f32; 3]) -> Self {
        vec3(a[0], a[1], a[2])
    }
}

impl Add for Vec3 {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        vec3(self.x + b.x, self.y + b.y, self.z + b.z)
    }
}

impl AddAssign for Vec3 {
    #[inline(always)]
    fn add_assign(&mut self, b: Self) {
        *self = *self + b;
    }
}

impl Sub for Vec3 {
    type Output = Self;
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        vec3(self.x - b.x, self.y - b.y, self.z - b.z)
    }
}

impl Mul<f32> for Vec3 {
    type Output = Self;
    #[inline(always)]
    fn mul(self, s: f32) -> Self {
        vec3(self.x * s, self.y * s, self.z * s)
    }
}

impl Mul for Vec3 {
    type Output = Self;
    /// Product of components, as for colours and filters.
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        vec3(self.x * b.x, self.y * b.y, self.z * b.z)
    }
}

impl MulAssign<f32> for Vec3 {
    #[inline(always)]
    fn mul_assign(&mut self, s: f32) {
        *self = *self * s;
    }
}

impl Neg for Vec3 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        vec3(-self.x, -self.y, -self.z)
    }
}

/// Returns the angle between two directions of unit length, radians.
pub fn angle(a: Vec3, b: Vec3) -> f32 {
    // The chord keeps small angles, which the cosine rounds away.
    let chord = length(sub(widen(a.array()), widen(b.array())));
    (2.0 * (0.5 * chord).min(1.0).asin()) as f32
}

/// A right-handed orthonormal frame whose third axis is a given unit vector.
/// Duff et al. 2017, "Building an Orthonormal Basis, Revisited", listing 3.
#[derive(Debug, Clone, Copy)]
pub struct Frame {
    /// First tangent.
    pub x: Vec3,
    /// Second tangent.
    pub y: Vec3,
    /// The given unit vector.
    pub z: Vec3,
}

impl Frame {
    /// Returns the frame around the unit vector `z`.
    #[inline(always)]
    pub fn around(z: Vec3) -> Self {
        // The sign of z.z keeps the denominator away from 0.
        let sign = 1.0_f32.copysign(z.z);
        let a = -1.0 / (sign + z.z);
        let b = z.x * z.y * a;
        Self {
            x: vec3(1.0 + sign * z.x * z.x * a, sign * b, -sign * z.x),
            y: vec3(b, sign + z.y * z.y * a, -z.y),
            z,
        }
    }

    /// Transforms from world to this frame.
    #[inline(always)]
    pub fn to_local(&self, v: Vec3) -> Vec3 {
        vec3(self.x.dot(v), self.y.dot(v), self.z.dot(v))
    }

    /// Transforms from this frame to world.
    #[inline(always)]
    pub fn to_world(&self, v: Vec3) -> Vec3 {
        self.x * v.x + self.y * v.y + self.z * v.z
    }
}

/// Returns column `k` of a matrix in f32: an axis of a light or its position.
pub fn matrix_column(matrix: &[[f64; 4]; 4], k: usize) -> Vec3 {
    vec3(
        matrix[0][k] as f32,
        matrix[1][k] as f32,
        matrix[2][k] as f32,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_orthonormal_and_right_handed_in_every_direction() {
        for i in 0..1000 {
            let t = i as f32;
            let z = vec3((t * 0.7).sin(), (t * 1.3).cos(), (t * 2.1).sin()).normalized();
            for z in [z, vec3(0.0, 0.0, -1.0), vec3(0.0, 0.0, 1.0)] {
                let f = Frame::around(z);
                assert!(f.x.dot(f.y).abs() < 1e-6 && f.x.dot(f.z).abs() < 1e-6);
                assert!((f.x.cross(f.y) - f.z).length() < 1e-6);
                let v = vec3(0.3, -0.8, 0.5);
                assert!((f.to_world(f.to_local(v)) - v).length() < 1e-6);
            }
        }
    }
}
