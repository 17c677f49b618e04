// SPDX-License-Identifier: GPL-3.0-or-later
//! Traversal of box trees with eight children per node by several rays in flight ([`crate::flight`]).
//!
//! A step does not branch on which boxes are hit: where the traversal of single rays sorts children by entry distance,
//! this one takes them in an order given by the signs of the direction alone. The children of a node lie in
//! slots named by the corners of the node, so that for each of the eight direction octants the nearest corner
//! comes first ([`BoxTree::by_corners`]; the slots are those of Ylitie, Karras and Laine 2017, Efficient
//! incoherent ray traversal on GPUs through compressed wide BVHs, section 3.2).

use crate::flight::{Steps, topmost};
use crate::slabs::Slabs;
use fearless_simd::{Bytes, Simd, SimdBase, SimdMask, f32x8, u8x32, u32x8};
use halfspace_leaf::blocks::Blocks;
use halfspace_leaf::{Job, Leaf};
use halfspace_nodes::box_corners::rank;
use halfspace_nodes::box_tree::{BoxTree, INNER};
use halfspace_nodes::nested::Nested;
use halfspace_nodes::next::Next;
use halfspace_nodes::plane_tree::MAX_DEPTH;
use halfspace_ray::query::{Best, Counters, Query};
use halfspace_ray::{FrameRay, RayRef};

/// Children per node.
const CHILDREN: usize = 8;

/// Stack entries. Each node of a path leaves all children but one behind; vector loads and stores take eight.
const STACK: usize = (MAX_DEPTH + 1) * (CHILDREN - 1) + 2 * CHILDREN;

/// Marks, in place of a count, the end of the traversal.
const OVER: u32 = INNER - 1;

/// For each direction octant, the byte permutation that puts children in stack order, the farthest corner
/// first.
static ORDER: [[u8; 4 * CHILDREN]; 8] = order();

/// Computes [`ORDER`]: entry `i` of an octant moves the four bytes of child `rank(octant, i)` to lane `i`.
const fn order() -> [[u8; 4 * CHILDREN]; 8] {
    let mut table = [[0; 4 * CHILDREN]; 8];
    let mut octant = 0;
    while octant < 8 {
        let mut byte = 0;
        while byte < 4 * CHILDREN {
            let child = rank(octant, byte / 4);
            table[octant][byte] = (4 * child + byte % 4) as u8;
            byte += 1;
        }
        octant += 1;
    }
    table
}

/// The traversal state of one ray.
pub struct Course {
    slabs: Slabs,
    /// The octant of its direction: bit `k` is set if component `k` has its sign bit set.
    octant: usize,
    start: f32,
    /// The child to visit next: its link and its count.
    next: (u32, u32),
    waiting: usize,
    /// Children still to visit and their entry distances, above a sentinel that ends the traversal.
    link: [f32; STACK],
    count: [f32; STACK],
    enter: [f32; STACK],
}

impl Course {
    /// Pops entries until one starts within `reach`, and makes it the next child.
    #[inline(always)]
    fn pop(&mut self, reach: f32) {
        let top = topmost(&self.enter, self.waiting, reach);
        self.waiting = top;
        self.next = (self.link[top].to_bits(), self.count[top].to_bits());
    }
}

/// The traversal of one tree whose children are in the slots of [`BoxTree::by_corners`].
pub struct Walk<'a>(pub &'a BoxTree<8>);

impl Steps for Walk<'_> {
    type Course = Course;

    fn course(&self) -> Course {
        Course {
            slabs: Slabs::new(&FrameRay::NOTHING),
            octant: 0,
            start: 0.0,
            next: (0, OVER),
            waiting: 0,
            link: [0.0; STACK],
            count: [f32::from_bits(OVER); STACK],
            enter: [f32::NEG_INFINITY; STACK],
        }
    }

    #[inline(always)]
    fn begin(&self, ray: &FrameRay, course: &mut Course) {
        course.slabs = Slabs::new(ray);
        course.octant = ray.signs as usize & 7;
        course.start = ray.t_min;
        course.next = (0, INNER);
        course.waiting = 1;
    }

    #[inline(always)]
    fn count_plain<C: Counters>(&self, counters: &mut C) {
        counters.step_boxes();
    }

    #[inline(always)]
    fn next(&self, course: &Course) -> Next {
        match course.next.1 {
            INNER => Next::PLAIN,
            OVER => Next::OVER,
            _ => Next::LEAF,
        }
    }

    #[inline(always)]
    fn plain<S: Simd>(&self, simd: S, course: &mut Course, reach: f32) {
        let node = &self.0.nodes[course.next.0 as usize];
        // Intersect the ray with all eight boxes.
        let (enter, leave) =
            (course.slabs).meet_all::<S, f32x8<S>, 8>(simd, &node.bounds, (course.start, reach));
        // Permute children and distances into stack order, the nearest corner last.
        let places = u8x32::from_slice(simd, &ORDER[course.octant & 7]);
        let ordered = |bits: &[u32; CHILDREN]| {
            let all: f32x8<S> = u32x8::from_slice(simd, bits).bitcast();
            all.swizzle_dyn(places)
        };
        let (enter, leave) = (enter.swizzle_dyn(places), leave.swizzle_dyn(places));
        // Push the boxes that are hit with one compressed store per row; the lanes behind them are overwritten
        // later.
        let live = enter.simd_le(leave);
        let at = course.waiting;
        let row = at..at + CHILDREN;
        let (link, count) = (ordered(&node.link), ordered(&node.count));
        link.compress(live)
            .store_slice(&mut course.link[row.clone()]);
        count
            .compress(live)
            .store_slice(&mut course.count[row.clone()]);
        enter.compress(live).store_slice(&mut course.enter[row]);
        course.waiting = at + live.to_bitmask().count_ones() as usize;
        course.pop(reach);
    }

    fn bytes(&self) -> usize {
        self.0.bytes()
    }

    #[inline(always)]
    fn fetch_plain(&self, course: &Course) {
        self.0.nodes[course.next.0 as usize].fetch_ahead();
    }

    #[inline(always)]
    fn fetch_leaf(&self, blocks: &Blocks, course: &Course) {
        blocks.fetch_ahead(course.next.0);
    }

    #[inline(always)]
    fn leaf<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        job: Job<'_>,
        RayRef { ray, frame }: RayRef<'_>,
        (course, best): (&mut Course, &mut Best),
        counters: &mut C,
    ) {
        let (link, count) = course.next;
        let leaf = Leaf {
            first: link,
            count: count as usize,
        };
        counters.leaf(leaf.count);
        if job.test::<S, Q, C>(
            simd,
            leaf,
            RayRef { ray, frame },
            frame.t_max,
            best,
            counters,
        ) {
            course.next.1 = OVER;
        } else {
            course.pop(best.reach);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_corner_comes_first_whatever_the_direction() {
        for (octant, order) in ORDER.iter().enumerate() {
            let last = usize::from(order[4 * (CHILDREN - 1)]) / 4;
            // The last entry is on top of the stack; for a negative component the nearest corner is the upper
            // one.
            assert_eq!(last, octant);
        }
    }
}
