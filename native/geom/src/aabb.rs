// SPDX-License-Identifier: GPL-3.0-or-later
//! Axis-aligned boxes.

/// A closed axis-aligned box; empty if any `min` exceeds its `max`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aabb {
    /// Smallest coordinates.
    pub min: [f32; 3],
    /// Largest coordinates.
    pub max: [f32; 3],
}

impl Aabb {
    /// The empty box, neutral for [`Self::union`].
    pub const EMPTY: Self = Self {
        min: [f32::INFINITY; 3],
        max: [f32::NEG_INFINITY; 3],
    };

    /// Returns whether the box contains no point.
    #[inline]
    pub fn is_empty(&self) -> bool {
        (0..3).any(|k| self.min[k] > self.max[k])
    }

    /// Extends the box to contain `p`.
    #[inline]
    pub fn grow(&mut self, p: [f32; 3]) {
        for ((lo, hi), x) in self.min.iter_mut().zip(&mut self.max).zip(p) {
            // `+ 0.0` turns -0.0 to +0.0, so that stored bounds have only one zero.
            *lo = lo.min(x + 0.0);
            *hi = hi.max(x + 0.0);
        }
    }

    /// Returns the smallest box around three points.
    #[inline]
    pub fn of_triangle([a, b, c]: [[f32; 3]; 3]) -> Self {
        let mut bounds = Self::EMPTY;
        for k in 0..3 {
            // `+ 0.0` as in `grow`.
            bounds.min[k] = a[k].min(b[k]).min(c[k]) + 0.0;
            bounds.max[k] = a[k].max(b[k]).max(c[k]) + 0.0;
        }
        bounds
    }

    /// Returns the smallest box around both; either may be empty.
    #[inline]
    pub fn union(&self, other: &Self) -> Self {
        let mut both = *self;
        for k in 0..3 {
            // Bounds are never NaN, so each comparison and assignment is one instruction.
            if other.min[k] < both.min[k] {
                both.min[k] = other.min[k];
            }
            if other.max[k] > both.max[k] {
                both.max[k] = other.max[k];
            }
        }
        both
    }

    /// Returns the side length along axis `k`, in f64 so that it never overflows.
    #[inline]
    pub fn extent(&self, k: usize) -> f64 {
        f64::from(self.max[k]) - f64::from(self.min[k])
    }

    /// Returns the surface area; 0 for a box that is empty, a line or a point.
    #[inline]
    pub fn area(&self) -> f64 {
        if self.is_empty() {
            return 0.0;
        }
        let [x, y, z] = [self.extent(0), self.extent(1), self.extent(2)];
        2.0 * (x * y + y * z + z * x)
    }

    /// Returns the largest absolute coordinate; 0 for the empty box.
    pub fn magnitude(&self) -> f32 {
        if self.is_empty() {
            return 0.0;
        }
        self.min
            .iter()
            .chain(&self.max)
            .fold(0.0, |m, x| m.max(x.abs()))
    }
}
