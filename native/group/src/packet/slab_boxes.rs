// SPDX-License-Identifier: GPL-3.0-or-later
//! Packets through the boxes that intervals leave (Wald, Boulos and Shirley 2007): one box per node, derived from the
//! parent's on the way down, is tested against all rays when the node is visited. Stack entries hold a node and its
//! box; they need no interval per ray, a quarter of the memory that packets through the intervals themselves take.

use crate::packet::boxes::slabs;
use crate::packet::leaf::{self, Active};
use crate::packet::traversal::PacketTree;
use crate::packet::{self, Group, Packet, Width};
use fearless_simd::{Simd, SimdBase, SimdFloat};
use halfspace_geom::Aabb;
use halfspace_geom::bound::{keep_max_each, keep_min_each};
use halfspace_nodes::plane_tree::MAX_DEPTH;
use halfspace_nodes::slab_boxes::{BoxedNode, SlabBoxes};
use halfspace_nodes::slab_node::Double;
use halfspace_ray::query::{Counters, Query};
use halfspace_single::objects::slab_boxes::SlabBoxTraversal;
use halfspace_trace::input::Input;

impl PacketTree for SlabBoxes {
    type Entry<'a> = BoxedNode;
    type Single<'a> = SlabBoxTraversal<'a, Double>;

    fn single(&self) -> Self::Single<'_> {
        SlabBoxTraversal::new(&self.tree, self.bounds)
    }

    fn stack(&self) -> Vec<BoxedNode> {
        // Each level leaves one child on the stack, and the lowest level both.
        vec![self.root(); MAX_DEPTH + 3]
    }

    #[inline(always)]
    fn trace_group<S: Simd, Q: Query, C: Counters, L: Width>(
        &self,
        simd: S,
        input: Input<'_>,
        packet: &mut Packet,
        group: Group,
        stack: &mut [BoxedNode],
        counters: &mut [C],
    ) {
        let charged = packet.places[group.lead];
        let slabs = slabs::<S, L>(simd, packet);
        let start = packet.enter(group);
        let octant = (group.signs & 7) as usize;
        stack[0] = self.root();
        let mut size = 1;
        while size != 0 {
            // Pop the nearest node, and find the rays that meet its box before their best hit.
            size -= 1;
            let own = stack[size];
            let reach = packet::load::<S, L>(simd, &packet.reach);
            let start = packet::load::<S, L>(simd, &start);
            let (enter, leave) = meet::<S, L>(simd, &own.region, octant, &slabs, [start, reach]);
            let lanes = packet::live::<S, L>(enter, leave) & group.lanes;
            if lanes == 0 {
                continue;
            }
            packet.join(lanes, group, counters);
            if let Some(leaf) = own.leaf() {
                counters[charged].leaf(leaf.count);
                let active = Active {
                    lanes,
                    leave: &leave,
                };
                leaf::test::<S, Q, C, L>(simd, input, leaf, packet, active, counters);
                continue;
            }
            // Push the children, the near one on top.
            counters[charged].step_boxes();
            for child in self.children(&own, octant).into_iter().flatten() {
                stack[size] = child;
                size += 1;
            }
        }
    }
}

/// The distances at which rays of one octant enter and leave a box, inside `[start, reach]`. A distance that is NaN cuts
/// off nothing.
#[inline(always)]
fn meet<S: Simd, L: Width>(
    simd: S,
    region: &Aabb,
    octant: usize,
    slabs: &[[L::Vector<S>; 3]; 3],
    [start, reach]: [L::Vector<S>; 2],
) -> (L::Vector<S>, L::Vector<S>) {
    let (mut enter, mut leave) = (start, reach);
    for (k, &[inv, before, behind]) in slabs.iter().enumerate() {
        let sides = [region.min[k], region.max[k]];
        let back = octant >> k & 1;
        let [soon, late] = [sides[back], sides[back ^ 1]].map(|x| L::Vector::splat(simd, x));
        enter = keep_max_each(soon.mul_add(inv, before), enter);
        leave = keep_min_each(late.mul_add(inv, behind), leave);
    }
    (enter, leave)
}
