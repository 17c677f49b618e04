// SPDX-License-Identifier: GPL-3.0-or-later
//! Three-component vectors as plain arrays, in f64, for the builders and the verdict.

/// A point or a direction.
pub type Vec3 = [f64; 3];

/// Returns `f` of each of three elements. Unlike `array::map` it is always inlined, also into code for a larger
/// instruction set than the crate's own.
#[inline(always)]
pub fn map<T: Copy, U>(a: [T; 3], f: impl Fn(T) -> U) -> [U; 3] {
    [f(a[0]), f(a[1]), f(a[2])]
}

/// Converts a stored point to f64; exact.
#[inline(always)]
pub fn widen(a: [f32; 3]) -> Vec3 {
    [f64::from(a[0]), f64::from(a[1]), f64::from(a[2])]
}

/// Returns `a - b`.
#[inline(always)]
pub fn sub(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// Returns `a + s * b`.
#[inline(always)]
pub fn add_scaled(a: Vec3, s: f64, b: Vec3) -> Vec3 {
    [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]]
}

/// Returns the dot product `a . b`.
#[inline(always)]
pub fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Returns the cross product `a x b`.
#[inline(always)]
pub fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// Returns the Euclidean length.
#[inline(always)]
pub fn length(a: Vec3) -> f64 {
    dot(a, a).sqrt()
}
