// SPDX-License-Identifier: GPL-3.0-or-later
//! Single rays through interval hierarchies with an interval per child.

use crate::batch;
use crate::pending::{Pending, make_room, next};
use crate::single::single_rays;
use crate::slabs::Slabs;
use fearless_simd::{Simd, SimdFloat, SimdMask, f32x4, f32x8};
use halfspace_geom::bound::{keep_max, keep_max_each, keep_min, keep_min_each};
use halfspace_leaf::{Job, Leaf};
use halfspace_nodes::plane_tree::MAX_DEPTH;
use halfspace_nodes::slab_wide::{LEAF, WIDEST, WideSlabs};
use halfspace_ray::query::{Best, Counters, Query};
use halfspace_ray::{Hit, RayRef};

impl Slabs {
    /// Intersects the ray with the intervals of the children along an axis, one per lane of `V`. Writes entry
    /// and exit distances and returns the mask of those the ray may hit something in.
    #[inline(always)]
    fn between<S: Simd, V: SimdFloat<S, Element = f32>, const W: usize>(
        &self,
        simd: S,
        (planes, axis): (&[[f32; W]; 2], usize),
        (enter, leave): (f32, f32),
        (enters, leaves): (&mut [f32; W], &mut [f32; W]),
    ) -> u64 {
        let splat = |x: f32| V::splat(simd, x);
        let row = self.entry_row(axis);
        let (near, far) = (
            V::from_slice(simd, &planes[row]),
            V::from_slice(simd, &planes[row ^ 1]),
        );
        let inv = splat(self.inv[axis]);
        let enter = keep_max_each(near.mul_add(inv, splat(self.near[axis])), splat(enter));
        let leave = keep_min_each(far.mul_add(inv, splat(self.far[axis])), splat(leave));
        enter.store_slice(enters);
        leave.store_slice(leaves);
        enter.simd_le(leave).to_bitmask()
    }

    /// [`Self::between`] in scalar code, for two children, since the shortest vector has four lanes.
    #[inline(always)]
    fn between_few<const W: usize>(
        &self,
        (planes, axis): (&[[f32; W]; 2], usize),
        (enter, leave): (f32, f32),
        (enters, leaves): (&mut [f32; W], &mut [f32; W]),
    ) -> u64 {
        let row = self.entry_row(axis);
        let mut mask = 0;
        for lane in 0..W {
            enters[lane] = keep_max(planes[row][lane] * self.inv[axis] + self.near[axis], enter);
            leaves[lane] = keep_min(
                planes[row ^ 1][lane] * self.inv[axis] + self.far[axis],
                leave,
            );
            mask |= u64::from(enters[lane] <= leaves[lane]) << lane;
        }
        mask
    }
}

/// The traversal of one tree.
pub struct Walk<'a, const W: usize>(pub &'a WideSlabs<W>);

impl<const W: usize> batch::Walk for Walk<'_, W> {
    type Scratch = Vec<Pending>;

    fn scratch(&self) -> Self::Scratch {
        // Derived: each level leaves at most all children but one, and the lowest all of them.
        vec![Pending::default(); (MAX_DEPTH + 1) * (W - 1) + 2 * WIDEST]
    }

    #[inline(always)]
    fn cast<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        job: Job<'_>,
        RayRef { ray, frame }: RayRef<'_>,
        stack: &mut Self::Scratch,
        counters: &mut C,
    ) -> Hit {
        let slabs = Slabs::new(frame);
        let mut best = Best::new(frame);
        let mut waiting = 0;
        let mut node = &self.0.nodes[0];
        let (mut enter, mut leave) = (frame.t_min, frame.t_max);
        loop {
            let axis = (node.word & LEAF) as usize;
            if axis < 3 {
                counters.step_boxes();
                // Intersect all children at once.
                let (mut enters, mut leaves) = ([0.0; W], [0.0; W]);
                let (planes, range) = ((&node.planes, axis), (enter, leave));
                let out = (&mut enters, &mut leaves);
                let mut hits = match W {
                    8 => slabs.between::<S, f32x8<S>, W>(simd, planes, range, out),
                    4 => slabs.between::<S, f32x4<S>, W>(simd, planes, range, out),
                    _ => slabs.between_few(planes, range, out),
                };
                hits &= (1 << node.children()) - 1;
                // Push those the ray may hit, the nearest on top.
                let base = waiting;
                while hits != 0 {
                    let lane = hits.trailing_zeros() as usize % W;
                    hits &= hits - 1;
                    let at = make_room(stack, base, &mut waiting, enters[lane]);
                    #[expect(clippy::cast_possible_truncation, reason = "at most 8")]
                    let node = node.link() + lane as u32;
                    stack[at] = Pending {
                        node,
                        enter: enters[lane],
                        leave: leaves[lane],
                    };
                }
            } else {
                let count = node.link() as usize;
                counters.leaf(count);
                if job.test_any::<S, Q, C>(
                    simd,
                    Leaf {
                        first: node.planes[0][0].to_bits(),
                        count,
                    },
                    RayRef { ray, frame },
                    leave,
                    &mut best,
                    counters,
                ) {
                    return best.hit();
                }
            }
            let Some(child) = next(stack, &mut waiting, best.reach) else {
                return best.hit();
            };
            let place;
            (place, enter, leave) = child.within(best.reach);
            node = &self.0.nodes[place as usize];
        }
    }
}

single_rays! {
    /// Single rays through nodes of 2 intervals.
    fn wide_slabs2(WideSlabs<2>) -> Walk<'a, 2> {
        |kernel| Walk(&kernel.tree)
    }
}

single_rays! {
    /// Single rays through nodes of 4 intervals.
    fn wide_slabs4(WideSlabs<4>) -> Walk<'a, 4> {
        |kernel| Walk(&kernel.tree)
    }
}

single_rays! {
    /// Single rays through nodes of 8 intervals.
    fn wide_slabs8(WideSlabs<8>) -> Walk<'a, 8> {
        |kernel| Walk(&kernel.tree)
    }
}
