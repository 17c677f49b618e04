// SPDX-License-Identifier: GPL-3.0-or-later
//! Leaves of plane trees visited by beams: tests of the pixels' rays, and splits along the outlines of the triangles
//! hit.

use crate::bundle::{Bundle as _, Common, LANES, RAYS, lanes, load};
use crate::frame_rows::Candidate;
use crate::planes::{Beam, CUT, Tile, mask_of};
use fearless_simd::Simd;
use halfspace_geom::vec3::{sub, widen};
use halfspace_geom::view::Line;
use halfspace_leaf::Leaf;
use halfspace_ray::query::Counters;

impl Tile<'_> {
    /// Tests the rays of a beam against the triangles of a leaf, and splits the beam along those that are hit.
    #[inline(always)]
    pub(super) fn leaf<S: Simd, C: Counters>(
        &mut self,
        simd: S,
        leaf: Leaf,
        beam: Beam,
        left: &mut Vec<Beam>,
        counters: &mut [C],
    ) {
        for i in lanes(beam.pixels) {
            counters[i].visit(leaf.first, leaf.count);
            counters[i].tests(leaf.count);
        }
        let shared = Common(self.eye);
        let mut pieces = vec![beam];
        self.job.blocks.each(leaf, |id, corners| {
            // Test eight rays at a time in f32, then apply the exact verdict to the candidates.
            let seen = shared.see(corners);
            let mut found = 0;
            for row in (0..RAYS).step_by(LANES) {
                let bits = beam.pixels >> row & 0xff;
                if bits == 0 {
                    continue;
                }
                let reach = load(simd, &self.rows.reach, row);
                let able = shared.candidates(simd, &seen, &self.rows.rays, row, reach) & bits;
                for lane in lanes(able) {
                    let i = row + lane;
                    let (best, count) = (&mut self.best[i], &mut counters[i]);
                    let candidate = Candidate { id, corners };
                    (self.rows).offer(i, self.slice, self.job, candidate, best, count);
                    found |= u64::from(best.hit().triangle == id) << i;
                }
            }
            if found != 0 {
                self.cut(corners, found, &mut pieces, counters);
            }
        });
        left.append(&mut pieces);
    }

    /// Splits the beams of `pieces` along the outline of a triangle that hides some, but not all, of their
    /// pixels. `found` is the mask of pixels whose best hit is this triangle.
    fn cut<C: Counters>(
        &self,
        corners: [[f32; 3]; 3],
        found: u64,
        pieces: &mut Vec<Beam>,
        counters: &mut [C],
    ) {
        let whole = |beam: &Beam| beam.pixels & found == 0 || beam.pixels & !found == 0;
        if pieces.iter().all(whole) {
            return;
        }
        let eye = widen(self.eye);
        let Some(edges) = self.view.edges(corners.map(|p| sub(widen(p), eye))) else {
            return;
        };
        for _ in 0..pieces.len() {
            let mut beam = pieces.remove(0);
            if whole(&beam) {
                pieces.push(beam);
                continue;
            }
            counters[beam.pixels.trailing_zeros() as usize].case(|| CUT);
            // Cut off the part beyond each edge as a piece of its own.
            for edge in &edges {
                let outside = mask_of(lanes(beam.pixels).filter(|&i| edge.at(self.at[i]) < 0.0));
                if outside == 0 {
                    continue;
                }
                let beyond = Line(edge.0.map(|x| -x));
                pieces.push(Beam {
                    polygon: beam.polygon.part(&beyond).unwrap_or(beam.polygon),
                    pixels: outside,
                });
                beam.pixels &= !outside;
                if beam.pixels == 0 {
                    break;
                }
                beam.polygon = beam.polygon.part(edge).unwrap_or(beam.polygon);
            }
            if beam.pixels != 0 {
                pieces.push(beam);
            }
        }
    }
}
