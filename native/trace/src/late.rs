// SPDX-License-Identifier: GPL-3.0-or-later
//! Deferred exact tests: rays of a batch whose traversals have ended, each with one triangle it provably hits,
//! are collected here and get the exact distances and weights sixteen at a time.

use crate::batch::Write;
use crate::row::{LANES, Row};
use crate::verdicts::apart;
use fearless_simd::Simd;
use halfspace_geom::verdict::verdict_within;
use halfspace_ray::query::Deferred;
use halfspace_ray::{FrameRay, Hit, Ray};

/// The collected rays, one per lane.
pub struct Late {
    /// Number of lanes in use.
    used: usize,
    o: [Row; 3],
    d: [Row; 3],
    /// Factors from frame to scene distances.
    to_scene: [f64; LANES],
    corners: [[Row; 3]; 3],
    triangles: [u32; LANES],
    /// Indices of the rays in the batch.
    indices: [usize; LANES],
}

impl Default for Late {
    /// No rays.
    fn default() -> Self {
        Self {
            used: 0,
            o: [[0.0; LANES]; 3],
            d: [[0.0; LANES]; 3],
            to_scene: [1.0; LANES],
            corners: [[[0.0; LANES]; 3]; 3],
            triangles: [0; LANES],
            indices: [0; LANES],
        }
    }
}

impl Late {
    /// Adds ray `index` of the batch `rays`; answers all if every lane is taken. The frame must
    /// be unscaled, and `held` must be the only triangle that it is known to hit.
    #[inline(always)]
    pub fn push<S: Simd>(
        &mut self,
        simd: S,
        index: usize,
        rays: &[Ray],
        frame: &FrameRay,
        held: &Deferred,
        write: Write<'_>,
    ) {
        // Copy the ray and the triangle's vertices to the next free lane.
        let lane = self.used;
        for k in 0..3 {
            self.o[k][lane] = rays[index].o[k];
            self.d[k][lane] = frame.d[k];
            for corner in 0..3 {
                self.corners[corner][k][lane] = held.corners[corner][k];
            }
        }
        self.to_scene[lane] = frame.to_scene();
        self.triangles[lane] = held.triangle;
        self.indices[lane] = index;
        self.used += 1;
        if self.used == LANES {
            self.settle(simd, rays, write);
        }
    }

    /// Answers all collected rays: calls `write` with the index and the hit of each. Compiled once for all traversals.
    #[inline(never)]
    pub fn settle<S: Simd>(&mut self, simd: S, rays: &[Ray], write: Write<'_>) {
        if self.used != 0 {
            simd.vectorize(
                #[inline(always)]
                || self.answer(simd, rays, write),
            );
        }
    }

    /// [`Self::settle`] for at least one ray.
    #[inline(always)]
    fn answer<S: Simd>(&mut self, simd: S, rays: &[Ray], write: Write<'_>) {
        // Compute all answers in f64 vectors; lanes that are too close to call get the scalar exact test.
        let (certain, [t, u, v]) = apart(simd, &self.o, &self.d, &self.to_scene, &self.corners);
        for lane in 0..std::mem::take(&mut self.used).min(LANES) {
            let (index, triangle) = (self.indices[lane], self.triangles[lane]);
            let hit = if certain >> lane & 1 == 1 {
                Hit {
                    t: t[lane],
                    triangle,
                    u: u[lane],
                    v: v[lane],
                }
            } else {
                // Take the scalar exact test where f64 could not decide; it rounds the same way.
                let corner = |i: usize| {
                    let [x, y, z] = &self.corners[i];
                    [x[lane], y[lane], z[lane]]
                };
                let ray = &rays[index];
                let corners = [corner(0), corner(1), corner(2)];
                let found = verdict_within(ray.o, ray.d, corners, [ray.t_min, ray.t_max]);
                debug_assert!(found.is_some(), "the ray certainly hits it");
                found.map_or(Hit::MISS, |found| Hit {
                    t: found.t,
                    triangle,
                    u: found.u,
                    v: found.v,
                })
            };
            write(index, hit);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch};
    use halfspace_geom::verdict::verdict;
    use halfspace_ray::frame::Frame;
    use halfspace_scene::Triangles;
    use halfspace_strategies::point;
    use proptest::prelude::*;

    /// A triangle, an origin, and the weights of a point to aim at.
    fn aimed() -> impl Strategy<Value = ([[f32; 3]; 3], [f32; 3], [f32; 2])> {
        let corner = || point().prop_map(|p| p.map(|x| if x.abs() < 1e9 { x } else { 1.0 }));
        (
            [corner(), corner(), corner()],
            point(),
            [0.0f32..1.0, 0.0f32..1.0],
        )
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2_000))]
        #[test]
        fn late_verdicts_are_those_of_single_rays(shots in prop::collection::vec(aimed(), 1..80)) {
            let corners: Vec<_> = shots.iter().flat_map(|(corners, ..)| *corners).collect();
            let indices = (0..corners.len() as u32 / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
            let scene = Triangles::new(corners, indices).unwrap();
            let frame = Frame::new(scene.bounds());
            // Traversals in scaled frames defer nothing.
            prop_assume!(frame.is_unscaled());
            let (mut rays, mut framed, mut held, mut expected) = (vec![], vec![], vec![], vec![]);
            for (triangle, (corners, o, [s, t])) in (0..).zip(&shots) {
                let [a, b, c] = corners;
                let d = std::array::from_fn(|k| {
                    a[k] * (1.0 - s) * (1.0 - t) + b[k] * s + c[k] * t * (1.0 - s) - o[k]
                });
                let ray = Ray { o: *o, d, t_min: 0.0, t_max: f32::INFINITY };
                let hit = verdict(*o, d, *corners).filter(|hit| (0.0..f32::INFINITY).contains(&hit.t));
                let (Some(hit), Some(in_frame)) = (hit, frame.ray(&ray)) else {
                    continue;
                };
                rays.push(ray);
                framed.push(in_frame);
                held.push(Deferred { triangle, corners: *corners, low: 0.0 });
                expected.push([hit.t.to_bits(), triangle, hit.u.to_bits(), hit.v.to_bits()]);
            }
            let mut answers = vec![None; rays.len()];
            dispatch!(Level::new(), simd => {
                let mut late = Late::default();
                let write = &mut |index: usize, hit: Hit| {
                    assert!(answers[index].is_none(), "answered twice");
                    answers[index] = Some([hit.t.to_bits(), hit.triangle, hit.u.to_bits(), hit.v.to_bits()]);
                };
                for index in 0..rays.len() {
                    late.push(simd, index, &rays, &framed[index], &held[index], write);
                }
                late.settle(simd, &rays, write);
            });
            for (answer, right) in answers.iter().zip(expected) {
                prop_assert_eq!(*answer, Some(right));
            }
        }
    }
}
