// SPDX-License-Identifier: GPL-3.0-or-later
//! Packets of 4, 8 or 16 consecutive rays of a batch, one ray per SIMD lane (Wald et al. 2001; Wald 2004).
//!
//! The rays of a packet are split into groups of equal direction signs, because the near child of an axis plane
//! is then the same for the whole group. A ray alone in its group, and an irregular ray, is traced by the
//! single-ray traversal.
//!
//! Each ray keeps its own interval in every node and is active while that interval is not empty. The nodes
//! where a ray is active are thus those of its own single-ray traversal, and its hit does not depend on the
//! other rays.

pub mod boxes;
pub mod kernel;
pub mod leaf;
pub mod planes;
pub mod walk;

use crate::tile::{Held, LANES, Row, bits, verdict as tile_verdict};
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask, f32x4, f32x8, f32x16, mask32x16};
use halfspace_geom::verdict::verdict_within;
use halfspace_leaf::blocks::Blocks;
use halfspace_ray::frame::PRUNE;
use halfspace_ray::query::{Counters, Query};
use halfspace_ray::{FrameRay, Hit, Ray};

mod fill;

/// Number of rays of the largest packet.
pub const MOST: usize = LANES;

/// A packet width: the number of rays and the vector type that holds one number of each.
pub trait Width: Sync {
    /// The vector with one f32 lane per ray.
    type Vector<S: Simd>: SimdFloat<S, Element = f32>;
    /// Number of rays, equal to the number of lanes.
    const RAYS: usize;
}

/// Packets of 4.
#[derive(Debug)]
pub struct Four;

/// Packets of 8.
#[derive(Debug)]
pub struct Eight;

/// Packets of 16.
#[derive(Debug)]
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

/// Loads the first `L::RAYS` lanes of a row.
#[inline(always)]
pub fn load<S: Simd, L: Width>(simd: S, row: &Row) -> L::Vector<S> {
    L::Vector::from_slice(simd, &row[..L::RAYS])
}

/// Stores a vector into the first `L::RAYS` lanes of a row.
#[inline(always)]
pub fn store<S: Simd, L: Width>(vector: L::Vector<S>, row: &mut Row) {
    vector.store_slice(&mut row[..L::RAYS]);
}

/// Mask of the active lanes, those with `enter <= leave`. A NaN in either bound makes its lane inactive.
#[inline(always)]
pub fn live<S: Simd, L: Width>(enter: L::Vector<S>, leave: L::Vector<S>) -> u64 {
    enter.simd_le(leave).to_bitmask()
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
    to_frame: Row,
    /// Error bound of subnormal distances, in the frame ([`halfspace_ray::frame_ray::FrameRay`]).
    last_place: Row,
    t_min: Row,
    /// Distance of the best hit, or the ray's `t_max` if there is none yet, in the scene's units.
    t: Row,
    u: Row,
    v: Row,
    id: [u32; MOST],
    held: Held<1>,
    /// Direction signs, repeated in bits 0, 1 and 2 of each byte.
    signs: [u32; MOST],
    /// Mask of the irregular rays, which are traced one by one.
    odd: u64,
    /// Index of each ray in the caller's slice.
    pub places: [usize; MOST],
    /// Number of rays.
    pub count: usize,
    /// Mask of the rays known to be occluded, for any-hit queries.
    pub blocked: u16,
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

    /// One ray of the packet for [`crate::stream`], `None` if it is irregular.
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

    /// Takes a candidate triangle for several rays and updates their hits and `reach`.
    ///
    /// `open` is the mask of rays whose hit f32 could not rule out, `sure` of those whose hit inside the
    /// triangle f32 has proven. `quotient` is the distance in the frame: numerator, its error bound,
    /// denominator, its error bound. `words` is the triangle's number, then the arguments of
    /// [`Blocks::corners_at`].
    #[inline(always)]
    pub fn offer<S: Simd, Q: Query, C: Counters>(
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
        // Ignore rays that have this triangle as their hit already.
        if !Q::ANY {
            for i in 0..MOST {
                open &= !(u16::from((self.id[i] == id) | (self.held.id[0][i] == id)) << i);
            }
        }
        let sure = sure & open;
        // Accept the sure hits whose distances prove, too, without an exact verdict: hold back those of a
        // nearest-hit query until the traversal ends, and end any-hit rays at once.
        if sure != 0 {
            // Round the limits on the distance inwards, so that a proven hit satisfies them after rounding.
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
        // Decide the remaining candidates exactly, ray by ray.
        while open != 0 {
            let i = open.trailing_zeros() as usize % MOST;
            open &= open - 1;
            counters[self.places[i]].verdict();
            let ray = &rays[self.places[i]];
            self.verdict::<Q>(ray, i, (id, blocks.corners_at(words.1, words.2)));
        }
    }

    /// Applies the exact verdict to one ray's candidate and takes the hit if it precedes the best one.
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

    /// Computes the hits that are held back, at the end of the traversal, when no nearer ones can come.
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

    /// The cold part of [`Self::settle`], compiled once for all trees.
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
        // Compute all distances and weights in f64 lanes, with a mask of those that are certainly rounded
        // right.
        let (certain, [t, u, v]) = tile_verdict::apart(simd, lines, &corners);
        let mut left = lanes;
        while left != 0 {
            let i = left.trailing_zeros() as usize % MOST;
            left &= left - 1;
            counters[self.places[i]].verdict();
            let id = self.held.id[0][i];
            if certain >> i & 1 == 1 {
                // Its distance has been proven to lie inside the ray's interval.
                if Hit::precedes((t[i], id), (self.t[i], self.id[i])) {
                    (self.t[i], self.u[i], self.v[i], self.id[i]) = (t[i], u[i], v[i], id);
                }
            } else {
                let (from, n) = self.held.words(0, i);
                // f64 is not certain: compute this hit exactly.
                let ray = &rays[self.places[i]];
                self.verdict::<Q>(ray, i, (id, blocks.corners_at(from, n)));
            }
        }
        self.held = Held::none();
    }

    /// Takes a hit that was found outside the packet.
    #[inline(always)]
    pub fn know(&mut self, i: usize, hit: Hit) {
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

/// Mask of the rays whose distance `t / det` is certainly positive and between `soonest` and `latest`.
///
/// The quotient's relative rounding is covered by `PRUNE`; the determinant must exceed four times its error
/// bound.
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
