// SPDX-License-Identifier: GPL-3.0-or-later
//! Minimum and maximum for interval bounds, in which NaN bounds nothing.
//!
//! An error bound that overflows, combined with an infinite distance, gives NaN. The child of a node must then
//! count as hit, so the previous bound stays, on every processor.

use fearless_simd::{Simd, SimdFloat};

/// Returns the maximum, or `b` if `a` is NaN; compiles to one instruction.
#[inline(always)]
pub fn keep_max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Returns the minimum, or `b` if `a` is NaN; compiles to one instruction.
#[inline(always)]
pub fn keep_min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// Whether the plain vector `max` and `min` return the second operand if the first is NaN.
///
/// They do on x86, at no cost. On other processors NaN propagates, and the precise variants take one
/// instruction.
const SECOND_STAYS: bool = cfg!(any(target_arch = "x86", target_arch = "x86_64"));

/// Returns [`keep_max`] lane by lane: `max` that keeps `b` where `a` is NaN. `b` must not be NaN.
#[inline(always)]
pub fn keep_max_each<S: Simd, V: SimdFloat<S, Element = f32>>(a: V, b: V) -> V {
    if SECOND_STAYS {
        a.max(b)
    } else {
        a.max_precise(b)
    }
}

/// Returns [`keep_min`] lane by lane: `min` that keeps `b` where `a` is NaN. `b` must not be NaN.
#[inline(always)]
pub fn keep_min_each<S: Simd, V: SimdFloat<S, Element = f32>>(a: V, b: V) -> V {
    if SECOND_STAYS {
        a.min(b)
    } else {
        a.min_precise(b)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::{Level, SimdBase, dispatch, f32x4, f32x8, f32x16};

    #[test]
    fn nan_bounds_nothing() {
        assert_eq!(keep_max(f32::NAN, 1.0), 1.0);
        assert_eq!(keep_min(f32::NAN, 1.0), 1.0);
        macro_rules! check {
            ($simd:expr, $vector:ident, $lanes:literal) => {{
                let new: [f32; $lanes] =
                    std::array::from_fn(|i| [f32::NAN, 2.0, -f32::NAN, -2.0][i % 4]);
                let known = $vector::splat($simd, 1.0);
                let (mut most, mut least) = ([0.0; $lanes], [0.0; $lanes]);
                let new = $vector::from_slice($simd, &new);
                keep_max_each(new, known).store_slice(&mut most);
                keep_min_each(new, known).store_slice(&mut least);
                for i in 0..$lanes {
                    assert_eq!(most[i], [1.0, 2.0, 1.0, 1.0][i % 4], "lane {i}");
                    assert_eq!(least[i], [1.0, 1.0, 1.0, -2.0][i % 4], "lane {i}");
                }
            }};
        }
        dispatch!(Level::new(), simd => {
            check!(simd, f32x4, 4);
            check!(simd, f32x8, 8);
            check!(simd, f32x16, 16);
        });
    }
}
