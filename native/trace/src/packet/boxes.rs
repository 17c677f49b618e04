// SPDX-License-Identifier: GPL-3.0-or-later
//! Packet traversal of box trees: each box of a node is tested against all rays, one ray per lane. The next box
//! is the one that the first active ray in it enters soonest.

use crate::input::Input;
use crate::packet::leaf::{self, Active};
use crate::packet::traversal::PacketTree;
use crate::packet::{self, Group, MOST, Packet, Width};
use crate::single::objects::boxes as box_tree;
use crate::stack::{Entry, make_room};
use crate::tile::Row;
use fearless_simd::{Select, Simd, SimdBase, SimdFloat};
use halfspace_geom::bound::{keep_max_each, keep_min_each};
use halfspace_leaf::Leaf;
use halfspace_nodes::box_tree::{BoxTree, INNER, Wide};
use halfspace_nodes::plane_tree::MAX_DEPTH;
use halfspace_ray::query::{Counters, Query};

/// A stack entry: a box still to visit and the entry distance of each ray, infinite for rays that miss it.
#[derive(Clone, Copy)]
pub struct BoxEntry {
    /// Entry distance of the first ray that hits the box; the sort key.
    first: f32,
    link: u32,
    count: u32,
    enter: Row,
}

impl Entry for BoxEntry {
    #[inline(always)]
    fn enter(&self) -> f32 {
        self.first
    }
}

impl<const W: usize> PacketTree for BoxTree<W> {
    type Entry<'a> = BoxEntry;
    type Single<'a>
        = box_tree::BoxTraversal<'a, W>
    where
        Self: 'a;

    fn single(&self) -> Self::Single<'_> {
        box_tree::BoxTraversal(self)
    }

    fn stack(&self) -> Vec<BoxEntry> {
        let blank = BoxEntry {
            first: 0.0,
            link: 0,
            count: 0,
            enter: [0.0; MOST],
        };
        // Each level leaves at most all children but one on the stack, and the lowest level all of them.
        vec![blank; (MAX_DEPTH + 1) * (W - 1) + 2 * W]
    }

    #[inline(always)]
    fn trace_group<S: Simd, Q: Query, C: Counters, L: Width>(
        &self,
        simd: S,
        input: Input<'_>,
        packet: &mut Packet,
        group: Group,
        stack: &mut [BoxEntry],
        counters: &mut [C],
    ) {
        let charged = packet.places[group.lead];
        let slabs = slabs::<S, L>(simd, packet);
        // Leaves need no exit distances of boxes, only the ends of the rays.
        let ends = packet::load::<S, L>(simd, &packet.reach);
        let mut enters = packet.enter(group);
        let mut size = 0;
        let mut hits = Hits::none();
        let mut node = &self.nodes[0];
        loop {
            counters[charged].step_boxes();
            let inside = packet::load::<S, L>(simd, &enters);
            let reach = packet::load::<S, L>(simd, &packet.reach);
            if C::COUNTS {
                packet.join(packet::live::<S, L>(inside, reach), group, counters);
            }
            let met = hits.test::<S, L>(simd, node, &slabs, group.signs, inside, reach);
            hits.push(node, met, stack, &mut size);

            // Pop the nearest box, and test leaves until an inner node comes up.
            node = loop {
                if size == 0 {
                    return;
                }
                size -= 1;
                // Drop rays whose best hit has come before this box since it was pushed.
                let next = &stack[size];
                let enter = packet::load::<S, L>(simd, &next.enter);
                let reach = packet::load::<S, L>(simd, &packet.reach);
                let lanes = packet::live::<S, L>(enter, reach) & group.lanes;
                if lanes == 0 {
                    continue;
                }
                if next.count == INNER {
                    enters = next.enter;
                    break &self.nodes[next.link as usize];
                }
                let own = Leaf {
                    first: next.link,
                    count: next.count as usize,
                };
                // Prefetch the leaf, and the entry that follows it.
                input.blocks.fetch_ahead(own.first);
                if let Some(further) = stack[..size].last() {
                    self.fetch_ahead(further.link, further.count, input.blocks);
                }
                counters[charged].leaf(own.count);
                packet.join(lanes, group, counters);
                let active = Active {
                    lanes,
                    leave: &ends,
                };
                leaf::test::<S, Q, C, L>(simd, input, own, packet, active, counters);
            };
        }
    }
}

/// The rays that hit each box of a node.
struct Hits<const W: usize> {
    /// Mask of the rays, per box.
    lanes: [u64; W],
    /// Entry distances, infinite for rays that miss the box.
    enter: [Row; W],
}

impl<const W: usize> Hits<W> {
    #[inline(always)]
    fn none() -> Self {
        Self {
            lanes: [0; W],
            enter: [[f32::INFINITY; MOST]; W],
        }
    }

    /// Tests rays of common direction signs, inside the node between `inside` and `reach`, against all boxes of
    /// the node. Returns the mask of the boxes that some ray hits.
    #[inline(always)]
    fn test<S: Simd, L: Width>(
        &mut self,
        simd: S,
        node: &Wide<W>,
        slabs: &[[L::Vector<S>; 3]; 3],
        signs: u32,
        inside: L::Vector<S>,
        reach: L::Vector<S>,
    ) -> u32 {
        // Choose the near and the far plane row of each axis; the signs are the same for all rays.
        let side = |k: usize, far: u32| &node.bounds[k + 3 * ((signs >> k & 1) ^ far) as usize];
        let near = [side(0, 0), side(1, 0), side(2, 0)];
        let far = [side(0, 1), side(1, 1), side(2, 1)];
        // Test all boxes before the first is pushed: a branch for each would often be mispredicted.
        let mut met = 0_u32;
        for child in 0..W {
            let (mut enter, mut leave) = (inside, reach);
            for (k, &[inv, before, behind]) in slabs.iter().enumerate() {
                let (soon, late) = (near[k][child], far[k][child]);
                // Ignore a distance that is NaN.
                enter = keep_max_each(L::Vector::splat(simd, soon).mul_add(inv, before), enter);
                leave = keep_min_each(L::Vector::splat(simd, late).mul_add(inv, behind), leave);
            }
            // Rays that miss this box are inactive in the subtree.
            let outside = L::Vector::splat(simd, f32::INFINITY);
            let entered = enter.simd_le(leave).select(enter, outside);
            packet::store::<S, L>(entered, &mut self.enter[child]);
            self.lanes[child] = packet::live::<S, L>(enter, leave);
            met |= u32::from(self.lanes[child] != 0 && node.count[child] != 0) << child;
        }
        met
    }

    /// Pushes the boxes of `met`, sorted by entry distance with the nearest on top.
    #[inline(always)]
    fn push(&self, node: &Wide<W>, mut met: u32, stack: &mut [BoxEntry], size: &mut usize) {
        let base = *size;
        while met != 0 {
            let child = met.trailing_zeros() as usize % W;
            met &= met - 1;
            let (lanes, enter) = (self.lanes[child], self.enter[child]);
            let first = enter[lanes.trailing_zeros() as usize % MOST];
            let at = make_room(stack, base, size, first);
            stack[at] = BoxEntry {
                first,
                link: node.link[child],
                count: node.count[child],
                enter,
            };
        }
    }
}

/// The coefficients of the slab tests, per axis: the factor of a plane's coordinate, and the terms added for
/// entry and for exit planes. These are [`crate::slabs::Slabs`] with one ray per lane.
#[inline(always)]
pub fn slabs<S: Simd, L: Width>(simd: S, packet: &Packet) -> [[L::Vector<S>; 3]; 3] {
    [
        slab::<S, L>(simd, packet, 0),
        slab::<S, L>(simd, packet, 1),
        slab::<S, L>(simd, packet, 2),
    ]
}

/// The coefficients for axis `k`.
#[inline(always)]
fn slab<S: Simd, L: Width>(simd: S, packet: &Packet, k: usize) -> [L::Vector<S>; 3] {
    let splat = |x: f32| L::Vector::splat(simd, x);
    let inv = packet::load::<S, L>(simd, &packet.inv[k]);
    let slack = packet::load::<S, L>(simd, &packet.slack[k]);
    let shift = packet::load::<S, L>(simd, &packet.o[k]) * inv;
    // If a product with some coordinate may overflow, this axis bounds nothing.
    let most = splat(f32::MAX);
    let span = packet::load::<S, L>(simd, &packet.span) * inv;
    let finite = span.abs().simd_le(most) & (slack + shift.abs()).simd_le(most);
    [
        finite.select(inv, splat(0.0)),
        finite.select(-shift - slack, splat(f32::NEG_INFINITY)),
        finite.select(slack - shift, splat(f32::INFINITY)),
    ]
}
