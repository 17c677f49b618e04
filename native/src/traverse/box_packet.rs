// SPDX-License-Identifier: GPL-3.0-or-later
//! Trees of boxes walked by packets: each box of a node against all rays, one to a lane. The box that the
//! first ray inside it enters soonest is visited first.

use super::blocks::Blocks;
use super::box_tree::{self, BoxTree, INNER, Slabs};
use super::packet::{self, Group, MOST, Packet, Row, Width};
use super::packet_walk::{self, PacketTree};
use super::query::Counters;
use super::ray::Ray;
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

/// What slab tests need of the rays: [`Slabs`], a ray to a lane.
#[derive(Default)]
pub struct Rows {
    inv: [Row; 3],
    near: [Row; 3],
    far: [Row; 3],
    /// Where rays leave the scene: the ends of boxes are of no use to leaves.
    ends: Row,
}

impl packet_walk::Rows for Rows {
    #[inline(always)]
    fn fill(&mut self, packet: &Packet) {
        for (i, frame) in packet.frames.iter().enumerate().take(MOST) {
            let slabs = Slabs::new(frame);
            for k in 0..3 {
                self.inv[k][i] = slabs.inv[k];
                self.near[k][i] = slabs.near[k];
                self.far[k][i] = slabs.far[k];
            }
            self.ends[i] = frame.t_max;
        }
    }
}

impl<const W: usize> PacketTree for BoxTree<W> {
    type Rows = Rows;
    type Pending = Pending;
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
    fn follow<S: Simd, C: Counters, L: Width>(
        &self,
        simd: S,
        task: (&Triangles, &Blocks, &[Ray]),
        (packet, rows): (&mut Packet, &Rows),
        group: Group,
        stack: &mut [Pending],
        counters: &mut [C],
    ) {
        let mut enters = packet.enter(group);
        let mut waiting = 0;
        let mut node = &self.nodes[0];
        loop {
            counters[group.lead].step_axis();
            let inside = packet::load::<S, L>(simd, &enters);
            let reach = packet::load::<S, L>(simd, &packet.reach);
            let base = waiting;
            for child in 0..W {
                if node.count[child] == 0 {
                    continue;
                }
                let (mut enter, mut leave) = (inside, reach);
                for k in 0..3 {
                    let back = group.signs >> k & 1 == 1;
                    let (low, high) = (node.bounds[k][child], node.bounds[3 + k][child]);
                    let (soon, late) = if back { (high, low) } else { (low, high) };
                    let inv = packet::load::<S, L>(simd, &rows.inv[k]);
                    let near = packet::load::<S, L>(simd, &rows.near[k]);
                    let far = packet::load::<S, L>(simd, &rows.far[k]);
                    // What is not a number bounds nothing.
                    enter = L::Vector::splat(simd, soon).mul_add(inv, near).max(enter);
                    leave = L::Vector::splat(simd, late).mul_add(inv, far).min(leave);
                }
                let lanes = packet::live::<S, L>(enter, leave);
                if lanes == 0 {
                    continue;
                }
                // Rays that miss this box take no part in what is inside.
                let outside = L::Vector::splat(simd, f32::INFINITY);
                let entered = enter.simd_le(leave).select(enter, outside);
                let mut own = [f32::INFINITY; MOST];
                packet::store::<S, L>(entered, &mut own);
                let first = own[lanes.trailing_zeros() as usize % MOST];
                let mut at = waiting;
                while at > base && stack[at - 1].first < first {
                    stack[at] = stack[at - 1];
                    at -= 1;
                }
                stack[at] = Pending {
                    first,
                    link: node.link[child],
                    count: node.count[child],
                    enter: own,
                };
                waiting += 1;
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
                counters[group.lead].leaf(leaf.1);
                packet.leaf(simd, task, leaf, (lanes, &rows.ends), counters);
            };
        }
    }
}
