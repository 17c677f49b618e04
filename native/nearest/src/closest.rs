// SPDX-License-Identifier: GPL-3.0-or-later
//! The nearest triangle of points, and all triangles within a distance.
//!
//! A box is skipped only if its distance, rounded down, exceeds that of the nearest triangle so far, rounded up, so
//! boxes at equal distances are visited: the answer is that of a comparison of all triangles, in any order.

use crate::number::U;
use crate::surface::{Node, Surface};
use crate::threads::{self, Work};
use crate::verdict::Candidate;
use halfspace_base::error::{Error, Result};
use halfspace_base::memory::check_room;
use halfspace_geom::vec3::widen;
use halfspace_nodes::box_tree::{INNER, WIDEST};
use std::cmp::Ordering;
use std::sync::OnceLock;
use std::sync::atomic::{self, AtomicUsize};

/// Factor on the computed squared distance of a box that makes it a lower bound. Derived: six roundings.
const BELOW: f64 = 1.0 - 16.0 * U;

/// The nearest triangle of a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nearest {
    /// Distance, correctly rounded; infinite if there is no triangle.
    pub distance: f32,
    /// Index of the triangle, the smallest of those at the same exact distance; [`Self::NONE`] has `u32::MAX`.
    pub triangle: u32,
    /// Closest point, each coordinate correctly rounded; NaN if there is no triangle.
    pub point: [f32; 3],
}

impl Nearest {
    /// No triangle.
    pub const NONE: Self = Self {
        distance: f32::INFINITY,
        triangle: u32::MAX,
        point: [f32::NAN; 3],
    };

    /// Returns the answer of a candidate, `None` if its distance exceeds the largest f32.
    fn of(candidate: &Candidate, point: [f32; 3]) -> Option<Self> {
        let closest = candidate.closest(point);
        (closest.distance < f32::INFINITY).then_some(Self {
            distance: closest.distance,
            triangle: candidate.id,
            point: closest.point,
        })
    }
}

/// The triangles near many points.
#[derive(Debug, Clone, PartialEq)]
pub struct Near {
    /// Where the triangles of each point begin in [`Self::found`], then the number of all: one more than points.
    pub offsets: Vec<usize>,
    /// The triangles of one point after another, nearest first; of equal exact distances, the smallest index first.
    pub found: Vec<Nearest>,
}

/// A child of a node that waits for its visit.
#[derive(Clone, Copy)]
struct Entry {
    /// Lower bound of its squared distance.
    least: f64,
    link: u32,
    count: u32,
}

/// Returns lower bounds of the squared distances of a node's boxes. Those of empty slots mean nothing.
#[inline(always)]
fn distances(node: &Node, point: [f64; 3]) -> [f64; WIDEST] {
    let mut sums = [0.0; WIDEST];
    for (k, x) in point.into_iter().enumerate() {
        let (min, max) = (&node.bounds[k], &node.bounds[3 + k]);
        for lane in 0..WIDEST {
            let (below, above) = (f64::from(min[lane]) - x, x - f64::from(max[lane]));
            let outside = if below > above { below } else { above };
            let outside = if outside > 0.0 { outside } else { 0.0 };
            sums[lane] += outside * outside;
        }
    }
    sums.map(|sum| sum * BELOW)
}

impl Surface {
    /// Returns the triangle nearest to a point, of those at most at `limit`.
    pub fn nearest(&self, point: [f32; 3], limit: f32) -> Nearest {
        let mut stack = Vec::with_capacity(64);
        let best = self.search(point, limit, &mut stack);
        best.and_then(|best| Nearest::of(&best, point))
            .unwrap_or(Nearest::NONE)
    }

    /// Returns the nearest candidate, with an empty list as memory for nodes to visit.
    fn search(&self, point: [f32; 3], limit: f32, stack: &mut Vec<Entry>) -> Option<Candidate> {
        let mut best: Option<Candidate> = None;
        let mut reach = if limit >= 0.0 {
            f64::from(limit) * f64::from(limit)
        } else {
            -1.0
        };
        let wide = widen(point);
        push(self.node(self.root()), wide, reach, stack);
        while let Some(entry) = stack.pop() {
            if entry.least > reach {
                continue;
            }
            if entry.count == INNER {
                push(self.node(entry.link), wide, reach, stack);
                continue;
            }
            // Compare the triangles of the leaf with the nearest so far.
            for &id in self.leaf(entry.link, entry.count) {
                let one = Candidate::new(point, id, self.scene().corners(id));
                let nearer = one.span.low <= reach
                    && match &best {
                        Some(best) => one.order(best, point) == Ordering::Less,
                        None => one.is_within(limit, point),
                    };
                if nearer {
                    reach = reach.min(one.span.high);
                    best = Some(one);
                }
            }
        }
        best
    }

    /// Returns all candidates at most at `radius`, nearest first.
    fn gather(&self, point: [f32; 3], radius: f32) -> Vec<Candidate> {
        let mut found = Vec::new();
        if radius < 0.0 {
            return found;
        }
        let (wide, reach) = (widen(point), f64::from(radius) * f64::from(radius));
        let mut stack = Vec::new();
        push(self.node(self.root()), wide, reach, &mut stack);
        while let Some(entry) = stack.pop() {
            if entry.count == INNER {
                push(self.node(entry.link), wide, reach, &mut stack);
                continue;
            }
            let leaf = self.leaf(entry.link, entry.count).iter();
            let candidates = leaf.map(|&id| Candidate::new(point, id, self.scene().corners(id)));
            found.extend(candidates.filter(|one| one.is_within(radius, point)));
        }
        found.sort_by(|a, b| a.order(b, point));
        found
    }

    /// Returns the triangle nearest to each point, of those at most at the limit of the point.
    ///
    /// # Errors
    /// [`Error::Memory`] if the answers do not fit the memory, and [`Error::Cancelled`].
    pub fn nearest_of_each<'w>(
        &self,
        points: &[[f32; 3]],
        limit: impl Fn(usize) -> f32 + Sync,
        work: impl Into<Work<'w>>,
    ) -> Result<Vec<Nearest>> {
        check_room("points", size_of_val(points) as u64 * 2)?;
        threads::each(points, work.into(), |i, &point| {
            self.nearest(point, limit(i))
        })
    }

    /// Returns all triangles at most at the radius of each point. Triangles whose distance exceeds the largest f32 are left
    /// out.
    ///
    /// # Errors
    /// [`Error::Memory`] if the answers do not fit the memory, and [`Error::Cancelled`].
    pub fn within<'w>(
        &self,
        points: &[[f32; 3]],
        radius: impl Fn(usize) -> f32 + Sync,
        work: impl Into<Work<'w>>,
    ) -> Result<Near> {
        // Gather the triangles of each point, as long as all of them fit the memory.
        let (count, full) = (AtomicUsize::new(0), OnceLock::<Error>::new());
        let lists = threads::each(points, work.into(), |i, &point| {
            if full.get().is_some() {
                return Vec::new();
            }
            let candidates = self.gather(point, radius(i));
            let answers = candidates.iter().filter_map(|one| Nearest::of(one, point));
            let list: Vec<_> = answers.collect();
            let all = count.fetch_add(list.len(), atomic::Ordering::Relaxed) + list.len();
            // The list of all answers is made besides those of the points.
            if let Err(error) = check_room("points within", (2 * all * size_of::<Nearest>()) as u64)
            {
                let _ = full.set(error);
            }
            list
        })?;
        if let Some(error) = full.into_inner() {
            return Err(error);
        }
        // Join the lists.
        let mut offsets = Vec::with_capacity(lists.len() + 1);
        let mut found = Vec::with_capacity(count.into_inner());
        offsets.push(0);
        for list in lists {
            found.extend(list);
            offsets.push(found.len());
        }
        Ok(Near { offsets, found })
    }
}

/// Pushes the children of a node that are at most at `reach`, the nearest last.
#[inline(always)]
fn push(node: &Node, point: [f64; 3], reach: f64, stack: &mut Vec<Entry>) {
    let first = stack.len();
    for (lane, least) in distances(node, point).into_iter().enumerate() {
        if node.count[lane] != 0 && least <= reach {
            let (link, count) = (node.link[lane], node.count[lane]);
            stack.push(Entry { least, link, count });
        }
    }
    stack[first..].sort_unstable_by(|a, b| b.least.total_cmp(&a.least));
}
