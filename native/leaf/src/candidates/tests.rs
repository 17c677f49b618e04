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
