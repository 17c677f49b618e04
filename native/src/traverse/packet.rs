// SPDX-License-Identifier: GPL-3.0-or-later
//! Packets of rays: 4, 8 or 16 that follow each other in a batch, one to a lane (Wald et al. 2001; Wald
//! 2004). They need not have anything in common; those whose directions have the same signs go together,
//! the near child of a plane across an axis being the same for all of them, and one that is left alone
//! is walked alone, as is one that is odd in any way.
//!
//! Each ray has an interval of its own in each node. It takes part as long as that is not empty, so no
//! ray's answer depends on its company: what its own walk would visit, the packet visits with it.

use super::blocks::Blocks;
use super::frame::{FrameRay, PRUNE};
use super::query::{Counters, Query};
use super::ray::{Hit, Ray};
use super::tile::{Held, LANES, Row, bits};
use super::tile_verdict;
use crate::geom::verdict::verdict_within;
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask, f32x4, f32x8, f32x16, mask32x16};

mod fill;

/// Rays of the largest packet.
pub const MOST: usize = LANES;

/// How many rays make a packet.
pub trait Width: Sync {
    /// The vector with as many lanes.
    type Vector<S: Simd>: SimdFloat<S, Element = f32>;
    /// Its lanes.
    const RAYS: usize;
}

/// Packets of 4.
pub struct Four;

/// Packets of 8.
pub struct Eight;

/// Packets of 16.
pub struct Sixteen;

impl Width for Four {
    type Vector<S: Simd> = f32x4<S>;
    const RAYS: usize = 4;
}

impl Width for Eight {
    type Vector<S: Simd> = f32x8<S>;
    const RAYS: usize = 8;
}

impl Width for Sixteen {
    type Vector<S: Simd> = f32x16<S>;
    const RAYS: usize = 16;
}

/// The part of a row that a packet of this width has.
#[inline(always)]
pub fn load<S: Simd, L: Width>(simd: S, row: &Row) -> L::Vector<S> {
    L::Vector::from_slice(simd, &row[..L::RAYS])
}

/// Writes it.
#[inline(always)]
pub fn store<S: Simd, L: Width>(vector: L::Vector<S>, row: &mut Row) {
    vector.store_slice(&mut row[..L::RAYS]);
}

/// The rays that take part where these are their intervals. One that is not a number ends nothing.
#[inline(always)]
pub fn live<S: Simd, L: Width>(enter: L::Vector<S>, leave: L::Vector<S>) -> u64 {
    enter.simd_le(leave).to_bitmask()
}

/// Up to 16 rays, and what each has found. Packets share one after another, as most of it is the same size
/// whatever they are.
pub struct Packet {
    /// Origins per axis.
    pub o: [Row; 3],
    /// Directions per axis, in the frame.
    pub d: [Row; 3],
    /// Reciprocal directions.
    pub inv: [Row; 3],
    /// Bounds on the errors of distances to planes across each axis.
    pub slack: [Row; 3],
    /// Bounds on the errors of heights over oblique planes.
    pub oblique_pad: Row,
    /// Largest distance along an axis between an origin and any point of the scene.
    pub span: Row,
    /// Where rays enter the scene, or begin.
    pub start: Row,
    /// How far each ray still has to look.
    pub reach: Row,
    /// The box of the origins.
    pub(super) origins: [[f32; 3]; 2],
    /// The box of the directions of rays with a common origin: its middle, and half its extent.
    pub(super) fan: Option<[[f32; 3]; 2]>,
    /// Units of the frame in one of the scene.
    to_frame: Row,
    /// Added to distances in the frame for the rounding of the smallest ones.
    last_place: Row,
    t_min: Row,
    /// The best hits, or how far the rays go, in the scene's units.
    t: Row,
    u: Row,
    v: Row,
    id: [u32; MOST],
    held: Held<1>,
    /// Sign bits of directions, as bits 0, 1 and 2 of each byte.
    signs: [u32; MOST],
    /// Rays that are to be walked alone.
    odd: u64,
    /// The places of the rays among those that they are taken from.
    pub places: [usize; MOST],
    /// How many rays there are.
    pub count: usize,
    /// Rays of which it is known that something is in their way, where that is asked.
    pub(super) blocked: u16,
}

/// A few rays of a packet that go together.
#[derive(Clone, Copy)]
pub struct Group {
    /// A bit for each.
    pub lanes: u64,
    /// The first of them.
    pub lead: usize,
    /// Their sign bits, as in [`super::frame::FrameRay::signs`].
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
            held: Held::none(),
            signs: [0; MOST],
            odd: 0,
            places: [0; MOST],
            count: 0,
            blocked: 0,
        }
    }
}

impl Packet {
    /// The rays among `left` that go with the first of them.
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

    /// What [`super::stream`] needs of a ray of the packet, unless it is odd.
    #[inline(always)]
    pub(super) fn framed(&self, lane: usize) -> Option<FrameRay<'static>> {
        let of = |rows: &[Row; 3]| [rows[0][lane], rows[1][lane], rows[2][lane]];
        (self.odd >> lane & 1 == 0).then(|| FrameRay {
            o: of(&self.o),
            d: of(&self.d),
            signs: self.signs[lane],
            t_min: self.start[lane],
            t_max: self.reach[lane],
            span: self.span[lane],
            to_frame: f64::from(self.to_frame[lane]),
            last_place: self.last_place[lane],
            ..FrameRay::NOTHING
        })
    }

    /// Where each ray of a group enters the scene; the others nowhere.
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

    /// Takes rays of which f32 cannot rule out that they hit a triangle, its number and where its words are; `sure`:
    /// those of which it is certain. `quotient`: the distance in the frame as numerator and denominator, each
    /// with a bound on its error.
    #[inline(always)]
    pub(super) fn offer<S: Simd, Q: Query, C: Counters>(
        &mut self,
        simd: S,
        (blocks, rays): (&Blocks, &[Ray]),
        (open, sure): (u16, u16),
        quotient: [f32x16<S>; 4],
        words: (u32, usize, usize),
        counters: &mut [C],
    ) {
        let id = words.0;
        let mut open = open;
        if !Q::ANY {
            for i in 0..MOST {
                open &= !(u16::from((self.id[i] == id) | (self.held.id[0][i] == id)) << i);
            }
        }
        let sure = sure & open;
        if sure != 0 {
            let row = |row: &Row| f32x16::from_slice(simd, row);
            let (to_frame, last_place) = (row(&self.to_frame), row(&self.last_place));
            let prune = f32x16::splat(simd, PRUNE);
            let soonest = row(&self.t_min) * to_frame * prune + last_place;
            let latest = row(&self.t) * to_frame * f32x16::splat(simd, 2.0 - PRUNE);
            let limits = [soonest, latest, last_place];
            let known = row(&self.reach);
            let (taken, reach) = if Q::ANY {
                (
                    within(simd, quotient, limits) & sure,
                    f32x16::splat(simd, f32::NEG_INFINITY),
                )
            } else {
                let (taken, late) = self.held.take(simd, (0, sure), quotient, limits, words);
                (taken, (late * prune + last_place).min(known))
            };
            if taken != 0 {
                open &= !taken;
                if Q::ANY {
                    self.blocked |= taken;
                }
                let lanes = mask32x16::from_bitmask(simd, u64::from(taken));
                let reach: f32x16<S> = lanes.select(reach, known);
                reach.store_slice(&mut self.reach);
            }
        }
        while open != 0 {
            let i = open.trailing_zeros() as usize % MOST;
            open &= open - 1;
            counters[self.places[i]].verdict();
            let ray = &rays[self.places[i]];
            self.verdict::<Q>(ray, i, (id, blocks.corners_at(words.1, words.2)));
        }
    }

    /// Puts one ray's candidate to the verdict.
    #[inline(never)]
    fn verdict<Q: Query>(&mut self, ray: &Ray, i: usize, (id, corners): (u32, [[f32; 3]; 3])) {
        let best = self.t[i];
        let Some(found) = verdict_within(ray.o, ray.d, corners, [ray.t_min, best]) else {
            return;
        };
        if !ray.reaches(found.t) || !Hit::precedes((found.t, id), (best, self.id[i])) {
            return;
        }
        if Q::ANY {
            self.blocked |= 1 << i;
        }
        self.t[i] = found.t;
        self.u[i] = found.u;
        self.v[i] = found.v;
        self.id[i] = id;
        let reach = found.t * self.to_frame[i] * PRUNE + self.last_place[i];
        self.reach[i] = if Q::ANY {
            f32::NEG_INFINITY
        } else {
            reach.min(self.reach[i])
        };
    }

    /// Works out the hits that are held back, once no nearer ones can come.
    #[inline(always)]
    pub fn settle<S: Simd, Q: Query, C: Counters>(
        &mut self,
        simd: S,
        blocks: (&Blocks, &[Ray]),
        counters: &mut [C],
    ) {
        if self.held.lanes[0] != 0 {
            self.release::<S, Q, C>(simd, blocks, counters);
        }
    }

    /// The same where there are some. One function for all trees.
    #[inline(never)]
    fn release<S: Simd, Q: Query, C: Counters>(
        &mut self,
        simd: S,
        blocks: (&Blocks, &[Ray]),
        counters: &mut [C],
    ) {
        simd.vectorize(
            #[inline(always)]
            || self.released::<S, Q, C>(simd, blocks, counters),
        );
    }

    #[inline(always)]
    fn released<S: Simd, Q: Query, C: Counters>(
        &mut self,
        simd: S,
        (blocks, rays): (&Blocks, &[Ray]),
        counters: &mut [C],
    ) {
        let lanes = self.held.lanes[0];
        let corners = tile_verdict::gathered(blocks, &self.held, 0);
        let to_scene = self.to_frame.map(|x| 1.0 / f64::from(x));
        let lines = (&self.o, &self.d, &to_scene);
        let (certain, [t, u, v]) = tile_verdict::apart(simd, lines, &corners);
        let mut left = lanes;
        while left != 0 {
            let i = left.trailing_zeros() as usize % MOST;
            left &= left - 1;
            counters[self.places[i]].verdict();
            let id = self.held.id[0][i];
            if certain >> i & 1 == 1 {
                // It certainly lies inside the ray's limits.
                if Hit::precedes((t[i], id), (self.t[i], self.id[i])) {
                    (self.t[i], self.u[i], self.v[i], self.id[i]) = (t[i], u[i], v[i], id);
                }
            } else {
                let (from, n) = self.held.words(0, i);
                let ray = &rays[self.places[i]];
                self.verdict::<Q>(ray, i, (id, blocks.corners_at(from, n)));
            }
        }
        self.held = Held::none();
    }

    /// Takes an answer that was found elsewhere.
    #[inline(always)]
    pub fn know(&mut self, i: usize, hit: Hit) {
        (self.t[i], self.u[i], self.v[i], self.id[i]) = (hit.t, hit.u, hit.v, hit.triangle);
    }

    /// What a ray has found.
    #[inline(always)]
    pub fn hit<Q: Query>(&self, i: usize) -> Hit {
        if Q::ANY && self.blocked >> i & 1 == 1 {
            // Of any hit only that there is one is asked.
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

/// The rays whose distances certainly lie between the first two limits.
#[inline(always)]
fn within<S: Simd>(
    simd: S,
    [t, t_error, det, det_error]: [f32x16<S>; 4],
    [soonest, latest, _]: [f32x16<S>; 3],
) -> u16 {
    let splat = |x: f32| f32x16::splat(simd, x);
    let low = (t - t_error) / (det + det_error) * splat(2.0 - PRUNE);
    let high = (t + t_error) / (det - det_error) * splat(PRUNE);
    let well = det.simd_gt(det_error * splat(4.0));
    bits(well & low.simd_gt(soonest) & low.simd_gt(splat(0.0)) & high.simd_lt(latest))
}
