// SPDX-License-Identifier: GPL-3.0-or-later
//! Single rays through interval hierarchies with an interval per child.

use crate::objects::intervals::{IntervalTraversal, IntervalTree, Next, Stack};
use crate::single_rays;
use fearless_simd::{Simd, SimdFloat, SimdMask, f32x4, f32x8};
use halfspace_geom::bound::{keep_max, keep_max_each, keep_min, keep_min_each};
use halfspace_leaf::Leaf;
use halfspace_nodes::plane_tree::MAX_DEPTH;
use halfspace_nodes::slab_wide::{LEAF, Node, WIDEST, WideSlabs};
use halfspace_ray::query::{Counters, Query};
use halfspace_ray::{FrameRay, Interval};
use halfspace_trace::slabs::Slabs;
use halfspace_trace::stack::NodeEntry;

/// The intervals of a ray in the children of a node.
struct Intervals<const W: usize> {
    enter: [f32; W],
    leave: [f32; W],
    /// Mask of the children that the ray may hit something in.
    met: u64,
}

/// Intersects the ray with the intervals of the children along an axis, one per lane of `V`.
#[inline(always)]
fn between<S: Simd, V: SimdFloat<S, Element = f32>, const W: usize>(
    slabs: &Slabs,
    simd: S,
    planes: &[[f32; W]; 2],
    axis: usize,
    interval: Interval,
) -> Intervals<W> {
    let splat = |x: f32| V::splat(simd, x);
    let row = slabs.entry_row(axis);
    let near = V::from_slice(simd, &planes[row]);
    let far = V::from_slice(simd, &planes[row ^ 1]);
    let inv = splat(slabs.inv[axis]);
    let (early, late) = (splat(slabs.near[axis]), splat(slabs.far[axis]));
    let enter = keep_max_each(near.mul_add(inv, early), splat(interval.enter));
    let leave = keep_min_each(far.mul_add(inv, late), splat(interval.leave));
    let mut intervals = Intervals {
        enter: [0.0; W],
        leave: [0.0; W],
        met: enter.simd_le(leave).to_bitmask(),
    };
    enter.store_slice(&mut intervals.enter);
    leave.store_slice(&mut intervals.leave);
    intervals
}

/// [`between`] in scalar code, for two children, since the shortest vector has four lanes.
#[inline(always)]
fn between_few<const W: usize>(
    slabs: &Slabs,
    planes: &[[f32; W]; 2],
    axis: usize,
    interval: Interval,
) -> Intervals<W> {
    let row = slabs.entry_row(axis);
    let (inv, early, late) = (slabs.inv[axis], slabs.near[axis], slabs.far[axis]);
    let (mut enter, mut leave, mut met) = ([0.0; W], [0.0; W], 0);
    for lane in 0..W {
        enter[lane] = keep_max(planes[row][lane] * inv + early, interval.enter);
        leave[lane] = keep_min(planes[row ^ 1][lane] * inv + late, interval.leave);
        met |= u64::from(enter[lane] <= leave[lane]) << lane;
    }
    Intervals { enter, leave, met }
}

impl<const W: usize> IntervalTree for WideSlabs<W> {
    type Node<'a> = &'a Node<W>;
    type Ray<'r> = Slabs;
    type Entries = Vec<NodeEntry>;

    fn entries() -> Self::Entries {
        // Derived: each level leaves at most all children but one, and the lowest all of them.
        vec![NodeEntry::blank(0); (MAX_DEPTH + 1) * (W - 1) + 2 * WIDEST]
    }

    #[inline(always)]
    fn node(&self, index: u32) -> &Node<W> {
        &self.nodes[index as usize]
    }

    #[inline(always)]
    fn prepare<'r>(ray: &'r FrameRay<'r>) -> Slabs {
        Slabs::new(ray)
    }

    #[inline(always)]
    fn step<'a, S: Simd, Q: Query, C: Counters>(
        &'a self,
        simd: S,
        node: &'a Node<W>,
        slabs: &Slabs,
        interval: Interval,
        stack: &mut Stack<'_>,
        counters: &mut C,
    ) -> Next<&'a Node<W>> {
        let axis = (node.word & LEAF) as usize;
        if axis >= 3 {
            return Next::Leaf(Leaf {
                first: node.planes[0][0].to_bits(),
                count: node.link() as usize,
            });
        }
        // Intersect all children at once.
        counters.step_boxes();
        let Intervals { enter, leave, met } = match W {
            8 => between::<S, f32x8<S>, W>(slabs, simd, &node.planes, axis, interval),
            4 => between::<S, f32x4<S>, W>(slabs, simd, &node.planes, axis, interval),
            _ => between_few(slabs, &node.planes, axis, interval),
        };
        // Push those the ray may hit, the nearest on top.
        let mut met = met & ((1 << node.children()) - 1);
        let base = stack.size();
        while met != 0 {
            let lane = met.trailing_zeros() as usize % W;
            met &= met - 1;
            #[expect(clippy::cast_possible_truncation, reason = "at most 8")]
            let node = node.link() + lane as u32;
            let interval = Interval::new(enter[lane], leave[lane]);
            stack.insert::<Q>(base, NodeEntry { node, interval });
        }
        Next::Pop
    }
}

single_rays! {
    /// Single rays through nodes of 2 intervals.
    fn wide_slabs2(WideSlabs<2>) -> IntervalTraversal<'a, WideSlabs<2>> {
        |kernel| IntervalTraversal(&*kernel.tree)
    }
}

single_rays! {
    /// Single rays through nodes of 4 intervals.
    fn wide_slabs4(WideSlabs<4>) -> IntervalTraversal<'a, WideSlabs<4>> {
        |kernel| IntervalTraversal(&*kernel.tree)
    }
}

single_rays! {
    /// Single rays through nodes of 8 intervals.
    fn wide_slabs8(WideSlabs<8>) -> IntervalTraversal<'a, WideSlabs<8>> {
        |kernel| IntervalTraversal(&*kernel.tree)
    }
}
