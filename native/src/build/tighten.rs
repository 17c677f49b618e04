// SPDX-License-Identifier: GPL-3.0-or-later
//! Where a hierarchy of intervals cuts off empty space: planes bound a child on the side along which
//! it was parted and on no other, so a region may be much larger than what is in it.

use crate::geom::Aabb;

/// When to cut: where that leaves less than this share of the region's surface. 0 for never.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tighten(pub f64);

/// How to cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sides {
    /// With one plane.
    One,
    /// With two planes.
    Both,
}

/// A cut.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cut {
    /// 0, 1 or 2.
    pub axis: usize,
    /// What is left of the region.
    pub inside: Aabb,
    /// Where what is left lies when one side was cut off: 0 below, 1 above.
    pub full: usize,
}

impl Tighten {
    /// The cut that leaves the smallest surface of `region` around a node of these `bounds`, if it is
    /// worth a node.
    pub fn cut(self, sides: Sides, region: &Aabb, bounds: &Aabb) -> Option<Cut> {
        if self.0 == 0.0 {
            return None;
        }
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
        // Either half alone: the one above is the larger.
        let one = cut(0.9, Sides::One, &region).expect("the upper half is empty");
        assert_eq!((one.axis, one.full, one.inside.max), (0, 0, [4.0; 3]));
        assert_eq!(cut(0.5, Sides::One, &region), None);
        assert_eq!(cut(0.0, Sides::Both, &region), None);
    }
}
