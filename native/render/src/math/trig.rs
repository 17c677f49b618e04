// SPDX-License-Identifier: GPL-3.0-or-later
//! Sine, cosine and arcsine from additions, multiplications and square roots.
//!
//! The system's functions use fused operations on some machines and not on others, so their last bits differ. These
//! give the same image everywhere, and are faster.

/// Returns sine and cosine of `turns` full turns, for `turns` in 0..1, with an error below 2e-7: Taylor series on
/// an eighth of a turn to both sides of the nearest quarter.
#[inline(always)]
pub fn sin_cos_turns(turns: f32) -> (f32, f32) {
    // Reduce to an eighth of a turn around the nearest quarter.
    let quarters = (turns * 4.0 + 0.5).floor();
    let x = (turns - quarters * 0.25) * std::f32::consts::TAU;
    let x2 = x * x;
    let s = x
        * (1.0
            + x2 * (-1.0 / 6.0
                + x2 * (1.0 / 120.0 + x2 * (-1.0 / 5040.0 + x2 * (1.0 / 362_880.0)))));
    let c = 1.0
        + x2 * (-0.5
            + x2 * (1.0 / 24.0
                + x2 * (-1.0 / 720.0 + x2 * (1.0 / 40_320.0 - x2 * (1.0 / 3_628_800.0)))));
    // Rotate back by the quarters.
    match quarters as i32 & 3 {
        0 => (s, c),
        1 => (c, -s),
        2 => (-s, -c),
        _ => (-c, s),
    }
}

/// Returns the arcsine in radians with an error below 4e-7; arguments are clamped to ±1. Minimax polynomial of
/// Cephes' `asinf` (Moshier 1992) up to 1/2, the half-angle formula above.
#[inline(always)]
pub fn asin(x: f32) -> f32 {
    // asin x = π/2 - 2 asin √((1 - x) / 2) for large arguments.
    let a = x.abs().min(1.0);
    let far = a > 0.5;
    let z = if far { 0.5 * (1.0 - a) } else { a * a };
    let root = if far { z.sqrt() } else { a };
    let p = ((((0.042_163_2 * z + 0.024_181_312) * z + 0.045_470_025) * z + 0.074_953_005) * z
        + 0.166_667_52)
        * z
        * root
        + root;
    let y = if far {
        std::f32::consts::FRAC_PI_2 - 2.0 * p
    } else {
        p
    };
    y.copysign(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_as_stated() {
        let n = 200_000;
        for i in 0..n {
            let u = i as f32 / n as f32;
            let (s, c) = sin_cos_turns(u);
            let (es, ec) = (f64::from(u) * std::f64::consts::TAU).sin_cos();
            assert!(
                (f64::from(s) - es).abs() < 2e-7,
                "sin of {u} turns: {s} {es}"
            );
            assert!(
                (f64::from(c) - ec).abs() < 2e-7,
                "cos of {u} turns: {c} {ec}"
            );
            let x = 2.0 * u - 1.0;
            let e = f64::from(x).asin();
            assert!(
                (f64::from(asin(x)) - e).abs() < 4e-7,
                "asin {x}: {} {e}",
                asin(x)
            );
        }
        assert_eq!(sin_cos_turns(0.25), (1.0, 0.0));
        assert_eq!((asin(1.5), asin(0.0)), (std::f32::consts::FRAC_PI_2, 0.0));
    }
}
