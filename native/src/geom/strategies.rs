// SPDX-License-Identifier: GPL-3.0-or-later
//! Random geometry for property tests.

use proptest::prelude::*;

/// Coordinates of few bits, which meet edges and planes exactly, small and large ones, and any float at all.
pub fn coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![
        (-8i8..8).prop_map(f32::from),
        -1.0f32..1.0,
        -1e-3f32..1e-3,
        -1e6f32..1e6,
        prop::num::f32::NORMAL | prop::num::f32::SUBNORMAL | prop::num::f32::ZERO,
    ]
}

/// Points of such coordinates.
pub fn point() -> impl Strategy<Value = [f32; 3]> {
    [coordinate(), coordinate(), coordinate()]
}

/// A point in or near a triangle, for a ray to be aimed at; the weights are between 0 and 1.
pub fn near_triangle([a, b, c]: [[f32; 3]; 3], [s, t]: [f32; 2]) -> [f32; 3] {
    std::array::from_fn(|k| a[k] * (1.0 - s) * (1.0 - t) + b[k] * s + c[k] * t)
}
