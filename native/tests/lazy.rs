// SPDX-License-Identifier: GPL-3.0-or-later
//! Lazily built trees: the tree equals that of a complete build, whichever rays build it and in any order, and the
//! answers are those of brute force while it grows.

mod hard;
#[path = "hard/turns.rs"]
mod turns;

use halfspace::base::Monitor;
use halfspace::base::error::Error;
use halfspace::inspect::validate::validate;
use halfspace::nodes::lazy_tree::{Part, Unbuilt};
use halfspace::nodes::shape::Shape;
use halfspace::oracle::cases::{Case, Random, aimed, grid, soup};
use halfspace::ray::{Hit, Order, Ray, RayCounters, Tracer};
use halfspace::registry::{self, TREES};
use halfspace::scene::Triangles;
use halfspace::structure::Structure;
use std::sync::{Arc, Barrier};

fn build(scene: &Arc<Triangles>, spec: &str, threads: usize) -> Structure {
    let config = registry::parse(spec).unwrap();
    Structure::build(scene.clone(), config, threads, &Monitor::new()).unwrap()
}

/// Every structure that can be built lazily: its complete and its lazy configuration.
fn specs() -> Vec<(String, String)> {
    let lazy = |tree: &&_| {
        let tree: &halfspace::structure::row::StructureSpec = tree;
        tree.params.iter().any(|p| p.name == "lazy")
    };
    let specs: Vec<_> = (TREES.iter().filter(lazy))
        .map(|tree| (tree.id.to_owned(), format!("{}:lazy=1", tree.id)))
        .collect();
    // The trees along normals, clusters, random and fixed directions are among them.
    assert!(specs.len() > 10);
    specs
}

fn closest(structure: &Structure, rays: &[Ray]) -> Vec<Hit> {
    let mut hits = vec![Hit::MISS; rays.len()];
    structure.closest(rays, &mut hits, None);
    hits
}

/// Number of answers that differ in some bit.
fn wrong(hits: &[Hit], expected: &[Hit]) -> usize {
    let bits = |h: &Hit| (h.triangle, h.t.to_bits(), h.u.to_bits(), h.v.to_bits());
    (hits.iter().zip(expected))
        .filter(|(a, b)| bits(a) != bits(b))
        .count()
}

fn same_tree(eager: &Structure, lazy: &Structure, about: &str) {
    let (eager, lazy) = (eager.built(), lazy.built());
    // Brute force replaces a complete tree whose rays would do more work, which is unknown while rays build it.
    if eager.tree.is_none() {
        return;
    }
    assert!(eager.same_nodes(lazy), "{about}: nodes");
    assert!(eager.leaves == lazy.leaves, "{about}: leaves");
    // The expected cost is summed in another order.
    let cost = (eager.shape.sah_cost - lazy.shape.sah_cost).abs();
    assert!(cost <= 1e-4 * eager.shape.sah_cost, "{about}: cost");
    let nodes = |shape: &Shape| (shape.nodes_axis, shape.nodes_oblique, shape.leaves);
    assert_eq!(nodes(&eager.shape), nodes(&lazy.shape), "{about}: nodes");
    // A tree that rays build does not know when it is complete, so it says nothing about cut triangles.
    let certain = |line: &&String| !line.starts_with("cut triangles");
    assert!(
        (eager.left_out.iter().filter(certain)).eq(lazy.left_out.iter().filter(certain)),
        "{about}: {:?}, {:?}",
        eager.left_out,
        lazy.left_out
    );
    assert_eq!(eager.shape.references, lazy.shape.references, "{about}");
    assert_eq!(eager.shape.depth_max, lazy.shape.depth_max, "{about}");
}

/// A scene whose parts have parts of their own.
fn large() -> Arc<Triangles> {
    soup(grid(11, 0.3))
}

#[test]
fn the_lazy_tree_equals_the_complete_one() {
    let scene = large();
    let rays = aimed(&scene, 40, &mut Random(3));
    for (i, (at_once, spec)) in specs().into_iter().enumerate() {
        for &threads in turns::in_turn(&[1, 2, 16], i) {
            let eager = build(&scene, &at_once, threads);
            let untouched = build(&scene, &spec, threads);
            let before = untouched.progress();
            assert!(
                before.built == 0 && before.unbuilt > 4,
                "{spec}: {before:?}"
            );
            same_tree(&eager, &untouched, &spec);
            let seen = build(&scene, &spec, threads);
            for one in rays.chunks(1) {
                closest(&seen, one);
            }
            let some = seen.progress();
            assert!(some.built > 4 && some.unbuilt > 4, "{spec}: {some:?}");
            assert!(some.shape.leaves < eager.shape().leaves, "{spec}");
            same_tree(&eager, &seen, &spec);
            let all = seen.progress();
            assert!(
                all.built > some.built && all.unbuilt == 0,
                "{spec}: {all:?}"
            );
            assert_eq!(validate(&seen), Vec::<String>::new(), "{spec}");
            // Apart from the heads of its parts it has the same nodes and leaves; wide nodes serve other traversals.
            let single = build(&scene, &format!("{at_once}:traversal=dir"), threads).bytes();
            let heads = (all.built + 1) * (size_of::<Part>() + size_of::<Unbuilt>());
            let parts = all.bytes - heads;
            assert!(parts >= single, "{spec}: {parts} bytes, {single} at once");
        }
    }
    for Case { name, scene, .. } in hard::cases(7) {
        for (at_once, spec) in specs() {
            let (eager, lazy) = (build(&scene, &at_once, 1), build(&scene, &spec, 1));
            same_tree(&eager, &lazy, &format!("{name}, {spec}"));
        }
    }
}

#[test]
fn rays_that_build_answer_like_brute_force() {
    for (
        c,
        Case {
            name, scene, rays, ..
        },
    ) in hard::cases(7).into_iter().enumerate()
    {
        let rays: Vec<_> = rays.into_iter().step_by(3).collect();
        let expected = closest(&build(&scene, "brute", 1), &rays);
        for (s, (_, spec)) in specs().into_iter().enumerate() {
            let lazy = || build(&scene, &spec, 1);
            let hits = closest(&lazy(), &rays);
            assert_eq!(wrong(&hits, &expected), 0, "{name}, {spec}");
            // Each other query builds a tree, too.
            for &query in turns::in_turn(&["tiles", "counted", "occluded"], c + s) {
                let mut found = hits.clone();
                match query {
                    "tiles" => lazy().closest_ordered(&rays, &mut found, None, Order::Tiles),
                    "counted" => {
                        let mut counters = vec![RayCounters::default(); rays.len()];
                        lazy().closest(&rays, &mut found, Some(&mut counters));
                    }
                    _ => {
                        let mut blocked = vec![false; rays.len()];
                        lazy().occluded(&rays, &mut blocked, None);
                        let hits: Vec<_> = expected.iter().map(Hit::is_hit).collect();
                        assert_eq!(blocked, hits, "{name}, {spec}: occluded");
                    }
                }
                assert_eq!(wrong(&found, &expected), 0, "{name}, {spec}: {query}");
            }
        }
    }
}

#[test]
fn rays_of_several_threads_race_for_the_same_parts() {
    const THREADS: usize = 4;
    let scene = large();
    let rays = aimed(&scene, 400, &mut Random(8));
    let expected = closest(&build(&scene, "kd", 1), &rays);
    for (at_once, spec) in specs() {
        let lazy = build(&scene, &spec, 1);
        let start = Barrier::new(THREADS);
        let answers: Vec<_> = std::thread::scope(|scope| {
            let threads: Vec<_> = (0..THREADS)
                .map(|_| {
                    scope.spawn(|| {
                        start.wait();
                        closest(&lazy, &rays)
                    })
                })
                .collect();
            threads.into_iter().map(|t| t.join().unwrap()).collect()
        });
        for hits in answers {
            assert_eq!(wrong(&hits, &expected), 0, "{spec}");
        }
        same_tree(&build(&scene, &at_once, 1), &lazy, &spec);
    }
}

/// A lazy build cannot fail half way, so a tree that would exceed the memory is refused at the start.
#[test]
fn a_lazy_tree_that_would_exceed_the_memory_is_refused_at_once() {
    // Overlapping long thin triangles, each in many leaves.
    let mut random = Random(5);
    let corners = (0..3000).flat_map(|_| {
        let at = random.point(0.0, 1.0);
        let beside = |size: f32, random: &mut Random| {
            let by = random.point(-size, size);
            [0, 1, 2].map(|k| at[k] + by[k])
        };
        [at, beside(0.5, &mut random), beside(0.005, &mut random)]
    });
    let scene = soup(corners.collect());
    // The first structures build quickest.
    let specs = specs();
    for (_, spec) in specs.iter().take(specs.len().div_ceil(hard::share())) {
        // Clipped triangles of unbuilt nodes take as much memory as the tree.
        let whole = format!("{spec},clip=0");
        let spec = if registry::parse(&whole).is_ok() {
            whole
        } else {
            spec.clone()
        };
        let within = |limit: usize| {
            let monitor = Monitor::new();
            monitor.limit_memory(limit as u64);
            Structure::build(scene.clone(), registry::parse(&spec).unwrap(), 1, &monitor)
        };
        let ample = build(&scene, &spec, 1);
        let start = ample.bytes();
        ample.built();
        let whole = ample.progress().bytes;
        assert!(whole > 8 * start, "{spec}: {start} of {whole} bytes");
        let error = within(whole / 4 * 3).err();
        assert!(
            matches!(&error, Some(Error::Memory(text)) if text.contains("once rays")),
            "{spec}, {whole} bytes: {error:?}"
        );
        let enough = within(whole / 2 * 3);
        assert!(enough.is_ok(), "{spec}, {whole} bytes: {:?}", enough.err());
        assert_eq!(enough.unwrap().progress().built, 0, "{spec}");
    }
}

#[test]
fn traversals_of_complete_trees_exclude_a_lazy_build() {
    for (_, spec) in specs() {
        for more in ["traversal=packet8", "shadow=beam", "nodes=boxes"] {
            let refused = registry::parse(&format!("{spec},{more}")).unwrap_err();
            let reason = refused.to_string();
            let named = reason.contains("lazy=1 has no effect") && reason.contains(more);
            assert!(named, "{spec},{more}: {reason}");
        }
    }
    let bad = registry::parse("kd:lazy=2").unwrap_err().to_string();
    assert!(bad.contains("lazy=2 is not one of 0, 1"), "{bad}");
}
