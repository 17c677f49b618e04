// SPDX-License-Identifier: GPL-3.0-or-later
//! The rays of a packet in structure-of-arrays layout, and their division into groups.

use crate::packet::MOST;
use crate::tile::{Deferred, Row};
use halfspace_nodes::projected_tree::CODES;
use halfspace_ray::query::{Counters, Query};
use halfspace_ray::{FrameRay, Hit};
use halfspace_trace::blocker::Blocker;

/// The rays of a packet along the numbered directions of a tree, each projected where the first node has it.
pub struct Projections {
    /// Mask of the directions onto which the rays have been projected.
    pub known: u32,
    /// By direction: heights of the origins, inverse speeds, and error bounds of distances to planes.
    pub rows: [[Row; 3]; CODES],
}

/// Up to 16 rays and their hits, in structure-of-arrays layout. One packet is refilled for consecutive sets of
/// rays; its rows have 16 lanes for every packet width.
pub struct Packet {
    /// Origins per axis, in the frame.
    pub o: [Row; 3],
    /// Directions per axis, in the frame.
    pub d: [Row; 3],
    /// Reciprocal directions per axis.
    pub inv: [Row; 3],
    /// Error bounds of distances to axis planes, per axis.
    pub slack: [Row; 3],
    /// Error bounds of heights above oblique planes.
    pub oblique_pad: Row,
    /// Largest distance along an axis between the origin and any point of the scene.
    pub span: Row,
    /// Distance where each ray enters the scene's box, or its `t_min` if that is larger.
    pub start: Row,
    /// Distance beyond which no hit of the ray is needed, in the frame.
    pub reach: Row,
    /// Bounding box of the origins: minimum and maximum.
    pub origins: [[f32; 3]; 2],
    /// Box of the directions as centre and half extent; `None` if the origins differ.
    pub fan: Option<[[f32; 3]; 2]>,
    /// Scale from distances `t` of the caller's ray to distances in the frame, a power of two.
    pub(super) to_frame: Row,
    /// Error bound of subnormal distances, in the frame ([`halfspace_ray::frame_ray::FrameRay`]).
    pub(super) last_place: Row,
    pub(super) t_min: Row,
    /// Distance of the best hit, or the ray's `t_max` if there is none yet, in the scene's units.
    pub(super) t: Row,
    pub(super) u: Row,
    pub(super) v: Row,
    pub(super) id: [u32; MOST],
    pub(super) deferred: Deferred<1>,
    /// Direction signs, repeated in bits 0, 1 and 2 of each byte.
    pub(super) signs: [u32; MOST],
    /// Mask of the irregular rays, which are traced one by one.
    pub(super) odd: u64,
    /// Index of each ray in the caller's slice.
    pub places: [usize; MOST],
    /// Number of rays.
    pub count: usize,
    /// Mask of the rays known to be occluded, for any-hit queries.
    pub blocked: u16,
    /// The leaf that blocks most rays, of the last packet until this one has another.
    pub blocker: Blocker,
    /// Whether the leaf that blocked most rays of the last packet is tested first.
    pub cache: bool,
    /// The rays along the directions of a tree.
    pub projections: Projections,
}

/// The rays of a packet that are traced together, because their direction signs agree.
#[derive(Clone, Copy)]
pub struct Group {
    /// Mask of the group's lanes.
    pub lanes: u64,
    /// The first of these lanes.
    pub lead: usize,
    /// The common direction signs, as in [`halfspace_ray::frame_ray::FrameRay::signs`].
    pub signs: u32,
}

impl Default for Packet {
    fn default() -> Self {
        let zero = [0.0; MOST];
        Self {
            o: [zero; 3],
            d: [[1.0; MOST]; 3],
            inv: [zero; 3],
            slack: [zero; 3],
            oblique_pad: zero,
            span: zero,
            start: zero,
            reach: zero,
            origins: [[0.0; 3]; 2],
            fan: None,
            to_frame: [1.0; MOST],
            last_place: zero,
            t_min: zero,
            t: zero,
            u: zero,
            v: zero,
            id: [Hit::NONE; MOST],
            deferred: Deferred::none(),
            signs: [0; MOST],
            odd: 0,
            places: [0; MOST],
            count: 0,
            blocked: 0,
            blocker: Blocker::default(),
            cache: false,
            projections: Projections {
                known: 0,
                rows: [[zero; 3]; CODES],
            },
        }
    }
}

impl Packet {
    /// The group of the first lane of `left`: all lanes of `left` with its direction signs, or that lane alone
    /// if its ray is irregular.
    #[inline(always)]
    pub fn group(&self, left: u64) -> Group {
        let lead = left.trailing_zeros() as usize % MOST;
        let signs = self.signs[lead];
        let mut lanes = 1 << lead;
        if self.odd & lanes == 0 {
            for (i, own) in self.signs.iter().enumerate() {
                lanes |= u64::from(*own == signs) << i;
            }
            lanes &= left & !self.odd;
        }
        Group { lanes, lead, signs }
    }

    /// Counts a visit for each of these rays of the group but the first, for which the step or leaf is counted.
    #[inline(always)]
    pub fn join<C: Counters>(&self, lanes: u64, group: Group, counters: &mut [C]) {
        if !C::COUNTS {
            return;
        }
        let mut left = lanes & group.lanes & !(1 << group.lead);
        while left != 0 {
            counters[self.places[left.trailing_zeros() as usize % MOST]].joined();
            left &= left - 1;
        }
    }

    /// One ray of the packet for streams, `None` if it is irregular.
    #[inline(always)]
    pub fn framed(&self, lane: usize) -> Option<FrameRay<'static>> {
        let of = |rows: &[Row; 3]| [rows[0][lane], rows[1][lane], rows[2][lane]];
        (self.odd >> lane & 1 == 0).then(|| FrameRay {
            o: of(&self.o),
            d: of(&self.d),
            signs: self.signs[lane],
            t_min: self.start[lane],
            t_max: self.reach[lane],
            span: self.span[lane],
            oblique_pad: self.oblique_pad[lane],
            to_frame: f64::from(self.to_frame[lane]),
            last_place: self.last_place[lane],
            ..FrameRay::NOTHING
        })
    }

    /// Entry distances of a group's rays; infinity in all other lanes, which makes them inactive.
    #[inline(always)]
    pub fn enter(&self, group: Group) -> Row {
        let mut enter = [f32::INFINITY; MOST];
        for (i, start) in self.start.iter().enumerate() {
            if group.lanes >> i & 1 == 1 {
                enter[i] = *start;
            }
        }
        enter
    }

    /// Takes a hit that was found outside the packet.
    #[inline(always)]
    pub fn set_hit(&mut self, i: usize, hit: Hit) {
        (self.t[i], self.u[i], self.v[i], self.id[i]) = (hit.t, hit.u, hit.v, hit.triangle);
    }

    /// The hit of a ray. For an occluded any-hit ray only [`Hit::is_hit`] has a meaning.
    #[inline(always)]
    pub fn hit<Q: Query>(&self, i: usize) -> Hit {
        if Q::ANY && self.blocked >> i & 1 == 1 {
            // An any-hit query returns existence only; number and weights are placeholders.
            return Hit {
                t: self.t[i],
                triangle: 0,
                u: 0.0,
                v: 0.0,
            };
        }
        if self.id[i] == Hit::NONE {
            return Hit::MISS;
        }
        Hit {
            t: self.t[i],
            triangle: self.id[i],
            u: self.u[i],
            v: self.v[i],
        }
    }
}
