// SPDX-License-Identifier: GPL-3.0-or-later
//! The start of a stream: rays are scaled into the frame and sorted by octant.

use crate::OCTANTS;
use crate::Run;
use crate::lists::Stream;
use crate::ray_state::{Line, RayState};
use fearless_simd::{Simd, SimdBase};
use halfspace_geom::vec3::map;
use halfspace_group::packet::boxes::slabs;
use halfspace_group::packet::{MOST, Packet, Sixteen};
use halfspace_trace::slabs::Slabs;

impl Run<'_> {
    /// Scales the rays into the frame, sixteen at once, and adds those that meet the scene to the stream of
    /// their octant. `intervals`: whether the lists have intervals.
    #[inline(always)]
    pub(super) fn set_out<S: Simd, P: Copy>(
        &self,
        simd: S,
        streams: &mut [Stream<P>; OCTANTS],
        states: &mut Vec<RayState>,
        intervals: bool,
    ) {
        states.clear();
        for stream in &mut *streams {
            stream.forget();
        }
        let mut packet = Packet::default();
        // Fill a packet with sixteen rays, and compute their slab coefficients.
        for (chunk, rays) in self.rays.chunks(MOST).enumerate() {
            let first = MOST * chunk;
            packet.count = rays.len();
            for (i, place) in packet.places.iter_mut().enumerate().take(rays.len()) {
                *place = first + i;
            }
            let there = packet.fill(simd, self.frame, self.rays, None);
            let mut rows = [[[0.0; MOST]; 3]; 3];
            for (rows, slabs) in rows.iter_mut().zip(slabs::<S, Sixteen>(simd, &packet)) {
                for (row, slab) in rows.iter_mut().zip(slabs) {
                    slab.store_slice(row);
                }
            }
            // Store the state of each ray; irregular ones are framed by themselves.
            for (lane, own) in rays.iter().enumerate().take(MOST) {
                let index = first + lane;
                let still = map(own.d, |d| f32::from(u8::from(d != 0.0)));
                let state = match packet.framed(lane) {
                    Some(ray) => (there >> lane & 1 == 1).then(|| {
                        let row = |of: usize| map([0, 1, 2], |k: usize| rows[k][of][lane]);
                        let line = Line::new(&ray, row(0), row(1), row(2));
                        (
                            ray.signs,
                            RayState::new(&ray, line, ray.certain(own), still),
                        )
                    }),
                    // An irregular ray.
                    None => self.framed(index).map(|ray| {
                        let Slabs { inv, near, far, .. } = Slabs::new(&ray);
                        let line = Line::new(&ray, inv, near, far);
                        (
                            ray.signs,
                            RayState::new(&ray, line, ray.certain(own), ray.still),
                        )
                    }),
                };
                states.push(match state {
                    Some((signs, state)) => {
                        streams[signs as usize % OCTANTS].put(index, &state.line, intervals);
                        state
                    }
                    None => RayState::nothing(),
                });
            }
        }
    }
}
