// SPDX-License-Identifier: GPL-3.0-or-later
//! Adaptive sampling: blocks of 8 × 8 pixels whose noise is below a threshold get no more samples.
//!
//! After Dammertz, Hanika, Keller and Lensch 2010 ("A Hierarchical Automatic Stopping Condition for Monte Carlo
//! Global Illumination"): the mean of every second sample is an image of its own, and its distance from the mean of
//! all samples estimates the noise. A pixel's error is that distance divided by the square root of its brightness,
//! as in Cycles, so that a threshold has about the same effect in both. A block's error is the root mean square of
//! its pixels' errors.
//!
//! A block stops when it and its neighbours within the tile are below the threshold, because a few pixels can agree
//! by chance. Decisions are made tile by tile at fixed sample counts, so the image does not depend on the schedule.
//! The estimate is biased: the number of samples depends on their values.

use crate::film::{BLOCK, TileArea};
use crate::settings::{CHECK_SAMPLES, Settings};

/// Per pixel of a tile: the sum of all samples, and the sum of every second sample.
#[derive(Debug, Clone)]
pub struct Noise {
    sums: Vec<[[f64; 3]; 2]>,
}

impl Noise {
    /// Sums of zero for this number of pixels.
    pub fn new(pixels: usize) -> Self {
        Self {
            sums: vec![[[0.0; 3]; 2]; pixels],
        }
    }

    /// Adds sample number `index` of a pixel. Samples with odd index also go into the second sum.
    #[inline]
    pub fn add(&mut self, pixel: usize, index: u32, color: [f32; 3]) {
        for sum in &mut self.sums[pixel][..1 + (index & 1) as usize] {
            for (s, c) in sum.iter_mut().zip(color) {
                *s += f64::from(c);
            }
        }
    }

    /// Returns the error of a pixel after `samples` samples, which must be an even number.
    fn error(&self, pixel: usize, samples: u32) -> f64 {
        let [all, half] = self.sums[pixel];
        let n = f64::from(samples);
        // Compare the mean of all samples with the mean of the odd half, channel by channel.
        let mut distance = 0.0;
        let mut sum = 0.0;
        for (a, h) in all.into_iter().zip(half) {
            distance += (a / n - 2.0 * h / n).abs();
            sum += a / n;
        }
        // The small constant keeps the error of black pixels finite.
        let error = distance / (1e-4 + sum.max(0.0).sqrt());
        // Infinities and NaN would pass the comparison with the threshold; such a pixel never stops.
        if error.is_finite() { error } else { f64::MAX }
    }

    /// Clears `active` for the blocks of a tile that need no more samples after `done` samples.
    pub fn stop_quiet_blocks(
        &self,
        area: TileArea,
        done: u32,
        settings: &Settings,
        active: &mut [bool],
    ) {
        // Mark as quiet the blocks that have stopped and those whose error is below the threshold.
        let (across, up) = area.blocks();
        // Cancelled blocks count as quiet, so that they do not keep their neighbours active.
        let mut quiet: Vec<bool> = active.iter().map(|active| !active).collect();
        for (block, quiet) in quiet.iter_mut().enumerate().filter(|(_, quiet)| !**quiet) {
            let (bx, by) = (block as u32 % across * BLOCK, block as u32 / across * BLOCK);
            // The error of a block is the root mean square over its pixels, fewer at the edge of the tile.
            let (mut squares, mut pixels) = (0.0, 0.0);
            for y in by..(by + BLOCK).min(area.height) {
                for x in bx..(bx + BLOCK).min(area.width) {
                    squares += self.error((y * area.width + x) as usize, done).powi(2);
                    pixels += 1.0;
                }
            }
            *quiet = (squares / pixels).sqrt() < f64::from(settings.noise_threshold);
        }
        // Stop the blocks whose 3 × 3 neighbourhood, clipped to the tile, is quiet.
        for (block, active) in active.iter_mut().enumerate() {
            let (bx, by) = (block as u32 % across, block as u32 / across);
            let around = |at: u32, end: u32| at.saturating_sub(1)..(at + 2).min(end);
            let all_quiet = around(by, up)
                .all(|y| around(bx, across).all(|x| quiet[(y * across + x) as usize]));
            *active = *active && !all_quiet;
        }
    }
}

/// Whether the noise is estimated after `done` samples. Never after the last sample, where a decision changes
/// nothing.
pub fn is_due(settings: &Settings, done: u32) -> bool {
    settings.noise_threshold > 0.0
        && done.is_multiple_of(CHECK_SAMPLES)
        && done >= min_samples(settings)
        && done < settings.samples
}

/// Returns the number of samples before the first decision: lower thresholds need more, as in Cycles.
fn min_samples(settings: &Settings) -> u32 {
    match settings.min_samples {
        0 => (16.0 / settings.noise_threshold.powf(0.3)).ceil().max(4.0) as u32,
        n => n,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AREA: TileArea = TileArea {
        x: 0,
        y: 0,
        width: 32,
        height: 24,
    };

    fn settings() -> Settings {
        Settings {
            samples: 64,
            noise_threshold: 0.05,
            min_samples: 16,
            ..Default::default()
        }
    }

    #[test]
    fn quiet_blocks_stop_unless_a_neighbour_is_noisy() {
        let mut noise = Noise::new(AREA.pixels());
        for pixel in 0..AREA.pixels() {
            let x = pixel % 32;
            for index in 0..16 {
                // The leftmost blocks flicker.
                let value = if x < 8 { (index & 1) as f32 } else { 0.5 };
                noise.add(pixel, index, [value; 3]);
            }
        }
        let mut active = vec![true; 12];
        noise.stop_quiet_blocks(AREA, 16, &settings(), &mut active);
        let row = [true, true, false, false];
        assert_eq!(active, [row, row, row].concat());
    }

    #[test]
    fn stopped_blocks_stay_stopped_and_nan_keeps_a_block_active() {
        let mut noise = Noise::new(AREA.pixels());
        noise.add(0, 0, [f32::NAN, 0.0, 0.0]);
        let mut active = vec![true; 12];
        active[11] = false;
        noise.stop_quiet_blocks(AREA, 16, &settings(), &mut active);
        assert!(active[0] && active[1] && active[5] && !active[2] && !active[11]);
    }

    #[test]
    fn decisions_are_made_at_fixed_sample_counts() {
        let due: Vec<_> = (1..=64).filter(|&n| is_due(&settings(), n)).collect();
        assert_eq!(due, [16, 32, 48], "not after the last: it changes nothing");
        let automatic = Settings {
            min_samples: 0,
            noise_threshold: 0.01,
            samples: 200,
            ..settings()
        };
        assert_eq!((1..200).find(|&n| is_due(&automatic, n)), Some(64));
    }
}
