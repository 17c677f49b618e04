// SPDX-License-Identifier: GPL-3.0-or-later
//! The ranges of roughness and index that a grid covers, and its levels.

/// Levels of a grid whose roughness varies over the surface.
const ROUGHNESSES: usize = 17;
/// Levels per unit of [`place_of_index`] of one whose index varies.
const INDICES: f32 = 6.0;

/// One number's range in a [`super::Grid`]: even steps, or a single value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axis {
    low: f32,
    high: f32,
    pub(super) levels: usize,
}

impl Axis {
    /// A number that does not vary.
    pub fn fixed(value: f32) -> Self {
        Self {
            low: value,
            high: value,
            levels: 1,
        }
    }

    /// Roughness, 0..1.
    pub fn roughness() -> Self {
        Self {
            low: 0.0,
            high: 1.0,
            levels: ROUGHNESSES,
        }
    }

    /// An index of refraction between two. The levels are even in number, so that none lies at 1, where all passes,
    /// when the range is from an index to its inverse.
    pub fn index(low: f32, high: f32) -> Self {
        let [low, high] = [low, high].map(place_of_index);
        Self {
            low,
            high,
            levels: 2 * (1 + ((high - low) * INDICES * 0.5) as usize),
        }
    }

    pub(super) fn level(&self, i: usize) -> f32 {
        if self.levels == 1 {
            self.low
        } else {
            self.low + (self.high - self.low) * i as f32 / (self.levels - 1) as f32
        }
    }

    /// The level below a value and how far it is to the next.
    #[inline(always)]
    pub(super) fn find(&self, value: f32) -> (usize, f32) {
        if self.levels == 1 {
            return (0, 0.0);
        }
        let x = (value - self.low) / (self.high - self.low) * (self.levels - 1) as f32;
        let x = x.clamp(0.0, (self.levels - 1) as f32);
        let i = (x as usize).min(self.levels - 2);
        (i, x - i as f32)
    }

    pub(super) fn key(&self) -> [u32; 3] {
        [self.low.to_bits(), self.high.to_bits(), self.levels as u32]
    }
}

/// Place of an index on its axis: even steps of it part the indices about 1, where boundaries change fast, finer than
/// high ones. An index and its inverse lie opposite each other.
#[inline(always)]
pub(super) fn place_of_index(eta: f32) -> f32 {
    let log = eta.ln();
    log.abs().sqrt().copysign(log)
}

pub(super) fn index_at(place: f32) -> f32 {
    (place * place.abs()).exp()
}
