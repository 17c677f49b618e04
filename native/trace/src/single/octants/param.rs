// SPDX-License-Identifier: GPL-3.0-or-later
//! Top-down traversal of octrees by the distances of the mid planes (the linear-time traversal of Arvo 1988, in
//! the parametric form of Revelles, Ureña and Lastra 2000).
//!
//! The three mid planes of a node split the ray interval; the intervals of the eight octants are computed at
//! once, one per lane, in the order of the direction: lane 0 lies on the near side of all three planes, and no
//! octant comes before one that it may occlude. Distances carry their error bounds, so no hit is lost to
//! rounding, whatever the origin.

use crate::batch;
use crate::single::single_rays;
use fearless_simd::{Select, Simd, SimdBase, SimdMask, f32x8, mask32x8};
use halfspace_geom::bound::{keep_max, keep_min};
use halfspace_geom::vec3::map;
use halfspace_leaf::{Job, Leaf};
use halfspace_nodes::octants::MAX_DEPTH;
use halfspace_nodes::octree_nodes::Octree;
use halfspace_ray::query::{Best, Counters, Query};
use halfspace_ray::{Hit, RayRef};

/// Stack entries: every level but the last leaves at most seven octants behind.
const STACK: usize = 7 * MAX_DEPTH as usize + 1;

/// A stack entry: a node still to visit, its lower corner, and the ray interval inside it.
#[derive(Clone, Copy, Default)]
pub struct Pending {
    node: u32,
    low: [f32; 3],
    enter: f32,
    leave: f32,
}

/// The traversal of one tree by single rays.
pub struct Walk<'a>(pub &'a Octree);

/// The stack of a traversal.
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
        job: Job<'_>,
        RayRef { ray, frame }: RayRef<'_>,
        stack: &mut Stack,
        counters: &mut C,
    ) -> Hit {
        let tree = self.0;
        let cube = tree.cube();
        let mut best = Best::new(frame);
        // Octants are stored by sign bits, so `lane ^ signs` turns the ray's order into theirs.
        let signs = frame.signs & 7;
        // Masks of the lanes beyond the mid plane of each axis.
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
                // Test the triangles of a leaf.
                let Leaf { first, count } = node.blocks();
                counters.leaf(count);
                if count != 0
                    && job.test::<S, Q, C>(
                        simd,
                        Leaf { first, count },
                        RayRef { ray, frame },
                        leave,
                        &mut best,
                        counters,
                    )
                {
                    return best.hit();
                }
                continue;
            }
            counters.step_boxes();
            // Split the interval: octants beyond a plane start at it, the others end there, both with the error
            // bound.
            let half = cube.edge(node.level() + 1);
            let mid = map(low, |x| x + half);
            let mut enters = f32x8::splat(simd, enter);
            let mut leaves = f32x8::splat(simd, keep_min(best.reach, leave));
            for k in 0..3 {
                let distance = (mid[k] - frame.o[k]) * frame.inv[k];
                // NaN, which occurs for rays from very far away, bounds nothing.
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
            // Push the octants that are hit and not empty, the nearest last.
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

single_rays! {
    /// Single rays from the root down, octants in the order of the direction.
    fn param(Octree) -> Walk<'a> {
        |kernel| Walk(&kernel.tree)
    }
}
