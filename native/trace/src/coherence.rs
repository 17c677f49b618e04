// SPDX-License-Identifier: GPL-3.0-or-later
//! Any-hit rays by their coherence: batches whose rays go the same way go in tiles, others in streams.
//!
//! Nothing states what an any-hit ray is for. Shadow rays of neighbouring pixels lead to one light, so their directions
//! differ little; bounces and rays to large lights and panoramas go all ways. A tile of the latter cannot be formed, and
//! its packets fall apart into groups of a few rays, while a stream collects the rays of each node whatever their order.

use crate::batch::Batch;
use crate::kernel::Kernel;
use halfspace_ray::query::Any;
use halfspace_ray::{Ray, RayCounters};
use std::sync::Arc;

/// Number of pairs of consecutive rays in the sample.
const PAIRS: usize = 128;

/// Square of the cosine of the largest angle between rays that go the same way.
const ALONG: f32 = 0.9;

/// Sends each batch of any-hit rays to the kernel that suits its coherence.
#[derive(Debug)]
struct ByCoherence {
    tiles: Arc<dyn Kernel<Any>>,
    streams: Arc<dyn Kernel<Any>>,
}

/// Any hits: `tiles` answers batches whose rays go the same way, `streams` the others.
pub fn by_coherence(
    tiles: Arc<dyn Kernel<Any>>,
    streams: Arc<dyn Kernel<Any>>,
) -> Arc<dyn Kernel<Any>> {
    Arc::new(ByCoherence { tiles, streams })
}

impl ByCoherence {
    fn kernel(&self, rays: &[Ray]) -> &dyn Kernel<Any> {
        if are_coherent(rays) {
            &*self.tiles
        } else {
            &*self.streams
        }
    }
}

impl Kernel<Any> for ByCoherence {
    fn trace(&self, batch: &Batch<'_>, answers: &mut [bool]) {
        self.kernel(batch.rays).trace(batch, answers);
    }

    fn count(&self, batch: &Batch<'_>, answers: &mut [bool], counters: &mut [RayCounters]) -> bool {
        self.kernel(batch.rays).count(batch, answers, counters)
    }

    fn counts(&self) -> bool {
        self.tiles.counts() && self.streams.counts()
    }

    fn working_set(&self) -> Option<usize> {
        self.streams.working_set()
    }
}

/// Whether most rays of a sample go the way of the ray before them.
fn are_coherent(rays: &[Ray]) -> bool {
    let pairs = PAIRS.min(rays.len() / 2);
    let along = |i: usize| {
        let at = i * rays.len() / pairs;
        let (a, b) = (&rays[at].d, &rays[at + 1].d);
        let dot = |a: &[f32; 3], b: &[f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let both = dot(a, b);
        // NaN and infinity are no direction.
        both > 0.0 && both * both >= ALONG * dot(a, a) * dot(b, b)
    };
    2 * (0..pairs).filter(|&i| along(i)).count() >= pairs
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rays(n: usize, direction: impl Fn(usize) -> [f32; 3]) -> Vec<Ray> {
        let ray = |i| Ray {
            d: direction(i),
            ..halfspace_ray::rays::BLANK
        };
        (0..n).map(ray).collect()
    }

    #[test]
    fn rays_to_a_light_are_coherent_and_bounces_are_not() {
        let light = |i: usize| [1.0 + 0.001 * i as f32, 2.0, -0.5].map(|x| x * (1 + i % 7) as f32);
        let corner = |i: usize| [0, 1, 2].map(|k: usize| if i >> k & 1 == 0 { 1.0 } else { -1.0 });
        for n in [2, 3, 17, 255, 256, 257, 8192] {
            assert!(are_coherent(&rays(n, light)), "{n}");
            assert!(!are_coherent(&rays(n, corner)), "{n}");
            assert!(!are_coherent(&rays(n, |_| [0.0; 3])), "{n}");
            // The silhouettes of a picture interrupt few of its rays.
            let mostly = |i: usize| {
                if i.is_multiple_of(5) {
                    corner(i)
                } else {
                    light(i)
                }
            };
            assert!(n < 20 || are_coherent(&rays(n, mostly)), "{n}");
        }
        assert!(are_coherent(&[]) && are_coherent(&rays(1, corner)));
    }
}
