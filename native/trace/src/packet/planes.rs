// SPDX-License-Identifier: GPL-3.0-or-later
//! Packet traversal of plane trees: the steps of [`crate::single::planes::dir`] with one ray per lane. The rays of a
//! packet may disagree about the near side of an oblique plane; the first ray decides the order, and each ray
//! keeps its own interval in both children.

use crate::packet::walk::PacketTree;
use crate::packet::{self, Group, MOST, Packet, Width, leaf as packet_leaf};
use crate::single::planes::dir as plane_dir;
use crate::tile::Row;
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask};
use halfspace_geom::bound::{keep_max_each, keep_min_each};
use halfspace_leaf::{Job, Leaf};
use halfspace_nodes::lazy_tree::LazyTree;
use halfspace_nodes::plane_tree::{MAX_DEPTH, Node, PlaneTree, near_child};
use halfspace_nodes::planes::{Inside, Planes};
use halfspace_ray::Ray;
use halfspace_ray::query::{Counters, Query};

/// A stack entry: a node and the interval of each ray in it.
#[derive(Clone, Copy)]
pub struct Pending<A> {
    node: A,
    enter: Row,
    leave: Row,
}

/// A child's number and the interval of each ray in it.
type Part<S, L> = (u32, <L as Width>::Vector<S>, <L as Width>::Vector<S>);

macro_rules! packets_of_planes {
    ($tree:ty) => {
        impl PacketTree for $tree {
            type Pending<'a> = Pending<<&'a $tree as Planes>::At>;
            type Single<'a> = plane_dir::Walk<&'a $tree>;

            fn single(&self) -> Self::Single<'_> {
                plane_dir::Walk(self)
            }

            fn stack(&self) -> Vec<Self::Pending<'_>> {
                let blank = Pending {
                    node: Planes::root(self),
                    enter: [0.0; MOST],
                    leave: [0.0; MOST],
                };
                vec![blank; MAX_DEPTH + 1]
            }

            #[inline(always)]
            fn follow_packet<'a, S: Simd, Q: Query, C: Counters, L: Width>(
                &'a self,
                simd: S,
                triangles: Job<'_>,
                rays: &[Ray],
                packet: (&mut Packet, Group),
                stack: &mut [Self::Pending<'a>],
                counters: &mut [C],
            ) {
                follow::<S, _, Q, C, L>(simd, self, triangles, rays, packet, stack, counters);
            }
        }
    };
}

packets_of_planes!(PlaneTree);
packets_of_planes!(LazyTree);

/// Traverses the tree with one group of a packet.
#[inline(always)]
fn follow<S: Simd, T: Planes, Q: Query, C: Counters, L: Width>(
    simd: S,
    tree: T,
    Job { scene, mut blocks }: Job<'_>,
    rays: &[Ray],
    (packet, group): (&mut Packet, Group),
    stack: &mut [Pending<T::At>],
    counters: &mut [C],
) {
    let whole = blocks;
    // Count all visits for the group's first ray.
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
                // Ignore a distance that is NaN: the interval keeps its end.
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
                let own = match tree.inside(
                    node,
                    Leaf { first, count },
                    Job {
                        scene,
                        blocks: whole,
                    },
                ) {
                    Inside::Triangles(own) => own,
                    Inside::Part(root) => {
                        node = root;
                        continue;
                    }
                };
                // Test the rays whose interval in this leaf is not empty.
                counters[charged].leaf(count);
                let lanes = packet::live::<S, L>(enter, leave) & group.lanes;
                if count != 0 {
                    // In a tree built in parts, finish the hits in the blocks of the part that is left.
                    if T::PARTS && !std::ptr::eq(own, blocks) {
                        packet.settle::<S, Q, C>(simd, (blocks, rays), counters);
                        blocks = own;
                    }
                    packet_leaf::test::<S, Q, C, L>(
                        simd,
                        (blocks, rays),
                        Leaf { first, count },
                        packet,
                        (lanes, &leave),
                        counters,
                    );
                }
                let reach = packet::load::<S, L>(simd, &packet.reach);
                // Pop entries until one is met by a ray that has no nearer hit.
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
        // Visit the children met by some ray, and skip empty ones.
        let [first, second] = parts;
        if !on_way::<S, L>(first, empty) {
            // The second child may be empty or missed too; its own node or leaf then ends the branch.
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

/// Whether a child holds something and some ray meets it.
#[inline(always)]
fn on_way<S: Simd, L: Width>((child, enter, leave): Part<S, L>, empty: u32) -> bool {
    empty >> (child & 1) & 1 == 0 && packet::live::<S, L>(enter, leave) != 0
}

/// The two children of an oblique node with the interval of each ray in them, the near child of the ray `lead`
/// first.
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
    // Ignore a distance that is NaN: the interval keeps its end.
    let near_leave = keep_min_each(distance + slack, leave);
    let far_enter = keep_max_each(distance - slack, enter);
    // For rays that go down through the plane, exchange near and far.
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

/// Dot products of a normal with one vector per lane.
#[inline(always)]
fn along<S: Simd, L: Width>(simd: S, [x, y, z]: [f32; 3], v: &[Row; 3]) -> L::Vector<S> {
    let first = packet::load::<S, L>(simd, &v[0]) * L::Vector::splat(simd, x);
    let second = packet::load::<S, L>(simd, &v[1]) * L::Vector::splat(simd, y);
    let third = packet::load::<S, L>(simd, &v[2]) * L::Vector::splat(simd, z);
    first + second + third
}
