// SPDX-License-Identifier: GPL-3.0-or-later
//! Hierarchies with spatial splits: a triangle in several leaves changes no answer, on all contract scenes and for every
//! way to send rays.

mod common;
#[path = "common/cores.rs"]
mod cores;

use common::build;
use cores::on_all_cores;
use halfspace::inspect::validate::validate;
use halfspace::oracle::cases::{Case, Random, Size, aimed, cases, soup};
use halfspace::oracle::levels;
use halfspace::ray::{Hit, Order, Ray, RayCounters, Tracer};
use halfspace::registry;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Bit patterns of the nearest hits, and whether each ray is occluded.
type Answers = (Vec<[u32; 4]>, Vec<bool>);

fn answers(
    structure: &impl Tracer,
    rays: &[Ray],
    order: Order,
    mut counters: Option<&mut [RayCounters]>,
) -> Answers {
    let mut hits = vec![Hit::MISS; rays.len()];
    let mut blocked = vec![false; rays.len()];
    structure.closest_ordered(rays, &mut hits, counters.as_deref_mut(), order);
    structure.occluded(rays, &mut blocked, counters);
    let bits = |hit: &Hit| [hit.t, hit.u, hit.v].map(f32::to_bits);
    let hits = hits.iter().map(|hit| {
        let [t, u, v] = bits(hit);
        [t, hit.triangle, u, v]
    });
    (hits.collect(), blocked)
}

/// Returns the configuration with spatial splits for each way to send rays through eight boxes.
fn specs() -> Vec<String> {
    let row = registry::find("bvh-sah").expect("a structure");
    let spelled = row.ways.iter().map(|way| row.spelled(way));
    let specs = spelled.map(|way| format!("bvh-sah:splits=4,{way}"));
    let specs: Vec<_> = specs
        .map(|spec| spec.trim_end_matches(',').to_owned())
        .collect();
    assert!(specs.len() > 8 && specs.iter().all(|spec| registry::parse(spec).is_ok()));
    specs
}

/// Long thin triangles across a room, in all directions, with some twice.
fn beams(count: usize) -> Vec<[f32; 3]> {
    let mut random = Random(8);
    let mut beam = || {
        let (from, to) = (random.point(-1.0, 1.0), random.point(-1.0, 1.0));
        let beside = random.point(-0.01, 0.01);
        [from, to, [0, 1, 2].map(|k| to[k] + beside[k])]
    };
    let mut corners: Vec<_> = (0..count).flat_map(|_| beam()).collect();
    corners.extend_from_within(..30);
    corners
}

#[test]
fn answers_are_those_of_brute_force_on_all_contract_scenes() {
    let specs = specs();
    let cut = AtomicUsize::new(0);
    on_all_cores(cases(Size::Small, 7), |case| {
        let Case {
            name, scene, rays, ..
        } = case;
        let brute = build(&scene, "brute");
        for (i, spec) in specs.iter().enumerate() {
            // Trace a third of the rays, another third for the next specification.
            let rays: Vec<_> = rays.iter().copied().skip(i % 3).step_by(3).collect();
            let structure = build(&scene, spec);
            assert_eq!(validate(&structure), Vec::<String>::new(), "{name}, {spec}");
            let further = structure.shape().references - scene.live().len();
            cut.fetch_add(further, Ordering::Relaxed);
            let expected = answers(&brute, &rays, Order::None, None);
            let found = answers(&structure, &rays, Order::None, None);
            assert!(found == expected, "{name}, {spec}");
            let some: Vec<_> = rays.iter().copied().step_by(8).collect();
            let expected = answers(&brute, &some, Order::None, None);
            for (set, level) in levels() {
                for order in [Order::None, Order::Tiles] {
                    let found = answers(&structure.at_level(level), &some, order, None);
                    assert!(found == expected, "{name}, {spec}, {set}");
                }
            }
        }
    });
    let cut = cut.into_inner();
    assert!(cut > 1000, "only {cut} further references");
}

#[test]
fn counters_change_no_answer() {
    let scene = soup(beams(400));
    let rays = aimed(&scene, 3000, &mut Random(6));
    let brute = build(&scene, "brute");
    let expected = answers(&brute, &rays, Order::None, None);
    for spec in specs() {
        let structure = build(&scene, &spec);
        assert!(structure.shape().references > scene.len(), "{spec}");
        let mut counters = vec![RayCounters::default(); rays.len()];
        let found = answers(&structure, &rays, Order::Tiles, Some(&mut counters));
        assert!(found == expected, "{spec}");
    }
}

#[test]
fn qualities_build_the_trees_of_other_configurations() {
    let scene = soup(beams(400));
    for (quality, spec) in [
        ("fast", "bvh-hlbvh"),
        ("medium", "bvh-sah"),
        ("high", "bvh-sah:splits=0.3"),
    ] {
        let built = build(&scene, &format!("bvh-sah:quality={quality}"));
        let expected = build(&scene, spec);
        assert!(built.built().same_nodes(expected.built()), "{quality}");
    }
}
