// SPDX-License-Identifier: GPL-3.0-or-later
//! All pairs of triangles of two surfaces that have a point in common. Both trees are traversed together: of a pair of
//! boxes that meet, the node with the larger box is opened.

use crate::meeting::Triangle;
use crate::surface::Surface;
use crate::threads::{self, Work};
use halfspace_base::error::{Error, Result};
use halfspace_base::memory::check_room;
use halfspace_geom::Aabb;
use halfspace_nodes::box_tree::{INNER, WIDEST};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Number of pairs of nodes from which on threads share them (chosen: some dozens for each of many processors).
const TASKS: usize = 1024;

/// A node or a leaf, and its box.
#[derive(Clone, Copy)]
struct Part {
    bounds: Aabb,
    link: u32,
    count: u32,
}

/// Two surfaces, or one and itself.
struct Pair<'a> {
    one: &'a Surface,
    other: &'a Surface,
    /// Whether both are one surface: neighbours are then no overlaps.
    same: bool,
}

impl Surface {
    /// Returns all pairs of a triangle of this surface and one of the other that have a point in common, sorted.
    ///
    /// If both are the same object, a triangle is not paired with itself, nor with those that share an edge with it:
    /// two vertices by index. Triangles that share one vertex are a pair only if they have a further point in common.
    /// Each pair is then found in both orders.
    ///
    /// # Errors
    /// [`Error::Memory`] if the pairs do not fit the memory, and [`Error::Cancelled`].
    pub fn overlaps<'w>(&self, other: &Self, work: impl Into<Work<'w>>) -> Result<Vec<[u32; 2]>> {
        let work = work.into();
        let pair = Pair {
            one: self,
            other,
            same: std::ptr::eq(self, other),
        };
        // Open pairs of nodes breadth first until there are enough for all threads.
        let mut tasks = vec![[whole(self), whole(other)]];
        let mut opened = true;
        while opened && tasks.len() < TASKS {
            opened = false;
            let mut next = Vec::new();
            for task in tasks {
                if pair.open(task, &mut next) {
                    opened = true;
                } else {
                    next.push(task);
                }
            }
            tasks = next;
        }
        // Find the pairs of each, as long as all of them fit the memory.
        let (count, full) = (AtomicUsize::new(0), OnceLock::<Error>::new());
        let lists = threads::each(&tasks, work, |_, &task| {
            let mut found = Vec::new();
            if full.get().is_none() {
                pair.find(task, &mut found, work, |more| {
                    let all = count.fetch_add(more, Ordering::Relaxed) + more;
                    match check_room("overlaps", (2 * all * size_of::<[u32; 2]>()) as u64) {
                        Ok(()) => true,
                        Err(error) => {
                            let _ = full.set(error);
                            false
                        }
                    }
                });
            }
            found
        })?;
        if work.is_cancelled() {
            return Err(Error::Cancelled);
        }
        if let Some(error) = full.into_inner() {
            return Err(error);
        }
        let mut pairs = lists.concat();
        pairs.sort_unstable();
        Ok(pairs)
    }
}

impl Pair<'_> {
    /// Appends the pairs that a pair of parts contains. `more` is called with the number of new pairs, some thousands at
    /// a time, and returns whether to go on.
    fn find(
        &self,
        task: [Part; 2],
        found: &mut Vec<[u32; 2]>,
        work: Work<'_>,
        mut more: impl FnMut(usize) -> bool,
    ) {
        let (mut stack, mut known) = (vec![task], 0);
        while let Some(task) = stack.pop() {
            if work.is_cancelled() {
                return;
            }
            if self.open(task, &mut stack) {
                continue;
            }
            self.compare(task, found);
            if found.len() - known > 1 << 14 {
                if !more(found.len() - known) {
                    return;
                }
                known = found.len();
            }
        }
        more(found.len() - known);
    }

    /// Appends the pairs that meet of the children of one part, the node with the larger box, and the other part.
    /// Returns `false` for two leaves.
    fn open(&self, task: [Part; 2], stack: &mut Vec<[Part; 2]>) -> bool {
        let [one, other] = task;
        let inner = [one.count == INNER, other.count == INNER];
        let side = match inner {
            [false, false] => return false,
            [true, true] => usize::from(other.bounds.area() > one.bounds.area()),
            [first, _] => usize::from(!first),
        };
        let surface = [self.one, self.other][side];
        let node = surface.node(task[side].link);
        for lane in (0..WIDEST).filter(|&lane| node.count[lane] != 0) {
            let mut next = task;
            next[side] = Part {
                bounds: Aabb {
                    min: [0, 1, 2].map(|k: usize| node.bounds[k][lane]),
                    max: [0, 1, 2].map(|k: usize| node.bounds[3 + k][lane]),
                },
                link: node.link[lane],
                count: node.count[lane],
            };
            if meet(&next) {
                stack.push(next);
            }
        }
        true
    }

    /// Compares all triangles of two leaves.
    fn compare(&self, [one, other]: [Part; 2], found: &mut Vec<[u32; 2]>) {
        let prepared = |surface: &Surface, part: Part| {
            let ids = surface.leaf(part.link, part.count).iter();
            let triangle = |&id| {
                let corners = surface.scene().corners(id);
                (id, Aabb::of_triangle(corners), Triangle::new(corners))
            };
            ids.map(triangle).collect::<Vec<_>>()
        };
        let others = prepared(self.other, other);
        for (a, own, triangle) in prepared(self.one, one) {
            for (b, bounds, against) in &others {
                if boxes_meet(&own, bounds) && self.overlap(a, &triangle, *b, against) {
                    found.push([a, *b]);
                }
            }
        }
    }

    /// Returns whether two triangles are a pair.
    fn overlap(&self, a: u32, one: &Triangle, b: u32, other: &Triangle) -> bool {
        if !self.same {
            return one.meets(other);
        }
        let indices = |id: u32| self.one.scene().indices()[id as usize];
        let (own, others) = (indices(a), indices(b));
        let mut shared = (0..3).filter_map(|i| {
            let j = others.iter().position(|&vertex| vertex == own[i])?;
            Some((i, j))
        });
        match (a == b, shared.next(), shared.next()) {
            (true, ..) | (_, _, Some(_)) => false,
            (_, Some((i, j)), None) => one.meets_beyond(i, other, j),
            (_, None, None) => one.meets(other),
        }
    }
}

/// Returns the root of a surface, in a box without limits.
fn whole(surface: &Surface) -> Part {
    Part {
        bounds: Aabb {
            min: [f32::NEG_INFINITY; 3],
            max: [f32::INFINITY; 3],
        },
        link: surface.root(),
        count: INNER,
    }
}

/// Returns whether two parts have a point in common.
fn meet([one, other]: &[Part; 2]) -> bool {
    boxes_meet(&one.bounds, &other.bounds)
}

/// Returns whether two closed boxes have a point in common.
#[inline(always)]
fn boxes_meet(a: &Aabb, b: &Aabb) -> bool {
    (0..3).all(|k| a.min[k] <= b.max[k] && b.min[k] <= a.max[k])
}
