// SPDX-License-Identifier: GPL-3.0-or-later
//! Which hits answer a ray: all of them, or only those with triangles that the ray can see.

use crate::counters::Counters;
use crate::ray::{Hit, HitKey};

/// Length of a list of hits that is not yet sorted (chosen).
const SHORT: usize = 32;

/// The hits of one ray with different triangles, gathered while a tree is traversed; the nearest if their number is
/// limited.
///
/// A triangle in several leaves is found in each of them, so the list is sorted and shortened whenever it has doubled.
#[derive(Debug, Clone)]
pub struct Gathered {
    hits: Vec<Hit>,
    /// Largest number of hits that are kept.
    most: usize,
    /// Length at which the list is sorted next.
    full: usize,
    /// Distance of the last hit kept, once the list is full.
    limit: f32,
}

impl Gathered {
    /// Makes an empty list of at most `most` hits.
    pub fn new(most: usize) -> Self {
        Self {
            hits: Vec::new(),
            most,
            full: SHORT,
            limit: if most == 0 {
                f32::NEG_INFINITY
            } else {
                f32::INFINITY
            },
        }
    }

    /// Adds a hit. Returns the distance, in units of the direction, beyond which no hit is wanted.
    pub fn add(&mut self, hit: Hit) -> f32 {
        self.hits.push(hit);
        if self.hits.len() >= self.full {
            self.sort();
            self.full = 2 * self.hits.len().max(SHORT / 2);
        }
        self.limit
    }

    /// Returns the hits, nearest first; of equal distances, the smallest triangle number first.
    pub fn finish(mut self) -> Vec<Hit> {
        self.sort();
        self.hits
    }

    /// Sorts the list and removes repetitions and what lies beyond the wanted number.
    fn sort(&mut self) {
        let key = |hit: &Hit| HitKey::new(hit.t, hit.triangle);
        self.hits.sort_unstable_by(|a, b| key(a).order(key(b)));
        self.hits.dedup_by_key(|hit| hit.triangle);
        self.hits.truncate(self.most);
        if self.hits.len() == self.most
            && let Some(last) = self.hits.last()
        {
            self.limit = last.t;
        }
    }
}

/// The triangles that a ray can see: those whose mask shares a bit with the mask of the ray.
#[derive(Debug, Clone, Copy)]
pub struct Visible<'a> {
    /// The mask of each triangle.
    pub triangles: &'a [u32],
    /// The mask of the ray.
    pub ray: u32,
}

impl Visible<'_> {
    /// Returns whether the ray can see a triangle.
    pub fn sees(&self, triangle: u32) -> bool {
        self.triangles[triangle as usize] & self.ray != 0
    }
}

/// What a hit means to a ray.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Filtered {
    /// It may be the answer of the ray.
    Kept,
    /// The ray goes on as if it were not there.
    Passed,
    /// The ray needs no other hit.
    Ended,
}

/// Returns what a hit means to the ray with an index. It is called while the ray is traced, for its hits in no particular
/// order, more than once for a triangle in several leaves, and maybe again after [`Filtered::Ended`].
pub type HitFilter<'a> = &'a dyn Fn(usize, &Hit) -> Filtered;

/// Counts nothing, and passes the hits of one ray to a filter.
#[derive(Clone, Copy)]
pub struct Sieve<'a> {
    /// The filter.
    pub filter: HitFilter<'a>,
    /// Index of the ray.
    pub ray: usize,
}

impl Sieve<'_> {
    /// Returns the distance up to which the ray goes on without a hit, or `None` if the hit is kept.
    #[inline(always)]
    pub fn beyond(&self, hit: &Hit) -> Option<f32> {
        match (self.filter)(self.ray, hit) {
            Filtered::Kept => None,
            Filtered::Passed => Some(f32::INFINITY),
            Filtered::Ended => Some(f32::NEG_INFINITY),
        }
    }
}

impl Counters for Sieve<'_> {
    #[inline(always)]
    fn set_aside(&mut self, hit: Hit) -> Option<f32> {
        self.beyond(&hit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hit(t: f32, triangle: u32) -> Hit {
        Hit {
            t,
            triangle,
            u: 0.0,
            v: 0.0,
        }
    }

    #[test]
    fn each_triangle_is_kept_once_in_order_of_distance_and_number() {
        let mut gathered = Gathered::new(usize::MAX);
        for i in 0..200 {
            gathered.add(hit((i % 7) as f32, i % 14));
        }
        let found: Vec<_> = gathered
            .finish()
            .iter()
            .map(|h| (h.t, h.triangle))
            .collect();
        let expected: Vec<_> = (0..7)
            .flat_map(|t| [(t as f32, t), (t as f32, t + 7)])
            .collect();
        assert_eq!(found, expected);
    }

    #[test]
    fn a_limited_list_keeps_the_nearest_and_ends_the_search_behind_them() {
        let mut gathered = Gathered::new(3);
        let limits: Vec<_> = (0..100)
            .map(|i| gathered.add(hit(100.0 - i as f32, i)))
            .collect();
        assert_eq!(limits[0], f32::INFINITY);
        assert!(limits[99] < 100.0, "{}", limits[99]);
        let found: Vec<_> = gathered.finish().iter().map(|h| h.t).collect();
        assert_eq!(found, [1.0, 2.0, 3.0]);
        assert_eq!(Gathered::new(0).add(hit(1.0, 1)), f32::NEG_INFINITY);
    }

    #[test]
    fn masks_without_a_common_bit_hide_a_triangle() {
        let triangles = [0b01, 0b10, 0];
        let visible = Visible {
            triangles: &triangles,
            ray: 0b110,
        };
        assert_eq!([0, 1, 2].map(|i| visible.sees(i)), [false, true, false]);
    }
}
