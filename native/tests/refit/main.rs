// SPDX-License-Identifier: GPL-3.0-or-later
//! Structures that are fitted to moved triangles: every traversal returns what brute force returns for the triangles
//! where they are now, and no invariant breaks.

#[path = "../common/mod.rs"]
mod common;
#[path = "../hard/mod.rs"]
mod hard;

use common::build;
use halfspace::base::Monitor;
use halfspace::base::error::Error;
use halfspace::inspect::validate::validate;
use halfspace::oracle::cases::{Random, aimed, grid, soup};
use halfspace::ray::{Hit, Order, Ray, Tracer};
use halfspace::registry::TREES;
use halfspace::scene::Triangles;
use halfspace::structure::Structure;
use halfspace::structure::row::StructureSpec;
use std::sync::Arc;

/// Structures that must be fitted, among others.
const FITTED: [&str; 7] = [
    "bvh-sah", "bih", "bih-sah", "bih5", "bih1", "bih-n", "bih-bvh",
];

/// The structures that can be fitted.
fn fitted() -> impl Iterator<Item = &'static StructureSpec> {
    let scene = soup(grid(2, 0.3));
    TREES
        .iter()
        .filter(move |tree| build(&scene, tree.id).can_refit())
}

/// Every way through the structures that can be fitted, and their other node widths.
fn specs() -> Vec<String> {
    let ways = fitted().flat_map(|tree| tree.spelled_ways());
    let more = [
        "bvh-sah:width=4",
        "bvh-sah:width=2",
        "bvh-sah:width=4,traversal=tile",
        "bvh-sah:width=2,traversal=packet",
        "bih-n:n=2",
        "bih-n:n=8",
        "bih:leaves=corners",
        "bih:empty=0",
        "bih5:empty=1,leaf_size=1",
        "bih1:empty=1,leaf_size=1",
        "bih-n:empty=1,leaf_size=1",
        "bvh-sah:shadow=cache",
    ];
    ways.chain(more.map(ToOwned::to_owned)).collect()
}

/// Number of answers that differ from those of brute force over the same triangles.
fn wrong(structure: &Structure, rays: &[Ray]) -> usize {
    let brute = build(structure.scene(), "brute");
    let bits = |h: &Hit| (h.triangle, h.t.to_bits(), h.u.to_bits(), h.v.to_bits());
    let answers = |structure: &Structure, order| {
        let mut hits = vec![Hit::MISS; rays.len()];
        structure.closest_ordered(rays, &mut hits, None, order);
        hits.iter().map(bits).collect::<Vec<_>>()
    };
    let blocked = |structure: &Structure| {
        let mut blocked = vec![false; rays.len()];
        structure.occluded(rays, &mut blocked, None);
        blocked
    };
    let expected = answers(&brute, Order::None);
    let mut differ = 0;
    for order in [Order::None, Order::Tiles] {
        let found = answers(structure, order);
        differ += found.iter().zip(&expected).filter(|(a, b)| a != b).count();
    }
    let expected = blocked(&brute);
    differ
        + (blocked(structure).iter().zip(&expected))
            .filter(|(a, b)| a != b)
            .count()
}

/// Rays aimed at a scene; an empty one gets those of a small grid.
fn rays(scene: &Arc<Triangles>) -> Vec<Ray> {
    let count = 96;
    if scene.live().is_empty() {
        return aimed(&soup(grid(3, 0.3)), count, &mut Random(5));
    }
    let mut rays = aimed(scene, count, &mut Random(5));
    rays.retain(|ray| ray.o.iter().chain(&ray.d).all(|x| x.is_finite()));
    rays
}

/// A way to move vertices: a name, and the place of a vertex after the motion.
type Motion = (&'static str, fn(usize, [f32; 3]) -> [f32; 3]);

/// Motions, the last of which brings the vertices back.
const MOTIONS: [Motion; 9] = [
    ("a wave", |_, p| [p[0], p[1] + (3.0 * p[0]).sin(), p[2]]),
    ("far away", |_, p| p.map(|x| x + 3e6)),
    ("one triangle far away", |i, p| {
        if i < 3 { p.map(|x| x + 1e5) } else { p }
    }),
    ("a hundred thousand times as large", |_, p| {
        p.map(|x| 1e5 * x)
    }),
    ("a hundred thousand times as small", |_, p| {
        p.map(|x| 1e-5 * x)
    }),
    ("mirrored and scattered", |i, p| {
        let far = (i / 3 * 7919 % 101) as f32;
        [-p[0] + far, p[1] - far, p[2] + 0.5 * far]
    }),
    (
        "collapsed in part",
        |i, p| if i % 4 == 0 { [1.0; 3] } else { p },
    ),
    ("collapsed to nothing", |_, _| [2.0; 3]),
    ("not at all", |_, p| p),
];

fn moved(scene: &Triangles, motion: Motion) -> Vec<[f32; 3]> {
    let vertices = scene.vertices().iter().enumerate();
    vertices.map(|(i, &p)| motion.1(i, p)).collect()
}

fn check(structure: &Structure, about: &str) {
    assert_eq!(validate(structure), [""; 0], "{about}");
    assert_eq!(wrong(structure, &rays(structure.scene())), 0, "{about}");
}

#[test]
fn moved_triangles_are_hit_as_brute_force_hits_them() {
    let scene = soup(grid(4, 0.3));
    for spec in specs() {
        let built = build(&scene, &spec);
        let mut before = None;
        for motion in MOTIONS {
            let about = format!("{spec}, {}", motion.0);
            // Fit the tree as it was built, and the one that the last motion left.
            let vertices = moved(&scene, motion);
            let fitted = built.refit(vertices.clone(), 2, &Monitor::new()).unwrap();
            check(&fitted, &about);
            if let Some(before) = before {
                let again = Structure::refit(&before, vertices, 1, &Monitor::new()).unwrap();
                assert!(again.built().same_nodes(fitted.built()), "{about}: again");
                assert!(again.leaves() == fitted.leaves(), "{about}: leaves");
            }
            before = Some(fitted);
        }
        // Back at the first places, the nodes are those of the build.
        let back = before.expect("several motions");
        assert_eq!(back.refitted().times, 1);
        assert!(back.leaves() == built.leaves(), "{spec}");
        assert_eq!(back.shape().sah_cost, built.shape().sah_cost, "{spec}");
        assert!(back.built().same_nodes(built.built()), "{spec}");
    }
}

#[test]
fn all_difficult_scenes_can_move() {
    for case in hard::cases(7) {
        for spec in ["bvh-sah", "bih", "bih1", "bih-n", "bih-bvh"] {
            let built = build(&case.scene, spec);
            let shift = (
                "shifted",
                (|_, p| [p[0], p[1] + 0.25 * p[0].abs(), p[2]]) as fn(_, [f32; 3]) -> _,
            );
            match built.refit(moved(&case.scene, shift), 1, &Monitor::new()) {
                Ok(fitted) => check(&fitted, &format!("{spec}, {}", case.name)),
                // The motion may give an area to a triangle that had none.
                Err(error) => assert!(
                    matches!(error, Error::Refit(_)) && case.scene.dropped() > 0,
                    "{spec}, {}: {error}",
                    case.name
                ),
            }
        }
    }
}

#[test]
fn triangles_that_were_lost_for_a_while_are_found_again() {
    let scene = soup(grid(4, 0.3));
    for spec in specs() {
        let built = build(&scene, &spec);
        // Lose half of the triangles to NaN, then all of them, then find them again.
        let mut half = scene.vertices().to_vec();
        for triangle in half.chunks_mut(6) {
            triangle[1] = [f32::NAN, f32::INFINITY, 0.0];
        }
        let lost = built.refit(half, 1, &Monitor::new()).unwrap();
        assert_eq!(lost.scene().live().len(), scene.len() / 2);
        check(&lost, &spec);
        let nothing = lost
            .refit(
                vec![[f32::NAN; 3]; scene.vertices().len()],
                1,
                &Monitor::new(),
            )
            .unwrap();
        assert_eq!(nothing.shape().references, 0);
        check(&nothing, &spec);
        let found = nothing
            .refit(scene.vertices().to_vec(), 1, &Monitor::new())
            .unwrap();
        assert!(found.built().same_nodes(built.built()), "{spec}");
        check(&found, &spec);
        assert_eq!(found.refitted().times, 3);
    }
}

#[test]
fn the_cost_grows_where_neighbours_part() {
    let scene = soup(grid(6, 0.3));
    for spec in ["bvh-sah", "bih"] {
        let built = build(&scene, spec);
        let scattered = built
            .refit(moved(&scene, MOTIONS[5]), 1, &Monitor::new())
            .unwrap();
        let cost = scattered.refitted().cost_built;
        assert_eq!(cost, built.shape().sah_cost);
        assert!(
            scattered.shape().sah_cost > 2.0 * cost,
            "{spec}: {:?}",
            scattered.shape()
        );
    }
}

#[test]
fn the_result_is_the_same_on_any_number_of_threads() {
    let scene = soup(grid(17, 0.3));
    for spec in ["bvh-sah", "bih", "bih-n"] {
        let built = build(&scene, spec);
        let vertices = moved(&scene, MOTIONS[5]);
        let one = built.refit(vertices.clone(), 1, &Monitor::new()).unwrap();
        for threads in [2, 7] {
            let several = built
                .refit(vertices.clone(), threads, &Monitor::new())
                .unwrap();
            assert!(one.built().same_nodes(several.built()), "{spec}");
            assert!(one.leaves() == several.leaves(), "{spec}");
        }
        assert_eq!(validate(&one), [""; 0], "{spec}");
    }
}

#[test]
fn rejects_motions_that_cannot_be_fitted_with_the_reason() {
    let scene = soup(grid(3, 0.3));
    for tree in TREES.iter() {
        let structure = build(&scene, tree.id);
        if structure.can_refit() {
            let error = structure
                .refit(vec![[0.0; 3]; 2], 1, &Monitor::new())
                .unwrap_err();
            assert!(matches!(error, Error::Shape(_)), "{}: {error}", tree.id);
        } else {
            assert!(!FITTED.contains(&tree.id), "{}", tree.id);
            let error = structure
                .refit(scene.vertices().to_vec(), 1, &Monitor::new())
                .unwrap_err();
            assert!(matches!(error, Error::Refit(_)), "{}: {error}", tree.id);
            assert!(error.to_string().contains(tree.id), "{error}");
        }
    }
    // A triangle without area is in no leaf, so it cannot appear.
    let mut flat = scene.vertices().to_vec();
    flat[4] = flat[3];
    let flat = soup(flat);
    let error = build(&flat, "bih")
        .refit(scene.vertices().to_vec(), 1, &Monitor::new())
        .unwrap_err();
    assert!(
        error.to_string().starts_with("triangle 1 had no area"),
        "{error}"
    );
}

#[test]
fn a_cancelled_fit_ends() {
    let scene = soup(grid(3, 0.3));
    for id in fitted().map(|tree| tree.id) {
        let structure = build(&scene, id);
        let monitor = Monitor::new();
        let vertices = scene.vertices().to_vec();
        assert!(structure.refit(vertices.clone(), 1, &monitor).is_ok());
        monitor.cancel();
        let error = structure.refit(vertices, 1, &monitor).unwrap_err();
        assert!(matches!(error, Error::Cancelled), "{id}: {error}");
    }
}
