// SPDX-License-Identifier: GPL-3.0-or-later
//! Trees of boxes, eight to a node, walked by several rays in flight ([`super::flight`]).
//!
//! No step has a branch: where single rays sort the boxes that they meet by distance, these take them in an order
//! that their direction alone tells. The children of a node lie in places named by corners of it, so that for
//! each of the eight octants of directions the nearest corner comes first ([`BoxTree::by_corners`]; the places are those of
//! Ylitie, Karras and Laine 2017, Efficient incoherent ray traversal on GPUs through compressed wide BVHs, section 3.2).

use super::blocks::Blocks;
use super::box_tree::{BoxTree, INNER, Slabs, Wide};
use super::flight::{Next, Steps, topmost};
use super::frame::FrameRay;
use super::nested::Nested;
use super::query::{Best, Counters, Query};
use super::ray::Ray;
use crate::build::plane_tree::MAX_DEPTH;
use crate::geom::vec3::map;
use crate::scene::Triangles;
use fearless_simd::{Bytes, Simd, SimdBase, SimdMask, f32x8, u8x32, u32x8};
use rayon::prelude::*;

/// Children of a node.
const CHILDREN: usize = 8;

/// Each node of a path leaves at most all children but one behind; loads and stores take eight.
const STACK: usize = (MAX_DEPTH + 1) * (CHILDREN - 1) + 2 * CHILDREN;

/// Instead of a count: the walk is over.
const OVER: u32 = INNER - 1;

/// For each octant of directions, bytes of the children's places, the farthest corner first.
static ORDER: [[u8; 4 * CHILDREN]; 8] = order();

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

/// The child at this place in the order of visits, the last one 0; and the place of a child.
#[inline(always)]
pub(super) const fn rank(octant: usize, child: usize) -> usize {
    (CHILDREN - 1) ^ child ^ octant
}

impl BoxTree<8> {
    /// The same tree, with each child in the place of the corner of its node that it is nearest to: bit `k` of a place
    /// says whether the corner is the upper one along axis `k`.
    pub fn by_corners(mut self) -> Self {
        (self.nodes.par_iter_mut()).for_each(|node| *node = by_corners(node));
        self
    }
}

/// The node with its children in other places: the child that is farthest in any corner goes there, then the next one.
fn by_corners(node: &Wide<8>) -> Wide<8> {
    let (mut open, mut middle) = (0_u32, [0.0; 3]);
    let mut centre = [[0.0; 3]; CHILDREN];
    for (lane, centre) in centre.iter_mut().enumerate() {
        if node.count[lane] == 0 {
            continue;
        }
        open |= 1 << lane;
        for k in 0..3 {
            centre[k] = 0.5 * node.bounds[k][lane] + 0.5 * node.bounds[3 + k][lane];
            middle[k] += centre[k];
        }
    }
    let count = open.count_ones() as f32;
    let mut far = [[0.0; CHILDREN]; CHILDREN];
    for lane in 0..CHILDREN {
        let from = map([0, 1, 2], |k| centre[lane][k] - middle[k] / count);
        for (corner, far) in far[lane].iter_mut().enumerate() {
            let towards = |k: usize| {
                if corner >> k & 1 == 1 {
                    from[k]
                } else {
                    -from[k]
                }
            };
            *far = towards(0) + towards(1) + towards(2);
        }
    }
    let (mut out, mut free) = (BoxTree::<8>::BLANK, (1_u32 << CHILDREN) - 1);
    // Where a child would go, of the corners that are free.
    let farthest = |lane: usize, free: u32| {
        let corners = (0..CHILDREN).filter(|corner| free >> corner & 1 == 1);
        let farther = |a: usize, b: usize| if far[lane][b] > far[lane][a] { b } else { a };
        corners
            .reduce(farther)
            .expect("no more children than corners")
    };
    let mut best = std::array::from_fn::<_, CHILDREN, _>(|lane| farthest(lane, free));
    while open != 0 {
        let lanes = (0..CHILDREN).filter(|lane| open >> lane & 1 == 1);
        let farther = |a: usize, b: usize| {
            if far[b][best[b]] > far[a][best[a]] {
                b
            } else {
                a
            }
        };
        let lane = lanes.reduce(farther).expect("some are open");
        let corner = best[lane];
        if free >> corner & 1 == 0 {
            best[lane] = farthest(lane, free);
            continue;
        }
        (open, free) = (open & !(1 << lane), free & !(1 << corner));
        for (to, from) in out.bounds.iter_mut().zip(&node.bounds) {
            to[corner] = from[lane];
        }
        out.link[corner] = node.link[lane];
        out.count[corner] = node.count[lane];
    }
    out
}

/// A ray on its way.
pub struct Course {
    slabs: Slabs,
    /// The octant of its direction.
    octant: usize,
    start: f32,
    /// The child to go on with: its link and its count.
    next: (u32, u32),
    waiting: usize,
    /// Children to visit, and where the ray enters them; below them all one that ends the walk.
    link: [f32; STACK],
    count: [f32; STACK],
    enter: [f32; STACK],
}

impl Course {
    /// Goes on with the last child that may hold something nearer than `reach`.
    #[inline(always)]
    fn pop(&mut self, reach: f32) {
        let top = topmost(&self.enter, self.waiting, reach);
        self.waiting = top;
        self.next = (self.link[top].to_bits(), self.count[top].to_bits());
    }
}

/// The walk over one tree whose children are [`BoxTree::by_corners`].
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
        let (enter, leave) =
            (course.slabs).meet_all::<S, f32x8<S>, 8>(simd, &node.bounds, (course.start, reach));
        let places = u8x32::from_slice(simd, &ORDER[course.octant & 7]);
        let ordered = |bits: &[u32; CHILDREN]| {
            let all: f32x8<S> = u32x8::from_slice(simd, bits).bitcast();
            all.swizzle_dyn(places)
        };
        let (enter, leave) = (enter.swizzle_dyn(places), leave.swizzle_dyn(places));
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
        (scene, blocks): (&Triangles, &Blocks),
        (ray, frame): (&Ray, &FrameRay),
        (course, best): (&mut Course, &mut Best),
        counters: &mut C,
    ) {
        let (link, count) = course.next;
        let leaf = (link, count as usize);
        counters.leaf(leaf.1);
        let own = (ray, frame, frame.t_max);
        if blocks.test::<S, Q, C>(simd, leaf, scene, own, best, counters) {
            course.next.1 = OVER;
        } else {
            course.pop(best.reach);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A node whose children are the corners of a cube: `corner(lane)` says which.
    fn node(corner: impl Fn(usize) -> usize) -> Wide<8> {
        let mut node = BoxTree::<8>::BLANK;
        for lane in 0..CHILDREN {
            for k in 0..3 {
                let low = if corner(lane) >> k & 1 == 1 { 2.0 } else { 0.0 };
                (node.bounds[k][lane], node.bounds[3 + k][lane]) = (low, low + 1.0);
            }
            (node.link[lane], node.count[lane]) = (corner(lane) as u32, 1);
        }
        node
    }

    /// A wrong place would change no answer, only the time that rays take.
    #[test]
    fn children_lie_at_the_corners_that_they_are_nearest_to() {
        for turn in 0..CHILDREN {
            let found = by_corners(&node(|lane| (3 * lane + turn) % CHILDREN));
            assert_eq!(found.link, [0, 1, 2, 3, 4, 5, 6, 7]);
            assert_eq!(found, node(|lane| lane));
        }
    }

    #[test]
    fn the_nearest_corner_comes_first_whatever_the_direction() {
        for (octant, order) in ORDER.iter().enumerate() {
            let last = usize::from(order[4 * (CHILDREN - 1)]) / 4;
            // The last one is on top of the stack; a ray that goes down along an axis comes from its upper end.
            assert_eq!(last, octant);
        }
    }

    #[test]
    fn no_child_is_lost_where_several_want_one_corner() {
        let mut crowded = BoxTree::<8>::BLANK;
        for lane in 0..5 {
            for k in 0..3 {
                (crowded.bounds[k][lane], crowded.bounds[3 + k][lane]) = (1.0, 2.0);
            }
            (crowded.link[lane], crowded.count[lane]) = (10 + lane as u32, INNER);
        }
        let mut links: Vec<_> = (by_corners(&crowded).link.into_iter())
            .filter(|&link| link != 0)
            .collect();
        links.sort_unstable();
        assert_eq!(links, [10, 11, 12, 13, 14]);
    }
}
