// SPDX-License-Identifier: GPL-3.0-or-later
//! Bounds of intervals: what is not a number bounds nothing.
//!
//! An allowance that overflows against an infinite distance is not a number. A child of a node must then count as
//! met, so the bound that was known stays, on every processor.

use fearless_simd::{Simd, SimdFloat};

/// `max` that keeps `b` when `a` is NaN, and compiles to one instruction.
#[inline(always)]
pub fn keep_max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// `min` that keeps `b` when `a` is NaN, and compiles to one instruction.
#[inline(always)]
pub fn keep_min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// What the plain maximum and minimum of vectors do with NaN is the processor's affair: on x86 the second operand
/// stays, which is what is wanted, at no cost; on others NaN spreads, and the precise ones are one instruction.
const SECOND_STAYS: bool = cfg!(any(target_arch = "x86", target_arch = "x86_64"));

/// The same lane by lane: `max` that keeps `b` where `a` is NaN. `b` is a number.
#[inline(always)]
pub fn keep_max_each<S: Simd, V: SimdFloat<S, Element = f32>>(a: V, b: V) -> V {
    if SECOND_STAYS {
        a.max(b)
    } else {
        a.max_precise(b)
    }
}

/// The same lane by lane: `min` that keeps `b` where `a` is NaN. `b` is a number.
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
    fn what_is_not_a_number_bounds_nothing() {
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
