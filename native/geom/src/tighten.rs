// SPDX-License-Identifier: GPL-3.0-or-later
//! Removes empty space in interval hierarchies. Planes bound a child only on the side of its parent's partition,
//! so a region may be much larger than its contents.

use crate::Aabb;

/// Threshold: a cut is made if it leaves less than this share of the region's surface area; 0 for never.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tighten(pub f64);

/// Number of planes of a cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sides {
    /// One plane.
    One,
    /// Two planes.
    Both,
}

/// A cut that removes empty space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cut {
    /// Axis of the planes: 0, 1 or 2.
    pub axis: usize,
    /// Rest of the region.
    pub inside: Aabb,
    /// Side of the rest when one plane cuts: 0 below, 1 above.
    pub full: usize,
}

impl Tighten {
    /// Returns the cut that leaves the smallest surface area of `region` around a node with these `bounds`, if it
    /// is below the threshold.
    pub fn cut(self, sides: Sides, region: &Aabb, bounds: &Aabb) -> Option<Cut> {
        if self.0 == 0.0 {
            return None;
        }
        // Evaluate the surface area that each cut leaves.
        let side = [0, 1, 2].map(|k| region.extent(k));
        let mut least = self.0 * region.area();
        let mut best = None;
        for axis in 0..3 {
            let (across, along) = (side[(axis + 1) % 3], side[(axis + 2) % 3]);
            let mut consider = |full: usize, low: f32, high: f32| {
                let length = f64::from(high) - f64::from(low);
                let area = 2.0 * (length * (across + along) + across * along);
                if area < least {
                    least = area;
                    best = Some((axis, full, low, high));
                }
            };
            let (low, high) = (bounds.min[axis], bounds.max[axis]);
            // With one plane, only one side of the region changes.
            if sides == Sides::Both {
                consider(0, low, high);
            } else {
                consider(0, region.min[axis], high);
                consider(1, low, region.max[axis]);
            }
        }
        let (axis, full, low, high) = best?;
        let mut inside = *region;
        (inside.min[axis], inside.max[axis]) = (low, high);
        Some(Cut { axis, inside, full })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_gain_is_taken_and_small_ones_are_not() {
        let region = Aabb {
            min: [0.0; 3],
            max: [8.0, 4.0, 4.0],
        };
        let bounds = Aabb {
            min: [3.0, 0.0, 0.0],
            max: [4.0, 4.0, 4.0],
        };
        let cut = |share, sides, region: &Aabb| Tighten(share).cut(sides, region, &bounds);
        let both = cut(0.9, Sides::Both, &region).expect("seven eighths are empty");
        assert_eq!((both.axis, both.inside), (0, bounds));
        assert_eq!(cut(1.0, Sides::Both, &bounds), None);
        // With one plane, the part above the contents is the larger to remove.
        let one = cut(0.9, Sides::One, &region).expect("the upper half is empty");
        assert_eq!((one.axis, one.full, one.inside.max), (0, 0, [4.0; 3]));
        assert_eq!(cut(0.5, Sides::One, &region), None);
        assert_eq!(cut(0.0, Sides::Both, &region), None);
    }
}
