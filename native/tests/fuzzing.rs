// SPDX-License-Identifier: GPL-3.0-or-later
//! Random input of every kind: no configuration string and no triangles cause a panic, and every structure answers
//! like brute force.

use halfspace::base::Monitor;
use halfspace::oracle::exact_closest;
use halfspace::ray::{Hit, Order, Ray, Tracer};
use halfspace::registry::{self, TREES};
use halfspace::scene::Triangles;
use halfspace::structure::Structure;
use halfspace::structure::row::{Kind, ParamSpec};
use halfspace::structure::way::{NODES, TRAVERSAL};
use proptest::prelude::*;
use std::sync::Arc;

/// Numbers of few bits, which coincide often, or numbers of any exponent, NaN and infinity.
fn number() -> impl Strategy<Value = f32> {
    prop_oneof![
        6 => (-8i8..8).prop_map(f32::from),
        4 => (-8i8..8).prop_map(|x| f32::from(x) / 8.0),
        4 => -1.0f32..1.0,
        2 => prop::num::f32::NORMAL | prop::num::f32::SUBNORMAL | prop::num::f32::ZERO,
        1 => prop::num::f32::ANY,
    ]
}

fn point() -> impl Strategy<Value = [f32; 3]> {
    [number(), number(), number()]
}

fn ray() -> impl Strategy<Value = Ray> {
    (point(), point(), number(), number(), any::<bool>()).prop_map(
        |(o, d, t_min, t_max, limited)| Ray {
            o,
            d,
            t_min: if limited { t_min } else { 0.0 },
            t_max: if limited { t_max } else { f32::INFINITY },
        },
    )
}

/// A value that is valid or invalid for the parameter.
fn value(param: &'static ParamSpec) -> BoxedStrategy<String> {
    match param.kind {
        Kind::Integer { min, max } => (min..=max).prop_map(|x| x.to_string()).boxed(),
        Kind::Float { min, max } => (min..=max).prop_map(|x| x.to_string()).boxed(),
        Kind::Choice(_) => prop::sample::select(param.kind.options().unwrap())
            .prop_map(str::to_owned)
            .boxed(),
    }
}

/// A valid configuration of any structure, without `robust=none`, which returns wrong hits on purpose.
fn spec() -> impl Strategy<Value = String> {
    (0..TREES.len()).prop_flat_map(|i| {
        let tree = &TREES[i];
        let pairs: Vec<_> = tree
            .all_params()
            .filter(|param| !["robust", NODES, TRAVERSAL].contains(&param.name))
            .map(|param| {
                prop::option::of(value(param))
                    .prop_map(move |v| v.map(|v| format!("{}={v}", param.name)))
            })
            .collect();
        (prop::sample::select(tree.spelled_ways()), pairs).prop_map(move |(way, pairs)| {
            // Leave out what has no effect next to the others.
            let mut spec = format!("{way}{}", if way.contains(':') { "" } else { ":" });
            for pair in pairs.into_iter().flatten() {
                let more = format!("{spec},{pair}");
                if registry::parse(&more).is_ok() {
                    spec = more;
                }
            }
            spec
        })
    })
}

fn build(scene: &Arc<Triangles>, spec: &str) -> Structure {
    Structure::build(
        scene.clone(),
        registry::parse(spec).unwrap(),
        1,
        &Monitor::new(),
    )
    .unwrap()
}

fn bits(hit: &Hit) -> [u32; 4] {
    [
        hit.t.to_bits(),
        hit.triangle,
        hit.u.to_bits(),
        hit.v.to_bits(),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(400) })]

    #[test]
    fn every_configuration_answers_like_brute_force(
        spec in spec(),
        corners in prop::collection::vec(point(), 0..90),
        rays in prop::collection::vec(ray(), 1..60),
        aims in prop::collection::vec(any::<[prop::sample::Index; 2]>(), 0..60),
    ) {
        let count = u32::try_from(corners.len() / 3).unwrap();
        let indices = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let mut rays = rays;
        if count > 0 {
            // Trace from vertex to vertex, too.
            rays.extend(aims.iter().map(|[a, b]| {
                let (o, p) = (corners[a.index(corners.len())], corners[b.index(corners.len())]);
                Ray { o, d: std::array::from_fn(|k| p[k] - o[k]), t_min: 0.0, t_max: f32::INFINITY }
            }));
        }
        let scene = Arc::new(Triangles::new(corners, indices).unwrap());
        let config = registry::parse(&spec).unwrap();
        let structure = Structure::build(scene.clone(), config, 1, &Monitor::new()).unwrap();
        let brute = build(&scene, "brute");
        let mut expected = vec![Hit::MISS; rays.len()];
        let mut found = expected.clone();
        let mut occluded = vec![false; rays.len()];
        brute.closest(&rays, &mut expected, None);
        structure.closest(&rays, &mut found, None);
        structure.occluded(&rays, &mut occluded, None);
        let mut in_tiles = vec![Hit::MISS; rays.len()];
        structure.closest_ordered(&rays, &mut in_tiles, None, Order::Tiles);
        for (i, ray) in rays.iter().enumerate() {
            prop_assert_eq!(bits(&in_tiles[i]), bits(&expected[i]), "{}, in tiles: {:?}", spec, ray);
            prop_assert_eq!(bits(&found[i]), bits(&expected[i]), "{}: {:?}", spec, ray);
            prop_assert_eq!(occluded[i], expected[i].is_hit(), "{}: {:?}", spec, ray);
            if ray.o.iter().chain(&ray.d).all(|x| x.is_finite()) {
                let exact = exact_closest(&scene, ray).hit;
                prop_assert_eq!((found[i].t, found[i].triangle), (exact.t, exact.triangle), "{:?}", ray);
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(20_000) })]

    #[test]
    fn no_text_makes_the_parser_panic(
        text in prop_oneof![
            any::<String>(),
            "(kd|kd-sah|brute)?:?([a-z_]{0,12}=?[-+.0-9a-z]{0,24},?){0,4}",
        ]
    ) {
        let _ = registry::parse(&text);
    }

    #[test]
    fn valid_specs_read_back_from_their_canonical_text(spec in spec()) {
        let config = registry::parse(&spec).unwrap();
        let again = registry::parse(&config.canonical()).unwrap();
        prop_assert_eq!(config.canonical(), again.canonical());
        prop_assert!(config.values().zip(again.values()).all(|(a, b)| a == b));
    }
}
