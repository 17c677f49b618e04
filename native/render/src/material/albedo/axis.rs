// SPDX-License-Identifier: GPL-3.0-or-later
//! The ranges of roughness and index that a grid covers, and the levels that divide them.

/// Levels of an axis of roughness. With [`INDICES`], grids are within 4e-3 of single tables (tested).
const ROUGHNESSES: usize = 17;
/// Levels per unit of [`index_to_axis`] of an axis of indices.
const INDICES: f32 = 6.0;

/// Range of one parameter of a [`crate::material::albedo::Grid`]: a number of evenly spaced levels, or a single value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axis {
    low: f32,
    high: f32,
    pub(super) levels: usize,
}

impl Axis {
    /// The axis of a parameter that does not vary.
    pub fn fixed(value: f32) -> Self {
        Self {
            low: value,
            high: value,
            levels: 1,
        }
    }

    /// The axis of roughness, 0..1.
    pub fn roughness() -> Self {
        Self {
            low: 0.0,
            high: 1.0,
            levels: ROUGHNESSES,
        }
    }

    /// The axis of indices of refraction from `low` to `high`. The number of levels is even, so that for a range
    /// from an index to its inverse no level lies at 1, where nothing is reflected.
    pub fn index(low: f32, high: f32) -> Self {
        // Space the levels evenly on the axis, not in the index itself.
        let [low, high] = [low, high].map(index_to_axis);
        Self {
            low,
            high,
            levels: 2 * (1 + ((high - low) * INDICES * 0.5) as usize),
        }
    }

    /// Returns the value at level `i`.
    pub(super) fn level(&self, i: usize) -> f32 {
        if self.levels == 1 {
            self.low
        } else {
            self.low + (self.high - self.low) * i as f32 / (self.levels - 1) as f32
        }
    }

    /// Returns the level below a value and the fraction of the step above it. Values outside are clamped.
    #[inline(always)]
    pub(super) fn find(&self, value: f32) -> (usize, f32) {
        if self.levels == 1 {
            return (0, 0.0);
        }
        // Clamp to the range, and let the last level belong to the last step.
        let x = (value - self.low) / (self.high - self.low) * (self.levels - 1) as f32;
        let x = x.clamp(0.0, (self.levels - 1) as f32);
        let i = (x as usize).min(self.levels - 2);
        (i, x - i as f32)
    }

    /// Returns what identifies the axis in the map of grids.
    pub(super) fn key(&self) -> [u32; 3] {
        [self.low.to_bits(), self.high.to_bits(), self.levels as u32]
    }
}

/// Maps an index to its axis: sign(ln η) √|ln η|. Even steps there are fine near index 1, where the reflectance
/// changes fast, and coarse at high indices; an index and its inverse are mirrored at 0.
#[inline(always)]
pub(super) fn index_to_axis(eta: f32) -> f32 {
    let log = eta.ln();
    log.abs().sqrt().copysign(log)
}

/// Inverse of [`index_to_axis`].
pub(super) fn axis_to_index(position: f32) -> f32 {
    (position * position.abs()).exp()
}
