// SPDX-License-Identifier: GPL-3.0-or-later
//! Shadow rays of a point light, reversed: seen from the light they are an image, and begin as one beam.
//!
//! The light is not given. It is estimated from the rays; a ray that passes it too far away goes on singly. The reversed
//! ray only names the cells on the way. In these the ray itself is tested, so the answer does not depend on the estimate.
//! Rays of a sun without size have no common point; they are found by their common direction ([`crate::source`]).

use crate::source::sample;
use halfspace_geom::vec3::{add_scaled, dot, sub, widen};
use halfspace_ray::Ray;
use halfspace_ray::frame::{Frame, U};
use halfspace_trace::batch::Batch;

/// Largest distance of a ray from its reversed one, in units of rounding of the scene's largest coordinate. Derived:
/// leaves contain what is within 40 of these units; the planes of a beam take up to 6.
const OFF: f64 = 24.0 * U as f64;

/// Rays seen from a light.
pub struct Seen {
    /// The light in the frame.
    pub light: [f32; 3],
    /// One ray for each of the batch, from the light to its origin; rays of other lights have an empty interval.
    pub rays: Vec<Ray>,
    /// Number of rays with an interval.
    pub count: usize,
}

/// A light that some rays lead to.
#[derive(Clone, Copy)]
pub struct Light<'a> {
    reversal: Reversal<'a>,
    /// The light in the frame.
    point: [f32; 3],
    /// Number of sampled rays that lead to it.
    pub samples: usize,
}

/// Turns the rays of one light round.
#[derive(Clone, Copy)]
pub struct Reversal<'a> {
    frame: &'a Frame,
    /// Largest distance of a ray from its reversed one.
    off: f64,
}

impl<'a> Reversal<'a> {
    /// For the rays of a batch; `None` if the frame changes distances.
    pub fn new(batch: &Batch<'a>) -> Option<Self> {
        let frame = batch.frame;
        let off = OFF * f64::from(frame.bounds().magnitude());
        (frame.is_unscaled() && off.is_finite()).then_some(Self { frame, off })
    }

    /// A ray that no beam contains.
    fn none(light: [f32; 3]) -> Ray {
        Ray {
            o: light,
            d: [0.0; 3],
            t_min: 0.0,
            t_max: 0.0,
        }
    }

    /// The direction from the light to the origin of a ray; `None` for a ray that does not lead to the light, or passes
    /// it too far away.
    fn reversed(&self, ray: &Ray, light: [f32; 3]) -> Option<[f32; 3]> {
        let o = self.frame.point(ray.o);
        if !(self.frame.map().is_exact(o) && ray.t_min >= 0.0 && ray.t_min <= ray.t_max) {
            return None;
        }
        let (way, d) = (sub(widen(light), widen(o)), widen(ray.d));
        let at = dot(way, d) / dot(d, d);
        // Bound the distance of both lines up to the light, then behind it, then the rounding of the new direction.
        let size = dot(way, way).sqrt();
        let there = add_scaled(way, -at, d);
        let share = f64::from(ray.t_max) / at;
        let off = dot(there, there).sqrt() * share.max(1.0)
            + (share - 1.0).max(0.0) * size
            + f64::from(U) * size;
        #[expect(clippy::cast_possible_truncation, reason = "rounds to f32")]
        (at > 0.0 && off <= self.off).then(|| way.map(|x| -x as f32))
    }

    /// Estimates the light of some of the rays: the end of one, or the point where it meets another, whichever more rays
    /// lead to.
    pub fn light(self, rays: &[Ray], ids: &[u32]) -> Option<Light<'a>> {
        let first = &rays[*ids.first()? as usize];
        let some = sample(rays, ids);
        let (o, d) = (widen(self.frame.point(first.o)), widen(first.d));
        let mut ends = vec![f64::from(first.t_max)];
        for other in &some[1..] {
            // Find where the first ray is nearest to the other one.
            let (way, e) = (sub(widen(self.frame.point(other.o)), o), widen(other.d));
            let (square, both, own) = (dot(d, d), dot(d, e), dot(e, e));
            let sine = square * own - both * both;
            if sine > 1e-6 * square * own {
                ends.push((own * dot(way, d) - both * dot(way, e)) / sine);
            }
        }
        // Take the point that most of the samples lead to.
        let point = |t: f64| {
            #[expect(clippy::cast_possible_truncation, reason = "an estimate")]
            add_scaled(o, t, d).map(|x| x as f32)
        };
        let meeting = |light: [f32; 3]| {
            let leads = |ray: &&&Ray| self.reversed(ray, light).is_some();
            some.iter().filter(leads).count()
        };
        let points = ends.into_iter().map(point);
        let finite = points.filter(|light| light.iter().all(|x| x.is_finite()));
        let best = finite.max_by_key(|light| meeting(*light))?;
        let samples = meeting(best);
        (samples > 1).then_some(Light {
            reversal: self,
            point: best,
            samples,
        })
    }
}

impl Light<'_> {
    /// Sees those of the rays with these indices from the light that lead to it.
    pub fn seen(&self, rays: &[Ray], ids: &[u32]) -> Seen {
        let light = self.point;
        let mut seen = Seen {
            light,
            rays: vec![Reversal::none(light); rays.len()],
            count: 0,
        };
        for id in ids {
            let id = *id as usize;
            if let Some(d) = self.reversal.reversed(&rays[id], light) {
                seen.count += 1;
                seen.rays[id] = Ray {
                    o: light,
                    d,
                    t_min: 0.0,
                    t_max: 1.0,
                };
            }
        }
        seen
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{Random, tree_over};
    use crate::traversal::{BEAM, SINGLE};
    use fearless_simd::Level;
    use halfspace_geom::verdict::verdict_within;
    use halfspace_ray::RayCounters;
    use halfspace_scene::Triangles;
    use std::sync::Arc;

    /// Triangles of about the size of a third, in the cube from -1 to 1.
    fn triangles(random: &mut Random) -> Triangles {
        let mut corners = Vec::new();
        for _ in 0..60 {
            let centre = random.point();
            for _ in 0..3 {
                let aside = random.point();
                corners.push(std::array::from_fn(|k| 0.9 * centre[k] + 0.3 * aside[k]));
            }
        }
        let numbers = (0..60).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]);
        Triangles::new(corners, numbers.collect()).unwrap()
    }

    /// Compares all answers with those of all triangles; returns the numbers of blocked rays, beams and single rays.
    fn traced(scene: &Triangles, rays: &[Ray], least: u32, name: &str) -> [u32; 3] {
        let frame = Frame::new(scene.bounds());
        let (tree, blocks) = tree_over(scene, &frame);
        let kernel = crate::shadow_octants(&Arc::new(tree), &Arc::new(blocks), least);
        let batch = Batch {
            scene,
            frame: &frame,
            rays,
            level: Level::new(),
            shadow_cache: false,
            placed: None,
            monitor: None,
        };
        let mut blocked = vec![false; rays.len()];
        kernel.trace(&batch, &mut blocked);
        let mut again = vec![true; rays.len()];
        let mut counters = vec![RayCounters::default(); rays.len()];
        assert!(kernel.count(&batch, &mut again, &mut counters));
        assert_eq!(blocked, again, "{name}");
        let mut count = 0;
        for (ray, own) in rays.iter().zip(blocked) {
            let expected = (0..60).any(|id| {
                let span = [ray.t_min, ray.t_max];
                verdict_within(ray.o, ray.d, scene.corners(id), span)
                    .is_some_and(|found| ray.reaches(found.t))
            });
            assert_eq!(own, expected, "{name}: {ray:?}");
            count += u32::from(own);
        }
        let events = |i: usize| counters.iter().map(|own| own.cases[i]).sum();
        [count, events(BEAM), events(SINGLE)]
    }

    #[test]
    fn rays_to_lights_are_blocked_as_by_all_triangles() {
        let mut random = Random(7);
        let mut sum = [0; 3];
        for round in 0..12_usize {
            let scene = triangles(&mut random);
            let far = [0.8, 1.5, 3.0][round % 3];
            let lights: Vec<_> = (0..=round % 4)
                .map(|_| random.point().map(|x| far * x))
                .collect();
            let rays: Vec<_> = (0..2000)
                .map(|i| {
                    // From a triangle; the direction ends in the light, or has the length 1.
                    let [a, b, c] = scene.corners(i % 60);
                    let (u, v) = (0.3 * random.number().abs(), 0.3 * random.number().abs());
                    let point = |k: usize| a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k]);
                    let o = [point(0), point(1), point(2)];
                    let light = lights[i as usize % lights.len()];
                    let d: [f32; 3] = std::array::from_fn(|k| light[k] - o[k]);
                    let length = d.iter().map(|x| x * x).sum::<f32>().sqrt();
                    let end = if i % 7 < 4 { 1.0 } else { length };
                    Ray {
                        o,
                        d: d.map(|x| if end == 1.0 { x } else { x / length }),
                        t_min: 1e-4 * end,
                        t_max: 0.9999 * end,
                    }
                })
                .collect();
            for least in [1, 16] {
                let own = traced(&scene, &rays, least, &format!("round {round}"));
                assert!(least > 1 || own[2] < 100, "{} rays singly", own[2]);
                sum = std::array::from_fn(|i| sum[i] + own[i]);
            }
        }
        assert!((4_800..43_200).contains(&sum[0]), "{} blocked", sum[0]);
        assert!(sum[1] > 5_000 && sum[2] > 1_000, "{sum:?}");
    }

    #[test]
    fn rays_of_a_sun_are_blocked_as_by_all_triangles() {
        let mut random = Random(9);
        let mut sum = [0; 3];
        for round in 0..12_usize {
            let scene = triangles(&mut random);
            // Some suns shine along axes, some nearly so, some across.
            let suns: Vec<[f32; 3]> = (0..=round % 3)
                .map(|i| {
                    let d = random.point();
                    let axis = (round + i) % 3;
                    let small = [0.0, 1e-30, 1e-7, 1.0][round % 4];
                    std::array::from_fn(|k| if k == axis { 3.0 * d[k] } else { small * d[k] })
                })
                .collect();
            let rays: Vec<_> = (0..2000)
                .map(|i| {
                    let o = random.point().map(|x| 1.2 * x);
                    Ray {
                        o,
                        d: suns[i as usize % suns.len()],
                        t_min: [0.0, 1e-4, -0.3][i as usize % 3],
                        t_max: if i % 5 == 0 { 0.4 } else { f32::INFINITY },
                    }
                })
                .collect();
            for least in [1, 16] {
                let own = traced(&scene, &rays, least, &format!("round {round}"));
                assert!(least > 1 || own[2] < 300, "{} rays singly", own[2]);
                sum = std::array::from_fn(|i| sum[i] + own[i]);
            }
        }
        assert!((4_800..43_200).contains(&sum[0]), "{} blocked", sum[0]);
        assert!(sum[1] > 5_000 && sum[2] > 1_000, "{sum:?}");
    }

    #[test]
    fn rays_without_a_light_go_singly() {
        let mut random = Random(8);
        let scene = triangles(&mut random);
        let points: Vec<_> = (0..400).map(|_| random.point()).collect();
        let batch = |each: &dyn Fn([f32; 3]) -> ([f32; 3], [f32; 2])| -> Vec<Ray> {
            let ray = |o: &[f32; 3]| {
                let (d, [t_min, t_max]) = each(*o);
                Ray {
                    o: *o,
                    d,
                    t_min,
                    t_max,
                }
            };
            points.iter().map(ray).collect()
        };
        let endless = [0.0, f32::INFINITY];
        let to = |light: [f32; 3], o: [f32; 3]| std::array::from_fn(|k| light[k] - o[k]);
        let batches = [
            ("none", vec![]),
            (
                "sun of a size",
                batch(&|o| ([0.3 + 1e-3 * o[0], 0.2 + 1e-3 * o[1], 1.0], endless)),
            ),
            (
                "any way",
                batch(&|o| (o.map(|x| (70.0 * x).sin()), endless)),
            ),
            (
                "far light",
                batch(&|o| (to([0.0, 9.0, 1e5], o), [0.0, 0.99])),
            ),
            ("from behind", batch(&|o| (to([0.2; 3], o), [-1.0, 1.0]))),
            (
                "beyond the light",
                batch(&|o| (to([0.2; 3], o), [0.0, 3.0])),
            ),
            ("no direction", batch(&|_| ([0.0; 3], endless))),
        ];
        for (name, rays) in batches {
            let [_, beams, singles] = traced(&scene, &rays, 16, name);
            assert_eq!((beams, singles as usize), (0, rays.len()), "{name}");
        }
    }
}
