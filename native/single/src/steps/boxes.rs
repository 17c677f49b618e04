// SPDX-License-Identifier: GPL-3.0-or-later
//! Traversal of box trees with eight children per node step by step.
//!
//! A step does not branch on which boxes are hit: where the traversal of single rays sorts children by entry distance,
//! this one takes them in an order given by the signs of the direction alone. The children of a node lie in
//! slots named by the corners of the node, so that for each of the eight direction octants the nearest corner
//! comes first ([`BoxTree::by_corners`]; the slots are those of Ylitie, Karras and Laine 2017, Efficient
//! incoherent ray traversal on GPUs through compressed wide BVHs, section 3.2).

use crate::steps::{Steps, topmost};
use fearless_simd::{Bytes, Simd, SimdBase, SimdMask, f32x8, u8x32, u32x8};
use halfspace_leaf::blocks::Blocks;
use halfspace_leaf::{Job, Leaf};
use halfspace_nodes::box_corners::rank;
use halfspace_nodes::box_tree::{BoxTree, INNER};
use halfspace_nodes::nested::Nested;
use halfspace_nodes::next::Next;
use halfspace_nodes::plane_tree::MAX_DEPTH;
use halfspace_ray::query::{Best, Counters, Query};
use halfspace_ray::{FrameRay, Interval, RayRef};
use halfspace_trace::slabs::Slabs;

/// Children per node.
const CHILDREN: usize = 8;

/// Length of the stack. Derived: each node on a path leaves at most seven children on it, and vector loads and stores
/// take eight entries.
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

/// A child as its parent stores it.
#[derive(Clone, Copy)]
struct Child {
    link: u32,
    count: u32,
}

/// The traversal state of one ray.
pub struct State {
    slabs: Slabs,
    /// The octant of its direction: bit `k` is set if component `k` has its sign bit set.
    octant: usize,
    start: f32,
    /// The child to visit next.
    next: Child,
    /// Number of stack entries in use.
    size: usize,
    /// The stack: children still to visit and their entry distances, above a sentinel that ends the traversal.
    link: [f32; STACK],
    count: [f32; STACK],
    enter: [f32; STACK],
}

impl State {
    /// Pops entries until one starts within `reach`, and makes it the next child.
    #[inline(always)]
    fn pop(&mut self, reach: f32) {
        let top = topmost(&self.enter, self.size, reach);
        self.size = top;
        self.next = Child {
            link: self.link[top].to_bits(),
            count: self.count[top].to_bits(),
        };
    }
}

/// The traversal of one tree whose children are in the slots of [`BoxTree::by_corners`].
pub struct BoxSteps<'a>(pub &'a BoxTree<8>);

impl Steps for BoxSteps<'_> {
    type State = State;

    fn blank(&self) -> State {
        State {
            slabs: Slabs::new(&FrameRay::NOTHING),
            octant: 0,
            start: 0.0,
            next: Child {
                link: 0,
                count: OVER,
            },
            size: 0,
            link: [0.0; STACK],
            count: [f32::from_bits(OVER); STACK],
            enter: [f32::NEG_INFINITY; STACK],
        }
    }

    #[inline(always)]
    fn start(&self, ray: &FrameRay, state: &mut State) {
        state.slabs = Slabs::new(ray);
        state.octant = ray.signs as usize & 7;
        state.start = ray.t_min;
        state.next = Child {
            link: 0,
            count: INNER,
        };
        state.size = 1;
    }

    #[inline(always)]
    fn count_plain<C: Counters>(&self, counters: &mut C) {
        counters.step_boxes();
    }

    #[inline(always)]
    fn next(&self, state: &State) -> Next {
        match state.next.count {
            INNER => Next::PLAIN,
            OVER => Next::OVER,
            _ => Next::LEAF,
        }
    }

    #[inline(always)]
    fn plain<S: Simd>(&self, simd: S, state: &mut State, reach: f32) {
        let node = &self.0.nodes[state.next.link as usize];
        // Intersect the ray with all eight boxes.
        let range = Interval::new(state.start, reach);
        let (enter, leave) = (state.slabs).meet_all::<S, f32x8<S>, 8>(simd, &node.bounds, range);
        // Permute children and distances into stack order, the nearest corner last.
        let places = u8x32::from_slice(simd, &ORDER[state.octant & 7]);
        let ordered = |bits: &[u32; CHILDREN]| {
            let all: f32x8<S> = u32x8::from_slice(simd, bits).bitcast();
            all.swizzle_dyn(places)
        };
        let (enter, leave) = (enter.swizzle_dyn(places), leave.swizzle_dyn(places));
        // Push the boxes that are hit with one compressed store per row; the lanes behind them are overwritten
        // later.
        let live = enter.simd_le(leave);
        let at = state.size;
        let row = at..at + CHILDREN;
        let (link, count) = (ordered(&node.link), ordered(&node.count));
        link.compress(live)
            .store_slice(&mut state.link[row.clone()]);
        count
            .compress(live)
            .store_slice(&mut state.count[row.clone()]);
        enter.compress(live).store_slice(&mut state.enter[row]);
        state.size = at + live.to_bitmask().count_ones() as usize;
        state.pop(reach);
    }

    fn bytes(&self) -> usize {
        self.0.bytes()
    }

    #[inline(always)]
    fn fetch_plain(&self, state: &State) {
        self.0.nodes[state.next.link as usize].fetch_ahead();
    }

    #[inline(always)]
    fn fetch_leaf(&self, blocks: &Blocks, state: &State) {
        blocks.fetch_ahead(state.next.link);
    }

    #[inline(always)]
    fn leaf<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        job: Job<'_>,
        ray: RayRef<'_>,
        state: &mut State,
        best: &mut Best,
        counters: &mut C,
    ) {
        let leaf = Leaf {
            first: state.next.link,
            count: state.next.count as usize,
        };
        counters.leaf(leaf.count);
        if job.test::<S, Q, C>(simd, leaf, ray, ray.frame.t_max, best, counters) {
            state.next.count = OVER;
        } else {
            state.pop(best.reach);
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
