// SPDX-License-Identifier: GPL-3.0-or-later
//! Batches by their coherence: any-hit rays go in tiles, packets or streams.
//!
//! Nothing states what a batch is for, and how well its rays keep together depends on the tree, too: rays from a picture
//! to a light may pass several leaves between one pixel and the next. So a few packets of each batch are traced and
//! counted first. The number of rays that visit a node together decides, which depends on these rays and the tree alone:
//! neither on earlier batches nor on a clock. The sample is traced again with the others, and its counts are dropped.

use halfspace_ray::query::Any;
use halfspace_ray::{Ray, RayCounters};
use halfspace_trace::batch::Batch;
use halfspace_trace::kernel::Kernel;
use std::sync::Arc;

/// Number of pairs of consecutive rays in the sample of directions.
const PAIRS: usize = 128;

/// Square of the cosine of the largest angle between rays that go the same way.
const ALONG: f32 = 0.9;

/// Number of rays of a packet.
const PACKET: usize = 16;

/// Largest number of packets in the sample.
const PACKETS: usize = 8;

/// Number of rays of a batch per packet of the sample, so that the sample takes about one percent of the time.
const RAYS_PER_PACKET: usize = 4096;

/// Largest number of rays that are traced after one sample (chosen: four packets).
const BATCH: usize = 1 << 14;

/// Numbers of rays per visit of a packet from which one kernel is faster than another. Measured on Zen 4 with AVX2 and
/// AVX-512: shadow rays of points, discs and suns, 128 x 128 to 1024 x 1024 of them. Through boxes, on 5 scenes, the
/// choice between packets and streams takes 5 and 2.5 % longer than the faster of both; the others are measured on Sponza
/// and the dragon alone.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// Tiles instead of packets.
    tiles: f32,
    /// Packets instead of streams.
    packets: f32,
}

impl Limits {
    /// Through nodes of eight boxes.
    pub const BOXES: Self = Self {
        tiles: 13.3,
        packets: 9.25,
    };

    /// Through split planes, where streams visit more nodes.
    pub const PLANES: Self = Self {
        tiles: 12.0,
        packets: 7.25,
    };

    /// Through other nodes; measured with intervals.
    pub const OTHERS: Self = Self {
        packets: 7.25,
        ..Self::BOXES
    };
}

/// Sends each batch to one of three kernels, by the number of rays that visit a node of a packet together.
#[derive(Debug)]
struct ByCoherence {
    tiles: Arc<dyn Kernel<Any>>,
    packets: Arc<dyn Kernel<Any>>,
    streams: Arc<dyn Kernel<Any>>,
    limits: Limits,
}

/// `tiles` and `packets` answer batches whose rays visit nodes together, `streams` the others.
pub fn any_by_coherence(
    tiles: Arc<dyn Kernel<Any>>,
    packets: Arc<dyn Kernel<Any>>,
    streams: Arc<dyn Kernel<Any>>,
    limits: Limits,
) -> Arc<dyn Kernel<Any>> {
    Arc::new(ByCoherence {
        tiles,
        packets,
        streams,
        limits,
    })
}

impl ByCoherence {
    fn kernel(&self, batch: &Batch<'_>) -> &dyn Kernel<Any> {
        if !go_the_same_way(batch.rays) {
            return &*self.streams;
        }
        let together = rays_per_visit(&*self.packets, batch);
        if together >= self.limits.tiles {
            &*self.tiles
        } else if together >= self.limits.packets {
            &*self.packets
        } else {
            &*self.streams
        }
    }
}

impl Kernel<Any> for ByCoherence {
    fn trace(&self, batch: &Batch<'_>, answers: &mut [bool]) {
        self.kernel(batch).trace(batch, answers);
    }

    fn count(&self, batch: &Batch<'_>, answers: &mut [bool], counters: &mut [RayCounters]) -> bool {
        self.kernel(batch).count(batch, answers, counters)
    }

    fn counts(&self) -> bool {
        [&self.tiles, &self.packets, &self.streams]
            .iter()
            .all(|kernel| kernel.counts())
    }

    fn batch(&self) -> Option<usize> {
        Some(BATCH)
    }

    fn working_set(&self) -> Option<usize> {
        self.streams.working_set()
    }
}

/// The number of rays of a packet that visit a node together, by a sample of the batch; [`PACKET`] for batches that are
/// too small for a sample, and for those whose sample misses the scene.
fn rays_per_visit(packets: &dyn Kernel<Any>, batch: &Batch<'_>) -> f32 {
    let rays = sample(batch.rays);
    let mut answers = vec![false; rays.len()];
    let mut counters = vec![RayCounters::default(); rays.len()];
    let batch = Batch {
        rays: &rays,
        shadow_cache: false,
        ..*batch
    };
    if rays.is_empty() || !packets.count(&batch, &mut answers, &mut counters) {
        return PACKET as f32;
    }
    // Each visit is counted in full for one ray of the group, and as a visit for all.
    let own = |c: &RayCounters| c.steps() + c.leaves + c.leaves_empty;
    let visits: u32 = counters.iter().map(RayCounters::visits).sum();
    let groups: u32 = counters.iter().map(own).sum();
    if groups == 0 {
        return PACKET as f32;
    }
    visits as f32 / groups as f32
}

/// Rays of whole packets, spread over the batch.
fn sample(rays: &[Ray]) -> Vec<Ray> {
    let count = (rays.len() / RAYS_PER_PACKET).min(PACKETS);
    (0..count)
        .flat_map(|i| {
            let first = (2 * i + 1) * rays.len() / (2 * count) / PACKET * PACKET;
            &rays[first..first + PACKET]
        })
        .copied()
        .collect()
}

/// Whether most rays of a sample go the way of the ray before them.
fn go_the_same_way(rays: &[Ray]) -> bool {
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
    use fearless_simd::Level;
    use halfspace_ray::frame::Frame;
    use halfspace_scene::Triangles;
    use std::sync::atomic::{AtomicU32, Ordering};

    fn rays(n: usize, direction: impl Fn(usize) -> [f32; 3]) -> Vec<Ray> {
        let ray = |i| Ray {
            d: direction(i),
            ..halfspace_ray::rays::BLANK
        };
        (0..n).map(ray).collect()
    }

    #[test]
    fn rays_to_a_light_go_the_same_way_and_bounces_do_not() {
        let light = |i: usize| [1.0 + 0.001 * i as f32, 2.0, -0.5].map(|x| x * (1 + i % 7) as f32);
        let corner = |i: usize| [0, 1, 2].map(|k: usize| if i >> k & 1 == 0 { 1.0 } else { -1.0 });
        for n in [2, 3, 17, 255, 256, 257, 8192] {
            assert!(go_the_same_way(&rays(n, light)), "{n}");
            assert!(!go_the_same_way(&rays(n, corner)), "{n}");
            assert!(!go_the_same_way(&rays(n, |_| [0.0; 3])), "{n}");
            // The silhouettes of a picture interrupt few of its rays.
            let mostly = |i: usize| {
                if i.is_multiple_of(5) {
                    corner(i)
                } else {
                    light(i)
                }
            };
            assert!(n < 20 || go_the_same_way(&rays(n, mostly)), "{n}");
        }
        assert!(go_the_same_way(&[]) && go_the_same_way(&rays(1, corner)));
    }

    #[test]
    fn the_sample_has_whole_packets_spread_over_the_batch() {
        for n in [0, 15, 4095, 4096, 8200, 20_001, 1 << 15, 1 << 17] {
            let all = rays(n, |i| [i as f32, 0.0, 0.0]);
            let numbers: Vec<_> = sample(&all).iter().map(|ray| ray.d[0] as usize).collect();
            assert_eq!(numbers.len(), PACKET * (n / 4096).min(PACKETS), "{n}");
            for packet in numbers.chunks(PACKET) {
                assert!(packet[0].is_multiple_of(PACKET), "{n}");
                assert!(packet.iter().copied().eq(packet[0]..packet[0] + PACKET));
            }
            let ends = [numbers.first(), numbers.last()].map(|end| end.map_or(n / 2, |end| *end));
            assert!(ends[0] <= n / 2 && ends[1] + PACKET >= n / 2, "{n}");
            assert!(numbers.is_sorted());
        }
    }

    /// Counts `groups` groups of visits and `joined` further visits for each ray, and the batches that it traces.
    #[derive(Debug, Default)]
    struct Stub {
        groups: u32,
        joined: u32,
        counts: bool,
        traced: AtomicU32,
    }

    impl Kernel<Any> for Stub {
        fn trace(&self, _: &Batch<'_>, _: &mut [bool]) {
            self.traced.fetch_add(1, Ordering::Relaxed);
        }

        fn count(&self, _: &Batch<'_>, _: &mut [bool], counters: &mut [RayCounters]) -> bool {
            for c in counters {
                (c.steps_boxes, c.joined) = (self.groups, self.joined);
            }
            self.counts
        }
    }

    /// Calls `f` with a batch of these rays through an empty scene.
    fn with_batch<T>(rays: &[Ray], f: impl FnOnce(&Batch<'_>) -> T) -> T {
        let scene = Triangles::new(Vec::new(), Vec::new()).unwrap();
        let frame = Frame::new(scene.bounds());
        f(&Batch {
            scene: &scene,
            frame: &frame,
            rays,
            level: Level::new(),
            shadow_cache: true,
            placed: None,
            monitor: None,
        })
    }

    /// Packets of which `groups` groups of visits and `joined` further visits are counted for each ray.
    fn packets(groups: u32, joined: u32) -> Arc<Stub> {
        Arc::new(Stub {
            groups,
            joined,
            counts: true,
            ..Stub::default()
        })
    }

    #[test]
    fn rays_that_visit_nodes_together_are_counted() {
        let together = |n: usize, packets: &Stub| {
            with_batch(&rays(n, |_| [1.0; 3]), |batch| {
                rays_per_visit(packets, batch)
            })
        };
        assert_eq!(together(4096, &packets(4, 33)), 9.25);
        assert_eq!(together(4096, &packets(4, 8)), 3.0);
        assert_eq!(together(4095, &packets(4, 8)), 16.0, "too few for a sample");
        assert_eq!(together(4096, &packets(0, 0)), 16.0, "all miss the scene");
        let uncounted = Stub::default();
        assert_eq!(together(4096, &uncounted), 16.0);
    }

    #[test]
    fn batches_go_to_the_kernel_of_their_coherence() {
        let corner = |i: usize| [0, 1, 2].map(|k: usize| if i >> k & 1 == 0 { 1.0 } else { -1.0 });
        let (along, around) = (rays(4096, |_| [1.0; 3]), rays(4096, corner));
        // Returns which of the kernels trace rays with this number of rays per visit.
        let traced = |rays: &[Ray], joined: u32| {
            let [tiles, streams] = [(); 2].map(|()| Arc::new(Stub::default()));
            let together = packets(10, joined);
            let any = any_by_coherence(
                tiles.clone(),
                together.clone(),
                streams.clone(),
                Limits::BOXES,
            );
            with_batch(rays, |batch| any.trace(batch, &mut vec![false; rays.len()]));
            [tiles, together, streams].map(|stub| stub.traced.load(Ordering::Relaxed))
        };
        assert_eq!(traced(&along, 130), [1, 0, 0]);
        assert_eq!(traced(&along, 110), [0, 1, 0]);
        assert_eq!(traced(&along, 80), [0, 0, 1]);
        assert_eq!(traced(&around, 130), [0, 0, 1]);
    }
}
