// SPDX-License-Identifier: GPL-3.0-or-later
//! Packets of rays: 4, 8 or 16 that follow each other in a batch, one to a lane (Wald et al. 2001; Wald
//! 2004). They need not have anything in common; those whose directions have the same signs go together,
//! the near child of a plane across an axis being the same for all of them, and one that is left alone
//! is walked alone, as is one that is odd in any way.
//!
//! Each ray has an interval of its own in each node. It takes part as long as that is not empty, so no
//! ray's answer depends on its company: what its own walk would visit, the packet visits with it.

use super::blocks::Blocks;
use super::bound::{keep_max_each, keep_min_each};
use super::frame::{Frame, PARALLEL_PAD, PRUNE, TINY, U};
use super::query::{Counters, Query};
use super::ray::{Hit, Ray};
use super::tile::{self, Held, LANES, ORDINARY, Row, bits};
use super::tile_verdict;
use crate::geom::vec3::map;
use crate::geom::verdict::verdict_within;
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask, f32x4, f32x8, f32x16, mask32x16};

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

/// The middle of a box of directions, and half its extent with what rounding may add.
#[inline(always)]
fn middle(low: [f32; 3], high: [f32; 3]) -> [[f32; 3]; 2] {
    let (mut middle, mut half) = ([0.0; 3], [0.0; 3]);
    for k in 0..3 {
        middle[k] = 0.5 * (low[k] + high[k]);
        half[k] = 0.5 * (high[k] - low[k]) + 8.0 * U;
    }
    [middle, half]
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
    /// Takes the rays at the packet's places, and forgets all others. `known` are the best hits that they have
    /// already, if there are any; rays end there. Returns those that enter the scene. One function for all trees.
    #[inline(never)]
    pub fn fill<S: Simd>(
        &mut self,
        simd: S,
        frame: &Frame,
        rays: &[Ray],
        known: Option<&[Hit; MOST]>,
    ) -> u64 {
        simd.vectorize(
            #[inline(always)]
            || self.filled(simd, frame, rays, known),
        )
    }

    #[inline(always)]
    fn filled<S: Simd>(
        &mut self,
        simd: S,
        frame: &Frame,
        rays: &[Ray],
        known: Option<&[Hit; MOST]>,
    ) -> u64 {
        self.blocked = 0;
        self.held = Held::none();
        let mut there = self.take(rays);
        if !frame.is_scene() {
            self.odd |= there;
            there = 0;
        }
        if let Some(known) = known {
            for (i, hit) in known.iter().enumerate().take(self.count) {
                if hit.is_hit() {
                    self.know(i, *hit);
                }
            }
        }
        self.odd | self.cut(simd, frame) & there
    }

    /// Takes what is ordinary of the rays, a lane each; returns those lanes.
    #[inline(always)]
    fn take(&mut self, rays: &[Ray]) -> u64 {
        let nowhere = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        let ((mut least, mut most), (mut slowest, mut quickest)) = (nowhere, nowhere);
        let mut there = 0;
        self.odd = 0;
        for i in 0..self.count.min(MOST) {
            let ray = &rays[self.places[i]];
            let size = |v: [f32; 3]| v[0].abs().max(v[1].abs()).max(v[2].abs());
            // A maximum forgets what is not a number, a sum does not.
            let sums = (ray.o[0] + ray.o[1] + ray.o[2]) + (ray.d[0] + ray.d[1] + ray.d[2]);
            let longest = size(ray.d);
            let ordinary = sums.abs() < f32::INFINITY
                && ORDINARY.contains(&longest)
                && size(ray.o) < ORDINARY.end
                && 0.0 <= ray.t_min
                && ray.t_min <= ray.t_max;
            if !ordinary {
                self.odd |= 1 << i;
                self.id[i] = Hit::NONE;
                continue;
            }
            there |= 1 << i;
            let unit = f32::from_bits(longest.to_bits() & 0x7f80_0000);
            let inverse = 1.0 / unit;
            for k in 0..3 {
                self.o[k][i] = ray.o[k];
                self.d[k][i] = ray.d[k] * inverse;
                least[k] = least[k].min(ray.o[k]);
                most[k] = most[k].max(ray.o[k]);
                slowest[k] = slowest[k].min(self.d[k][i]);
                quickest[k] = quickest[k].max(self.d[k][i]);
            }
            let [x, y, z] = map(ray.d, |d| d.to_bits() >> 31);
            self.signs[i] = 0x0101_0101 * (x | y << 1 | z << 2);
            self.to_frame[i] = unit;
            self.t_min[i] = ray.t_min;
            self.t[i] = ray.t_max;
            self.id[i] = Hit::NONE;
        }
        self.origins = [least, most];
        self.fan = (least == most).then(|| middle(slowest, quickest));
        there
    }

    /// Cuts the rays to the scene's box, as [`Frame::ray`] does; returns those that meet it.
    #[inline(always)]
    fn cut<S: Simd>(&mut self, simd: S, frame: &Frame) -> u64 {
        let splat = |x: f32| f32x16::splat(simd, x);
        let bounds = frame.bounds();
        let magnitude = splat(bounds.magnitude());
        let robust = splat(frame.robust());
        let to_frame = tile::load(simd, &self.to_frame);
        let last_place = to_frame.mul_add(splat(f32::from_bits(1)), splat(TINY));
        let far = tile::load(simd, &self.o[0])
            .abs()
            .max(tile::load(simd, &self.o[1]).abs())
            .max(tile::load(simd, &self.o[2]).abs());
        let span = far + magnitude;
        let parallel = splat(U) / span;
        let t_min = tile::load(simd, &self.t_min) * to_frame;
        let t_max = tile::load(simd, &self.t) * to_frame;
        let mut near = t_min * splat(2.0 - PRUNE) - last_place;
        let mut exit = t_max * splat(PRUNE) + last_place;
        for k in 0..3 {
            let o = tile::load(simd, &self.o[k]);
            let d = tile::load(simd, &self.d[k]);
            let pad = (o.abs() + magnitude) * splat(PARALLEL_PAD);
            let slowest = parallel * pad;
            let d = d.abs().simd_lt(slowest).select(slowest.copysign(d), d);
            let inv = splat(1.0) / d;
            let slack = pad * inv.abs();
            let low = (splat(bounds.min[k]) - o) * inv;
            let high = (splat(bounds.max[k]) - o) * inv;
            let back = splat(1.0).copysign(d).simd_lt(splat(0.0));
            // What is not a number bounds nothing.
            near = keep_max_each(back.select(high, low) - slack, near);
            exit = keep_min_each(back.select(low, high) + slack, exit);
            store::<S, Sixteen>(inv, &mut self.inv[k]);
            store::<S, Sixteen>(slack * robust, &mut self.slack[k]);
        }
        store::<S, Sixteen>(span, &mut self.span);
        store::<S, Sixteen>(span * splat(28.0 * U) * robust, &mut self.oblique_pad);
        store::<S, Sixteen>(last_place, &mut self.last_place);
        store::<S, Sixteen>(near, &mut self.start);
        store::<S, Sixteen>(exit, &mut self.reach);
        live::<S, Sixteen>(near, exit)
    }

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
