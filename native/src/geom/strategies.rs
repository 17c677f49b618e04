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
