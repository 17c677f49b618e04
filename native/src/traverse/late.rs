// SPDX-License-Identifier: GPL-3.0-or-later
//! Rays of a batch whose walks are over, each with one triangle that it certainly hits: the verdicts, which
//! say where, are passed on sixteen at a time.

use super::frame::FrameRay;
use super::query::Held;
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
        held: &Held,
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
