// SPDX-License-Identifier: GPL-3.0-or-later
//! Rays of a batch whose walks are over, each with one triangle that it certainly hits: the verdicts, which
//! say where, are passed on sixteen at a time.

use super::frame::FrameRay;
use super::query::Deferred;
use super::ray::{Hit, Ray};
use super::tile::{LANES, Row};
use super::tile_verdict;
use crate::geom::verdict::verdict_within;
use fearless_simd::Simd;

/// Rays that wait, a lane each.
pub struct Late {
    waiting: usize,
    o: [Row; 3],
    d: [Row; 3],
    to_scene: [f64; LANES],
    corners: [[Row; 3]; 3],
    triangles: [u32; LANES],
    /// Their places in the batch.
    places: [usize; LANES],
}

impl Late {
    /// None yet.
    pub fn new() -> Self {
        Self {
            waiting: 0,
            o: [[0.0; LANES]; 3],
            d: [[0.0; LANES]; 3],
            to_scene: [1.0; LANES],
            corners: [[[0.0; LANES]; 3]; 3],
            triangles: [0; LANES],
            places: [0; LANES],
        }
    }

    /// Takes in the ray with this place in the batch; when enough wait, answers them. The frame is the scene's own,
    /// and nothing that the ray hits is known yet but `held`.
    #[inline(always)]
    pub fn push<S: Simd>(
        &mut self,
        simd: S,
        (place, rays): (usize, &[Ray]),
        frame: &FrameRay,
        held: &Deferred,
        write: &mut impl FnMut(usize, Hit),
    ) {
        let lane = self.waiting;
        for k in 0..3 {
            self.o[k][lane] = frame.o[k];
            self.d[k][lane] = frame.d[k];
            for corner in 0..3 {
                self.corners[corner][k][lane] = held.corners[corner][k];
            }
        }
        self.to_scene[lane] = frame.to_scene();
        self.triangles[lane] = held.triangle;
        self.places[lane] = place;
        self.waiting += 1;
        if self.waiting == LANES {
            self.settle(simd, rays, write);
        }
    }

    /// Answers those that wait.
    #[inline(always)]
    pub fn settle<S: Simd>(&mut self, simd: S, rays: &[Ray], write: &mut impl FnMut(usize, Hit)) {
        if self.waiting == 0 {
            return;
        }
        let lines = (&self.o, &self.d, &self.to_scene);
        let (certain, [t, u, v]) = tile_verdict::apart(simd, lines, &self.corners);
        for lane in 0..std::mem::take(&mut self.waiting).min(LANES) {
            let (place, triangle) = (self.places[lane], self.triangles[lane]);
            let hit = if certain >> lane & 1 == 1 {
                Hit {
                    t: t[lane],
                    triangle,
                    u: u[lane],
                    v: v[lane],
                }
            } else {
                let corner = |i: usize| {
                    let [x, y, z] = &self.corners[i];
                    [x[lane], y[lane], z[lane]]
                };
                let ray = &rays[place];
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
            write(place, hit);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::strategies::point;
    use crate::geom::verdict::verdict;
    use crate::scene::Triangles;
    use crate::traverse::frame::Frame;
    use fearless_simd::{Level, dispatch};
    use proptest::prelude::*;

    /// A triangle, an origin, weights of a point to aim at.
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
            // Walks in scaled frames put nothing off.
            prop_assume!(frame.is_scene());
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
                let mut late = Late::new();
                let mut write = |place: usize, hit: Hit| {
                    assert!(answers[place].is_none(), "answered twice");
                    answers[place] = Some([hit.t.to_bits(), hit.triangle, hit.u.to_bits(), hit.v.to_bits()]);
                };
                for place in 0..rays.len() {
                    late.push(simd, (place, &rays), &framed[place], &held[place], &mut write);
                }
                late.settle(simd, &rays, &mut write);
            });
            for (answer, right) in answers.iter().zip(expected) {
                prop_assert_eq!(*answer, Some(right));
            }
        }
    }
}
