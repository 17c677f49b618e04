// SPDX-License-Identifier: GPL-3.0-or-later
//! Nearest triangles and overlaps against integers, and against a comparison of all triangles.

use crate::meeting::Triangle;
use crate::verdict::Candidate;
use crate::{Nearest, Surface};
use halfspace_base::Monitor;
use halfspace_oracle::cases::{Case, Random, Size, cases, soup};
use halfspace_oracle::{ExactNearest, exact_nearest, exact_overlap};
use halfspace_scene::Triangles;
use halfspace_structure::Structure;
use halfspace_trees::registry;
use proptest::prelude::*;
use std::sync::Arc;

fn surface(scene: &Arc<Triangles>, spec: &str) -> Surface {
    let config = registry::parse(spec).unwrap();
    let structure = Structure::build(scene.clone(), config, 1, &Monitor::new()).unwrap();
    Surface::new(&structure).unwrap()
}

fn bits(found: &Nearest) -> (u32, u32, [u32; 3]) {
    (
        found.triangle,
        found.distance.to_bits(),
        found.point.map(f32::to_bits),
    )
}

fn exact_bits(found: &ExactNearest) -> (u32, u32, [u32; 3]) {
    (
        found.triangle,
        found.distance.to_bits(),
        found.point.map(f32::to_bits),
    )
}

/// The candidates of a point at most at `radius`, by a look at all triangles.
fn candidates(scene: &Triangles, point: [f32; 3], radius: f32) -> Vec<Candidate> {
    let finite = |id: &u32| {
        let corners = scene.corners(*id);
        corners.as_flattened().iter().all(|x| x.is_finite())
    };
    let ids = (0..u32::try_from(scene.len()).unwrap()).filter(finite);
    let all = ids.map(|id| Candidate::new(point, id, scene.corners(id)));
    all.filter(|one| one.is_within(radius, point)).collect()
}

/// The nearest triangle of a point by a comparison of all triangles.
fn brute_force(scene: &Triangles, point: [f32; 3], limit: f32) -> Nearest {
    let all = candidates(scene, point, limit).into_iter();
    let best = all.reduce(|a, b| if b.order(&a, point).is_lt() { b } else { a });
    let answer = best.map(|one| (one.id, one.closest(point)));
    answer
        .filter(|(_, closest)| closest.distance < f32::INFINITY)
        .map_or(Nearest::NONE, |(triangle, closest)| Nearest {
            distance: closest.distance,
            triangle,
            point: closest.point,
        })
}

/// Points on, near and far from a scene.
fn points(case: &Case, random: &mut Random) -> Vec<[f32; 3]> {
    let scene = &case.scene;
    let mut found: Vec<_> = case.rays.iter().step_by(83).map(|ray| ray.o).collect();
    for _ in 0..8 {
        let Some(&id) = scene.live().get(random.below(scene.live().len().max(1))) else {
            break;
        };
        let [a, b, c] = scene.corners(id);
        let (s, t) = (random.unit(), random.unit());
        let far = 10.0_f32.powf(12.0 * t - 6.0);
        found.extend([
            a,
            std::array::from_fn(|k| a[k] / 2.0 + b[k] / 2.0),
            std::array::from_fn(|k| a[k] * (1.0 - s) * (1.0 - t) + b[k] * s * (1.0 - t) + c[k] * t),
            std::array::from_fn(|k| a[k] + far * (b[k] - a[k]) - far * s * (c[k] - a[k])),
            random.point(-far, far),
        ]);
    }
    found.retain(|p| p.iter().all(|x| x.is_finite()));
    found
}

/// Generates coordinates of few bits, which meet edges and planes exactly, and others of any exponent.
fn coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![
        4 => (-3i8..4).prop_map(f32::from),
        2 => -1.0f32..1.0,
        1 => (-4i16..4, -20i32..20).prop_map(|(m, e)| f32::from(m) * 2.0_f32.powi(e)),
        1 => prop::num::f32::NORMAL | prop::num::f32::SUBNORMAL | prop::num::f32::ZERO,
    ]
}

fn point() -> impl Strategy<Value = [f32; 3]> {
    [coordinate(), coordinate(), coordinate()]
}

/// Generates triangles: any, with equal vertices, slivers, and with a vertex on the line of the others.
fn triangle() -> impl Strategy<Value = [[f32; 3]; 3]> {
    let shapes = ([point(), point(), point()], 0usize..6, -30i32..1);
    let make = |([a, b, c], shape, e): ([[f32; 3]; 3], usize, i32)| {
        let mix = |s: f32, t: f32| std::array::from_fn(|k| a[k] * s + b[k] * t);
        match shape {
            0 => [a, b, b],
            1 => [a, a, a],
            2 => [a, b, mix(0.5, 0.5)],
            3 => {
                let middle: [f32; 3] = mix(0.5, 0.5);
                let thin = 2.0_f32.powi(e);
                [
                    a,
                    b,
                    std::array::from_fn(|k| middle[k] + thin * (c[k] - middle[k])),
                ]
            }
            _ => [a, b, c],
        }
    };
    let finite = |t: &[[f32; 3]; 3]| t.as_flattened().iter().all(|x| x.is_finite());
    shapes.prop_map(make).prop_filter("finite", finite)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6_000))]
    #[test]
    fn distance_and_closest_point_are_those_of_integers(
        corners in triangle(), p in point(), (s, t) in (0.0f32..1.0, 0.0f32..1.0), on in any::<bool>(), limit in coordinate(),
    ) {
        // Every other point lies near the triangle.
        let p = if on {
            let [a, b, c] = corners;
            std::array::from_fn(|k| a[k] * (1.0 - s) * (1.0 - t) + b[k] * s * (1.0 - t) + c[k] * t)
        } else {
            p
        };
        prop_assume!(p.iter().all(|x: &f32| x.is_finite()));
        let scene = soup(corners.to_vec());
        let exact = exact_nearest(&scene, p, f32::INFINITY);
        let one = Candidate::new(p, 0, corners);
        let closest = one.closest(p);
        if exact.triangle == 0 {
            prop_assert_eq!(closest.distance.to_bits(), exact.distance.to_bits());
            prop_assert_eq!(closest.point.map(f32::to_bits), exact.point.map(f32::to_bits));
        } else {
            prop_assert_eq!(closest.distance, f32::INFINITY);
        }
        // The distance itself is a limit of which rounding decides, and the numbers around it.
        for limit in [limit, exact.distance, exact.distance.next_up(), exact.distance.next_down()] {
            let within = exact_nearest(&scene, p, limit).triangle == 0;
            prop_assert_eq!(one.is_within(limit, p) && closest.distance < f32::INFINITY, within);
        }
    }

    #[test]
    fn the_nearer_triangle_is_that_of_integers(
        mut a in triangle(), b in triangle(), p in point(), shared in 0usize..4,
    ) {
        // Three of four pairs share vertices.
        a[..shared.min(2)].copy_from_slice(&b[..shared.min(2)]);
        let scene = soup([a, b].concat());
        let exact = exact_nearest(&scene, p, f32::INFINITY).triangle;
        let [one, other] = [0, 1].map(|id| Candidate::new(p, id, [a, b][id as usize]));
        let nearer = if one.order(&other, p).is_lt() { 0 } else { 1 };
        prop_assert!(exact == nearer || exact == u32::MAX, "{} {}", exact, nearer);
    }

    #[test]
    fn triangles_meet_as_integers_decide(mut a in triangle(), b in triangle(), shared in 0usize..6, s in 0.0f32..1.0) {
        match shared {
            0 => a[0] = b[0],
            1 => a[..2].copy_from_slice(&b[..2]),
            // Near a point of the other triangle.
            2 => a[0] = std::array::from_fn(|k| b[0][k] * s + b[1][k] * (1.0 - s)),
            _ => {}
        }
        prop_assume!(a.as_flattened().iter().all(|x| x.is_finite()));
        let exact = exact_overlap(a, b);
        prop_assert_eq!(Triangle::new(a).meets(&Triangle::new(b)), exact);
        prop_assert_eq!(Triangle::new(b).meets(&Triangle::new(a)), exact);
    }
}

#[test]
fn the_tree_finds_what_a_comparison_of_all_triangles_finds() {
    let (mut random, mut found) = (Random(5), 0);
    for case in cases(Size::Small, 3) {
        let surfaces = ["bvh-sah", "bvh-sah:width=4", "bvh-sah:width=2"]
            .map(|spec| surface(&case.scene, spec));
        for (i, p) in points(&case, &mut random).into_iter().enumerate() {
            let right = brute_force(&case.scene, p, f32::INFINITY);
            for surface in &surfaces {
                let nearest = surface.nearest(p, f32::INFINITY);
                assert_eq!(bits(&nearest), bits(&right), "{} {p:?}", case.name);
            }
            // Integers take long: one of many points.
            if i % 13 == 0 {
                let exact = exact_nearest(&case.scene, p, f32::INFINITY);
                assert_eq!(exact_bits(&exact), bits(&right), "{} {p:?}", case.name);
            }
            // The distance itself is a limit that rounding decides.
            for limit in [right.distance, right.distance.next_down()] {
                let nearest = surfaces[i % 3].nearest(p, limit);
                let right = brute_force(&case.scene, p, limit);
                assert_eq!(bits(&nearest), bits(&right), "{} {p:?}", case.name);
            }
            found += usize::from(right != Nearest::NONE);
        }
    }
    assert!(found > 1_000, "{found}");
}

#[test]
fn all_triangles_within_a_distance_are_found_in_order() {
    let (mut random, mut found) = (Random(6), 0);
    for (i, case) in cases(Size::Small, 3).into_iter().enumerate() {
        let surface = surface(&case.scene, ["bvh-sah", "bvh-sah:width=4"][i % 2]);
        for p in points(&case, &mut random).into_iter().step_by(9) {
            // So far that some dozens of triangles lie within.
            let mut all = candidates(&case.scene, p, f32::MAX);
            all.sort_by(|a, b| a.span.high.total_cmp(&b.span.high));
            let Some(last) = all.get(all.len().min(60).saturating_sub(1)) else {
                continue;
            };
            let limit = last.closest(p).distance;
            let mut right = candidates(&case.scene, p, limit);
            right.sort_by(|a, b| a.order(b, p));
            let near = surface.within(&[p], |_| limit, 1).unwrap();
            let ids = near.found.iter().map(|one| one.triangle);
            let finite = right
                .iter()
                .filter(|one| one.closest(p).distance < f32::INFINITY);
            assert!(
                ids.eq(finite.map(|one| one.id)),
                "{} {p:?} {limit}",
                case.name
            );
            for one in &near.found {
                assert!(one.distance <= limit, "{} {p:?}", case.name);
            }
            found += near.found.len();
        }
    }
    assert!(found > 5_000, "{found}");
}

/// All pairs by a comparison of all triangles.
fn all_pairs(one: &Triangles, other: &Triangles) -> Vec<[u32; 2]> {
    let finite = |scene: &Triangles| -> Vec<_> {
        let ids = 0..u32::try_from(scene.len()).unwrap();
        let all = ids.map(|id| (id, scene.corners(id)));
        all.filter(|(_, corners)| corners.as_flattened().iter().all(|x| x.is_finite()))
            .map(|(id, corners)| (id, Triangle::new(corners)))
            .collect()
    };
    let (own, others) = (finite(one), finite(other));
    let pairs = own.iter().flat_map(|(a, first)| {
        let met = others.iter().filter(|(_, second)| first.meets(second));
        met.map(|(b, _)| [*a, *b])
    });
    pairs.collect()
}

#[test]
fn all_overlaps_are_found() {
    let all = cases(Size::Small, 4);
    let mut found = 0;
    for (i, case) in all.iter().enumerate() {
        let own = surface(&case.scene, "bvh-sah");
        // The next case, and the same triangles without common indices.
        let others = [&all[(i + 1) % all.len()].scene, &case.scene];
        for other in &others[..1 + usize::from(i % 3 == 0)] {
            let against = surface(other, "bvh-sah:width=4");
            let right = all_pairs(&case.scene, other);
            for threads in [1, 3] {
                assert_eq!(
                    own.overlaps(&against, threads).unwrap(),
                    right,
                    "{}",
                    case.name
                );
            }
            found += right.len();
        }
    }
    assert!(found > 10_000, "{found}");
}

#[test]
fn neighbours_of_one_surface_overlap_only_in_further_points() {
    // Two triangles share an edge; one shares a vertex and pierces; one shares a vertex and lies apart.
    let vertices = vec![
        [0.0, 0.0, 0.0],
        [4.0, 0.0, 0.0],
        [0.0, 4.0, 0.0],
        [4.0, 4.0, 0.0],
        [1.0, 1.0, -1.0],
        [1.0, 1.0, 2.0],
        [-1.0, -2.0, 1.0],
        [-2.0, -1.0, 1.0],
    ];
    let triangles = vec![[0, 1, 2], [1, 3, 2], [0, 4, 5], [0, 6, 7]];
    let scene = Arc::new(Triangles::new(vertices, triangles).unwrap());
    let one = surface(&scene, "bvh-sah");
    assert_eq!(one.overlaps(&one, 1).unwrap(), [[0, 2], [2, 0]]);
    // Another surface of the same triangles has all that touch.
    let again = surface(&scene, "bvh-sah");
    let all = one.overlaps(&again, 1).unwrap();
    let touching = [[0, 0], [0, 1], [0, 2], [0, 3], [1, 0], [1, 1]];
    assert_eq!(all[..6], touching);
    assert_eq!(all.len(), 12);
}

#[test]
fn no_triangles_have_no_nearest_and_no_overlaps() {
    let nothing = soup(Vec::new());
    let nan = soup(vec![[f32::NAN; 3]; 3]);
    let dot = soup(vec![[1.0, 2.0, 3.0]; 3]);
    for scene in [&nothing, &nan] {
        let empty = surface(scene, "bvh-sah");
        assert_eq!(bits(&empty.nearest([0.0; 3], 9.0)), bits(&Nearest::NONE));
        assert_eq!(
            empty.within(&[[0.0; 3]], |_| 9.0, 1).unwrap().offsets,
            [0, 0]
        );
        let other = surface(&dot, "bvh-sah");
        assert_eq!(empty.overlaps(&other, 1).unwrap(), [[0; 2]; 0]);
        assert_eq!(other.overlaps(&empty, 1).unwrap(), [[0; 2]; 0]);
        // A point is found although no ray hits it.
        let found = other.nearest([1.0, 2.0, 5.0], 2.0);
        assert_eq!(
            (found.triangle, found.distance, found.point),
            (0, 2.0, [1.0, 2.0, 3.0])
        );
    }
}

#[test]
fn other_trees_are_refused_by_name() {
    // Long diagonal triangles, which spatial splits divide.
    let diagonal = |i: u16| {
        let x = f32::from(i);
        [[x, 0.0, 0.0], [x + 64.0, 64.0, 64.0], [x, 0.1, 0.0]]
    };
    let scene = soup((0..64).flat_map(diagonal).collect());
    let surface = |spec| {
        let config = registry::parse(spec).unwrap();
        let structure = Structure::build(scene.clone(), config, 1, &Monitor::new()).unwrap();
        Surface::new(&structure)
    };
    assert!(surface("bvh-ploc").is_ok());
    for spec in ["kd", "bvh-sah:splits=1"] {
        let error = surface(spec).unwrap_err().to_string();
        let expected = format!("structure: {spec} has no boxes");
        assert!(error.starts_with(&expected), "{error}");
    }
}
