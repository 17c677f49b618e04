// SPDX-License-Identifier: GPL-3.0-or-later
//! Plane trees walked by packets: the steps of [`super::plane_dir`], one ray to a lane. At an oblique plane
//! the rays of a packet may disagree about the near side; the first of them decides which comes first, and each
//! keeps its own intervals of both.

use super::blocks::Blocks;
use super::packet::{self, Group, MOST, Packet, Row, Width};
use super::packet_walk::{PacketTree, Rows};
use super::plane_dir;
use super::query::Counters;
use super::ray::Ray;
use crate::build::plane_tree::{MAX_DEPTH, Node, PlaneTree, near_child};
use crate::scene::Triangles;
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask};

/// A child still to visit, and the interval of each ray inside it.
#[derive(Clone, Copy)]
pub struct Pending {
    node: u32,
    enter: Row,
    leave: Row,
}

/// What planes need of the rays.
#[derive(Default)]
pub struct Axes {
    inv: [Row; 3],
    slack: [Row; 3],
    oblique_pad: Row,
}

impl Rows for Axes {
    #[inline(always)]
    fn fill(&mut self, packet: &Packet) {
        for (i, frame) in packet.frames.iter().enumerate().take(MOST) {
            for k in 0..3 {
                self.inv[k][i] = frame.inv[k];
                self.slack[k][i] = frame.slack[k];
            }
            self.oblique_pad[i] = frame.oblique_pad;
        }
    }
}

/// A child, and the interval of each ray inside it.
type Part<S, L> = (u32, <L as Width>::Vector<S>, <L as Width>::Vector<S>);

impl PacketTree for PlaneTree {
    type Rows = Axes;
    type Pending = Pending;
    type Single<'a>
        = plane_dir::Walk<&'a PlaneTree>
    where
        Self: 'a;

    fn single(&self) -> Self::Single<'_> {
        plane_dir::Walk(self)
    }

    fn stack(&self) -> Vec<Pending> {
        let blank = Pending {
            node: 0,
            enter: [0.0; MOST],
            leave: [0.0; MOST],
        };
        vec![blank; MAX_DEPTH + 1]
    }

    #[inline(always)]
    fn follow<S: Simd, C: Counters, L: Width>(
        &self,
        simd: S,
        task: (&Triangles, &Blocks, &[Ray]),
        (packet, axes): (&mut Packet, &Axes),
        group: Group,
        stack: &mut [Pending],
        counters: &mut [C],
    ) {
        let lead = group.lead;
        let mut waiting = 0;
        let mut node = self.root();
        let mut enter = packet::load::<S, L>(simd, &packet.enter(group));
        let mut leave = packet::load::<S, L>(simd, &packet.reach);
        loop {
            let (parts, empty) = match self.node(node) {
                Node::Axis {
                    axis,
                    split,
                    empty,
                    link,
                    ..
                } => {
                    counters[lead].step_axis();
                    let o = packet::load::<S, L>(simd, &packet.o[axis]);
                    let inv = packet::load::<S, L>(simd, &axes.inv[axis]);
                    let slack = packet::load::<S, L>(simd, &axes.slack[axis]);
                    let distance = (L::Vector::splat(simd, split) - o) * inv;
                    // What is not a number bounds nothing.
                    let near: Part<S, L> = (
                        near_child(link, group.signs),
                        enter,
                        (distance + slack).min(leave),
                    );
                    let far = (near.0 ^ 1, (distance - slack).max(enter), leave);
                    ([near, far], empty)
                }
                Node::Oblique {
                    normal,
                    offset,
                    children,
                    empty,
                } => {
                    counters[lead].step_oblique();
                    let plane = (normal, offset, children);
                    let parts = oblique::<S, L>(simd, (packet, axes), lead, plane, (enter, leave));
                    (parts, empty)
                }
                Node::Leaf { first, count } => {
                    counters[lead].leaf(count);
                    let lanes = packet::live::<S, L>(enter, leave) & group.lanes;
                    if count != 0 {
                        let mut leaves = [0.0; MOST];
                        packet::store::<S, L>(leave, &mut leaves);
                        let cell = (lanes, &leaves);
                        packet.leaf(simd, task, (first, count), cell, counters);
                    }
                    let reach = packet::load::<S, L>(simd, &packet.reach);
                    loop {
                        if waiting == 0 {
                            return;
                        }
                        waiting -= 1;
                        let next = &stack[waiting];
                        enter = packet::load::<S, L>(simd, &next.enter);
                        leave = packet::load::<S, L>(simd, &next.leave).min(reach);
                        if packet::live::<S, L>(enter, leave) != 0 {
                            node = next.node;
                            break;
                        }
                    }
                    continue;
                }
            };
            // Where no ray is left, there is nothing; of children on the way an empty one is not visited.
            let [first, second] = parts;
            if !on_way::<S, L>(first, empty) {
                // If that is empty too, the walk finds so itself.
                (node, enter, leave) = second;
                continue;
            }
            if on_way::<S, L>(second, empty) {
                let next = &mut stack[waiting];
                next.node = second.0;
                packet::store::<S, L>(second.1, &mut next.enter);
                packet::store::<S, L>(second.2, &mut next.leave);
                waiting += 1;
            }
            (node, enter, leave) = first;
        }
    }
}

/// Whether a child has to be visited.
#[inline(always)]
fn on_way<S: Simd, L: Width>((child, enter, leave): Part<S, L>, empty: u32) -> bool {
    empty >> (child & 1) & 1 == 0 && packet::live::<S, L>(enter, leave) != 0
}

/// The children of an oblique node, the one first that is near to the first ray, and the intervals in
/// them of all.
#[inline(always)]
fn oblique<S: Simd, L: Width>(
    simd: S,
    (packet, axes): (&Packet, &Axes),
    lead: usize,
    (normal, offset, children): ([f32; 3], f32, u32),
    (enter, leave): (L::Vector<S>, L::Vector<S>),
) -> [Part<S, L>; 2] {
    let speed = along::<S, L>(simd, normal, &packet.d);
    let least = L::Vector::splat(simd, f32::MIN_POSITIVE).copysign(speed);
    let inv = L::Vector::splat(simd, 1.0) / (speed + least);
    let height = L::Vector::splat(simd, offset) - along::<S, L>(simd, normal, &packet.o);
    let slack = packet::load::<S, L>(simd, &axes.oblique_pad) * inv.abs();
    let distance = height * inv;
    // What is not a number bounds nothing.
    let near_leave = (distance + slack).min(leave);
    let far_enter = (distance - slack).max(enter);
    let down = inv.simd_lt(L::Vector::splat(simd, 0.0));
    let below = (
        children,
        down.select(far_enter, enter),
        down.select(leave, near_leave),
    );
    let above = (
        children + 1,
        down.select(enter, far_enter),
        down.select(near_leave, leave),
    );
    if down.to_bitmask() >> lead & 1 == 1 {
        [above, below]
    } else {
        [below, above]
    }
}

/// The products of a normal with vectors.
#[inline(always)]
fn along<S: Simd, L: Width>(simd: S, [x, y, z]: [f32; 3], v: &[Row; 3]) -> L::Vector<S> {
    let first = packet::load::<S, L>(simd, &v[0]) * L::Vector::splat(simd, x);
    let second = packet::load::<S, L>(simd, &v[1]) * L::Vector::splat(simd, y);
    let third = packet::load::<S, L>(simd, &v[2]) * L::Vector::splat(simd, z);
    first + second + third
}
