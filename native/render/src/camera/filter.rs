// SPDX-License-Identifier: GPL-3.0-or-later
//! The pixel filter, by importance sampling: camera samples are distributed around the pixel with the filter's own
//! density, and all have the same weight. Ernst, Stamminger and Greiner 2006, "Filter Importance Sampling"; Cycles
//! does the same.

use crate::check::{Error, Result};

/// Steps of the tabulated inverse distribution; the variance is within 0.5 % of the window's (tested).
const STEPS: usize = 1024;

/// The shape of the pixel filter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FilterKind {
    /// Blackman–Harris window of 4 terms: the default of Cycles.
    BlackmanHarris,
    /// Uniform over the width.
    Box,
}

/// A separable pixel filter, prepared for sampling.
#[derive(Debug, Clone)]
pub struct Filter {
    /// Offsets in pixels at evenly spaced values of the distribution function.
    inverse: Vec<f32>,
}

impl Filter {
    /// A filter of Blender's `width` in pixels, default 1.5; larger is softer. The box has this full width, the
    /// Blackman–Harris window twice as much, because most of its weight lies in the middle half (as in Cycles).
    ///
    /// # Errors
    /// [`Error::Spec`] if the width is not a number in 0..=20.
    pub fn new(kind: FilterKind, width: f32) -> Result<Self> {
        if !(0.0..=20.0).contains(&width) {
            return Err(Error::Spec(format!(
                "settings['filter_width'] must lie in 0..20 pixels, got {width}"
            )));
        }
        let inverse = match kind {
            FilterKind::Box => vec![-0.5 * width, 0.5 * width],
            FilterKind::BlackmanHarris => invert(blackman_harris, 2.0 * width),
        };
        Ok(Self { inverse })
    }

    /// Maps a random number in [0, 1) to the offset from the pixel's centre, in pixels.
    #[inline]
    pub fn offset(&self, u: f32) -> f32 {
        let x = u * (self.inverse.len() - 1) as f32;
        let i = (x as usize).min(self.inverse.len() - 2);
        let f = x - i as f32;
        self.inverse[i] + f * (self.inverse[i + 1] - self.inverse[i])
    }
}

/// Blackman–Harris window over 0..1, zero at both ends (Harris 1978, table I, minimum 4-term).
fn blackman_harris(x: f64) -> f64 {
    let v = std::f64::consts::TAU * x;
    0.35875 - 0.48829 * v.cos() + 0.14128 * (2.0 * v).cos() - 0.01168 * (3.0 * v).cos()
}

/// Tabulates the inverse of the distribution function of density `f` over 0..1, scaled to `width`.
fn invert(f: impl Fn(f64) -> f64, width: f32) -> Vec<f32> {
    // Integrate the density with finer steps than the table has.
    let fine = STEPS * 16;
    let mut sum = vec![0.0; fine + 1];
    for i in 0..fine {
        sum[i + 1] = sum[i] + f((i as f64 + 0.5) / fine as f64).max(0.0);
    }
    // Find the position where the integral reaches each step of the table.
    let mut at = 0;
    (0..=STEPS)
        .map(|i| {
            let target = sum[fine] * i as f64 / STEPS as f64;
            while at + 1 < fine && sum[at + 1] < target {
                at += 1;
            }
            let step = sum[at + 1] - sum[at];
            let inside = if step > 0.0 {
                (target - sum[at]) / step
            } else {
                0.0
            };
            let x = (at as f64 + inside.clamp(0.0, 1.0)) / fine as f64;
            ((x - 0.5) * f64::from(width)) as f32
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offsets_have_the_windows_variance_and_no_bias() {
        let filter = Filter::new(FilterKind::BlackmanHarris, 1.5).unwrap();
        let n = 100_000;
        let (mut mean, mut second, mut norm, mut exact) = (0.0, 0.0, 0.0, 0.0);
        for i in 0..n {
            let u = (f64::from(i) + 0.5) / f64::from(n);
            let x = f64::from(filter.offset(u as f32));
            mean += x;
            second += x * x;
            let p = 3.0 * (u - 0.5);
            norm += blackman_harris(u);
            exact += blackman_harris(u) * p * p;
        }
        assert!((mean / f64::from(n)).abs() < 1e-4);
        let (variance, exact) = (second / f64::from(n), exact / norm);
        assert!(
            (variance - exact).abs() < 5e-3 * exact,
            "{variance} {exact}"
        );
    }

    #[test]
    fn the_box_is_uniform_and_a_wrong_width_is_refused() {
        let filter = Filter::new(FilterKind::Box, 1.0).unwrap();
        assert_eq!((filter.offset(0.0), filter.offset(0.75)), (-0.5, 0.25));
        assert!(
            Filter::new(FilterKind::Box, f32::NAN)
                .unwrap_err()
                .to_string()
                .contains("filter_width")
        );
    }
}
