// SPDX-License-Identifier: GPL-3.0-or-later

use super::*;
use crate::blocks::Blocks;
use crate::keep::Keep;
use halfspace_geom::verdict::verdict;
use halfspace_ray::Ray;
use halfspace_ray::frame::Frame;
use halfspace_ray::query::NoCount;
use halfspace_scene::Triangles;
use halfspace_strategies::{near_triangle, point, tiny_from_afar};
use proptest::prelude::*;

/// The triangle in the frame of its scene.
fn framed(frame: &Frame, corners: [[f32; 3]; 3]) -> Triangle {
    Triangle {
        id: 0,
        corners: corners.map(|p| frame.point(p)),
    }
}

/// A weight of a corner; often on an edge, where signs are uncertain.
fn weight() -> impl Strategy<Value = f32> {
    prop_oneof![0.0f32..1.0, Just(0.0), Just(1.0)]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20_000))]
    #[test]
    fn no_hit_is_ever_rejected_and_proven_hits_are_hits(
        corners in [point(), point(), point()],
        o in point(),
        weights in [weight(), weight()],
        t_min in prop_oneof![Just(0.0f32), Just(-1.0), Just(f32::NEG_INFINITY)],
        turned in any::<bool>(),
    ) {
        let scene = Triangles::new(corners.to_vec(), vec![[0, 1, 2]]).unwrap();
        prop_assume!(!scene.live().is_empty());
        let frame = Frame::new(scene.bounds());
        let target = near_triangle(corners, weights);
        let d: [f32; 3] = std::array::from_fn(|k| if turned { o[k] - target[k] } else { target[k] - o[k] });
        prop_assume!(d.iter().all(|x| x.is_finite()));
        let ray = Ray { o, d, t_min, t_max: f32::INFINITY };
        let hit = verdict(o, d, corners).map(|v| v.t).filter(|t| *t >= t_min && t.is_finite());
        let Some(ray_in_frame) = frame.ray(&ray) else {
            return Ok(());
        };
        let triangle = framed(&frame, corners);
        let reaches = [Some(ray_in_frame.t_max), hit.map(|t| ray_in_frame.reach(t))];
        for reach in reaches.into_iter().flatten() {
            let candidate = triangle.candidate::<NoCount>(&ray_in_frame, reach, true);
            prop_assert!(candidate.is_some() || hit.is_none(), "rejected");
            let Some(Some([low, high])) = candidate else {
                continue;
            };
            // The bounds of a proven hit must enclose the exact distance.
            let [from, to] = ray_in_frame.certain(&ray);
            if low > from && high < to {
                prop_assert!(hit.is_some(), "proven without a hit");
                let at = f64::from(hit.unwrap()) / ray_in_frame.to_scene();
                let slack = 1e-7 * at + 1e-44 / ray_in_frame.to_scene();
                prop_assert!(f64::from(low) <= at + slack && at - slack <= f64::from(high));
            }
        }
    }

    #[test]
    fn no_tiny_triangle_is_rejected_from_afar((tiny, [o, d], [t_min, t_max]) in tiny_from_afar()) {
        let x = 2.0_f32.powi(39);
        let all = vec![tiny[0], tiny[1], tiny[2], [x; 3], [x, x, 0.5 * x], [-x, -x, 0.0]];
        let scene = Triangles::new(all, vec![[0, 1, 2], [3, 4, 5]]).unwrap();
        let frame = Frame::new(scene.bounds());
        let hit = verdict(o, d, tiny).filter(|hit| t_min <= hit.t && hit.t <= t_max);
        let Some(hit) = hit.filter(|_| scene.live().contains(&0)) else {
            return Ok(());
        };
        let ray = frame.ray(&Ray { o, d, t_min, t_max }).expect("it meets the scene");
        for reach in [ray.t_max, ray.reach(hit.t)] {
            prop_assert!(framed(&frame, tiny).candidate::<NoCount>(&ray, reach, false).is_some());
        }
    }
}

/// A triangle of fair shape, and a ray from afar to a point within it or close outside.
#[test]
fn the_published_test_agrees_away_from_edges() {
    let corners = [[0.0, 0.0, 1.0], [2.0, 0.25, 1.5], [0.5, 1.75, 0.75]];
    let scene = Triangles::new(corners.to_vec(), vec![[0, 1, 2]]).unwrap();
    let frame = Frame::new(scene.bounds());
    let (mut hits, mut misses) = (0, 0);
    for i in 0..40 {
        for j in 0..40 {
            // Weights from -0.48 to 1.47, none within 0.01 of an edge.
            let [u, v] = [i, j].map(|k: i16| 0.05 * f32::from(k) - 0.48);
            if (1.0 - u - v).abs() < 0.01 {
                continue;
            }
            let target: [f32; 3] = std::array::from_fn(|k| {
                corners[0][k]
                    + u * (corners[1][k] - corners[0][k])
                    + v * (corners[2][k] - corners[0][k])
            });
            for o in [[3.0, -2.0, 5.0], [-4.0, 0.5, -3.0], [0.5, 9.0, 1.0]] {
                let d: [f32; 3] = std::array::from_fn(|k| target[k] - o[k]);
                let ray = Ray {
                    o,
                    d,
                    t_min: 0.0,
                    t_max: f32::INFINITY,
                };
                let inside = u > 0.0 && v > 0.0 && u + v < 1.0;
                let found = frame.ray(&ray).and_then(|ray| {
                    framed(&frame, corners)
                        .published(&ray, ray.t_max)
                        .map(|hit| (hit, ray))
                });
                assert_eq!(found.is_some(), inside, "{u} {v} from {o:?}");
                let Some(([t, found_u, found_v], ray)) = found else {
                    misses += 1;
                    continue;
                };
                hits += 1;
                let t = f64::from(t) * ray.to_scene();
                assert!(
                    (t - 1.0).abs() < 1e-5
                        && (found_u - u).abs() < 1e-5
                        && (found_v - v).abs() < 1e-5
                );
                // Behind the origin there is no hit, although the ray's interval reaches there.
                let back = Ray {
                    o,
                    d: d.map(|x| -x),
                    t_min: f32::NEG_INFINITY,
                    t_max: f32::INFINITY,
                };
                let back = frame.ray(&back).expect("its line meets the scene");
                assert_eq!(framed(&frame, corners).published(&back, back.t_max), None);
            }
        }
    }
    assert!(hits > 500 && misses > 1000, "{hits} {misses}");
}

#[test]
fn leaves_of_several_blocks_hold_their_triangles() {
    let corners: Vec<[f32; 3]> = (0..60_u8)
        .map(|i| [f32::from(i), f32::from(i % 7), f32::from(i % 3)])
        .collect();
    let indices = (0..20).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let scene = Triangles::new(corners, indices).unwrap();
    let frame = Frame::new(scene.bounds());
    let ids: Vec<u32> = (0..20).rev().collect();
    for keep in [Keep::Corners, Keep::Indices] {
        let blocks = Blocks::filled(&frame, keep, keep.words(20), |words| {
            keep.write(words, &scene, &frame, &ids);
        });
        let leaf = Leaf {
            first: 0,
            count: 20,
        };
        for (index, &id) in ids.iter().enumerate() {
            let corners = scene.corners(id).map(|p| frame.point(p));
            assert_eq!(
                blocks.triangle(&scene, leaf, index),
                (id, corners),
                "{keep:?}, {index}"
            );
        }
    }
}
