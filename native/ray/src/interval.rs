// SPDX-License-Identifier: GPL-3.0-or-later
//! The part of a ray that lies in a region.

/// Distances between which a ray lies in a region, in units of the frame ray's direction. Empty if `leave` is less than
/// `enter`.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Interval {
    /// Distance where the ray enters the region.
    pub enter: f32,
    /// Distance where the ray leaves the region.
    pub leave: f32,
}

impl Interval {
    /// Makes the interval between two distances.
    #[inline(always)]
    pub fn new(enter: f32, leave: f32) -> Self {
        Self { enter, leave }
    }
}
