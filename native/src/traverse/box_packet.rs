// SPDX-License-Identifier: GPL-3.0-or-later
//! Trees of boxes walked by packets: each box of a node against all rays, one to a lane. The box that the
//! first ray inside it enters soonest is visited first.

use super::blocks::Blocks;
use super::bound::{keep_max_each, keep_min_each};
use super::box_tree::{self, BoxTree, INNER};
use super::packet::{self, Group, MOST, Packet, Width};
use super::packet_leaf;
use super::packet_walk::PacketTree;
use super::pending::{Waits, make_room};
use super::query::{Counters, Query};
use super::ray::Ray;
use super::tile::Row;
use crate::build::plane_tree::MAX_DEPTH;
use crate::scene::Triangles;
use fearless_simd::{Select, Simd, SimdBase, SimdFloat};

/// A box still to visit, and where each ray enters it; the others nowhere.
#[derive(Clone, Copy)]
pub struct Pending {
    /// Where the first of them does.
    first: f32,
    link: u32,
    count: u32,
    enter: Row,
}

impl Waits for Pending {
    #[inline(always)]
    fn enter(&self) -> f32 {
        self.first
    }
}

impl<const W: usize> PacketTree for BoxTree<W> {
    type Pending<'a> = Pending;
    type Single<'a>
        = box_tree::Walk<'a, W>
    where
        Self: 'a;

    fn single(&self) -> Self::Single<'_> {
        box_tree::Walk(self)
    }

    fn stack(&self) -> Vec<Pending> {
        let blank = Pending {
            first: 0.0,
            link: 0,
            count: 0,
            enter: [0.0; MOST],
        };
        // Each level leaves at most all children but one behind, and the lowest all of them.
        vec![blank; (MAX_DEPTH + 1) * (W - 1) + 2 * W]
    }

    #[inline(always)]
    fn follow_packet<S: Simd, Q: Query, C: Counters, L: Width>(
        &self,
        simd: S,
        (_, blocks): (&Triangles, &Blocks),
        rays: &[Ray],
        (packet, group): (&mut Packet, Group),
        stack: &mut [Pending],
        counters: &mut [C],
    ) {
        let charged = packet.places[group.lead];
        let slabs = slabs::<S, L>(simd, packet);
        // The ends of boxes are of no use to leaves.
        let ends = packet::load::<S, L>(simd, &packet.reach);
        let mut enters = packet.enter(group);
        let mut waiting = 0;
        // Which rays are inside each box of a node, and where they enter it.
        let mut lanes_of = [0; W];
        let mut entries = [[f32::INFINITY; MOST]; W];
        let mut node = &self.nodes[0];
        loop {
            counters[charged].step_axis();
            let inside = packet::load::<S, L>(simd, &enters);
            let reach = packet::load::<S, L>(simd, &packet.reach);
            let base = waiting;
            let side = |k: usize, far: u32| {
                let back = group.signs >> k & 1;
                &node.bounds[k + 3 * (back ^ far) as usize]
            };
            let near = [side(0, 0), side(1, 0), side(2, 0)];
            let far = [side(0, 1), side(1, 1), side(2, 1)];
            // All boxes before the first is dealt with: a branch for each would often be guessed wrongly.
            let mut met = 0_u32;
            for child in 0..W {
                let (mut enter, mut leave) = (inside, reach);
                for (k, [inv, before, behind]) in slabs.into_iter().enumerate() {
                    let (soon, late) = (near[k][child], far[k][child]);
                    // What is not a number bounds nothing.
                    enter = keep_max_each(L::Vector::splat(simd, soon).mul_add(inv, before), enter);
                    leave = keep_min_each(L::Vector::splat(simd, late).mul_add(inv, behind), leave);
                }
                // Rays that miss this box take no part in what is inside.
                let outside = L::Vector::splat(simd, f32::INFINITY);
                let entered = enter.simd_le(leave).select(enter, outside);
                packet::store::<S, L>(entered, &mut entries[child]);
                lanes_of[child] = packet::live::<S, L>(enter, leave);
                met |= u32::from(lanes_of[child] != 0 && node.count[child] != 0) << child;
            }
            while met != 0 {
                let child = met.trailing_zeros() as usize % W;
                met &= met - 1;
                let (lanes, own) = (lanes_of[child], entries[child]);
                let first = own[lanes.trailing_zeros() as usize % MOST];
                let at = make_room(stack, base, &mut waiting, first);
                stack[at] = Pending {
                    first,
                    link: node.link[child],
                    count: node.count[child],
                    enter: own,
                };
            }

            // Go on with the nearest box; leaves are tested until an inner node comes up.
            node = loop {
                if waiting == 0 {
                    return;
                }
                waiting -= 1;
                let next = &stack[waiting];
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
                let leaf = (next.link, next.count as usize);
                blocks.fetch_ahead(leaf.0);
                if let Some(further) = stack[..waiting].last() {
                    self.fetch_ahead((further.link, further.count), blocks);
                }
                counters[charged].leaf(leaf.1);
                let cell = (lanes, &ends);
                packet_leaf::test::<S, Q, C, L>(simd, (blocks, rays), leaf, packet, cell, counters);
            };
        }
    }
}

/// What slab tests need of the rays, per axis what coordinates are taken times, and what is added where rays enter
/// and where they leave: [`box_tree::Slabs`], a ray to a lane.
#[inline(always)]
pub(super) fn slabs<S: Simd, L: Width>(simd: S, packet: &Packet) -> [[L::Vector<S>; 3]; 3] {
    [
        slab::<S, L>(simd, packet, 0),
        slab::<S, L>(simd, packet, 1),
        slab::<S, L>(simd, packet, 2),
    ]
}

#[inline(always)]
fn slab<S: Simd, L: Width>(simd: S, packet: &Packet, k: usize) -> [L::Vector<S>; 3] {
    let splat = |x: f32| L::Vector::splat(simd, x);
    let inv = packet::load::<S, L>(simd, &packet.inv[k]);
    let slack = packet::load::<S, L>(simd, &packet.slack[k]);
    let shift = packet::load::<S, L>(simd, &packet.o[k]) * inv;
    // Where a product with any coordinate might overflow, the axis decides nothing.
    let most = splat(f32::MAX);
    let span = packet::load::<S, L>(simd, &packet.span) * inv;
    let finite = span.abs().simd_le(most) & (slack + shift.abs()).simd_le(most);
    [
        finite.select(inv, splat(0.0)),
        finite.select(-shift - slack, splat(f32::NEG_INFINITY)),
        finite.select(slack - shift, splat(f32::INFINITY)),
    ]
}
