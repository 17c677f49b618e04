// SPDX-License-Identifier: GPL-3.0-or-later
//! Camera rays by the size of triangles in pixels: batches go in tiles or in packets.
//!
//! A tile of 64 rays descends once for all of them, which pays where many of its rays meet the same leaf. Where
//! triangles are smaller than a few pixels, few do, and packets of 16 rays are faster. So a few rays of each batch are
//! traced first, and the distance between neighbouring rays at their hits is compared with the mean triangle of the
//! scene. The triangles hit would mislead: large ones are hit most, and small ones around them cost the time.
//! The choice depends on the batch and the scene alone: neither on earlier batches nor on a clock.

use halfspace_ray::query::Closest;
use halfspace_ray::{Hit, Ray, RayCounters};
use halfspace_scene::Triangles;
use halfspace_trace::batch::Batch;
use halfspace_trace::kernel::Kernel;
use std::sync::{Arc, OnceLock};

/// Number of rays of a batch per ray of the sample, which takes about one percent of the time: rays far from each other
/// take 20 times as long as those of a tile.
const RAYS_PER_SAMPLE: usize = 4096;

/// Largest number of rays in the sample.
const SAMPLES: usize = 8;

/// Largest number of triangles whose sizes are averaged.
const TRIANGLES: usize = 4096;

/// Largest number of rays that are traced after one sample: one of full size.
const BATCH: usize = RAYS_PER_SAMPLE * SAMPLES;

/// Size of the mean triangle, in distances between neighbouring rays, below which packets are faster than tiles.
#[derive(Debug, Clone, Copy)]
pub struct Footprint(f32);

impl Footprint {
    /// Through nodes of eight boxes.
    pub const BOXES: Self = Self(3.2);

    /// Through split planes.
    pub const PLANES: Self = Self(3.2);

    /// Through other nodes.
    pub const OTHERS: Self = Self(1.2);
}

/// Sends each batch to one of two kernels, by the size of the scene's triangles in pixels.
#[derive(Debug)]
struct ByFootprint {
    tiles: Arc<dyn Kernel<Closest>>,
    packets: Arc<dyn Kernel<Closest>>,
    limit: Footprint,
    /// Mean diagonal of the boxes of triangles.
    diagonal: OnceLock<f32>,
}

/// Returns a kernel that sends batches to `packets` where the mean triangle of the scene is smaller than the limit at
/// the median hit, and the others to `tiles`.
pub fn closest_by_footprint(
    tiles: Arc<dyn Kernel<Closest>>,
    packets: Arc<dyn Kernel<Closest>>,
    limit: Footprint,
) -> Arc<dyn Kernel<Closest>> {
    Arc::new(ByFootprint {
        tiles,
        packets,
        limit,
        diagonal: OnceLock::new(),
    })
}

impl ByFootprint {
    fn kernel(&self, batch: &Batch<'_>) -> &dyn Kernel<Closest> {
        let diagonal = *self.diagonal.get_or_init(|| mean_diagonal(batch.scene));
        match self.pitch(batch) {
            Some(pitch) if diagonal < self.limit.0 * pitch => &*self.packets,
            _ => &*self.tiles,
        }
    }

    /// The median distance between a ray and its neighbour where the ray hits the scene, by a sample of the batch; `None`
    /// if no ray of the sample hits it.
    fn pitch(&self, batch: &Batch<'_>) -> Option<f32> {
        // Take first rays of tiles, from the middle of each part: the next ray is the neighbour.
        let first = |i: usize| i * RAYS_PER_SAMPLE + RAYS_PER_SAMPLE / 2;
        let count = (batch.rays.len() / RAYS_PER_SAMPLE).min(SAMPLES);
        let rays: Vec<Ray> = (0..count).map(|i| batch.rays[first(i)]).collect();
        let mut hits = vec![Hit::MISS; count];
        self.packets.trace(
            &Batch {
                rays: &rays,
                ..*batch
            },
            &mut hits,
        );
        let mut pitches: Vec<f32> = (0..count)
            .filter(|&i| hits[i].is_hit())
            .map(|i| distance(&rays[i], &batch.rays[first(i) + 1], hits[i].t))
            .collect();
        let middle = pitches.len() / 2;
        (!pitches.is_empty()).then(|| *pitches.select_nth_unstable_by(middle, f32::total_cmp).1)
    }
}

impl Kernel<Closest> for ByFootprint {
    fn trace(&self, batch: &Batch<'_>, answers: &mut [Hit]) {
        self.kernel(batch).trace(batch, answers);
    }

    fn count(&self, batch: &Batch<'_>, answers: &mut [Hit], counters: &mut [RayCounters]) -> bool {
        self.kernel(batch).count(batch, answers, counters)
    }

    fn counts(&self) -> bool {
        self.tiles.counts() && self.packets.counts()
    }

    fn batch(&self) -> Option<usize> {
        Some(BATCH)
    }
}

/// The distance between the points at distance `t` of two rays.
fn distance(a: &Ray, b: &Ray, t: f32) -> f32 {
    length([0, 1, 2].map(|k| (b.o[k] - a.o[k]) + t * (b.d[k] - a.d[k])))
}

/// Returns the mean diagonal of the boxes of triangles that rays can hit. Averages at most [`TRIANGLES`] of them, at
/// equal steps of their list.
fn mean_diagonal(scene: &Triangles) -> f32 {
    let live = scene.live();
    let step = live.len().div_ceil(TRIANGLES).max(1);
    let (mut sum, mut count) = (0.0_f64, 0_u32);
    for &id in live.iter().step_by(step) {
        let corners = scene.corners(id);
        let extent = [0, 1, 2].map(|k| {
            let [a, b, c] = corners.map(|corner| corner[k]);
            a.max(b).max(c) - a.min(b).min(c)
        });
        sum += f64::from(length(extent));
        count += 1;
    }
    (sum / f64::from(count.max(1))) as f32
}

fn length(v: [f32; 3]) -> f32 {
    v.map(|x| x * x).iter().sum::<f32>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::Level;
    use halfspace_ray::frame::Frame;
    use std::sync::atomic::{AtomicU32, Ordering};

    /// Hits the scene at these distances, in turn; infinite ones are misses.
    #[derive(Debug, Default)]
    struct Stub {
        distances: Vec<f32>,
        traced: AtomicU32,
    }

    impl Kernel<Closest> for Stub {
        fn trace(&self, _: &Batch<'_>, answers: &mut [Hit]) {
            self.traced
                .fetch_add(answers.len() as u32, Ordering::Relaxed);
            for (answer, &t) in answers.iter_mut().zip(self.distances.iter().cycle()) {
                if t.is_finite() {
                    (answer.t, answer.triangle) = (t, 0);
                }
            }
        }
    }

    /// Triangles whose boxes have diagonals of five times these sizes.
    fn triangles(sizes: &[f32]) -> Triangles {
        let corners = |&s: &f32| [[0.0; 3], [3.0 * s, 0.0, 0.0], [0.0, 4.0 * s, 0.0]];
        let indices = (0..sizes.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]);
        Triangles::new(sizes.iter().flat_map(corners).collect(), indices.collect()).unwrap()
    }

    /// Rays of a pinhole whose directions are `pitch` apart, or parallel ones whose origins are.
    fn rays(n: usize, pitch: f32, parallel: bool) -> Vec<Ray> {
        let ray = |i: usize| {
            let x = (i % 8) as f32 * pitch;
            let (o, d) = if parallel { (x, 0.0) } else { (0.0, x) };
            Ray {
                o: [o, 0.0, 0.0],
                d: [d, 0.0, 1.0],
                ..halfspace_ray::rays::BLANK
            }
        };
        (0..n).map(ray).collect()
    }

    /// Number of rays that tiles and packets trace, the latter with those of the sample.
    fn traced(rays: &[Ray], scene: &Triangles, distances: &[f32]) -> [u32; 2] {
        let [tiles, packets] = [(); 2].map(|()| {
            Arc::new(Stub {
                distances: distances.to_vec(),
                ..Stub::default()
            })
        });
        let kernel = closest_by_footprint(tiles.clone(), packets.clone(), Footprint(3.0));
        let batch = Batch {
            scene,
            frame: &Frame::new(scene.bounds()),
            rays,
            level: Level::new(),
            shadow_cache: false,
            placed: None,
            monitor: None,
        };
        kernel.trace(&batch, &mut vec![Hit::MISS; rays.len()]);
        [tiles, packets].map(|stub| stub.traced.load(Ordering::Relaxed))
    }

    #[test]
    fn small_triangles_are_traced_in_packets_and_large_ones_in_tiles() {
        let (n, sampled) = (1 << 14, 4);
        for parallel in [false, true] {
            // Directions 0.1 apart are 0.2 apart at the hit.
            let rays = rays(n, if parallel { 0.2 } else { 0.1 }, parallel);
            let small = traced(&rays, &triangles(&[0.11]), &[2.0]);
            assert_eq!(small, [0, n as u32 + sampled], "2.75 pixels");
            let large = traced(&rays, &triangles(&[0.13]), &[2.0]);
            assert_eq!(large, [n as u32, sampled], "3.25 pixels");
        }
    }

    #[test]
    fn batches_without_a_size_are_traced_in_tiles() {
        let small = triangles(&[0.01]);
        let sampled = |n: usize, pitch: f32, t: f32| traced(&rays(n, pitch, false), &small, &[t]);
        assert_eq!(sampled(4096, 0.1, 2.0), [0, 4097]);
        assert_eq!(sampled(4095, 0.1, 2.0), [4095, 0], "no sample");
        assert_eq!(sampled(4096, 0.1, f32::INFINITY), [4096, 1], "no hit");
        assert_eq!(sampled(4096, 0.0, 2.0), [4096, 1], "equal rays");
        assert_eq!(sampled(0, 0.1, 2.0), [0, 0]);
        // All triangles are points, which no ray hits.
        let points = traced(
            &rays(4096, 0.1, false),
            &triangles(&[0.0]),
            &[f32::INFINITY],
        );
        assert_eq!(points, [4096, 1]);
    }

    #[test]
    fn the_median_distance_and_the_mean_triangle_decide() {
        let rays = rays(1 << 15, 0.1, false);
        let mean = triangles(&[0.01, 0.21]);
        // Pixels of 0.2 and 0.1 at the middle of the distances.
        let far = [1.0, 2.0, f32::INFINITY, 2.0, 9.0];
        assert_eq!(
            traced(&rays, &mean, &far),
            [0, (1 << 15) + 8],
            "2.75 pixels"
        );
        let near = [1.0, 1.0, f32::INFINITY, 1.0, 9.0];
        assert_eq!(traced(&rays, &mean, &near), [1 << 15, 8]);
    }

    #[test]
    fn few_of_many_triangles_are_averaged() {
        let sizes: Vec<f32> = (0..20_000).map(|i| 0.1 + (i % 7) as f32 * 0.1).collect();
        let mean = mean_diagonal(&triangles(&sizes));
        assert!((mean - 2.0).abs() < 0.01, "{mean}");
        assert_eq!(mean_diagonal(&triangles(&[])), 0.0);
    }
}
