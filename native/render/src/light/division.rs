// SPDX-License-Identifier: GPL-3.0-or-later
//! The division of lights into two groups, for a tree over them: by the cost of Conty Estevez and Kulla 2018, §4.4, or by
//! number.
//!
//! Their cost of a group is its intensity, times the measure of the directions into which it shines, times the area of
//! its box. Here the square of the box's diagonal replaces the area, which is 0 for lights in a row.

use crate::light::emission::Emission;
use crate::light::tree::{BoundingSphere, bounds};
use crate::math::vector::{Vec3, vec3};

/// Number of intervals of centres along each axis (theirs).
const BINS: usize = 12;

/// Groups of more than this number of lights are divided along their longest axes alone, which is faster (chosen).
const MANY: usize = 1024;

/// Lights whose centres fall into an interval.
#[derive(Debug, Clone, Copy)]
struct Group {
    low: Vec3,
    high: Vec3,
    brightness: f32,
    emission: Option<Emission>,
}

impl Group {
    const EMPTY: Self = Self {
        low: Vec3::splat(f32::INFINITY),
        high: Vec3::splat(f32::NEG_INFINITY),
        brightness: 0.0,
        emission: None,
    };

    fn of(sphere: &BoundingSphere) -> Self {
        let r = Vec3::splat(sphere.radius);
        Self {
            low: sphere.centre - r,
            high: sphere.centre + r,
            brightness: sphere.brightness,
            emission: Some(sphere.emission),
        }
    }

    #[inline(always)]
    fn union(&self, b: &Self) -> Self {
        // No coordinate is NaN, so each comparison and selection is one instruction.
        let less = |a: f32, b: f32| if b < a { b } else { a };
        let more = |a: f32, b: f32| if b > a { b } else { a };
        let (low, high) = (self.low, self.high);
        Self {
            low: vec3(
                less(low.x, b.low.x),
                less(low.y, b.low.y),
                less(low.z, b.low.z),
            ),
            high: vec3(
                more(high.x, b.high.x),
                more(high.y, b.high.y),
                more(high.z, b.high.z),
            ),
            brightness: self.brightness + b.brightness,
            emission: match (&self.emission, &b.emission) {
                (Some(a), Some(b)) if !a.is_all() => Some(a.union(b)),
                (a, b) => a.or(*b),
            },
        }
    }

    /// The cost of a group; `None` if it is empty.
    fn cost(&self) -> Option<f32> {
        let measure = self.emission?.measure();
        Some(self.brightness * measure * (self.high - self.low).length2())
    }
}

/// Returns the union of the directions of all lights.
pub(super) fn emission(spheres: &[BoundingSphere]) -> Emission {
    let each = spheres.iter().map(|sphere| sphere.emission);
    each.reduce(|a, b| a.union(&b)).unwrap_or(Emission::ALL)
}

/// Moves the lights of one side of the cheapest boundary between intervals to the front; returns their number. `None` if
/// all centres coincide, or no cost is finite.
pub(super) fn by_cost(spheres: &mut [BoundingSphere]) -> Option<usize> {
    let [low, high] = bounds(spheres, false);
    let size = (high - low).array();
    let longest = size[0].max(size[1]).max(size[2]);
    let bin = |sphere: &BoundingSphere, axis: usize| {
        let along = (sphere.centre.array()[axis] - low.array()[axis]) / size[axis];
        ((along * BINS as f32) as usize).min(BINS - 1)
    };
    let mut best: Option<(f32, usize, usize)> = None;
    let divided = |axis: usize| size[axis] == longest || spheres.len() <= MANY;
    for axis in (0..3).filter(|&axis| size[axis] > 0.0 && size[axis].is_finite() && divided(axis)) {
        let mut bins = [Group::EMPTY; BINS];
        for sphere in &*spheres {
            let own = &mut bins[bin(sphere, axis)];
            *own = own.union(&Group::of(sphere));
        }
        // Accumulate from above, then compare the boundaries from below.
        let mut above = bins;
        for i in (1..BINS - 1).rev() {
            above[i] = above[i].union(&above[i + 1]);
        }
        let mut below = Group::EMPTY;
        for i in 1..BINS {
            below = below.union(&bins[i - 1]);
            let (Some(a), Some(b)) = (below.cost(), above[i].cost()) else {
                continue;
            };
            // Thin groups are avoided (their factor for the shape of boxes).
            let cost = (a + b) * (longest / size[axis]);
            if cost.is_finite() && best.is_none_or(|(least, ..)| cost < least) {
                best = Some((cost, axis, i));
            }
        }
    }
    let (_, axis, boundary) = best?;
    // Move the lights below the boundary to the front. Both sides hold a light, since both costs exist.
    let mut below = 0;
    for i in 0..spheres.len() {
        if bin(&spheres[i], axis) < boundary {
            spheres.swap(below, i);
            below += 1;
        }
    }
    Some(below)
}

/// Moves the half of the lights with smaller centres along their longest axis to the front, equal ones by index; returns
/// their number.
pub(super) fn halve(spheres: &mut [BoundingSphere]) -> usize {
    let [low, high] = bounds(spheres, false);
    let size = (high - low).array();
    let longest = |a: usize, b: usize| if size[b] > size[a] { b } else { a };
    let axis = longest(longest(0, 1), 2);
    let middle = spheres.len() / 2;
    spheres.select_nth_unstable_by(middle, |a, b| {
        let key = |sphere: &BoundingSphere| sphere.centre.array()[axis];
        key(a).total_cmp(&key(b)).then(a.light.cmp(&b.light))
    });
    middle
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sphere(light: u32, centre: Vec3, down: bool) -> BoundingSphere {
        let axis = vec3(0.0, 0.0, if down { -1.0 } else { 1.0 });
        BoundingSphere {
            centre,
            radius: 0.1,
            brightness: 1.0,
            emission: Emission::around(axis, 0.3),
            light,
        }
    }

    /// The numbers of the lights on both sides.
    fn divided(mut spheres: Vec<BoundingSphere>) -> [Vec<u32>; 2] {
        let middle = by_cost(&mut spheres).unwrap();
        let (a, b) = spheres.split_at(middle);
        [a, b].map(|side| {
            let mut lights: Vec<u32> = side.iter().map(|sphere| sphere.light).collect();
            lights.sort_unstable();
            lights
        })
    }

    #[test]
    fn clusters_are_separated() {
        let near = (0..3).map(|i| sphere(i, vec3(i as f32 * 0.2, 0.0, 0.0), true));
        let far = (3..10).map(|i| sphere(i, vec3(20.0 + i as f32 * 0.2, 0.0, 0.0), true));
        assert_eq!(
            divided(near.chain(far).collect()),
            [vec![0, 1, 2], (3..10).collect()]
        );
    }

    #[test]
    fn lights_of_other_directions_are_separated() {
        // The rows are closer to each other than they are long.
        let row = |down: bool, first: u32| {
            (0..6).map(move |i| {
                let z = if down { 2.0 } else { 0.0 };
                sphere(first + i, vec3(i as f32 * 0.5, 0.0, z), down)
            })
        };
        assert_eq!(
            divided(row(true, 6).chain(row(false, 0)).collect()),
            [(0..6).collect::<Vec<_>>(), (6..12).collect()]
        );
    }

    #[test]
    fn coinciding_lights_are_halved() {
        let mut all: Vec<_> = (0..5)
            .map(|i| sphere(i, vec3(1.0, 2.0, 3.0), i % 2 == 0))
            .collect();
        assert!(by_cost(&mut all).is_none());
        assert_eq!(halve(&mut all), 2);
    }
}
