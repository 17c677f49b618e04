// SPDX-License-Identifier: GPL-3.0-or-later
//! Packet traversal of box trees: all boxes of a node are tested against the bounds of the group at once, then those
//! that are left against all rays, one ray per lane. The next box is the one that the first active ray in it enters
//! soonest, or, for any hits, the one in the last slot. At a turned node all rays are turned at once, with the error
//! bounds of [`halfspace_single::objects::obb`], and tested against each box.

use crate::packet::bundle::{Bundle, farthest};
use crate::packet::leaf::{self, Active};
use crate::packet::planes::along;
use crate::packet::traversal::PacketTree;
use crate::packet::{self, Group, MOST, Packet, Width};
use crate::tile::Row;
use fearless_simd::{Select, Simd, SimdBase, SimdFloat};
use halfspace_geom::bound::{keep_max_each, keep_min_each};
use halfspace_leaf::Leaf;
use halfspace_nodes::box_tree::{BoxTree, Wide};
use halfspace_nodes::obb_tree::{Boxes, Inner, ObbTree, Rotation, WIDTH};
use halfspace_nodes::plane_tree::MAX_DEPTH;
use halfspace_ray::query::{Counters, Query};
use halfspace_single::objects::boxes::BoxTraversal;
use halfspace_single::objects::obb::{ObbTraversal, coefficients};
use halfspace_trace::input::Input;
use halfspace_trace::stack::{Entry, make_room};

/// A stack entry: a box still to visit and the entry distance of each ray, infinite for rays that miss it.
#[derive(Clone, Copy)]
pub struct BoxEntry {
    /// Entry distance of the first ray that hits the box; the sort key.
    first: f32,
    link: u32,
    count: u32,
    /// Mask of the rays that hit the box.
    lanes: u64,
    enter: Row,
}

impl Entry for BoxEntry {
    #[inline(always)]
    fn enter(&self) -> f32 {
        self.first
    }
}

/// Implements packets for trees of `$width` boxes per node; rays alone in their group take the traversal `$single`.
macro_rules! packets {
    ([$($of:tt)*] $tree:ty, $width:expr, $single:ident<$($given:tt),*>) => {
        impl<$($of)*> PacketTree for $tree {
            type Entry<'a> = BoxEntry;
            type Single<'a>
                = $single<$($given),*>
            where
                Self: 'a;

            fn single(&self) -> Self::Single<'_> {
                $single(self)
            }

            fn stack(&self) -> Vec<BoxEntry> {
                let blank = BoxEntry {
                    first: 0.0,
                    link: 0,
                    count: 0,
                    lanes: 0,
                    enter: [0.0; MOST],
                };
                // Each level leaves at most all children but one on the stack, and the lowest level all of them.
                vec![blank; (MAX_DEPTH + 1) * ($width - 1) + 2 * $width]
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
                trace::<S, _, Q, C, L, { $width }>(simd, self, input, packet, group, stack, counters);
            }
        }
    };
}

packets!([const W: usize] BoxTree<W>, W, BoxTraversal<'a, W>);
packets!([] ObbTree, WIDTH, ObbTraversal<'a>);

/// Traverses a tree with one group of a packet. Steps and leaves are counted for the group's first ray.
#[inline(always)]
fn trace<S: Simd, T: Boxes<W>, Q: Query, C: Counters, L: Width, const W: usize>(
    simd: S,
    tree: &T,
    input: Input<'_>,
    packet: &mut Packet,
    group: Group,
    stack: &mut [BoxEntry],
    counters: &mut [C],
) {
    let charged = packet.places[group.lead];
    let slabs = slabs::<S, L>(simd, packet);
    let bundle = Bundle::new(simd, packet, group);
    let mut far = farthest(simd, packet, group);
    // Leaves need no exit distances of boxes, only the ends of the rays.
    let ends = packet::load::<S, L>(simd, &packet.reach);
    let mut enters = packet.enter(group);
    let mut size = 0;
    let Some(mut inner) = tree.inner(0, tree.root()) else {
        return;
    };
    loop {
        let rays: Rays<'_, S, L> = Rays {
            slabs: &slabs,
            inside: packet::load::<S, L>(simd, &enters),
            reach: packet::load::<S, L>(simd, &packet.reach),
        };
        if C::COUNTS {
            let lanes = packet::live::<S, L>(rays.inside, rays.reach);
            packet.join(lanes, group, counters);
        }
        let Inner { node, rotation } = inner;
        if let Some(rotation) = rotation {
            counters[charged].step_oblique();
            rays.push_turned::<Q, W>(simd, packet, rotation, node, stack, &mut size);
        } else {
            counters[charged].step_boxes();
            let some = bundle.meets(simd, node, far);
            // Choose the near and the far plane row of each axis; the signs are the same for all rays.
            let side =
                |k: usize, far: u32| &node.bounds[k + 3 * ((group.signs >> k & 1) ^ far) as usize];
            let near = [side(0, 0), side(1, 0), side(2, 0)];
            let far = [side(0, 1), side(1, 1), side(2, 1)];
            rays.push::<Q, W>(
                simd,
                #[inline(always)]
                |k, child| [near[k][child], far[k][child]].map(|side| L::Vector::splat(simd, side)),
                node,
                some,
                stack,
                &mut size,
            );
        }

        // Pop the nearest box, and test leaves until an inner node comes up.
        inner = loop {
            if size == 0 {
                return;
            }
            size -= 1;
            // Drop rays that have ended, or whose best hit has come before this box, since it was pushed.
            let next = &stack[size];
            let lanes = if Q::ANY {
                next.lanes & !u64::from(packet.blocked)
            } else {
                let enter = packet::load::<S, L>(simd, &next.enter);
                let reach = packet::load::<S, L>(simd, &packet.reach);
                packet::live::<S, L>(enter, reach) & group.lanes
            };
            if lanes == 0 {
                continue;
            }
            if let Some(inner) = tree.inner(next.link, next.count) {
                if !Q::ANY {
                    enters = next.enter;
                }
                break inner;
            }
            let (first, count) = (next.link, next.count as usize);
            let own = Leaf { first, count };
            // Prefetch the leaf, and the entry that follows it.
            input.blocks.fetch_ahead(own.first);
            if let Some(further) = stack[..size].last() {
                tree.fetch_ahead(further.link, further.count, input.blocks);
            }
            counters[charged].leaf(own.count);
            packet.join(lanes, group, counters);
            let active = Active {
                lanes,
                leave: &ends,
            };
            leaf::test::<S, Q, C, L>(simd, input, own, packet, active, counters);
            far = farthest(simd, packet, group);
        };
    }
}

/// The rays of a group at a node.
struct Rays<'a, S: Simd, L: Width> {
    /// Per axis, or per row of a rotation, the coefficients of slab tests.
    slabs: &'a [[L::Vector<S>; 3]; 3],
    /// Distances at which the rays enter the node, infinite for rays that miss it.
    inside: L::Vector<S>,
    reach: L::Vector<S>,
}

impl<S: Simd, L: Width> Rays<'_, S, L> {
    /// [`Self::push`] for all boxes of a turned node. The signs of the turned directions differ between rays.
    #[inline(always)]
    fn push_turned<Q: Query, const W: usize>(
        &self,
        simd: S,
        packet: &Packet,
        rotation: &Rotation,
        node: &Wide<W>,
        stack: &mut [BoxEntry],
        size: &mut usize,
    ) {
        let slabs = [0, 1, 2].map(
            #[inline(always)]
            |k: usize| turned::<S, L>(simd, packet, rotation.row(k)),
        );
        let down = slabs.map(
            #[inline(always)]
            |[inv, ..]| inv.simd_lt(L::Vector::splat(simd, 0.0)),
        );
        let there = (0..W).fold(0, |mask, child| {
            mask | u64::from(node.count[child] != 0) << child
        });
        let rays: Rays<'_, S, L> = Rays {
            slabs: &slabs,
            ..*self
        };
        rays.push::<Q, W>(
            simd,
            #[inline(always)]
            |k, child| {
                let [low, high] =
                    [k, k + 3].map(|row| L::Vector::splat(simd, node.bounds[row][child]));
                [down[k].select(high, low), down[k].select(low, high)]
            },
            node,
            there,
            stack,
            size,
        );
    }

    /// Tests the rays against the boxes of `some` and pushes those that any of them hits: for nearest hits the box that
    /// its first ray enters soonest on top, for any hits in the order of the slots. `sides` returns the planes of entry
    /// and of exit across an axis, of a child.
    #[inline(always)]
    fn push<Q: Query, const W: usize>(
        &self,
        simd: S,
        sides: impl Fn(usize, usize) -> [L::Vector<S>; 2],
        node: &Wide<W>,
        some: u64,
        stack: &mut [BoxEntry],
        size: &mut usize,
    ) {
        let base = *size;
        let mut left = some;
        while left != 0 {
            let child = left.trailing_zeros() as usize % W;
            left &= left - 1;
            let (mut enter, mut leave) = (self.inside, self.reach);
            for (k, &[inv, before, behind]) in self.slabs.iter().enumerate() {
                let [soon, late] = sides(k, child);
                // Ignore a distance that is NaN.
                enter = keep_max_each(soon.mul_add(inv, before), enter);
                leave = keep_min_each(late.mul_add(inv, behind), leave);
            }
            // The inverted bounds of an empty slot do not stop a ray that no axis bounds, so check the count.
            let lanes = packet::live::<S, L>(enter, leave);
            if lanes == 0 || node.count[child] == 0 {
                continue;
            }
            let (link, count) = (node.link[child], node.count[child]);
            if Q::ANY {
                let entry = &mut stack[*size];
                (entry.link, entry.count, entry.lanes) = (link, count, lanes);
                *size += 1;
                continue;
            }
            // Rays that miss this box are inactive in the subtree.
            let outside = L::Vector::splat(simd, f32::INFINITY);
            let mut row = [f32::INFINITY; MOST];
            packet::store::<S, L>(enter.simd_le(leave).select(enter, outside), &mut row);
            let first = row[lanes.trailing_zeros() as usize % MOST];
            let at = make_room(stack, base, size, first);
            stack[at] = BoxEntry {
                first,
                link,
                count,
                lanes,
                enter: row,
            };
        }
    }
}

/// The coefficients of the slab tests, per axis: the factor of a plane's coordinate, and the terms added for
/// entry and for exit planes. These are [`halfspace_trace::slabs::Slabs`] with one ray per lane.
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

/// The coefficients for the planes along a row of a rotation.
#[inline(always)]
fn turned<S: Simd, L: Width>(simd: S, packet: &Packet, row: [f32; 3]) -> [L::Vector<S>; 3] {
    let speed = along::<S, L>(simd, row, &packet.d);
    let height = along::<S, L>(simd, row, &packet.o);
    let pad = packet::load::<S, L>(simd, &packet.oblique_pad);
    coefficients(simd, speed, height, pad)
}
