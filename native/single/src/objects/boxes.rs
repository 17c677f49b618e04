// SPDX-License-Identifier: GPL-3.0-or-later
//! Single rays through nodes of two, four or eight boxes. The nearest box is visited first, the others go to a stack of
//! 64-bit words, which sort as integers: the bits of the entry distance above those of the child.

use crate::single_rays;
use fearless_simd::{Simd, f32x4, f32x8};
use halfspace_leaf::{Job, Leaf};
use halfspace_nodes::box_tree::{BoxTree, INNER, WIDEST, Wide};
use halfspace_nodes::plane_tree::MAX_DEPTH;
use halfspace_ray::query::{Best, Counters, NoCountLate, Query};
use halfspace_ray::{Interval, RayRef};
use halfspace_trace::batch::SingleTraversal;
use halfspace_trace::slabs::Slabs;

/// Length of the stack, a power of two so that masked indices need no check.
const STACK: usize = 512;

// Each level leaves at most all children but one on the stack, and the lowest level all of them.
const _: () = assert!((MAX_DEPTH + 1) * (WIDEST - 1) + 2 * WIDEST <= STACK);

/// Marks a leaf among the lower 32 bits of an entry: the rest is its slot, the node's index times the width plus the
/// lane. Without it they are the index of an inner node.
const LEAF: u32 = 1 << 31;

/// The entry below all others, which ends the traversal: it begins at negative infinity.
const END: i64 = (f32::NEG_INFINITY.to_bits() as i32 as i64) << 32 | u32::MAX as i64;

/// Distance where the ray enters a box on the stack.
#[inline(always)]
#[expect(clippy::cast_sign_loss, reason = "bits")]
fn enter(entry: i64) -> f32 {
    f32::from_bits((entry >> 32) as u32)
}

/// Boxes still to visit. Distances of one sign are sorted by their bits; behind the origin, where fewer rays begin, the
/// order is another one.
struct Stack<'a> {
    entries: &'a mut [i64; STACK],
    size: usize,
}

impl Stack<'_> {
    /// Adds an entry on top.
    #[inline(always)]
    fn push(&mut self, entry: i64) {
        self.entries[self.size % STACK] = entry;
        self.size += 1;
    }

    /// Adds an entry among those from index `base` on, which are sorted with the nearest on top.
    #[inline(always)]
    fn insert(&mut self, base: usize, entry: i64) {
        let mut at = self.size;
        while at > base && self.entries[(at - 1) % STACK] < entry {
            self.entries[at % STACK] = self.entries[(at - 1) % STACK];
            at -= 1;
        }
        self.entries[at % STACK] = entry;
        self.size += 1;
    }

    /// Removes the entry on top.
    #[inline(always)]
    fn pop(&mut self) -> i64 {
        self.size -= 1;
        self.entries[self.size % STACK]
    }

    /// Pops entries until one starts within `reach`.
    #[inline(always)]
    fn pop_within(&mut self, reach: f32) -> i64 {
        loop {
            let entry = self.pop();
            if enter(entry) <= reach {
                return entry;
            }
        }
    }
}

/// The traversal of one tree by single rays.
pub struct BoxTraversal<'a, const W: usize>(pub &'a BoxTree<W>);

impl<const W: usize> BoxTraversal<'_, W> {
    /// Takes the lowest lane out of a mask that is not empty.
    #[inline(always)]
    fn take(hits: &mut u64) -> usize {
        let lane = hits.trailing_zeros() as usize % W;
        *hits &= *hits - 1;
        lane
    }

    /// The mask of the slots that are not empty.
    #[inline(always)]
    fn used(node: &Wide<W>) -> u64 {
        (0..W).fold(0, |mask, lane| {
            mask | u64::from(node.count[lane] != 0) << lane
        })
    }
}

impl<const W: usize> SingleTraversal for BoxTraversal<'_, W> {
    type Scratch = Box<[i64; STACK]>;
    type Uncounted = NoCountLate;

    fn scratch(&self) -> Self::Scratch {
        Box::new([END; STACK])
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "an index below 2^31")]
    fn cast<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        job: Job<'_>,
        ray: RayRef<'_>,
        scratch: &mut Self::Scratch,
        counters: &mut C,
    ) -> Best {
        let frame = ray.frame;
        let slabs = Slabs::new(frame);
        let mut best = Best::new(frame);
        let mut stack = Stack {
            entries: scratch,
            size: 0,
        };
        stack.push(END);
        let mut at = 0;
        loop {
            // Test all children.
            counters.step_boxes();
            let node = &self.0.nodes[at];
            let mut enters = [0.0; W];
            let range = Interval::new(frame.t_min, best.reach);
            let mut hits = match W {
                8 => slabs.test::<S, f32x8<S>, W>(simd, &node.bounds, range, &mut enters),
                4 => slabs.test::<S, f32x4<S>, W>(simd, &node.bounds, range, &mut enters),
                _ => slabs.test_few(&node.bounds, range, &mut enters),
            };
            if hits == (1 << W) - 1 {
                // A ray without any bounding axis hits empty slots too, and then all slots.
                hits &= Self::used(node);
            }
            let low = |lane: usize| match node.count[lane] {
                INNER => node.link[lane],
                _ => LEAF | (at * W + lane) as u32,
            };
            let entry = |lane: usize| {
                i64::from(enters[lane].to_bits().cast_signed()) << 32 | i64::from(low(lane))
            };
            let ahead = |lane: usize| {
                (self.0).fetch_ahead(node.link[lane], node.count[lane], job.blocks);
                entry(lane)
            };

            // Go on to the nearest child, and push the others, the nearest on top.
            let mut next = if hits == 0 {
                stack.pop_within(best.reach)
            } else if hits & (hits - 1) == 0 {
                entry(Self::take(&mut hits))
            } else {
                let (a, b) = (ahead(Self::take(&mut hits)), ahead(Self::take(&mut hits)));
                let (near, far) = if Q::ANY || b < a { (b, a) } else { (a, b) };
                let base = stack.size;
                stack.push(far);
                if hits == 0 {
                    near
                } else {
                    stack.push(near);
                    while hits != 0 {
                        let child = ahead(Self::take(&mut hits));
                        if Q::ANY {
                            stack.push(child);
                        } else {
                            stack.insert(base, child);
                        }
                    }
                    stack.pop()
                }
            };

            // Test leaves until an inner node comes up.
            at = loop {
                let low = next as u32;
                if low & LEAF == 0 {
                    break low as usize;
                }
                if low == u32::MAX {
                    return best;
                }
                let slot = (low & !LEAF) as usize;
                let (parent, lane) = (&self.0.nodes[slot / W], slot % W);
                let leaf = Leaf {
                    first: parent.link[lane],
                    count: parent.count[lane] as usize,
                };
                counters.leaf(leaf.count);
                if job.test::<S, Q, C>(simd, leaf, ray, frame.t_max, &mut best, counters) {
                    return best;
                }
                next = stack.pop_within(best.reach);
            };
        }
    }
}

single_rays! {
    /// Single rays through nodes of 2 boxes, the nearest first.
    fn boxes2(BoxTree<2>) -> BoxTraversal<'a, 2> {
        |kernel| BoxTraversal(&kernel.tree)
    }
}

single_rays! {
    /// Single rays through nodes of 4 boxes, the nearest first.
    fn boxes4(BoxTree<4>) -> BoxTraversal<'a, 4> {
        |kernel| BoxTraversal(&kernel.tree)
    }
}

single_rays! {
    /// Single rays through nodes of 8 boxes, the nearest first.
    fn boxes8(BoxTree<8>) -> BoxTraversal<'a, 8> {
        |kernel| BoxTraversal(&kernel.tree)
    }
}
