// SPDX-License-Identifier: GPL-3.0-or-later
//! Hits of a packet: proven ones are deferred or end any-hit rays at once, the others get the exact verdict.

use crate::packet::{MOST, Packet};
use crate::tile::verdict::gathered;
use crate::tile::{Candidate, Deferred, Limits, Quotient, StoredTriangle, bits, load};
use fearless_simd::{Select, Simd, SimdBase, SimdMask, f32x16, mask32x16};
use halfspace_geom::verdict::verdict_within;
use halfspace_leaf::Job;
use halfspace_ray::frame::PRUNE;
use halfspace_ray::query::{Counters, Query};
use halfspace_ray::{HitKey, Ray};
use halfspace_trace::input::Input;
use halfspace_trace::verdicts::apart;

impl Packet {
    /// Takes a candidate triangle for several rays and updates their hits and `reach`.
    #[inline(always)]
    pub fn offer<S: Simd, Q: Query, C: Counters>(
        &mut self,
        simd: S,
        input: Input<'_>,
        candidate: &Candidate<S>,
        counters: &mut [C],
    ) {
        let triangle = candidate.triangle;
        let mut open = candidate.open;
        // Ignore rays that have this triangle as their hit already.
        if !Q::ANY {
            for i in 0..MOST {
                let known = (self.id[i] == triangle.id) | (self.deferred.id[0][i] == triangle.id);
                open &= !(u16::from(known) << i);
            }
        }
        let sure = candidate.sure & open;
        if sure != 0 {
            open &= !self.accept::<S, Q>(simd, sure, &candidate.distance, triangle);
        }
        // Decide the remaining candidates exactly, ray by ray.
        while open != 0 {
            let i = open.trailing_zeros() as usize % MOST;
            open &= open - 1;
            counters[self.places[i]].verdict();
            self.verdict::<Q>(&input.rays[self.places[i]], i, triangle, input.job());
        }
    }

    /// Accepts without an exact verdict those sure hits whose distances are certain, too: defers those of a
    /// nearest-hit query, and ends any-hit rays at once. Returns the mask of their rays.
    #[inline(always)]
    fn accept<S: Simd, Q: Query>(
        &mut self,
        simd: S,
        sure: u16,
        distance: &Quotient<S>,
        triangle: StoredTriangle,
    ) -> u16 {
        // Round the limits on the distance inwards, so that a proven hit satisfies them after rounding.
        let (to_frame, last_place) = (load(simd, &self.to_frame), load(simd, &self.last_place));
        let prune = f32x16::splat(simd, PRUNE);
        let limits = Limits {
            soonest: load(simd, &self.t_min) * to_frame * prune + last_place,
            latest: load(simd, &self.t) * to_frame * f32x16::splat(simd, 2.0 - PRUNE),
            last_place,
        };
        let known = load(simd, &self.reach);
        let (taken, reach) = if Q::ANY {
            (
                within(simd, distance, &limits) & sure,
                f32x16::splat(simd, f32::NEG_INFINITY),
            )
        } else {
            let (taken, late) = (self.deferred).take(simd, 0, sure, distance, &limits, triangle);
            (taken, (late * prune + last_place).min(known))
        };
        if taken != 0 {
            if Q::ANY {
                self.blocked |= taken;
            }
            let lanes = mask32x16::from_bitmask(simd, u64::from(taken));
            let reach: f32x16<S> = lanes.select(reach, known);
            reach.store_slice(&mut self.reach);
        }
        taken
    }

    /// Applies the exact verdict to one ray's candidate and takes the hit if it precedes the best one.
    #[inline(never)]
    fn verdict<Q: Query>(&mut self, ray: &Ray, i: usize, triangle: StoredTriangle, job: Job<'_>) {
        let id = triangle.id;
        let best = HitKey::new(self.t[i], self.id[i]);
        let corners = triangle.scene_corners(job);
        let span = [ray.t_min, best.last_before(id)];
        let Some(found) = verdict_within(ray.o, ray.d, corners, span) else {
            return;
        };
        if !ray.reaches(found.t) || !HitKey::new(found.t, id).precedes(best) {
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

    /// Computes the deferred hits at the end of the traversal, when no nearer ones can come.
    #[inline(always)]
    pub fn decide_deferred<S: Simd, Q: Query, C: Counters>(
        &mut self,
        simd: S,
        input: Input<'_>,
        counters: &mut [C],
    ) {
        if self.deferred.lanes[0] != 0 {
            self.decide_all::<S, Q, C>(simd, input, counters);
        }
    }

    /// The cold part of [`Self::decide_deferred`], compiled once for all trees.
    #[inline(never)]
    fn decide_all<S: Simd, Q: Query, C: Counters>(
        &mut self,
        simd: S,
        input: Input<'_>,
        counters: &mut [C],
    ) {
        simd.vectorize(
            #[inline(always)]
            || self.decide_lanes::<S, Q, C>(simd, input, counters),
        );
    }

    /// [`Self::decide_all`] in the instruction set of the caller.
    #[inline(always)]
    fn decide_lanes<S: Simd, Q: Query, C: Counters>(
        &mut self,
        simd: S,
        input: Input<'_>,
        counters: &mut [C],
    ) {
        let lanes = self.deferred.lanes[0];
        let corners = gathered(input.job(), &self.deferred, 0);
        let to_scene = self.to_frame.map(|x| 1.0 / f64::from(x));
        // Compute all distances and weights in f64 lanes, with a mask of those that are certainly rounded correctly.
        let (certain, [t, u, v]) = apart(simd, &self.o, &self.d, &to_scene, &corners);
        let mut left = lanes;
        while left != 0 {
            let i = left.trailing_zeros() as usize % MOST;
            left &= left - 1;
            counters[self.places[i]].verdict();
            let id = self.deferred.id[0][i];
            if certain >> i & 1 == 1 {
                // Its distance has been proven to lie inside the ray's interval.
                if HitKey::new(t[i], id).precedes(HitKey::new(self.t[i], self.id[i])) {
                    (self.t[i], self.u[i], self.v[i], self.id[i]) = (t[i], u[i], v[i], id);
                }
            } else {
                // f64 is not certain: compute this hit exactly.
                let triangle = self.deferred.triangle(0, i);
                self.verdict::<Q>(&input.rays[self.places[i]], i, triangle, input.job());
            }
        }
        self.deferred = Deferred::none();
    }
}

/// Mask of the rays whose distance is certainly positive and inside the limits.
///
/// The quotient's relative rounding is covered by `PRUNE`; the determinant must exceed four times its error
/// bound.
#[inline(always)]
fn within<S: Simd>(simd: S, distance: &Quotient<S>, limits: &Limits<S>) -> u16 {
    let splat = |x: f32| f32x16::splat(simd, x);
    let &Quotient {
        t,
        t_error,
        det,
        det_error,
    } = distance;
    let low = (t - t_error) / (det + det_error) * splat(2.0 - PRUNE);
    let high = (t + t_error) / (det - det_error) * splat(PRUNE);
    let well = det.simd_gt(det_error * splat(4.0));
    bits(well & low.simd_gt(limits.soonest) & low.simd_gt(splat(0.0)) & high.simd_lt(limits.latest))
}
