// SPDX-License-Identifier: GPL-3.0-or-later
//! A box as eight numbers in a row, whose union is one minimum per lane: builders spend most of their time on unions.

use halfspace_geom::Aabb;

/// Smallest coordinates and negated largest ones; a lane of each four is free for another number to minimise.
#[derive(Debug, Clone, Copy)]
#[repr(align(32))]
pub struct Reach([f32; 8]);

impl Reach {
    /// The empty box.
    pub const EMPTY: Self = Self([f32::INFINITY; 8]);

    /// The numbers of a box.
    #[inline(always)]
    pub fn new(bounds: &Aabb) -> Self {
        let ([a, b, c], [d, e, f]) = (bounds.min, bounds.max);
        Self([a, b, c, f32::INFINITY, -d, -e, -f, f32::INFINITY])
    }

    /// The same with the number in the second free lane.
    #[inline(always)]
    pub fn with(mut self, free: f32) -> Self {
        self.0[7] = free;
        self
    }

    /// Returns the number in the second free lane: the smallest of all that were united.
    #[inline(always)]
    pub fn free(&self) -> f32 {
        self.0[7]
    }

    /// Returns the smallest box around both.
    #[inline(always)]
    pub fn union(&self, other: &Self) -> Self {
        // The compiler makes one instruction of four comparisons and selections.
        Self(std::array::from_fn(|k| {
            if other.0[k] < self.0[k] {
                other.0[k]
            } else {
                self.0[k]
            }
        }))
    }

    /// Returns the box.
    #[inline(always)]
    pub fn bounds(&self) -> Aabb {
        let [a, b, c, _, d, e, f, _] = self.0;
        // `0.0 -` turns -0.0 to +0.0, so that bounds have only one zero.
        Aabb {
            min: [a, b, c],
            max: [0.0 - d, 0.0 - e, 0.0 - f],
        }
    }

    /// Returns the surface area of a box that is not empty, bit for bit that of [`Aabb::area`].
    #[inline(always)]
    pub fn area(&self) -> f64 {
        let extent = |k: usize| -f64::from(self.0[k + 4]) - f64::from(self.0[k]);
        let [x, y, z] = [extent(0), extent(1), extent(2)];
        2.0 * (x * y + y * z + z * x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn boxes() -> impl Strategy<Value = Aabb> {
        let number = || prop_oneof![Just(0.0_f32), -1e30_f32..1e30, -1.0_f32..1.0];
        let corner = move || [number(), number(), number()];
        (corner(), corner()).prop_map(|(a, b)| {
            let mut bounds = Aabb::EMPTY;
            bounds.grow(a);
            bounds.grow(b);
            bounds
        })
    }

    proptest! {
        #[test]
        fn unions_and_areas_are_those_of_boxes(all in prop::collection::vec(boxes(), 1..8)) {
            let both = all.iter().fold(Aabb::EMPTY, |both, one| both.union(one));
            let reach = all.iter().fold(Reach::EMPTY, |both, one| both.union(&Reach::new(one)));
            let bits = |bounds: Aabb| [bounds.min, bounds.max].map(|p| p.map(f32::to_bits));
            prop_assert_eq!(bits(reach.bounds()), bits(both));
            prop_assert_eq!(reach.area().to_bits(), both.area().to_bits());
        }

        #[test]
        fn the_free_lane_holds_the_smallest_number(all in prop::collection::vec(-1e9_f32..1e9, 1..8)) {
            let united = all.iter().fold(Reach::EMPTY, |both, &x| both.union(&Reach::EMPTY.with(x)));
            prop_assert_eq!(united.free(), all.iter().copied().fold(f32::INFINITY, f32::min));
        }
    }

    #[test]
    fn the_empty_box_is_neutral() {
        let bounds = Aabb {
            min: [-1.0, 0.0, 2.0],
            max: [1.0, 0.0, 3.0],
        };
        assert_eq!(Reach::EMPTY.union(&Reach::new(&bounds)).bounds(), bounds);
        assert!(Reach::EMPTY.bounds().is_empty());
    }
}
