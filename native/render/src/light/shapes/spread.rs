// SPDX-License-Identifier: GPL-3.0-or-later
//! The spread of area lights: cones into which the points of a light shine.

use std::f32::consts::{FRAC_PI_2, PI};

/// Smallest full angle in radians, one degree as in Cycles.
const NARROWEST: f32 = PI / 180.0;

/// Angle up to which the tangent of the half angle counts as infinite.
const FULL: f32 = 1e-6;

/// A cone in which the radiance falls linearly with the tangent of the angle from the axis, as in Cycles.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spread {
    /// Tangent of half the cone's angle; infinite for the half space.
    tangent: f32,
    /// Factor that keeps the power. With half angle a, the integral of (tan a - tan x) cos x sin x from 0 to a is
    /// (tan a - a) / 2, and that of cos x sin x over the half space is 1 / 2.
    scale: f32,
}

impl Spread {
    /// A cone of this full angle.
    pub fn new(angle: f32) -> Self {
        let half = 0.5 * angle.clamp(NARROWEST, PI);
        if half >= FRAC_PI_2 - FULL {
            return Self {
                tangent: f32::INFINITY,
                scale: 1.0,
            };
        }
        // In f64: the difference is the third power of a small angle.
        let wide = f64::from(half);
        #[expect(clippy::cast_possible_truncation, reason = "at most 10^7")]
        let scale = (1.0 / (wide.tan() - wide)) as f32;
        Self {
            tangent: half.tan(),
            scale,
        }
    }

    /// Whether light goes to all directions.
    #[inline]
    pub fn is_full(self) -> bool {
        self.tangent == f32::INFINITY
    }

    /// Returns half the cone's angle, in radians.
    pub fn half_angle(self) -> f32 {
        self.tangent.atan()
    }

    /// Radius of the circle, on a plane at this distance, whose points shine on a receiver.
    pub fn reach(self, distance: f32) -> f32 {
        self.tangent * distance
    }

    /// Radiance in a direction with this positive cosine to the axis, relative to light without a spread.
    #[inline]
    pub fn factor(self, cos: f32) -> f32 {
        if self.is_full() {
            return 1.0;
        }
        let tangent = (1.0 - cos * cos).max(0.0).sqrt() / cos;
        (self.tangent - tangent).max(0.0) * self.scale
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_spread_emits_the_same_power() {
        for degrees in [1.0_f32, 10.0, 60.0, 120.0, 170.0, 180.0] {
            let spread = Spread::new(degrees.to_radians());
            // Integrate over the square of the sine, whose differential is twice sin x cos x.
            let steps = 200_000_u32;
            let end = (0.5 * degrees.to_radians()).sin().powi(2);
            let sum: f64 = (0..steps)
                .map(|k| {
                    let sin2 = end * (f64::from(k) + 0.5) as f32 / steps as f32;
                    f64::from(spread.factor((1.0 - sin2).sqrt()))
                })
                .sum();
            let power = sum * f64::from(end) / f64::from(steps);
            assert!((power - 1.0).abs() < 0.01, "{degrees}: {power}");
        }
    }

    #[test]
    fn nothing_is_emitted_outside_of_the_cone() {
        let spread = Spread::new(60_f32.to_radians());
        assert_eq!(spread.factor(31_f32.to_radians().cos()), 0.0);
        assert!(spread.factor(29_f32.to_radians().cos()) > 0.0);
        assert!(spread.factor(1.0) > spread.factor(0.95));
        assert_eq!(Spread::new(PI).factor(0.01), 1.0);
        assert_eq!(
            Spread::new(0.0).factor(1.0),
            Spread::new(NARROWEST).factor(1.0)
        );
    }
}
