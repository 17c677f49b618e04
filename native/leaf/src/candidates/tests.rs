// SPDX-License-Identifier: GPL-3.0-or-later

use super::*;
use crate::blocks::{Blocks, WORDS};
use fearless_simd::{Level, dispatch};
use halfspace_geom::verdict::verdict;
use halfspace_ray::Ray;
use halfspace_ray::frame::Frame;
use halfspace_ray::query::{Closest, NoCountLate};
use halfspace_scene::Triangles;
use halfspace_strategies::{near_triangle, point, tiny_from_afar};
use proptest::array::{uniform3, uniform5};
use proptest::prelude::*;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20_000))]
    #[test]
    fn no_hit_is_ever_rejected(
        corners in prop::collection::vec(point(), 3..30),
        o in point(),
        weights in [0.0f32..1.0, 0.0f32..1.0],
        pick in any::<prop::sample::Index>(),
        t_min in prop_oneof![Just(0.0f32), Just(-1.0), Just(-1e3), Just(f32::NEG_INFINITY)],
        turned in any::<bool>(),
    ) {
        let count = corners.len() / 3;
        let indices = (0..u32::try_from(count).unwrap()).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let scene = Triangles::new(corners, indices).unwrap();
        prop_assume!(!scene.live().is_empty());
        let frame = Frame::new(scene.bounds());
        let mut blocks = Blocks::new();
        let first = blocks.push_leaf(&scene, &frame, scene.live());
        blocks.seal();
        let one = scene.live()[pick.index(scene.live().len())];
        let target = near_triangle(scene.corners(one), weights);
        let d: [f32; 3] = std::array::from_fn(|k| if turned { o[k] - target[k] } else { target[k] - o[k] });
        prop_assume!(d.iter().all(|x| x.is_finite()));
        let ray = Ray { o, d, t_min, t_max: f32::INFINITY };
        let hit = |id: u32| verdict(o, d, scene.corners(id)).map(|v| v.t).filter(|t| *t >= t_min && t.is_finite());
        let Some(framed) = frame.ray(&ray) else {
            prop_assert!(scene.live().iter().all(|&id| hit(id).is_none()), "the box test lost a hit");
            return Ok(());
        };
        // Test with the reach of the whole ray, and with that of each hit, within which nearer hits must stay.
        let hits: Vec<_> = scene.live().iter().filter_map(|&id| hit(id)).collect();
        let reaches: Vec<_> = hits.iter().map(|&t| (t, framed.reach(t))).chain([(f32::MAX, framed.t_max)]).collect();
        let mut at = first as usize;
        for ids in scene.live().chunks(LANES) {
            let n = ids.len();
            let block = blocks.block_words(at);
            for &(farthest, reach) in &reaches {
                let (mask, sure) = dispatch!(Level::new(), simd => {
                    let edges = Edges::new(simd, block, n);
                    let mut open = Candidates::new(simd, &edges, &framed, reach);
                    let proven = open.refine::<Closest, NoCountLate>(simd, &edges, &framed);
                    (open.lanes, std::array::from_fn::<_, LANES, _>(|lane| proven.range(lane)))
                });
                for (lane, &id) in ids.iter().enumerate() {
                    let lost = mask >> lane & 1 == 0 && hit(id).is_some_and(|t| t <= farthest);
                    prop_assert!(!lost, "triangle {id} was rejected");
                    let Some([low, high]) = sure[lane].filter(|_| mask >> lane & 1 == 1) else {
                        continue;
                    };
                    // The bounds of a proven hit must enclose the exact distance after its rounding.
                    let found = verdict(o, d, scene.corners(id)).map(|v| v.t);
                    prop_assert!(found.is_some(), "triangle {id} is missed for sure");
                    let [from, to] = framed.certain(&ray);
                    if low > from && high < to {
                        let t = found.unwrap();
                        prop_assert!(t_min <= t && t.is_finite(), "{t} is outside");
                        let at = f64::from(t) / framed.to_scene();
                        let slack = 1e-7 * at + 1e-44 / framed.to_scene();
                        prop_assert!(f64::from(low) <= at + slack && at - slack <= f64::from(high));
                        let above = (at as f32).next_up();
                        prop_assert!(framed.reach(t) <= framed.beyond(above), "something as near is lost");
                    }
                }
            }
            at += 1 + WORDS * n;
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20_000))]
    #[test]
    fn no_tiny_triangle_is_rejected_from_afar((tiny, [o, d], [t_min, t_max]) in tiny_from_afar()) {
        // A scene this large is just not scaled.
        let x = 2.0_f32.powi(39);
        let all = vec![tiny[0], tiny[1], tiny[2], [x; 3], [x, x, 0.5 * x], [-x, -x, 0.0]];
        let scene = Triangles::new(all, vec![[0, 1, 2], [3, 4, 5]]).unwrap();
        let frame = Frame::new(scene.bounds());
        let hit = verdict(o, d, tiny).filter(|hit| t_min <= hit.t && hit.t <= t_max);
        let Some(hit) = hit.filter(|_| scene.live().contains(&0)) else {
            return Ok(());
        };
        let mut blocks = Blocks::new();
        let first = blocks.push_leaf(&scene, &frame, &[0]);
        blocks.seal();
        let framed = frame.ray(&Ray { o, d, t_min, t_max }).expect("it meets the scene");
        let kept = dispatch!(Level::new(), simd => {
            let edges = Edges::new(simd, blocks.block_words(first as usize), 1);
            [framed.t_max, framed.reach(hit.t)].map(|reach| {
                let mut open = Candidates::new(simd, &edges, &framed, reach);
                open.refine::<Closest, NoCountLate>(simd, &edges, &framed);
                open.any()
            })
        });
        prop_assert_eq!(kept, [true; 2]);
    }
}

/// A direction with its largest component in [1, 2), as in a frame.
fn unit_direction() -> impl Strategy<Value = [f32; 3]> {
    let side = || -1.0f32..1.0;
    ([side(), side(), side()], 0..3usize, 1.0f32..2.0).prop_map(|(mut d, axis, longest)| {
        d[axis] = longest.copysign(d[axis]);
        d
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20_000))]
    #[test]
    fn no_hit_of_a_blurred_ray_is_rejected(
        corners in uniform3(uniform3(-1.0f32..1.0)),
        size in -8i32..2,
        d in unit_direction(),
        [s, t] in [0.0f32..1.0, 0.0f32..1.0],
        on_edge in any::<bool>(),
        distance in 0.0f32..8.0,
        errors in uniform5(uniform3(-1i8..2)),
        [blurred, turned] in [-20i32..-2, -24i32..-7],
    ) {
        // Make a ray that hits a triangle, inside or on an edge.
        let corners = corners.map(|p| p.map(|x| x * 2.0_f32.powi(size)));
        let weights = if on_edge { [s, 1.0 - s] } else { [s, t] };
        let target = near_triangle(corners, weights);
        let o: [f32; 3] = std::array::from_fn(|k| target[k] - distance * d[k]);
        let Some(hit) = verdict(o, d, corners).filter(|hit| hit.t >= 0.0) else {
            return Ok(());
        };
        // What the test reads differs from it by errors of which most are as large as they may be.
        let [blurred, turned] = [2.0_f32.powi(blurred + size), 2.0_f32.powi(turned)];
        let moved = |p: [f32; 3], error: [i8; 3], by: f32| -> [f32; 3] {
            std::array::from_fn(|k| p[k] + f32::from(error[k]) * by)
        };
        let read: [[f32; 3]; 3] = std::array::from_fn(|i| moved(corners[i], errors[i], 0.25 * blurred));
        let read_ray = [moved(o, errors[3], 0.5 * blurred), moved(d, errors[4], turned)];
        let largest = |a: [f32; 3], b: [f32; 3]| {
            (0..3).map(|k| (f64::from(a[k]) - f64::from(b[k])).abs()).fold(0.0, f64::max)
        };
        let of_corner = (0..3).map(|i| largest(read[i], corners[i])).fold(0.0, f64::max);
        let blur = ((largest(read_ray[0], o) + 2.0 * of_corner) as f32).next_up();
        let drift = (largest(read_ray[1], d) as f32).next_up();
        prop_assume!(read_ray[1].iter().all(|x| x.abs() <= 2.0));
        let scene = Triangles::new(read.to_vec(), vec![[0, 1, 2]]).unwrap();
        prop_assume!(!scene.live().is_empty());
        let frame = Frame::new(scene.bounds());
        prop_assume!(frame.is_unscaled() && frame.map().origin() == [0.0; 3]);
        let far = read_ray[0].map(f32::abs).into_iter().fold(0.0, f32::max);
        let framed = FrameRay {
            o: read_ray[0],
            d: read_ray[1],
            t_min: 0.0,
            span: far + frame.bounds().magnitude(),
            blur,
            drift,
            ..FrameRay::NOTHING
        };
        let mut blocks = Blocks::new();
        let first = blocks.push_leaf(&scene, &frame, &[0]);
        blocks.seal();
        let kept = dispatch!(Level::new(), simd => {
            let edges = Edges::new(simd, blocks.block_words(first as usize), 1);
            [f32::MAX, framed.reach(hit.t)].map(|reach| {
                let mut open = Candidates::new(simd, &edges, &framed, reach);
                open.refine::<Closest, NoCountLate>(simd, &edges, &framed);
                open.drop_beyond(simd, framed.reach(hit.t));
                open.any()
            })
        });
        prop_assert_eq!(kept, [true; 2], "{:?} {} {}", framed, hit.t, hit.u);
    }
}
