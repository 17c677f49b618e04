// SPDX-License-Identifier: GPL-3.0-or-later
//! Strategies for random geometry in property tests.

use proptest::prelude::*;

/// Generates coordinates of few bits, which meet edges and planes exactly, small and large ones, and any finite
/// float.
pub fn coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![
        (-8i8..8).prop_map(f32::from),
        -1.0f32..1.0,
        -1e-3f32..1e-3,
        -1e6f32..1e6,
        prop::num::f32::NORMAL | prop::num::f32::SUBNORMAL | prop::num::f32::ZERO,
    ]
}

/// Generates points with such coordinates.
pub fn point() -> impl Strategy<Value = [f32; 3]> {
    [coordinate(), coordinate(), coordinate()]
}

/// Returns a point in or near a triangle as the target of a ray; the weights are between 0 and 1.
pub fn near_triangle([a, b, c]: [[f32; 3]; 3], [s, t]: [f32; 2]) -> [f32; 3] {
    std::array::from_fn(|k| a[k] * (1.0 - s) * (1.0 - t) + b[k] * s + c[k] * t)
}

/// Generates a triangle of size 2^-20 to 2^-146 around 0, and a line through 0 with its origin 2^20 to 2^39 away,
/// before or behind the triangle: the vertices, the origin, the direction, and the closed interval of `t` in which
/// a hit counts.
pub fn tiny_from_afar() -> impl Strategy<Value = ([[f32; 3]; 3], [[f32; 3]; 2], [f32; 2])> {
    let corners = prop::array::uniform2(prop::array::uniform3(-1.0f32..1.0));
    let way = prop::array::uniform3(-1.0f32..1.0);
    (corners, 20..146_i32, 20..39_i32, way, any::<bool>()).prop_map(
        |([a, b], small, far, way, behind)| {
            // Two factors, because the power itself may underflow.
            let shrunk = |x: f32| x * 2.0_f32.powi(-small / 2) * 2.0_f32.powi(small / 2 - small);
            // The triangle contains 0, up to rounding.
            let c = std::array::from_fn(|k| -0.75 * (a[k] + b[k]));
            let distance = 2.0_f32.powi(far) * if behind { 1.0 } else { -1.0 };
            let limits = if behind {
                [f32::NEG_INFINITY, 0.0]
            } else {
                [0.0, f32::INFINITY]
            };
            let tiny = [a, b, c].map(|corner: [f32; 3]| corner.map(shrunk));
            (tiny, [way.map(|x| x * distance), way], limits)
        },
    )
}
