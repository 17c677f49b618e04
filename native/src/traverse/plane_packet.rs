// SPDX-License-Identifier: GPL-3.0-or-later
//! Plane trees walked by packets: the steps of [`super::plane_dir`], one ray to a lane. At an oblique plane
//! the rays of a packet may disagree about the near side; the first of them decides which comes first, and each
//! keeps its own intervals of both.

use super::blocks::Blocks;
use super::bound::{keep_max_each, keep_min_each};
use super::packet::{self, Group, MOST, Packet, Width};
use super::packet_leaf;
use super::packet_walk::PacketTree;
use super::plane_dir;
use super::planes::{Inside, Planes};
use super::query::{Counters, Query};
use super::ray::Ray;
use super::tile::Row;
use crate::build::plane_tree::{MAX_DEPTH, Node, near_child};
use crate::scene::Triangles;
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask};

/// A child still to visit, and the interval of each ray inside it.
#[derive(Clone, Copy)]
pub struct Pending<A> {
    node: A,
    enter: Row,
    leave: Row,
}

/// A child, and the interval of each ray inside it.
type Part<S, L> = (u32, <L as Width>::Vector<S>, <L as Width>::Vector<S>);

impl<T: Sync + 'static> PacketTree for T
where
    for<'a> &'a T: Planes,
{
    type Pending<'a> = Pending<<&'a T as Planes>::At>;
    type Single<'a> = plane_dir::Walk<&'a T>;

    fn single(&self) -> Self::Single<'_> {
        plane_dir::Walk(self)
    }

    fn stack(&self) -> Vec<Self::Pending<'_>> {
        let blank = Pending {
            node: self.root(),
            enter: [0.0; MOST],
            leave: [0.0; MOST],
        };
        vec![blank; MAX_DEPTH + 1]
    }

    #[inline(always)]
    fn follow_packet<'a, S: Simd, Q: Query, C: Counters, L: Width>(
        &'a self,
        simd: S,
        triangles: (&Triangles, &Blocks),
        rays: &[Ray],
        packet: (&mut Packet, Group),
        stack: &mut [Self::Pending<'a>],
        counters: &mut [C],
    ) {
        follow::<S, _, Q, C, L>(simd, self, triangles, rays, packet, stack, counters);
    }
}

#[inline(always)]
fn follow<S: Simd, T: Planes, Q: Query, C: Counters, L: Width>(
    simd: S,
    tree: T,
    (scene, mut blocks): (&Triangles, &Blocks),
    rays: &[Ray],
    (packet, group): (&mut Packet, Group),
    stack: &mut [Pending<T::At>],
    counters: &mut [C],
) {
    let whole = blocks;
    let lead = group.lead;
    let charged = packet.places[lead];
    let mut waiting = 0;
    let mut node = tree.root();
    let mut enter = packet::load::<S, L>(simd, &packet.enter(group));
    let mut leave = packet::load::<S, L>(simd, &packet.reach);
    'walk: loop {
        let (parts, empty) = match tree.node(node) {
            Node::Axis {
                axis,
                split,
                empty,
                link,
                ..
            } => {
                counters[charged].step_axis();
                let o = packet::load::<S, L>(simd, &packet.o[axis]);
                let inv = packet::load::<S, L>(simd, &packet.inv[axis]);
                let slack = packet::load::<S, L>(simd, &packet.slack[axis]);
                let distance = (L::Vector::splat(simd, split) - o) * inv;
                // What is not a number bounds nothing.
                let near: Part<S, L> = (
                    near_child(link, group.signs),
                    enter,
                    keep_min_each(distance + slack, leave),
                );
                let far = (near.0 ^ 1, keep_max_each(distance - slack, enter), leave);
                ([near, far], empty)
            }
            Node::Oblique {
                normal,
                offset,
                children,
                empty,
            } => {
                counters[charged].step_oblique();
                let plane = (normal, offset, children);
                let parts = oblique::<S, L>(simd, packet, lead, plane, (enter, leave));
                (parts, empty)
            }
            Node::Leaf { first, count } => {
                let own = match tree.inside((node, first, count), (scene, whole)) {
                    Inside::Triangles(own) => own,
                    Inside::Part(root) => {
                        node = root;
                        continue;
                    }
                };
                counters[charged].leaf(count);
                let lanes = packet::live::<S, L>(enter, leave) & group.lanes;
                if count != 0 {
                    if T::PARTS && !std::ptr::eq(own, blocks) {
                        packet.settle::<S, Q, C>(simd, (blocks, rays), counters);
                        blocks = own;
                    }
                    packet_leaf::test::<S, Q, C, L>(
                        simd,
                        (blocks, rays),
                        (first, count),
                        packet,
                        (lanes, &leave),
                        counters,
                    );
                }
                let reach = packet::load::<S, L>(simd, &packet.reach);
                loop {
                    if waiting == 0 {
                        break 'walk;
                    }
                    waiting -= 1;
                    let next = &stack[waiting];
                    enter = packet::load::<S, L>(simd, &next.enter);
                    leave = packet::load::<S, L>(simd, &next.leave).min(reach);
                    if packet::live::<S, L>(enter, leave) != 0 {
                        node = next.node;
                        continue 'walk;
                    }
                }
            }
        };
        // Where no ray is left, there is nothing; of children on the way an empty one is not visited.
        let [first, second] = parts;
        if !on_way::<S, L>(first, empty) {
            // If that is empty too, the walk finds so itself.
            (enter, leave) = (second.1, second.2);
            node = tree.sibling(node, second.0);
            continue;
        }
        if on_way::<S, L>(second, empty) {
            let next = &mut stack[waiting];
            next.node = tree.sibling(node, second.0);
            packet::store::<S, L>(second.1, &mut next.enter);
            packet::store::<S, L>(second.2, &mut next.leave);
            waiting += 1;
        }
        (enter, leave) = (first.1, first.2);
        node = tree.sibling(node, first.0);
    }
    if T::PARTS {
        packet.settle::<S, Q, C>(simd, (blocks, rays), counters);
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
    packet: &Packet,
    lead: usize,
    (normal, offset, children): ([f32; 3], f32, u32),
    (enter, leave): (L::Vector<S>, L::Vector<S>),
) -> [Part<S, L>; 2] {
    let speed = along::<S, L>(simd, normal, &packet.d);
    let least = L::Vector::splat(simd, f32::MIN_POSITIVE).copysign(speed);
    let inv = L::Vector::splat(simd, 1.0) / (speed + least);
    let height = L::Vector::splat(simd, offset) - along::<S, L>(simd, normal, &packet.o);
    let slack = packet::load::<S, L>(simd, &packet.oblique_pad) * inv.abs();
    let distance = height * inv;
    // What is not a number bounds nothing.
    let near_leave = keep_min_each(distance + slack, leave);
    let far_enter = keep_max_each(distance - slack, enter);
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
