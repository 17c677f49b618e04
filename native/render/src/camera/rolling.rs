// SPDX-License-Identifier: GPL-3.0-or-later
//! A rolling shutter: every row of the picture is exposed at its own time, from the top to the bottom, as in Cycles.

use crate::check::{Result, finite, within};

/// Parameters of a rolling shutter.
#[derive(Debug, Clone, PartialEq)]
pub struct RollingParams {
    /// Share of the opening for which a row is exposed, 0..1: 0 = each row shows one moment, 1 = the whole opening.
    pub duration: f64,
    /// Times, 0 to 1, at which equal shares of the light have passed the shutter; fewer than two = they are even.
    pub curve: Vec<f64>,
}

/// A rolling shutter of a picture.
#[derive(Debug, Clone)]
pub struct Rolling {
    duration: f32,
    curve: Vec<f32>,
    height: f32,
}

impl Rolling {
    /// The shutter of a picture of `height` rows.
    ///
    /// # Errors
    /// If the duration or a time is not within 0 and 1.
    pub fn new(params: &RollingParams, height: u32) -> Result<Self> {
        within(params.duration, 0.0, 1.0, || {
            "camera['rolling_shutter']".into()
        })?;
        finite(&params.curve, || "camera['shutter_curve']".into())?;
        Ok(Self {
            duration: params.duration as f32,
            curve: params.curve.iter().map(|&time| time as f32).collect(),
            height: height as f32,
        })
    }

    /// Returns the time, 0 to 1, at which a row, counted from the bottom, takes this share of its light.
    pub fn time(&self, row: u32, share: f32) -> f32 {
        let begin = 1.0 - row as f32 / self.height;
        (1.0 - self.duration) * begin + self.duration * self.opened(share)
    }

    /// Returns the time at which this share of the light has passed a shutter that does not roll.
    fn opened(&self, share: f32) -> f32 {
        let Some(last) = self.curve.len().checked_sub(1).filter(|&last| last > 0) else {
            return share;
        };
        let place = share.clamp(0.0, 1.0) * last as f32;
        let index = (place as usize).min(last - 1);
        let [a, b] = [self.curve[index], self.curve[index + 1]];
        a + (b - a) * (place - index as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_exposed_from_the_top_to_the_bottom() {
        let time = |duration, curve: &[f64], row, share| {
            let curve = curve.to_vec();
            let rolling = Rolling::new(&RollingParams { duration, curve }, 4).unwrap();
            rolling.time(row, share)
        };
        for (duration, curve, row, share, expected) in [
            (0.0, &[][..], 3, 0.7, 0.25),
            (0.0, &[], 0, 0.7, 1.0),
            (1.0, &[], 0, 0.7, 0.7),
            (0.5, &[], 2, 0.5, 0.5),
            (1.0, &[0.0, 0.8, 1.0], 0, 0.25, 0.4),
            (1.0, &[0.0, 0.8, 1.0], 0, 1.0, 1.0),
        ] {
            let found = time(duration, curve, row, share);
            assert!((found - expected).abs() < 1e-6, "{duration} {row}: {found}");
        }
    }

    #[test]
    fn absurd_shutters_are_named() {
        for (duration, curve, name) in [
            (1.5, vec![], "camera['rolling_shutter']"),
            (f64::NAN, vec![], "camera['rolling_shutter']"),
            (0.5, vec![0.0, f64::NAN], "camera['shutter_curve']"),
        ] {
            let error = Rolling::new(&RollingParams { duration, curve }, 4).unwrap_err();
            assert!(error.to_string().contains(name), "{error}");
        }
    }
}
