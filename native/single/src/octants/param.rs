// SPDX-License-Identifier: GPL-3.0-or-later
//! Top-down traversal of octrees by the distances of the mid planes (the linear-time traversal of Arvo 1988, in
//! the parametric form of Revelles, Ureña and Lastra 2000).
//!
//! The three mid planes of a node split the ray interval; the intervals of the eight octants are computed at
//! once, one per lane, in the order of the direction: lane 0 lies on the near side of all three planes, and no
//! octant comes before one that it may occlude. Distances carry their error bounds, so no hit is lost to
//! rounding, whatever the origin.

use crate::single_rays;
use fearless_simd::{Select, Simd, SimdBase, SimdMask, f32x8, mask32x8};
use halfspace_geom::bound::{keep_max, keep_min};
use halfspace_geom::vec3::map;
use halfspace_leaf::Job;
use halfspace_nodes::octants::MAX_DEPTH;
use halfspace_nodes::octree_nodes::Octree;
use halfspace_ray::query::{Best, Counters, NoCount, Query};
use halfspace_ray::{FrameRay, Interval, RayRef};
use halfspace_trace::batch::SingleTraversal;
use halfspace_trace::stack::Stack;

/// Length of the stack: every level but the last leaves at most seven octants behind.
const STACK: usize = 7 * MAX_DEPTH as usize + 1;

/// A stack entry: a node still to visit, its lower corner, and the ray's interval in it.
#[derive(Clone, Copy, Default)]
pub struct OctantEntry {
    node: u32,
    low: [f32; 3],
    interval: Interval,
}

/// Memory of the stack.
pub type Entries = [OctantEntry; STACK];

/// The octants of a node, one per lane, in the order of the direction.
struct Octants {
    /// Mask of the octants that the ray meets.
    met: u64,
    enter: [f32; 8],
    leave: [f32; 8],
}

/// Splits the interval of a ray in a node at the mid planes: octants beyond a plane start at it, the others end there,
/// both with the error bound. `beyond`: masks of the lanes beyond the mid plane of each axis.
#[inline(always)]
fn split<S: Simd>(
    simd: S,
    frame: &FrameRay,
    beyond: &[mask32x8<S>; 3],
    mid: [f32; 3],
    interval: Interval,
) -> Octants {
    let mut enters = f32x8::splat(simd, interval.enter);
    let mut leaves = f32x8::splat(simd, interval.leave);
    for k in 0..3 {
        let distance = (mid[k] - frame.o[k]) * frame.inv[k];
        // NaN, which occurs for rays from very far away, bounds nothing.
        let early = keep_max(distance - frame.slack[k], f32::NEG_INFINITY);
        let late = keep_min(distance + frame.slack[k], f32::INFINITY);
        let far = beyond[k];
        enters = far.select(enters.max(f32x8::splat(simd, early)), enters);
        leaves = far.select(leaves, leaves.min(f32x8::splat(simd, late)));
    }
    let mut octants = Octants {
        met: enters.simd_le(leaves).to_bitmask(),
        enter: [0.0; 8],
        leave: [0.0; 8],
    };
    enters.store_slice(&mut octants.enter);
    leaves.store_slice(&mut octants.leave);
    octants
}

/// The traversal of one tree by single rays.
pub struct OctreeTraversal<'a>(pub &'a Octree);

impl SingleTraversal for OctreeTraversal<'_> {
    type Scratch = Entries;
    type Uncounted = NoCount;

    fn scratch(&self) -> Entries {
        [OctantEntry::default(); STACK]
    }

    #[inline(always)]
    fn cast<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        job: Job<'_>,
        ray: RayRef<'_>,
        entries: &mut Entries,
        counters: &mut C,
    ) -> Best {
        let (tree, frame) = (self.0, ray.frame);
        let cube = tree.cube();
        let mut best = Best::new(frame);
        // Octants are stored by sign bits, so `lane ^ signs` turns the ray's order into theirs.
        let signs = frame.signs & 7;
        let beyond = map([0xaa, 0xcc, 0xf0], |bits| {
            mask32x8::from_bitmask(simd, bits)
        });
        let mut stack = Stack::new(entries);
        stack.push(OctantEntry {
            node: 0,
            low: cube.corner,
            interval: Interval::new(frame.t_min, frame.t_max),
        });
        while let Some(OctantEntry {
            node: index,
            low,
            interval,
        }) = stack.pop()
        {
            if interval.enter > best.reach {
                continue;
            }
            let node = tree.node(index);
            if !node.is_inner() {
                // Test the triangles of a leaf.
                let leaf = node.blocks();
                counters.leaf(leaf.count);
                if leaf.count != 0
                    && job.test::<S, Q, C>(simd, leaf, ray, interval.leave, &mut best, counters)
                {
                    return best;
                }
                continue;
            }
            counters.step_boxes();
            let half = cube.edge(node.level() + 1);
            let mid = map(low, |x| x + half);
            let within = Interval::new(interval.enter, keep_min(best.reach, interval.leave));
            let octants = split(simd, frame, &beyond, mid, within);
            // Push the octants that are met and not empty, the nearest last.
            let mut open = octants.met;
            while open != 0 {
                let lane = 63 - open.leading_zeros();
                open ^= 1 << lane;
                let octant = lane ^ signs;
                if node.empty_octants() >> octant & 1 == 0 {
                    let lane = lane as usize;
                    stack.push(OctantEntry {
                        node: node.children() + octant,
                        low: map([0, 1, 2], |k: usize| {
                            if octant >> k & 1 == 1 { mid[k] } else { low[k] }
                        }),
                        interval: Interval::new(octants.enter[lane], octants.leave[lane]),
                    });
                }
            }
        }
        best
    }
}

single_rays! {
    /// Single rays from the root down, octants in the order of the direction.
    fn param(Octree) -> OctreeTraversal<'a> {
        |kernel| OctreeTraversal(&kernel.tree)
    }
}
