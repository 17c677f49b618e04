// SPDX-License-Identifier: GPL-3.0-or-later
//! Vector arithmetic on eight triangles at once, for the leaf tests of packets and of tiles.
//!
//! The code has no closures: a closure is compiled for the instruction set of its caller only if it is inlined.

use crate::blocks::{LANES, SPAN};
use fearless_simd::{Simd, SimdBase, SimdFloat, f32x8};

/// One 3-vector per triangle for eight triangles, stored by axis.
pub type Vector8<S> = [f32x8<S>; 3];

/// Returns the first vertices of the triangles of a block of `n`, their edges to the second vertices and those to the
/// third.
#[inline(always)]
pub fn corner_and_sides<S: Simd>(simd: S, block: &[f32; SPAN], n: usize) -> [Vector8<S>; 3] {
    let a = point(simd, block, n, 0);
    let (b, c) = (point(simd, block, n, 3), point(simd, block, n, 6));
    [a, sub(b, a), sub(c, a)]
}

/// Loads the vertices whose coordinates start at row `row`: 0, 3 or 6.
#[inline(always)]
fn point<S: Simd>(simd: S, block: &[f32; SPAN], n: usize, row: usize) -> Vector8<S> {
    [
        load(simd, block, n, row),
        load(simd, block, n, row + 1),
        load(simd, block, n, row + 2),
    ]
}

/// Loads one row of a block of `n` triangles, without its header word.
#[inline(always)]
fn load<S: Simd>(simd: S, block: &[f32; SPAN], n: usize, row: usize) -> f32x8<S> {
    f32x8::from_slice(simd, &block[1 + row * n..1 + row * n + LANES])
}

/// Broadcasts one vector to all eight lanes.
#[inline(always)]
pub fn same<S: Simd>(simd: S, v: [f32; 3]) -> Vector8<S> {
    [
        f32x8::splat(simd, v[0]),
        f32x8::splat(simd, v[1]),
        f32x8::splat(simd, v[2]),
    ]
}

/// Returns the differences `a - b`.
#[inline(always)]
pub fn sub<S: Simd>(a: Vector8<S>, b: Vector8<S>) -> Vector8<S> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// Returns the largest absolute component of each vector.
#[inline(always)]
pub fn largest<S: Simd>(v: Vector8<S>) -> f32x8<S> {
    v[0].abs().max(v[1].abs()).max(v[2].abs())
}

/// Returns the absolute values of all components.
#[inline(always)]
pub fn abs<S: Simd>(v: Vector8<S>) -> Vector8<S> {
    [v[0].abs(), v[1].abs(), v[2].abs()]
}

/// Returns the cross products `a x b`.
#[inline(always)]
pub fn cross<S: Simd>(a: Vector8<S>, b: Vector8<S>) -> Vector8<S> {
    [
        a[1].mul_sub(b[2], a[2] * b[1]),
        a[2].mul_sub(b[0], a[0] * b[2]),
        a[0].mul_sub(b[1], a[1] * b[0]),
    ]
}

/// Returns the dot products `a . b`.
#[inline(always)]
pub fn dot<S: Simd>(a: Vector8<S>, b: Vector8<S>) -> f32x8<S> {
    b[0].mul_add(a[0], b[1].mul_add(a[1], b[2] * a[2]))
}
