// SPDX-License-Identifier: GPL-3.0-or-later
//! Octrees walked from the top, by the distances of the mid planes (the linear-time walk of Arvo
//! 1988, in the parametric form of Revelles, Ureña and Lastra 2000).
//!
//! The three mid planes of a node cut the ray's interval; the eight octants get their parts of it
//! at once, one lane each, in the order of the direction: lane 0 lies on the near side of all three
//! planes, and no octant comes before one that it may hide behind. Distances carry their error
//! bounds, so a hit is found wherever rounding puts it, from any origin.

use super::batch;
use super::blocks::Blocks;
use super::bound::{keep_max, keep_min};
use super::frame::FrameRay;
use super::query::{Best, Counters, Query};
use super::ray::{Hit, Ray};
use crate::build::octree::MAX_DEPTH;
use crate::build::octree_nodes::Octree;
use crate::geom::vec3::map;
use crate::scene::Triangles;
use fearless_simd::{Select, Simd, SimdBase, SimdMask, f32x8, mask32x8};

/// Every level but the last leaves at most seven octants waiting.
const STACK: usize = 7 * MAX_DEPTH as usize + 1;

/// A node still to visit, its lowest corner, and the interval of the ray inside it.
#[derive(Clone, Copy, Default)]
pub struct Pending {
    node: u32,
    low: [f32; 3],
    enter: f32,
    leave: f32,
}

/// The walk over one tree.
pub struct Walk<'a>(pub &'a Octree);

/// What the walk keeps.
pub type Stack = [Pending; STACK];

impl batch::Walk for Walk<'_> {
    type Scratch = Stack;

    fn scratch(&self) -> Stack {
        [Pending::default(); STACK]
    }

    #[inline(always)]
    fn cast<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        (scene, blocks): (&Triangles, &Blocks),
        (ray, frame): (&Ray, &FrameRay),
        stack: &mut Stack,
        counters: &mut C,
    ) -> Hit {
        let tree = self.0;
        let cube = tree.cube();
        let mut best = Best::new(frame);
        let signs = frame.signs & 7;
        // Lanes beyond the mid plane of each axis.
        let beyond = map([0xaa, 0xcc, 0xf0], |bits| {
            mask32x8::from_bitmask(simd, bits)
        });
        stack[0] = Pending {
            node: 0,
            low: cube.corner,
            enter: frame.t_min,
            leave: frame.t_max,
        };
        let mut waiting = 1;
        while waiting != 0 {
            waiting -= 1;
            let Pending {
                node: index,
                low,
                enter,
                leave,
            } = stack[waiting];
            if enter > best.reach {
                continue;
            }
            let node = tree.node(index);
            if !node.is_inner() {
                let (first, count) = node.blocks();
                counters.leaf(count);
                if count != 0
                    && blocks.test::<S, Q, C>(
                        simd,
                        (first, count),
                        scene,
                        (ray, frame, leave),
                        &mut best,
                        counters,
                    )
                {
                    return best.hit();
                }
                continue;
            }
            counters.step_axis();
            let half = cube.edge(node.level() + 1);
            let mid = map(low, |x| x + half);
            let mut enters = f32x8::splat(simd, enter);
            let mut leaves = f32x8::splat(simd, keep_min(best.reach, leave));
            for k in 0..3 {
                let distance = (mid[k] - frame.o[k]) * frame.inv[k];
                // Not a number, for rays from very far away, bounds nothing.
                let early = keep_max(distance - frame.slack[k], f32::NEG_INFINITY);
                let late = keep_min(distance + frame.slack[k], f32::INFINITY);
                let far: mask32x8<S> = beyond[k];
                enters = far.select(enters.max(f32x8::splat(simd, early)), enters);
                leaves = far.select(leaves, leaves.min(f32x8::splat(simd, late)));
            }
            let mut open = enters.simd_le(leaves).to_bitmask();
            let (mut from, mut to) = ([0.0; 8], [0.0; 8]);
            enters.store_slice(&mut from);
            leaves.store_slice(&mut to);
            // The nearest last, so that it is the next.
            while open != 0 {
                let lane = 63 - open.leading_zeros();
                open ^= 1 << lane;
                let octant = lane ^ signs;
                if node.empty_octants() >> octant & 1 == 0 {
                    stack[waiting] = Pending {
                        node: node.children() + octant,
                        low: map([0, 1, 2], |k: usize| {
                            if octant >> k & 1 == 1 { mid[k] } else { low[k] }
                        }),
                        enter: from[lane as usize],
                        leave: to[lane as usize],
                    };
                    waiting += 1;
                }
            }
        }
        best.hit()
    }
}
